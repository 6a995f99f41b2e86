//! Numbers of the device that no recording shows, and those that an operator states.

use super::{DraftError, template};
use crate::rigs::Workbench;
use serde::Serialize;

/// What the comment of a number begins with that no recording shows.
const KNOWN: &str = "must be known";

/// A number of the device that no recording shows.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct OperatorNumber {
    /// Its key within the device's table, such as `comb.angular_width`.
    pub key: String,
    /// The value of the published device.
    pub value: String,
    /// Why it must be known, or where it comes from.
    pub why: String,
}

/// The numbers of a device that its template marks as such that must be known.
///
/// # Errors
/// A device without a template.
pub fn operator_numbers(workbench: &Workbench, device: &str) -> Result<Vec<OperatorNumber>, DraftError> {
    let text = template(workbench, device)?.1.text;
    let marked = Line::all(text).filter_map(|line| {
        let why = line.comment.strip_prefix(KNOWN)?.trim_start_matches([',', ':', ' ']);
        Some(OperatorNumber { key: line.key(), value: line.value.to_owned(), why: why.to_owned() })
    });
    Ok(marked.collect())
}

/// The text of an experiment file with these values in the places of its own.
pub(super) fn with(text: &str, numbers: &[(String, String)]) -> Result<String, DraftError> {
    let mut changed = text.to_owned();
    for (key, value) in numbers {
        let end = format!(".{key}");
        let is_meant = |line: &Line| line.key() == *key || line.key().ends_with(&end);
        let places: Vec<Line> = Line::all(&changed).filter(is_meant).collect();
        let [line] = places.as_slice() else {
            let known = Line::all(text).map(|line| line.key()).collect();
            let several = places.iter().map(Line::key).collect();
            return Err(DraftError::Number { found: key.clone(), several, known });
        };
        // A number without a unit stands without quotes.
        let is_plain = !line.is_quoted && value.parse::<f64>().is_ok();
        let written = if is_plain { value.clone() } else { toml::Value::String(value.clone()).to_string() };
        let (start, end) = line.place;
        changed.replace_range(start..end, &written);
    }
    Ok(changed)
}

/// A line with a value in one of the device's tables.
struct Line<'t> {
    table: &'t str,
    name: &'t str,
    value: &'t str,
    is_quoted: bool,
    comment: &'t str,
    /// Where the value stands in the text, with its quotes.
    place: (usize, usize),
}

impl<'t> Line<'t> {
    /// Its key without `device` and the name of the device's table.
    fn key(&self) -> String {
        format!("{}.{}", self.table, self.name).trim_start_matches('.').to_owned()
    }

    /// All of them.
    fn all(text: &'t str) -> impl Iterator<Item = Self> {
        let (mut table, mut at) = (None, 0);
        text.split_inclusive('\n').filter_map(move |whole| {
            let start = at;
            at += whole.len();
            let line = whole.trim_end();
            if let Some(header) = line.strip_prefix('[') {
                let path = header.trim_end_matches(']').strip_prefix("device.");
                // The name of the device is none of the key.
                table = path.map(|path| path.split_once('.').map_or("", |(_, rest)| rest));
                return None;
            }
            let (name, rest) = line.split_once(" = ")?;
            let from = start + name.len() + " = ".len();
            let (value, is_quoted, length) = if let Some(quoted) = rest.strip_prefix('"') {
                let value = quoted.split('"').next()?;
                (value, true, value.len() + 2)
            } else {
                let value = rest.split(" #").next()?.trim_end();
                (value, false, value.len())
            };
            let comment = rest.get(length..)?.trim_start().trim_start_matches('#').trim();
            let is_number = is_quoted || value.parse::<f64>().is_ok();
            let table = table.filter(|_| is_number)?;
            Some(Self { table, name, value, is_quoted, comment, place: (from, from + length) })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "name = \"x\"\n[device.thing.comb]\nwidth = \"0.2 rad\" # must be known: it scales\nratio = 0.5\n\n\
        [device.thing.readout]\nwidth = \"1 V\"\n[simulate]\nduration = \"1 s\"\n";

    #[test]
    fn a_number_is_replaced_by_the_end_of_its_key() {
        let pair = |key: &str, value: &str| [(key.to_owned(), value.to_owned())];
        let found = with(TEXT, &pair("comb.width", "0.3 rad")).unwrap();
        assert!(found.contains("width = \"0.3 rad\" # must be known") && found.contains("width = \"1 V\""));
        let found = with(TEXT, &pair("ratio", "0.25")).unwrap();
        assert!(found.contains("ratio = 0.25\n"), "{found}");
        let found = with(TEXT, &pair("width", "1 m")).unwrap_err().to_string();
        assert!(found.contains("`comb.width` and `readout.width`"), "{found}");
        let found = with(TEXT, &pair("duration", "1 m")).unwrap_err().to_string();
        assert!(
            found.contains("found the number `duration`; the device has `comb.width`, `comb.ratio` and"),
            "{found}"
        );
    }
}

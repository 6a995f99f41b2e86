//! Lines before the rows that are marked as comments, among which names of columns may stand.

use super::head::cells;
use super::instruments::{self, InstrumentDialect};
use super::marks;
use super::units::{column_name, says_unit, unit_cell};
use super::{ColumnOrigin, NamedColumns};
use crate::time::parse_iso;

/// As many are kept, the last ones.
const KEPT: usize = 16;

/// Comments, of which the last may be names: `# time_s cap_V` of `numpy.savetxt`, `% Time (s), Input 1 (V)` of Moku.
#[derive(Default)]
pub(super) struct Comments {
    /// The instrument that the first of its comments tells.
    pub(super) instrument: Option<&'static InstrumentDialect>,
    /// Their lines, without the mark.
    lines: Vec<(u64, Vec<u8>)>,
}

/// Names, and units where they have a line of their own, that comments hold.
pub(super) struct CommentNames {
    pub(super) line: u64,
    pub(super) columns: Vec<String>,
    pub(super) units: Option<(u64, Vec<String>)>,
}

impl Comments {
    /// Keeps a line if it is a comment.
    pub(super) fn take(&mut self, line: &[u8], number: u64) -> bool {
        let Some(comment) = unmarked(line) else { return false };
        self.instrument = self.instrument.or_else(|| instruments::of_comment(comment));
        if self.lines.len() == KEPT {
            self.lines.remove(0);
        }
        self.lines.push((number, comment.to_vec()));
        true
    }

    /// Their lines, without the mark.
    pub(super) fn lines(&self) -> impl Iterator<Item = &[u8]> {
        self.lines.iter().map(|(_, line)| line.as_slice())
    }

    /// Columns without a unit with that which the instrument is known to have.
    pub(super) fn with_known_units(&self, columns: NamedColumns) -> NamedColumns {
        let Some(instrument) = self.instrument else { return columns };
        let named = |(index, (name, origin)): (usize, (String, ColumnOrigin))| {
            let unit = if says_unit(&name) { "" } else { instrument.unit_of(&name) };
            (column_name(&name, Some(unit), index), origin)
        };
        columns.into_iter().enumerate().map(named).collect()
    }

    /// The names of as many columns in the last comment that has as many words.
    pub(super) fn names(&self, separator: u8, count: usize) -> Option<CommentNames> {
        let mut last = self.lines.iter().enumerate().rev();
        last.find_map(|(index, (line, comment))| {
            let comment = behind_key(comment, separator);
            let names = marks::names(comment, separator, count)?;
            // A comment of as many words that holds a date or a time of day says when the file was made.
            if names.iter().any(|name| parse_iso(name.as_bytes()).is_some()) {
                return None;
            }
            // Words that are separated otherwise than the rows could be a sentence; names have units.
            if cells(comment, separator).len() != count && !names.iter().any(|name| says_unit(name)) {
                return None;
            }
            let before = index.checked_sub(1).and_then(|before| self.lines.get(before));
            let before = before.filter(|_| count > 1 && names.iter().all(|name| unit_cell(name).is_some()));
            let above =
                before.and_then(|(line, comment)| Some((*line, marks::names(comment, separator, count)?)));
            Some(match above {
                Some((above, words)) => {
                    CommentNames { line: above, columns: words, units: Some((*line, names)) }
                }
                None => CommentNames { line: *line, columns: names, units: None },
            })
        })
    }
}

/// What stands behind a key that announces names: `Headers, time,Ax,Ay,Az` of Gulf Coast Data Concepts.
fn behind_key(comment: &[u8], separator: u8) -> &[u8] {
    const KEYS: [&str; 5] = ["headers", "columns", "fields", "names", "channels"];
    let place = comment.iter().position(|byte| *byte == separator || *byte == b':');
    let Some((key, rest)) = place.map(|place| comment.split_at(place)) else { return comment };
    let is_key = KEYS.iter().any(|known| key.trim_ascii().eq_ignore_ascii_case(known.as_bytes()));
    if is_key { rest.get(1..).unwrap_or_default().trim_ascii() } else { comment }
}

/// A comment without its mark; `None` where a line is none. A semicolon marks one where it is the only one of its line: it may separate
/// the cells of a line whose first one is empty.
pub(super) fn unmarked(line: &[u8]) -> Option<&[u8]> {
    if let Some(rest) = line.strip_prefix(b"//") {
        return Some(rest.trim_ascii());
    }
    if let Some(rest) = line.strip_prefix(b";").filter(|rest| !rest.contains(&b';')) {
        return Some(rest.trim_ascii());
    }
    let mark = |byte: &u8| matches!(byte, b'#' | b'%');
    let rest = line.get(line.iter().take_while(|byte| mark(byte)).count()..)?;
    (rest.len() < line.len()).then(|| rest.trim_ascii())
}

//! An experiment file with other values at some keys: nothing else of it changes but the description, which is marked as that of the file before.

use super::{CauseReport, Edit};
use crate::config::{Experiment, Key, KeyStep};
use std::ops::Range;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// The text of an experiment file with what a cause says in it; `None` where a key has no place in it. Its description, which may state the
/// fault that is corrected, is marked as that of the file before.
pub fn pasted(experiment: &Experiment, cause: &CauseReport) -> Option<String> {
    let text =
        cause.edits.iter().try_fold(experiment.text().to_owned(), |text, edit| changed(&text, edit))?;
    let Some(description) = &experiment.description else { return Some(text) };
    let to = toml::Value::from(described_as_before(description, &cause.edits)).to_string();
    changed(&text, &Edit { key: "description".to_owned(), to, ..Edit::default() })
}

/// The description of a file without these edits, for the file with them.
fn described_as_before(description: &str, edits: &[Edit]) -> String {
    let said = edits.iter().map(|Edit { key, from, to, .. }| {
        let was = from.as_ref().map_or_else(|| "new".to_owned(), |from| format!("was {from}"));
        format!("`{key} = {to}` ({was})")
    });
    let said = said.collect::<Vec<String>>().join(", ");
    format!("Corrected by `kalmems diagnose`: {said}. Description of the file before that: {description}")
}

/// The text with one key changed.
pub(super) fn changed(text: &str, edit: &Edit) -> Option<String> {
    let key = Key::parse(&edit.key)?;
    let document = DeTable::parse(text).ok()?;
    let steps = key.steps();
    if let Some(span) = span_of(&document, steps) {
        return Some(format!("{}{}{}", text.get(..span.start)?, edit.to, text.get(span.end..)?));
    }
    let (KeyStep::Name(name), above) = steps.split_last()? else { return None };
    let line = format!("{name} = {}", edit.to);
    if let Some(first) = first_entry(text, &document, above) {
        // Before an entry of the same table, on a line of its own or within its braces.
        let begins = text.get(..first)?.rfind('\n').map_or(0, |end| end + 1);
        let is_alone = text.get(begins..first)?.trim().is_empty();
        let joint = if is_alone { "\n" } else { ", " };
        return Some(format!("{}{line}{joint}{}", text.get(..first)?, text.get(first..)?));
    }
    let header: Option<Vec<&str>> = above
        .iter()
        .map(|step| match step {
            KeyStep::Name(name) => Some(name.as_str()),
            KeyStep::Index(_) => None,
        })
        .collect();
    let header = format!("[{}]", header?.join("."));
    // A table without an entry: within its braces, or behind its header.
    if let Some(span) = span_of(&document, above) {
        let (before, own, behind) = (text.get(..span.start)?, text.get(span.clone())?, text.get(span.end..)?);
        if own.starts_with('{') {
            return Some(format!("{before}{{ {line} }}{behind}"));
        }
        // The span of a table that has no header of its own is another one's.
        if own == header {
            return Some(format!("{before}{header}\n{line}{behind}"));
        }
    }
    Some(format!("{}\n\n{header}\n{line}\n", text.trim_end()))
}

/// Where the value of a key stands.
fn span_of(document: &Spanned<DeTable<'_>>, steps: &[KeyStep]) -> Option<Range<usize>> {
    let (KeyStep::Name(first), rest) = steps.split_first()? else { return None };
    let mut value = document.get_ref().get(first.as_str())?;
    for step in rest {
        value = below(value.get_ref(), step)?;
    }
    Some(value.span())
}

fn below<'a, 'b>(value: &'a DeValue<'b>, step: &KeyStep) -> Option<&'a Spanned<DeValue<'b>>> {
    match (value, step) {
        (DeValue::Table(table), KeyStep::Name(name)) => table.get(name.as_str()),
        (DeValue::Array(list), KeyStep::Index(index)) => list.get(*index),
        _ => None,
    }
}

/// Where the first key of a table stands that has a value of its own in the text.
fn first_entry(text: &str, document: &Spanned<DeTable<'_>>, steps: &[KeyStep]) -> Option<usize> {
    let (KeyStep::Name(first), rest) = steps.split_first()? else { return None };
    let mut value = document.get_ref().get(first.as_str())?;
    for step in rest {
        value = below(value.get_ref(), step)?;
    }
    let DeValue::Table(table) = value.get_ref() else { return None };
    // A table with a header of its own is no entry of this one's lines.
    let is_inline = |span: Range<usize>| text.get(span).is_some_and(|value| value.starts_with('{'));
    let own = table.iter().filter(|(_, value)| match value.get_ref() {
        DeValue::Table(_) => is_inline(value.span()),
        DeValue::Array(list) => !list.iter().any(|entry| matches!(entry.get_ref(), DeValue::Table(_))),
        _ => true,
    });
    own.map(|(key, _)| key.span().start).min()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(text: &str, key: &str, to: &str) -> String {
        let edit = Edit { key: key.to_owned(), to: to.to_owned(), ..Edit::default() };
        changed(text, &edit).unwrap()
    }

    #[test]
    fn a_value_is_replaced_and_all_else_stays() {
        let text = "a = 1 # one\n[b.c]\nd = \"2 V\"   # two\n[[e]]\nf = { g = 1, h = 2 }\n";
        assert_eq!(after(text, "b.c.d", "\"3 V\""), text.replace("2 V", "3 V"));
        assert_eq!(after(text, "e[0].f.h", "5"), text.replace("h = 2", "h = 5"));
    }

    #[test]
    fn a_description_is_that_of_the_file_before() {
        let (from, to) = (Some("\"2 V\"".to_owned()), "\"3 V\"".to_owned());
        let edit = Edit { key: "b.d".to_owned(), from, to, ..Edit::default() };
        assert_eq!(
            described_as_before("d is too small", &[edit]),
            "Corrected by `kalmems diagnose`: `b.d = \"3 V\"` (was \"2 V\"). Description of the file before that: d is too small"
        );
    }

    #[test]
    fn a_new_key_gets_a_place_in_its_table() {
        let text = "[b.c]\n# of d\nd = 1\n[[e]]\nf = { g = 1 }\n";
        assert_eq!(after(text, "b.c.new", "7"), text.replace("d = 1", "new = 7\nd = 1"));
        assert_eq!(after(text, "e[0].new", "true"), text.replace("f = {", "new = true\nf = {"));
        assert_eq!(after(text, "e[0].f.new", "7"), text.replace("g = 1", "new = 7, g = 1"));
        assert_eq!(after(text, "b.x.new", "7"), format!("{text}\n[b.x]\nnew = 7\n"));
        assert!(after("a = 1\n", "b.new", "7").parse::<toml::Table>().is_ok());
        // In a table without an entry.
        assert_eq!(after("[b]\n\n[c]\nd = 1\n", "b.new", "7"), "[b]\nnew = 7\n\n[c]\nd = 1\n");
        assert_eq!(after("b = {}\n", "b.new", "7"), "b = { new = 7 }\n");
    }
}

//! Tektronix: settings above the columns, or beside the first rows.

use super::super::units::column_name;
use super::{DialectSearch, TextBeginning, columns, number};
use crate::csv::dialect::{ColumnOrigin, RecognizedText};

pub(super) fn find(text: &TextBeginning) -> DialectSearch {
    match text.cell(0) {
        "Record Length" if [3, 4].iter().all(|cell| number(text.cells.get(*cell)).is_some()) => beside(text),
        "Model" | "Record Length" => above(text),
        _ => None,
    }
    .map(Ok)
}

/// The unit of times, for which older ones write a capital.
fn seconds(unit: &str) -> &str {
    if unit == "S" { "s" } else { unit }
}

/// Series 2 to 6 and TBS: lines of settings, then `TIME,CH1,CH2` and rows in the units that the settings state.
fn above(text: &TextBeginning) -> Option<RecognizedText> {
    let header = ["TIME", "Time"].iter().find_map(|name| text.head.find(name, text.separator))?;
    let (names, _) = text.filled(header);
    let horizontal = text.values("Horizontal Units")?;
    let mut units = vec![horizontal.first().map_or("s", |unit| seconds(unit)).to_owned()];
    units.extend(text.values("Vertical Units").unwrap_or_default());
    let columns = columns(&names, &units);
    Some(text.found("a Tektronix oscilloscope", header, header + 1, columns, "units in the lines before"))
}

/// TDS and TBS1000: settings in the first three cells of the first rows, times and values in the fourth and fifth of all.
fn beside(text: &TextBeginning) -> Option<RecognizedText> {
    let value = |key: &str| text.values(key)?.into_iter().next();
    let source = value("Source").unwrap_or_else(|| "CH1".to_owned());
    let columns = vec![
        (column_name("time", Some(seconds(&value("Horizontal Units")?)), 3), ColumnOrigin::Cell(3)),
        (column_name(&source, value("Vertical Units").as_deref(), 4), ColumnOrigin::Cell(4)),
    ];
    let mut found =
        text.found("a Tektronix TDS oscilloscope", 0, 0, columns, "settings beside the first rows");
    found.point = Some(b'.');
    Some(found)
}

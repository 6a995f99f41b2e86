//! Yokogawa DL, DLM and ScopeCorder: `"Header Size",16` and lines of settings, a value for each waveform.

use super::super::units::column_name;
use super::{DialectSearch, TextBeginning, distinct, number};
use crate::FormatError;
use crate::csv::dialect::{ColumnOrigin, RecognizedText};

pub(super) fn find(text: &TextBeginning) -> DialectSearch {
    if text.cell(0) == "Header Size" { found(text).transpose() } else { None }
}

/// Rows are values alone, below the keys an empty cell; the time is `HResolution × (number − 1) + HOffset`.
fn found(text: &TextBeginning) -> Result<Option<RecognizedText>, FormatError> {
    let values = |key: &str| text.values(key).unwrap_or_default();
    let filled = |cells: Vec<String>| cells.into_iter().filter(|cell| !cell.is_empty()).collect::<Vec<_>>();
    let names = distinct(filled(values("TraceName")));
    let Some(header) = text.head.find("TraceName", text.separator) else { return Ok(None) };
    let damaged = |found: &str, expected: String| FormatError::Damaged {
        format: "Yokogawa",
        place: "header".to_owned(),
        found: found.to_owned(),
        expected,
    };
    let lines = text.cell(1).parse().ok().filter(|lines| (2..=128).contains(lines));
    let lines = lines.ok_or_else(|| damaged(text.cell(1), "the number of its lines".to_owned()))?;
    let first_row = text.head.filled(lines);
    let (cells, trailing) = text.filled(first_row);
    // Below the keys is an empty cell, or the time.
    let beside = cells.len().saturating_sub(names.len());
    if beside > 1 || cells.len() < names.len() {
        let found = format!("{} cells in line {}", cells.len(), text.head.number(first_row));
        return Err(damaged(&found, format!("a value for each of {} waveforms", names.len())));
    }
    let (starts, steps, units) = (values("HOffset"), values("HResolution"), values("VUnit"));
    let unit = values("HUnit").into_iter().next().unwrap_or_else(|| "s".to_owned());
    let time = column_name("time", Some(&unit), 0);
    let same = |cells: &[String]| {
        cells.iter().take(names.len()).all(|cell| number(Some(cell)) == number(cells.first()))
    };
    let mut columns = Vec::new();
    if beside == 1 && number(cells.first()).is_some() {
        columns.push((time, ColumnOrigin::Cell(0)));
    } else if let (Some(start), Some(step)) = (number(starts.first()), number(steps.first())) {
        if !same(&starts) || !same(&steps) {
            return Err(FormatError::Unsupported {
                format: "Yokogawa",
                what: "waveforms with times of their own".to_owned(),
                remedy: "save those with the same times in a file of their own".to_owned(),
            });
        }
        columns.push((time, ColumnOrigin::Counted { start, step }));
    }
    let named = |(index, name): (usize, &String)| {
        (column_name(name, units.get(index).map(String::as_str), index), ColumnOrigin::Cell(index + beside))
    };
    columns.extend(names.iter().enumerate().map(named));
    let mut found = text.found("a Yokogawa oscilloscope", header, first_row, columns, "units in the header");
    found.cells = cells.len();
    found.trailing = trailing;
    Ok(Some(found))
}

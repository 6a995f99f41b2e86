//! Keysight and Agilent: InfiniiVision in two lines, Infiniium in a preamble.

use super::super::units::column_name;
use super::{DialectSearch, TextBeginning, columns, distinct, number};
use crate::FormatError;
use crate::csv::dialect::{ColumnOrigin, RecognizedText, marks};
use crate::unit_spellings::unit_ending;

pub(super) fn find(text: &TextBeginning) -> DialectSearch {
    if text.cell(0) == "x-axis" {
        return infinii_vision(text).map(Ok);
    }
    let revision = (0..2).any(|line| text.head.line(line).starts_with(b"Revision:"));
    if revision { infiniium(text).transpose() } else { None }
}

/// `x-axis,1,2`, then `second,Volt,Volt`.
fn infinii_vision(text: &TextBeginning) -> Option<RecognizedText> {
    let names: Vec<String> = text.cells.iter().map(|name| channel(name)).collect();
    let units = text.head.cells(1, text.separator);
    if units.len() != names.len() || units.iter().any(|unit| unit_ending(unit).is_none()) {
        return None;
    }
    Some(text.found("a Keysight oscilloscope", 0, 2, columns(&names, &units), "units in line 2"))
}

/// A name for what Keysight calls by its number.
fn channel(name: &str) -> String {
    match name {
        "x-axis" => "time".to_owned(),
        number if number.bytes().all(|byte| byte.is_ascii_digit()) && !number.is_empty() => {
            format!("channel_{number}")
        }
        _ => name.to_owned(),
    }
}

/// The last lines of the preamble; the rows follow.
const LAST: [&str; 3] = ["Data", "Time Tags", "Min Bandwidth"];

/// `Revision:`, `Points:`, `XInc:`, `XOrg:`, … each with a value for every waveform, behind the colon or in cells of their own;
/// then pairs of time and value for each waveform, or values alone.
fn infiniium(text: &TextBeginning) -> Result<Option<RecognizedText>, FormatError> {
    let head = text.head;
    // The first line, of the names, may have other separators or none.
    let separator = if (0..4).any(|line| head.line(line).contains(&b'\t')) { b'\t' } else { b',' };
    let values = |key: &str, nth: usize| -> Vec<String> {
        let line = (0..head.len()).filter(|line| head.line(*line).starts_with(key.as_bytes())).nth(nth);
        let Some(line) = line else { return Vec::new() };
        let cells = head.cells(line, separator);
        let behind =
            cells.first().and_then(|cell| cell.split_once(':')).map(|(_, value)| value.trim().to_owned());
        behind.filter(|value| !value.is_empty()).into_iter().chain(cells.into_iter().skip(1)).collect()
    };
    let last = (0..head.len()).rev().find(|line| {
        let line = String::from_utf8_lossy(head.line(*line));
        LAST.iter().any(|key| line.starts_with(key))
    });
    let Some(last) = last else { return Ok(None) };
    let units = |key: &str, nth: usize| {
        let named = values(key, 0);
        if named.is_empty() { values("Units", nth) } else { named }
    };
    let (x_units, y_units) = (units("XUnits", 0), units("YUnits", 1));
    let (starts, steps) = (values("XOrg", 0), values("XInc", 0));
    let waveforms = steps.len().max(1);
    let first_row = head.filled(last + 1);
    let cells = head.cells(first_row, separator).len();
    let given = head.cells(0, separator);
    let given =
        if given.first().is_some_and(String::is_empty) { given.get(1..).unwrap_or_default() } else { &[] };
    let names = (0..waveforms)
        .map(|index| given.get(index).cloned().unwrap_or_else(|| format!("Channel {}", index + 1)));
    let names = distinct(names);
    let unit = |units: &[String], index: usize| units.get(index).or(units.first()).cloned();
    let value = |index: usize, name: &String, cell: usize| {
        (column_name(name, unit(&y_units, index).as_deref(), cell), ColumnOrigin::Cell(cell))
    };
    let mut columns = Vec::new();
    if cells == 2 * waveforms {
        for (index, name) in names.iter().enumerate() {
            let time = if index == 0 { "time".to_owned() } else { format!("time of {name}") };
            let unit = unit(&x_units, index).unwrap_or_else(|| "s".to_owned());
            columns.push((column_name(&time, Some(&unit), 2 * index), ColumnOrigin::Cell(2 * index)));
            columns.push(value(index, name, 2 * index + 1));
        }
    } else if cells == waveforms {
        let same = |cells: &[String]| cells.iter().all(|cell| number(Some(cell)) == number(cells.first()));
        if let (Some(start), Some(step)) = (number(starts.first()), number(steps.first())) {
            if !same(&starts) || !same(&steps) {
                return Err(FormatError::Unsupported {
                    format: "CSV",
                    what: "a Keysight Infiniium file of waveforms with times of their own (`XOrg`, `XInc`)".to_owned(),
                    remedy: "save those with the same times in a file of their own, or with pairs of time and value".to_owned(),
                });
            }
            let unit = unit(&x_units, 0).unwrap_or_else(|| "s".to_owned());
            columns.push((column_name("time", Some(&unit), 0), ColumnOrigin::Counted { start, step }));
        }
        columns.extend(names.iter().enumerate().map(|(index, name)| value(index, name, index)));
    } else {
        return Ok(None);
    }
    let mut found =
        text.found("a Keysight Infiniium oscilloscope", 0, first_row, columns, "units in the preamble");
    found.separator = separator;
    found.cells = cells;
    found.point = Some(marks::point(head, first_row, separator, &crate::CsvHints::default())?);
    Ok(Some(found))
}

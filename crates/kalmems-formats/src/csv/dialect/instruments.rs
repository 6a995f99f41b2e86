//! The preambles that oscilloscopes write before their columns, told by their first line.

use super::head::Head;
use super::units::{column_name, unit};
use super::{Found, Origin, labview, marks};
use crate::{CsvHints, FormatError};

/// The dialect of a text that begins as an instrument's does.
pub(super) fn find(head: &Head, hints: &CsvHints) -> Result<Option<Found>, FormatError> {
    let first = head.line(0);
    let separator = if first.contains(&b'\t') {
        b'\t'
    } else if first.contains(&b';') {
        b';'
    } else {
        b','
    };
    let cells = head.cells(0, separator);
    let cell = |index: usize| cells.get(index).map_or("", String::as_str);
    let found = if first.starts_with(b"LabVIEW Measurement") {
        Some(labview::find(head)?)
    } else if cell(0) == "X" && cells.iter().any(|name| name == "Increment") {
        rigol(head, separator)
    } else if cell(0) == "x-axis" {
        keysight(head, separator)
    } else if cell(0).starts_with("LECROY") {
        lecroy(head, separator)?
    } else if cell(0) == "Record Length" && cell(1).starts_with("Analog") {
        siglent(head, separator)
    } else if cell(0) == "Record Length" && is_number(cell(3)) && is_number(cell(4)) {
        tektronix_beside(head, separator)
    } else if matches!(cell(0), "Model" | "Record Length") {
        tektronix(head, separator)
    } else {
        None
    };
    let Some(mut found) = found else { return Ok(None) };
    found.point =
        if found.point == 0 { marks::point(head, found.first_row, separator, hints)? } else { found.point };
    Ok(Some(found))
}

fn is_number(cell: &str) -> bool {
    fast_float2::parse::<f64, _>(cell).is_ok()
}

fn number(cell: Option<&String>) -> Option<f64> {
    fast_float2::parse(cell?).ok()
}

/// One that has columns of cells from the first on.
fn columns(names: &[String], units: &[Option<String>]) -> Vec<(String, Origin)> {
    let unit = |index: usize| units.get(index).and_then(Option::as_deref);
    let named =
        |(index, name): (usize, &String)| (column_name(name, unit(index), index), Origin::Cell(index));
    names.iter().enumerate().map(named).collect()
}

/// Names without the empty one that a separator at the end leaves.
fn filled(mut cells: Vec<String>) -> (Vec<String>, bool) {
    let trailing = cells.len() > 1 && cells.last().is_some_and(String::is_empty);
    if trailing {
        cells.pop();
    }
    (cells, trailing)
}

/// DS1000 and its kin: `X,CH1,Start,Increment,`, then `Sequence,Volt,-3e-04,1e-07`, and rows of an index and volts. The time
/// is the start and so many increments.
fn rigol(head: &Head, separator: u8) -> Option<Found> {
    let (names, _) = filled(head.cells(0, separator));
    let values = head.cells(1, separator);
    let start_index = names.iter().position(|name| name == "Start")?;
    let start = number(values.get(start_index))?;
    let step = number(values.get(names.iter().position(|name| name == "Increment")?))?;
    let units: Vec<Option<String>> = values.iter().map(|cell| unit(cell)).collect();
    let mut columns = columns(names.get(..start_index)?, &units);
    *columns.first_mut()? = ("time_s".to_owned(), Origin::Affine { cell: 0, start, step });
    let (first, trailing) = filled(head.cells(2, separator));
    // Rows end with the last channel, or with empty cells below the start and the increment.
    let cells = if first.len() > start_index { first.len() } else { start_index };
    Some(Found {
        instrument: Some("a Rigol oscilloscope"),
        separator,
        point: b'.',
        header: 0,
        first_row: 2,
        cells,
        trailing: trailing || first.len() == start_index,
        columns,
        units: "units in line 2".to_owned(),
    })
}

/// InfiniiVision: `x-axis,1,2`, then `second,Volt,Volt`.
fn keysight(head: &Head, separator: u8) -> Option<Found> {
    let names: Vec<String> = head.cells(0, separator).into_iter().map(channel).collect();
    let units: Vec<Option<String>> = head.cells(1, separator).iter().map(|cell| unit(cell)).collect();
    if units.len() != names.len() || units.iter().any(Option::is_none) {
        return None;
    }
    Some(Found {
        instrument: Some("a Keysight oscilloscope"),
        separator,
        point: 0,
        header: 0,
        first_row: 2,
        cells: names.len(),
        trailing: false,
        columns: columns(&names, &units),
        units: "units in line 2".to_owned(),
    })
}

/// A name for what Keysight calls by its number.
fn channel(name: String) -> String {
    match name.as_str() {
        "x-axis" => "time".to_owned(),
        number if number.bytes().all(|byte| byte.is_ascii_digit()) && !number.is_empty() => {
            format!("channel_{number}")
        }
        _ => name,
    }
}

/// Lines on the segments, then `Time,Ampl` and rows in seconds and a unit that is not said.
fn lecroy(head: &Head, separator: u8) -> Result<Option<Found>, FormatError> {
    let segments = head.values("Segments", separator).and_then(|values| number(values.first()));
    if segments.is_some_and(|count| count > 1.0) {
        return Err(FormatError::Unsupported {
            format: "CSV",
            what: format!(
                "a LeCroy file of {} segments, whose rows do not say to which they belong,",
                segments.unwrap_or(0.0)
            ),
            remedy: "save each segment in a file of its own".to_owned(),
        });
    }
    let Some(header) = head.find("Time", separator) else { return Ok(None) };
    let names = head.cells(header, separator);
    Ok(Some(Found {
        instrument: Some("a LeCroy oscilloscope"),
        separator,
        point: 0,
        header,
        first_row: header + 1,
        cells: names.len(),
        trailing: false,
        columns: columns(&names, &[Some("s".to_owned())]),
        units: "times in seconds, no unit of the amplitudes".to_owned(),
    }))
}

/// Lines of settings, `Source,CH1,CH2` in newer ones, then `Second,Volt,Volt`.
fn siglent(head: &Head, separator: u8) -> Option<Found> {
    let header = head.find("Second", separator)?;
    let units: Vec<Option<String>> = head.cells(header, separator).iter().map(|cell| unit(cell)).collect();
    let sources = head.values("Source", separator).unwrap_or_else(|| {
        // `Vertical Scale,CH1: 0.05,CH2: 1.0`
        let scales = head.values("Vertical Scale", separator).unwrap_or_default();
        scales.iter().filter_map(|scale| Some(scale.split_once(':')?.0.trim().to_owned())).collect()
    });
    let mut names = vec!["time".to_owned()];
    names.extend(sources.into_iter().filter(|name| !name.is_empty()));
    if names.len() != units.len() {
        names = (0..units.len())
            .map(|i| if i == 0 { "time".to_owned() } else { format!("column_{}", i + 1) })
            .collect();
    }
    Some(Found {
        instrument: Some("a Siglent oscilloscope"),
        separator,
        point: 0,
        header,
        first_row: header + 1,
        cells: names.len(),
        trailing: false,
        columns: columns(&names, &units),
        units: format!("units in line {}", head.number(header)),
    })
}

/// Lines of settings, then `TIME,CH1,CH2` and rows in the units that the settings state.
fn tektronix(head: &Head, separator: u8) -> Option<Found> {
    let header = head.find("TIME", separator)?;
    let names = head.cells(header, separator);
    // Seconds are an `S` here.
    let horizontal = head.values("Horizontal Units", separator)?;
    let mut units = vec![horizontal.first().and_then(|text| unit(if text == "S" { "s" } else { text }))];
    let vertical = head.values("Vertical Units", separator).unwrap_or_default();
    units.extend(vertical.iter().map(|cell| unit(cell)));
    Some(Found {
        instrument: Some("a Tektronix oscilloscope"),
        separator,
        point: 0,
        header,
        first_row: header + 1,
        cells: names.len(),
        trailing: false,
        columns: columns(&names, &units),
        units: "units in the lines before".to_owned(),
    })
}

/// TDS: settings in the first three cells of the first rows, times and values in the fourth and fifth of all.
fn tektronix_beside(head: &Head, separator: u8) -> Option<Found> {
    let value = |key: &str| head.values(key, separator)?.into_iter().next();
    let source = value("Source").unwrap_or_else(|| "CH1".to_owned());
    let horizontal = value("Horizontal Units")?;
    let time = unit(if horizontal == "S" { "s" } else { &horizontal });
    let name = column_name(&source, value("Vertical Units").and_then(|text| unit(&text)).as_deref(), 4);
    let (cells, trailing) = filled(head.cells(0, separator));
    Some(Found {
        instrument: Some("a Tektronix TDS oscilloscope"),
        separator,
        point: b'.',
        header: 0,
        first_row: 0,
        cells: cells.len(),
        trailing,
        columns: vec![(column_name("time", time.as_deref(), 3), Origin::Cell(3)), (name, Origin::Cell(4))],
        units: "settings beside the first rows".to_owned(),
    })
}

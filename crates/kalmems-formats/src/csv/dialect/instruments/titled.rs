//! Names in a line with rows below it, as the table of instruments says where.

use super::super::units::column_name;
use super::table::{NamePlace, UnitPlace};
use super::{DialectSearch, TextBeginning, number, unit_of};
use crate::FormatError;
use crate::csv::dialect::{ColumnOrigin, RecognizedText, RecordShape};
use crate::name::parts;
use crate::unit_spellings::unit_ending;

/// The dialect; `None` where the text lacks what its instrument writes.
pub(super) fn find(
    text: &TextBeginning,
    instrument: &'static str,
    first_cells: &[&str],
    places: (NamePlace, UnitPlace),
) -> DialectSearch {
    let header = first_cells.iter().find_map(|first| text.head.find(first, text.separator))?;
    if text.head.cells(header, text.separator).iter().any(|name| name == "fieldname") {
        let what = "a LabOne file with a line for each field, such as sweeps are saved in,";
        let remedy = "save samples (`chunk;timestamp;x;y;…`), or as HDF5";
        return Some(Err(FormatError::unsupported("CSV", what, remedy)));
    }
    below(text, instrument, header, places).map(Ok)
}

fn below(
    text: &TextBeginning,
    instrument: &'static str,
    header: usize,
    (names_at, units_at): (NamePlace, UnitPlace),
) -> Option<RecognizedText> {
    let (mut names, _) = text.filled(header);
    let clock = match names_at {
        NamePlace::HeaderBeforeClock(start, step) => {
            let values = text.head.cells(header + 1, text.separator);
            let place = |key: &str| names.iter().position(|name| name == key);
            let (start, step) = (place(start)?, place(step)?);
            names.truncate(start);
            Some((number(values.get(start))?, number(values.get(step))?, names.first()? == "X"))
        }
        NamePlace::Keys(keys) => {
            let behind = keys.iter().find_map(|key| text.values(key)).unwrap_or_default();
            let name = |cell: &String| cell.split(':').next().unwrap_or_default().trim().to_owned();
            let channels = behind.iter().map(name).filter(|name| !name.is_empty());
            let all: Vec<String> = std::iter::once("time".to_owned()).chain(channels).collect();
            names = if all.len() == names.len() { all } else { vec![String::new(); names.len()] };
            None
        }
        NamePlace::Header => None,
    };
    let (units, said, first_row) = match units_at {
        UnitPlace::Line(below) => {
            let (mut units, _) = text.filled(header + below);
            units.truncate(names.len());
            // Beside a clock the first cell says what is counted, if it counts.
            for unit in units.iter_mut().skip(usize::from(clock.is_some_and(|(.., counts)| counts))) {
                *unit = unit_ending(unit).or_else(|| Some(parts(unit)?.1))?;
            }
            if units.len() != names.len() {
                return None;
            }
            let line = text.head.number(header + below);
            (units, format!("units in line {line}"), header + below + 1)
        }
        UnitPlace::Keys(first, others) => {
            let mut units = text.values(first)?;
            units.truncate(1);
            units.extend(text.values(others).unwrap_or_default());
            (units, "units in the lines before".to_owned(), header + 1)
        }
        UnitPlace::Known(known, said) => {
            let units = names.iter().map(|name| unit_of(name, known).to_owned()).collect();
            (units, said.to_owned(), header + 1)
        }
    };
    let column = |(index, name): (usize, &String)| {
        // The time has a unit of its own kind, for which older ones write a capital.
        let unit = units.get(index).map_or("", String::as_str);
        let unit = if index == 0 && unit == "S" { "s" } else { unit };
        (column_name(&plain_name(name), Some(unit), index), ColumnOrigin::Cell(index))
    };
    let columns: Vec<_> = names.iter().enumerate().map(column).collect();
    let mut found = text.found(instrument, header, first_row, columns, said);
    // Rows end with the last channel, or with empty cells below the clock.
    found.trailing |= clock.is_some() && found.cells == names.len();
    if let Some((start, step, counts)) = clock {
        let origin = if counts {
            ColumnOrigin::Affine { cell: 0, start, step }
        } else {
            ColumnOrigin::Counted { start, step }
        };
        found.columns.splice(..usize::from(counts), [("time_s".to_owned(), origin)]);
    }
    segments(text, &mut found);
    Some(found)
}

/// A name for what Keysight calls by its number.
fn plain_name(name: &str) -> String {
    match name {
        "x-axis" => "time".to_owned(),
        number if !number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit()) => {
            format!("channel_{number}")
        }
        _ => name.to_owned(),
    }
}

/// Segments that follow each other, each of as many rows as `Segments,2,SegmentSize,1002` says.
fn segments(text: &TextBeginning, found: &mut RecognizedText) {
    let size = text.values("Segments").and_then(|values| {
        let of = |index: usize| values.get(index)?.parse::<u64>().ok();
        Some((of(0)?, of(2)?))
    });
    if let Some((_, rows)) = size.filter(|(segments, rows)| *segments > 1 && *rows > 0) {
        found.columns.push(("segment".to_owned(), ColumnOrigin::Record));
        found.units = format!("{}, segments of {rows} rows, as line 2 says", found.units);
        found.records = RecordShape::OfRows(rows);
    }
}

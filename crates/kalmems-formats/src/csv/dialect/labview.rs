//! LabVIEW measurement files (`.lvm`): a header on the file, a header on the channels, and rows.

use super::head::Head;
use super::units::{column_name, unit};
use super::{Found, Origin};
use crate::FormatError;

/// What ends either header.
const END: &[u8] = b"***End_of_Header***";

pub(super) fn find(head: &Head) -> Result<Found, FormatError> {
    let ends: Vec<usize> = (0..head.len()).filter(|index| head.line(*index).starts_with(END)).collect();
    let damaged = |found: &str, expected: &str| FormatError::Damaged {
        format: "LabVIEW measurement",
        place: "header".to_owned(),
        found: found.to_owned(),
        expected: expected.to_owned(),
    };
    let [first, second] = *ends.as_slice() else {
        return Err(if ends.len() > 2 {
            FormatError::Unsupported {
                format: "LabVIEW measurement",
                what: "a file of several records".to_owned(),
                remedy: "write each in a file of its own".to_owned(),
            }
        } else {
            damaged("no end", "`***End_of_Header***` twice, once for the file and once for the channels")
        });
    };
    // The separator is said by a word that stands behind it.
    let says = |key: &str, value: &str| {
        (0..first).any(|index| {
            let line = String::from_utf8_lossy(head.line(index)).into_owned();
            line.strip_prefix(key).is_some_and(|rest| rest.trim() == value)
        })
    };
    let separator =
        if says("Separator,", "Comma") || head.line(1).contains(&b',') && !head.line(1).contains(&b'\t') {
            b','
        } else {
            b'\t'
        };
    let value = |key: &str| head.values(key, separator);
    let point = match value("Decimal_Separator").and_then(|v| v.into_iter().next()).as_deref() {
        Some(",") if separator != b',' => b',',
        _ => b'.',
    };
    let header = second + 1;
    let names = head.cells(header, separator);
    let comment = usize::from(names.last().is_some_and(|name| name == "Comment"));
    let count = names.len() - comment;
    let number = |text: &String| fast_float2::parse::<f64, _>(text.replace(',', ".")).ok();
    let of = |key: &str| {
        let line =
            (first..second).find(|i| head.cells(*i, separator).first().is_some_and(|cell| cell == key));
        line.map(|index| head.cells(index, separator)).unwrap_or_default()
    };
    let (units, starts, steps, dimensions) = (of("Y_Unit_Label"), of("X0"), of("Delta_X"), of("X_Dimension"));
    let mut columns = Vec::new();
    match value("X_Columns").and_then(|v| v.into_iter().next()).as_deref() {
        Some("No") => {
            let start = starts.get(1).and_then(number).ok_or_else(|| damaged("no `X0`", "the first time"))?;
            let step =
                steps.get(1).and_then(number).ok_or_else(|| damaged("no `Delta_X`", "the interval"))?;
            let same = |cells: &[String], value: f64| {
                cells
                    .iter()
                    .skip(1)
                    .take(count.saturating_sub(1))
                    .filter_map(number)
                    .all(|other| other == value)
            };
            if !same(&starts, start) || !same(&steps, step) {
                return Err(several_times());
            }
            if dimensions.get(1).is_none_or(|dimension| dimension == "Time") {
                columns.push(("time_s".to_owned(), Origin::Counted { start, step }));
            }
        }
        Some("Multi") => return Err(several_times()),
        _ => {
            let seconds = dimensions.get(1).is_none_or(|dimension| dimension == "Time").then_some("s");
            columns.push((column_name("time", seconds, 0), Origin::Cell(0)));
        }
    }
    for (index, name) in names.iter().enumerate().take(count).skip(1) {
        let unit = units.get(index).and_then(|text| unit(text));
        columns.push((column_name(name, unit.as_deref(), index), Origin::Cell(index)));
    }
    Ok(Found {
        instrument: Some("LabVIEW"),
        separator,
        point,
        header,
        first_row: header + 1,
        cells: count,
        trailing: true,
        columns,
        units: "units in the header".to_owned(),
    })
}

fn several_times() -> FormatError {
    FormatError::Unsupported {
        format: "LabVIEW measurement",
        what: "channels with times of their own".to_owned(),
        remedy: "write those with the same times in a file of their own".to_owned(),
    }
}

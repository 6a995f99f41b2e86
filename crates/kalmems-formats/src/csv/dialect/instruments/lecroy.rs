//! LeCroy: `LECROYWR640Zi,12345,Waveform`, lines on the segments, then `Time,Ampl`.

use super::{Beginning, columns, number};
use crate::FormatError;
use crate::csv::dialect::{Found, Origin, Records};

/// Rows in seconds and a unit that is not said; those of several segments follow each other, each segment of a length
/// that the second line states.
pub(super) fn find(text: &Beginning) -> Result<Option<Found>, FormatError> {
    if !text.cell(0).starts_with("LECROY") {
        return Ok(None);
    }
    let Some(header) = text.head.find("Time", text.separator) else { return Ok(None) };
    let (names, _) = text.filled(header);
    let mut columns = columns(&names, &["s".to_owned()]);
    let size = text.values("Segments").and_then(|values| {
        let of = |index: usize| values.get(index)?.parse::<u64>().ok();
        Some((of(0)?, of(2)?))
    });
    let mut units = "times in seconds, no unit of the amplitudes".to_owned();
    let records = match size {
        Some((segments, rows)) if segments > 1 && rows > 0 => {
            columns.push(("segment".to_owned(), Origin::Record));
            units = format!("{units}, segments of {rows} rows, as line 2 says");
            Records::OfRows(rows)
        }
        _ => Records::One,
    };
    let mut found = text.found("a LeCroy oscilloscope", header, header + 1, columns, units);
    found.cells = names.len();
    found.records = records;
    Ok(Some(found))
}

/// How many lines a preamble of so many segments has.
pub(super) fn lines(second: &[String]) -> usize {
    number(second.get(1)).map_or(0, |segments| if segments < 1e5 { segments as usize + 8 } else { 0 })
}

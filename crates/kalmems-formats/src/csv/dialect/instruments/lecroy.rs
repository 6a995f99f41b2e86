//! LeCroy: `LECROYWR640Zi,12345,Waveform`, lines on the segments, then `Time,Ampl`.

use super::{DialectSearch, TextBeginning, columns};
use crate::csv::dialect::{ColumnOrigin, RecordShape};

/// Rows in seconds and a unit that is not said; those of several segments follow each other, each segment of a length
/// that the second line states.
pub(super) fn find(text: &TextBeginning) -> DialectSearch {
    if !text.cell(0).starts_with("LECROY") {
        return None;
    }
    let header = text.head.find("Time", text.separator)?;
    let (names, _) = text.filled(header);
    let mut columns = columns(&names, &["s".to_owned()]);
    let size = text.values("Segments").and_then(|values| {
        let of = |index: usize| values.get(index)?.parse::<u64>().ok();
        Some((of(0)?, of(2)?))
    });
    let mut units = "times in seconds, no unit of the amplitudes".to_owned();
    let records = match size {
        Some((segments, rows)) if segments > 1 && rows > 0 => {
            columns.push(("segment".to_owned(), ColumnOrigin::Record));
            units = format!("{units}, segments of {rows} rows, as line 2 says");
            RecordShape::OfRows(rows)
        }
        _ => RecordShape::One,
    };
    let mut found = text.found("a LeCroy oscilloscope", header, header + 1, columns, units);
    found.cells = names.len();
    found.records = records;
    Some(Ok(found))
}

/// How many lines a preamble of so many segments has.
pub(super) fn lines(second: &[String]) -> usize {
    let segments = second.get(1).and_then(|segments| segments.parse::<usize>().ok());
    segments.filter(|segments| *segments < 100_000).map_or(0, |segments| segments + 8)
}

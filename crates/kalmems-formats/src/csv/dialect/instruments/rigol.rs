//! Rigol: the clock beside the names, or in them.

use super::super::units::column_name;
use super::{DialectSearch, TextBeginning, columns, number};
use crate::csv::dialect::{ColumnOrigin, RecognizedText};

pub(super) fn find(text: &TextBeginning) -> DialectSearch {
    if text.cell(0) == "X" && text.cells.iter().any(|cell| cell == "Increment") {
        return increments(text).map(Ok);
    }
    text.cells.iter().any(|cell| volts(cell).is_some()).then(|| Ok(clock_in_the_names(text)))
}

/// DS1000 and its kin: `X,CH1,Start,Increment,`, then `Sequence,Volt,-3e-04,1e-07`, and rows of an index and volts. The time
/// is the start and so many increments.
fn increments(text: &TextBeginning) -> Option<RecognizedText> {
    let (names, _) = text.filled(0);
    let values = text.head.cells(1, text.separator);
    let start_index = names.iter().position(|name| name == "Start")?;
    let start = number(values.get(start_index))?;
    let step = number(values.get(names.iter().position(|name| name == "Increment")?))?;
    let mut columns = columns(names.get(..start_index)?, &values);
    *columns.first_mut()? = ("time_s".to_owned(), ColumnOrigin::Affine { cell: 0, start, step });
    let mut found = text.found("a Rigol oscilloscope", 0, 2, columns, "units in line 2");
    // Rows end with the last channel, or with empty cells below the start and the increment.
    found.trailing |= found.cells == start_index;
    Some(found)
}

/// DS4000, MSO5000, DHO800 and their kin: `Time(s),CH1V,CH2V,t0 =-1.2e-3, tInc = 2e-9,`, without times where there is no
/// first column for them.
fn clock_in_the_names(text: &TextBeginning) -> RecognizedText {
    let (names, _) = text.filled(0);
    let said = |key: &str| {
        names.iter().find_map(|name| {
            number(Some(&name.strip_prefix(key)?.trim().strip_prefix('=')?.trim().to_owned()))
        })
    };
    let channels = names.iter().take_while(|name| !name.starts_with("t0")).count();
    let column = |(index, name): (usize, &String)| match volts(name) {
        Some(channel) => (column_name(channel, Some("V"), index), ColumnOrigin::Cell(index)),
        None => (column_name(name, None, index), ColumnOrigin::Cell(index)),
    };
    let mut columns: Vec<_> = names.iter().take(channels).enumerate().map(column).collect();
    if let (Some(start), Some(step)) = (said("t0"), said("tInc"))
        && !text.cell(0).starts_with("Time")
    {
        columns.insert(0, ("time_s".to_owned(), ColumnOrigin::Counted { start, step }));
    }
    let mut found = text.found("a Rigol oscilloscope", 0, 1, columns, "units in the names");
    // Empty cells below the clock.
    found.cells = text.filled(1).0.len().max(channels);
    found.trailing = true;
    found
}

/// The channel of a name such as `CH1V`.
fn volts(name: &str) -> Option<&str> {
    let channel = name.strip_suffix('V')?;
    let digits = channel.strip_prefix("CH")?;
    (!digits.is_empty() && digits.bytes().all(|byte| byte.is_ascii_digit())).then_some(channel)
}

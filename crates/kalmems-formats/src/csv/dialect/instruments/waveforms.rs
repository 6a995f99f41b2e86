//! Keys with a value for each waveform, then rows of values alone, behind one time, or in pairs with a time each.

use super::super::units::column_name;
use super::table::WaveformKeys;
use super::{TextBeginning, distinct, number};
use crate::FormatError;
use crate::clock::{RegularTimes, SampleStep, rows_later};
use crate::csv::dialect::{ColumnOrigin, RecognizedText, marks};

/// The dialect; `None` where rows are of another width than the waveforms have.
pub(super) fn find(
    text: &TextBeginning,
    instrument: &'static str,
    keys: &WaveformKeys,
) -> Result<Option<RecognizedText>, FormatError> {
    // The first line, of the names, may have other separators or none.
    let separator = if (0..4).any(|line| text.head.line(line).contains(&b'\t')) { b'\t' } else { b',' };
    let text = &TextBeginning { head: text.head, separator, cells: Vec::new() };
    let (starts, steps) = (values(text, keys.starts, 0), values(text, keys.steps, 0));
    let is_row = |line: &usize| {
        let cells = text.head.cells(*line, separator);
        let first = cells.first().is_some_and(|cell| cell.is_empty() || marks::is_number(cell));
        first && cells.iter().any(|cell| marks::is_number(cell))
    };
    let Some(first_row) = text.head.rows(0).find(is_row) else { return Ok(None) };
    let (cells, trailing) = text.filled(first_row);
    let names = match values(text, keys.names, 0) {
        named if !named.is_empty() => named,
        _ => {
            let above = text.head.cells(0, separator);
            let given =
                above.split_first().filter(|(first, _)| first.is_empty()).map_or(&[][..], |(_, given)| given);
            let name =
                |index: usize| given.get(index).cloned().unwrap_or_else(|| format!("Channel {}", index + 1));
            (0..steps.len().max(1)).map(name).collect()
        }
    };
    let names = distinct(names);
    let units = |keys: &[(&str, usize)]| {
        let mut found =
            keys.iter().map(|(key, nth)| values(text, key, *nth)).filter(|units| !units.is_empty());
        found.next().unwrap_or_default()
    };
    let (time_units, value_units) = (units(keys.time_units), units(keys.value_units));
    let unit_at = |units: &[String], index: usize| units.get(index).or(units.first()).cloned();
    let time = |name: &str, index: usize| {
        let unit = unit_at(&time_units, index).unwrap_or_else(|| "s".to_owned());
        column_name(name, Some(&unit), 0)
    };
    let value = |index: usize, name: &String, cell: usize| {
        (column_name(name, unit_at(&value_units, index).as_deref(), cell), ColumnOrigin::Cell(cell))
    };
    let has_time = cells.first().is_some_and(|cell| !cell.is_empty());
    let mut columns = Vec::new();
    if has_time && cells.len() == 2 * names.len() {
        for (index, name) in names.iter().enumerate() {
            let own = if index == 0 { "time".to_owned() } else { format!("time of {name}") };
            columns.push((time(&own, index), ColumnOrigin::Cell(2 * index)));
            columns.push(value(index, name, 2 * index + 1));
        }
    } else {
        let Some(before) = cells.len().checked_sub(names.len()).filter(|before| *before < 2) else {
            return Ok(None);
        };
        let mut later = Vec::new();
        let clock = number(starts.first()).zip(number(steps.first()));
        match (before == 1 && has_time, clock) {
            (true, _) => columns.push((time("time", 0), ColumnOrigin::Cell(0))),
            (false, Some((start, step))) => {
                let of =
                    |cells: &[String], index: usize, first: f64| number(cells.get(index)).unwrap_or(first);
                let waveform = |index| {
                    let step = SampleStep::Interval(of(&steps, index, step));
                    RegularTimes { row: 0, start_s: of(&starts, index, start), step }
                };
                let waveforms: Vec<RegularTimes> = (0..names.len()).map(waveform).collect();
                let (start, rows) = rows_later(&names, &waveforms).map_err(|why| {
                    FormatError::unsupported(
                        "CSV",
                        format!(
                            "a file of {instrument} with times of its own for each waveform (`{}`, `{}`; {why})",
                            keys.starts, keys.steps
                        ),
                        "save those with the same times in a file of their own, or with pairs of time and value",
                    )
                })?;
                later = rows;
                columns.push((time("time", 0), ColumnOrigin::Counted { start, step }));
            }
            (false, None) => {}
        }
        columns.extend(names.iter().enumerate().map(|(index, name)| {
            let (name, origin) = value(index, name, index + before);
            (name, later.get(index).map_or(origin, |rows| ColumnOrigin::later(index + before, *rows)))
        }));
    }
    let header = text.head.find(keys.names, separator).unwrap_or(0);
    let mut found = text.found(instrument, header, first_row, columns, "units in the preamble");
    (found.cells, found.trailing) = (cells.len(), trailing);
    found.point = Some(marks::point(text.head, first_row, separator, &crate::CsvHints::default())?);
    Ok(Some(found))
}

/// What follows a key, behind its colon or in cells of their own, in a line of those that begin with it.
fn values(text: &TextBeginning, key: &str, nth: usize) -> Vec<String> {
    let lines = (0..text.head.len()).map(|line| text.head.cells(line, text.separator));
    let mut keyed = lines.filter_map(|cells| {
        let (first, others) = cells.split_first()?;
        let (found, behind) = first.split_once(':').unwrap_or((first, ""));
        let all = std::iter::once(behind.trim().to_owned()).chain(others.iter().cloned());
        (found == key && !key.is_empty()).then(|| all.filter(|value| !value.is_empty()).collect())
    });
    keyed.nth(nth).unwrap_or_default()
}

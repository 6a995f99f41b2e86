//! Keys with a value for each waveform, then rows of values alone, behind one time, or in pairs with a time each.

use super::super::units::column_name;
use super::table::WaveformKeys;
use super::{TextBeginning, distinct, number};
use crate::clock::{RegularTimes, SampleStep, rows_later};
use crate::csv::dialect::{ColumnOrigin, NamedColumns, RecognizedText, marks};
use crate::{FormatError, Result};

/// Waveforms that stand in cells beside each other.
pub(super) struct WaveformColumns<'a> {
    pub(super) names: &'a [String],
    pub(super) cells: Vec<usize>,
    /// The cells of times: one before the first waveform, or one before each.
    pub(super) times: Vec<usize>,
    /// What is stated of their times, where there is no cell of them.
    pub(super) clocks: Vec<RegularTimes>,
    /// The units of times and values, where they are known.
    pub(super) time_unit: &'a dyn Fn(usize) -> Option<String>,
    pub(super) unit: &'a dyn Fn(usize) -> Option<String>,
}

impl WaveformColumns<'_> {
    /// Their columns; in words why they do not stand beside each other.
    pub(super) fn columns(&self) -> Result<NamedColumns, String> {
        let (mut columns, mut later) = (Vec::new(), Vec::new());
        if let (true, Some(first)) = (self.times.is_empty(), self.clocks.first()) {
            let (start, rows) = rows_later(self.names, &self.clocks)?;
            later = rows;
            let origin = ColumnOrigin::Counted { start, step: first.step.interval_s() };
            columns.extend((self.time_unit)(0).map(|unit| (column_name("time", Some(&unit), 0), origin)));
        }
        for (index, (name, cell)) in self.names.iter().zip(&self.cells).enumerate() {
            let own = if index == 0 { "time".to_owned() } else { format!("time of {name}") };
            let time = |cell: &usize| {
                (column_name(&own, (self.time_unit)(index).as_deref(), 0), ColumnOrigin::Cell(*cell))
            };
            columns.extend(self.times.get(index).map(time));
            let rows = later.get(index).copied().unwrap_or(0);
            let name = column_name(name, (self.unit)(index).as_deref(), *cell);
            columns.push((name, ColumnOrigin::later(*cell, rows)));
        }
        Ok(columns)
    }

    /// Which of the columns are times of waveforms behind the first, each with its waveform's.
    pub(super) fn own_times(&self) -> Vec<(usize, usize)> {
        (1..self.times.len()).map(|waveform| (2 * waveform, 2 * waveform + 1)).collect()
    }
}

/// The dialect; `None` where rows are of another width than the waveforms have.
pub(super) fn find(
    text: &TextBeginning,
    instrument: &'static str,
    keys: &WaveformKeys,
) -> Result<Option<RecognizedText>> {
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
    let has_time = cells.first().is_some_and(|cell| !cell.is_empty());
    let (times, before): (Vec<usize>, usize) = match cells.len().checked_sub(names.len()) {
        Some(before) if before < 2 => (if has_time { (0..before).collect() } else { Vec::new() }, before),
        Some(count) if has_time && count == names.len() => ((0..count).map(|index| 2 * index).collect(), 0),
        _ => return Ok(None),
    };
    let cell = |index: usize| if times.len() > 1 { 2 * index + 1 } else { index + before };
    // Of rows without a clock nobody knows what they count.
    if times.is_empty() && starts.is_empty() {
        return Ok(None);
    }
    let clocks = number(starts.first()).zip(number(steps.first())).map(|(start, step)| {
        let of = |cells: &[String], index: usize, first: f64| number(cells.get(index)).unwrap_or(first);
        let clock = |index| {
            let step = SampleStep::Interval(of(&steps, index, step));
            RegularTimes { row: 0, start_s: of(&starts, index, start), step }
        };
        (0..names.len()).map(clock).collect()
    });
    let waveforms = WaveformColumns {
        cells: (0..names.len()).map(cell).collect(),
        names: &names,
        times,
        clocks: clocks.unwrap_or_default(),
        // Some write a capital for seconds.
        time_unit: &|index| {
            Some(unit_at(&time_units, index).map_or("s".into(), |unit| unit.replace('S', "s")))
        },
        unit: &|index| unit_at(&value_units, index),
    };
    let own_times = waveforms.own_times();
    let columns = waveforms.columns().map_err(|why| {
        let (starts, steps) = (keys.starts, keys.steps);
        let times = format!("times of its own for each waveform (`{starts}`, `{steps}`; {why})");
        let remedy = "save those with the same times in a file of their own, or with pairs of time and value";
        FormatError::unsupported("CSV", format!("a file of {instrument} with {times}"), remedy)
    })?;
    let header = text.head.find(keys.names, separator).unwrap_or(0);
    let mut found = text.found(instrument, header, first_row, columns, "units in the preamble");
    (found.cells, found.trailing, found.own_times) = (cells.len(), trailing, own_times);
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

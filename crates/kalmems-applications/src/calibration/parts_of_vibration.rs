//! Pictures of records under vibration, with the parts in which the sensor is still, as they are before anything is computed.

use super::files::UnitRecord;
use super::tone::AXES;
use kalmems_figures::{Axis, Figure, Panel, Series, SeriesRole, pairs};
use std::ops::Range;

/// The shortest still part that is shown, in s, and in samples of a slow record.
const SHORTEST_S: f64 = 0.2;
const SHORTEST: usize = 64;
/// Blocks of the shortest part, and the part of the largest variance of all blocks up to which a block is still: a tenth of the amplitude.
const BLOCKS: usize = 8;
const QUIET: f64 = 0.01;

/// The rows in which all columns are still for some time. A record that moves from its beginning to its end has none.
pub(super) fn still_in_vibration(columns: &[&[f64]], interval_s: f64) -> Vec<Range<usize>> {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a positive count, saturating
    let shortest = ((SHORTEST_S / interval_s).ceil() as usize).max(SHORTEST);
    let block = shortest / BLOCKS;
    let rows = columns.iter().map(|values| values.len()).min().unwrap_or(0);
    let mut still = vec![true; rows / block];
    for values in columns {
        let variances: Vec<f64> = values.chunks_exact(block).map(variance).collect();
        let largest = variances.iter().copied().fold(0.0, f64::max);
        for (still, variance) in still.iter_mut().zip(variances) {
            *still &= variance <= QUIET * largest;
        }
    }
    let mut found: Vec<Range<usize>> = Vec::new();
    for place in (0..still.len()).filter(|place| still[*place]) {
        let [from, to] = [place * block, (place + 1) * block];
        match found.last_mut().filter(|last| last.end == from) {
            Some(last) => last.end = to,
            None => found.push(from..to),
        }
    }
    found.retain(|part| part.len() >= shortest);
    found
}

fn variance(values: &[f64]) -> f64 {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / count
}

/// The rates of the records of a condition one after the other, with the parts that were taken as still.
pub(super) fn parts_of_condition(condition: &str, records: &[UnitRecord]) -> Figure {
    let mut panel =
        Panel::new(Axis::new("time, one record after the other", "s"), Axis::new("rate", "deg/s"));
    let (mut from, mut is_first_still) = (0.0, true);
    for (number, record) in records.iter().enumerate() {
        let [Some(first), Some(last)] = [record.rates.time_s.first(), record.rates.time_s.last()] else {
            continue;
        };
        let time: Vec<f64> = record.rates.time_s.iter().map(|time| time - first + from).collect();
        let columns = || {
            AXES.into_iter()
                .zip(&record.rates.axes)
                .filter_map(|(axis, values)| Some((axis, values.as_ref()?)))
        };
        for (axis, values) in columns() {
            let shown: Vec<f64> = values.iter().map(|rate| rate.to_degrees()).collect();
            let label = if number == 0 { axis } else { "" };
            panel = panel.with(Series::line(
                label,
                SeriesRole::Measured,
                pairs(&time, &shown).collect::<Vec<_>>(),
            ));
        }
        let all: Vec<&[f64]> = columns().map(|(_, values)| values.as_slice()).collect();
        let interval_s = (last - first) / (time.len().max(2) - 1) as f64;
        for rows in still_in_vibration(&all, interval_s) {
            let ends = [rows.start, rows.end.saturating_sub(1)].map(|row| (time[row], 0.0));
            let label = if std::mem::take(&mut is_first_still) { "taken as still" } else { "" };
            panel = panel.with(Series::line(label, SeriesRole::Estimate, ends));
        }
        from += last - first + 0.05 * (last - first).max(interval_s);
    }
    Figure::new(
        format!("parts-{condition}"),
        format!("Records of the condition {condition}"),
        "The rates of the gyroscopes in the records of the condition, one after the other, with the parts that were taken as still: a record under vibration \
         has none, as a sine is fitted to all of it.",
    )
    .with(panel)
}

//! Pictures of records under vibration, with the parts in which the sensor is still, as they are before anything is computed.

use super::files::UnitRecord;
use super::still::{StillChannel, still_parts};
use super::tone::AXES;
use kalmems_figures::{Axis, Figure, Panel, Series, SeriesRole, pairs};

/// The parts of a second or longer are shown; of a slower record those of as many samples.
const SHORTEST_S: f64 = 1.0;
const SHORTEST: usize = 64;

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
        let channels: Vec<StillChannel> =
            columns().map(|(_, values)| StillChannel { values, is_rate: true }).collect();
        let interval_s = (last - first) / (time.len().max(2) - 1) as f64;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a positive count, saturating
        let shortest = ((SHORTEST_S / interval_s).ceil() as usize).max(SHORTEST);
        for rows in still_parts(&channels, shortest) {
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

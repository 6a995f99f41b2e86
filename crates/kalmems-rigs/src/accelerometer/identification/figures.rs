//! The picture of the identification.

use super::AccelerometerOutcome;
use super::visibility::{MistunedFilter, chance};
use kalmems_figures::{Axis, Figure, Panel, Series, SeriesRole};
use kalmems_models::constants::STANDARD_GRAVITY;

/// By parameter, so that the lines can be told apart.
const LINES: [(&str, SeriesRole); 3] =
    [("spring", SeriesRole::Estimate), ("damping", SeriesRole::Reference), ("mass", SeriesRole::Model)];

/// What an error of each parameter does to the acceleration, and what the innovations show of it.
pub fn of(outcome: &AccelerometerOutcome) -> Figure {
    let points = |index: usize, value: &dyn Fn(&MistunedFilter) -> f64| -> Vec<(f64, f64)> {
        let shifted = outcome.visibility[index].shifted.iter();
        shifted.map(|one| (100.0 * (one.factor - 1.0), value(one))).collect()
    };
    let axis = || Axis::new("error of the parameter", "%");
    let lines = |mut panel: Panel, value: &dyn Fn(&MistunedFilter) -> f64| {
        for (index, (label, role)) in LINES.into_iter().enumerate() {
            panel = panel.with(Series::line(label, role, points(index, value)));
        }
        panel
    };
    let mg = 1e-3 * STANDARD_GRAVITY;
    let moved = lines(Panel::new(axis(), Axis::new("acceleration moved, rms", "mg")), &|one| one.moved / mg)
        .with(Series::level("claimed", SeriesRole::Bound, outcome.found.claimed / mg));
    let right = outcome.visibility[0].shifted.iter().find(|one| one.factor == 1.0);
    let right = right.map_or(1.0, |one| one.mean_nis);
    let band = 1.96 * chance(outcome.found.samples);
    let nis = lines(Panel::new(axis(), Axis::new("mean NIS", "")), &|one| one.mean_nis)
        .with(Series::level("95 % of chance", SeriesRole::Bound, right + band))
        .with(Series::level("", SeriesRole::Bound, right - band));
    let caption = "What the filter says of this recording with one parameter off: how far its acceleration is from that \
                   with the parameters found, beside the standard deviation that it claims, and the mean of its normalised \
                   innovations squared. An error that moves the first and leaves the second within the band cannot be \
                   seen in the innovations' size.";
    Figure::new("visibility", "What a wrong parameter does, and what shows it", caption)
        .with(moved)
        .with(nis.sharing_x())
}

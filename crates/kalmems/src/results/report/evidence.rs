//! What the innovations of the filters look like, as figures of a page.

use super::figures::{label, role, stacked, time_axis};
use super::twins::twin;
use crate::estimate::{Trajectory, TrajectoryKind};
use crate::evaluate::InnovationEvidence;
use crate::results::marks::with_lock;
use crate::results::tracks::{BAND, SignalInnovations, Tracks, VALUE};
use crate::workflow::SegmentOutcome;
use kalmems_figures::{Axis, Figure, Panel, Series, SeriesRole};

/// Filters whose innovations are shown from all sides; the tests of the others are in the table.
const MOST: usize = 4;

/// The innovations over time, and of each filter their spectrum, correlation, course over a cycle and distribution. The filter to
/// trust comes first.
pub(super) fn evidence(
    segment: &SegmentOutcome,
    tracks: &Tracks,
    prefix: &str,
    trusted: Option<&str>,
) -> Vec<Figure> {
    let own = segment.estimate.trajectories.iter().zip(&segment.judgements);
    let claims = |(trajectory, _): &(&Trajectory, _)| {
        trajectory.kind == TrajectoryKind::Filtered
            && trajectory.claims()
            && twin(&segment.estimate, trajectory).is_none()
    };
    let mut filters: Vec<_> = own.filter(claims).collect();
    filters.sort_by_key(|(trajectory, _)| trusted != Some(trajectory.key.as_str()));
    filters.truncate(MOST);
    let mut figures = Vec::new();
    if !filters.is_empty() {
        figures.push(over_time(segment, tracks, filters.iter().map(|(trajectory, _)| *trajectory), prefix));
    }
    for (trajectory, judgement) in filters {
        if let Some(found) = judgement.evidence.as_ref().filter(|found| found.count > 0.0) {
            figures.push(looks(trajectory, found, prefix));
        }
    }
    figures
}

/// The innovations over time, with what each filter expects of them, and what it rejected.
fn over_time<'a>(
    segment: &SegmentOutcome,
    tracks: &Tracks,
    filters: impl Iterator<Item = &'a Trajectory>,
    prefix: &str,
) -> Figure {
    let caption = "The innovations: the recorded signal minus what the filter predicted for it, with three of the standard deviations \
                   that the filter gives them on each side. Of a filter that is right they are white noise of that size. Grey is where \
                   there are no samples; points are samples that were rejected as outliers, and where the signal was lost.";
    let all = filters.flat_map(|trajectory| {
        SignalInnovations::of(trajectory, &segment.estimate).into_iter().map(move |one| (trajectory, one))
    });
    let panels = all.map(|(trajectory, of)| {
        let (unit, factor) = of.unit;
        // Settling flattens all that follows; the page has it as well.
        let scored = trajectory.scored_after(segment.estimate.start_s, segment.estimate.skip_s);
        let times = || trajectory.time_s[scored.clone()].iter().copied();
        let sds = times().zip(&of.sd[scored.clone()]);
        let band = Series::band(
            "±3σ",
            role(trajectory),
            sds.map(|(t, sd)| (t, -3.0 * sd * factor, 3.0 * sd * factor)),
        );
        let own = times().zip(&of.innovation[scored.clone()]).map(|(t, r)| (t, r * factor));
        let own = Series::points(label(trajectory, segment, None), role(trajectory), own);
        let panel = Panel::new(time_axis(), Axis::new(of.label(), unit))
            .with(tracks.whole(&of.key, BAND, band))
            .with(tracks.whole(&of.key, VALUE, own));
        let mut panel = with_lock(tracks.gaps.shaded(panel), trajectory);
        let rejected = trajectory.rejected.iter().filter(|one| one.signal == of.place);
        let rejected: Vec<_> = rejected.map(|one| (one.time_s, one.innovation * factor)).collect();
        if !rejected.is_empty() {
            panel = panel.with(Series::points("rejected", SeriesRole::Model, rejected));
        }
        panel
    });
    stacked(Figure::new(format!("{prefix}innovations"), "Innovations", caption), panels.collect())
}

/// A number that comes from a Fourier transform, whose last digits are the platform's: in single precision, which a picture does not tell.
fn rounded(value: f64) -> f64 {
    #[allow(clippy::cast_possible_truncation)]
    let single = value as f32;
    f64::from(single)
}

/// The normalised innovations of a filter from all sides.
fn looks(trajectory: &Trajectory, found: &InnovationEvidence, prefix: &str) -> Figure {
    let name = format!("Innovations of {}, from all sides", trajectory.name);
    let caption = format!(
        "The {:.0} innovations after the settling time, each divided by its standard deviation, and where 95 % lie of a filter that is \
         right. Spectrum: the mean and the largest ordinate of groups of frequencies; a line is something periodic that the model does not \
         have, a rise towards one end a wrong process noise. Correlation with the innovations before. Over the cycle of the motion: what \
         repeats with it is an error of the model. Distribution.",
        found.count
    );
    let mut figure = Figure::new(format!("{prefix}innovations_{}", trajectory.key), name, caption);
    if !found.spectrum.is_empty() {
        let over = |of: fn(&crate::evaluate::SpectrumGroup) -> f64| -> Vec<(f64, f64)> {
            found.spectrum.iter().map(|group| (group.frequency_hz, rounded(of(group)))).collect()
        };
        let expected: Vec<(f64, f64, f64)> = found
            .spectrum
            .iter()
            .map(|group| (group.frequency_hz, group.expected[0], group.expected[1]))
            .collect();
        figure = figure.with(
            Panel::new(Axis::new("frequency", "Hz").log(), Axis::new("spectrum", "1").log())
                .with(Series::band("95 %", SeriesRole::Bound, expected))
                .with(Series::points("largest of a group", SeriesRole::Measured, over(|group| group.largest)))
                .with(Series::line("mean of a group", SeriesRole::Estimate, over(|group| group.level))),
        );
    }
    if !found.autocorrelation.is_empty() {
        let lag = |index: usize| (index + 1) as f64;
        let bound: Vec<(f64, f64, f64)> = found
            .autocorrelation
            .iter()
            .enumerate()
            .map(|(i, [_, bound])| (lag(i), -bound, *bound))
            .collect();
        let own: Vec<(f64, f64)> =
            found.autocorrelation.iter().enumerate().map(|(i, [own, _])| (lag(i), *own)).collect();
        figure = figure.with(
            Panel::new(Axis::new("updates before", "1"), Axis::new("correlation", "1"))
                .with(Series::band("95 %", SeriesRole::Bound, bound))
                .with(Series::points("correlation", SeriesRole::Estimate, own))
                .with(Series::level("", SeriesRole::Bound, 0.0)),
        );
    }
    for cycle in &found.cycles {
        let over = |of: fn(&[f64; 4]) -> f64| -> Vec<(f64, f64)> {
            cycle.parts.iter().map(|part| (part[0], of(part))).collect()
        };
        let bounds: Vec<(f64, f64, f64)> =
            cycle.parts.iter().map(|part| (part[0], -1.96 / part[1].sqrt(), 1.96 / part[1].sqrt())).collect();
        figure = figure.with(
            Panel::new(Axis::new("phase of the motion", "deg"), Axis::new("mean", "1"))
                .with(Series::band("95 % of the mean", SeriesRole::Bound, bounds))
                .with(Series::line("mean", SeriesRole::Estimate, over(|part| part[2]))),
        );
        let squares: Vec<(f64, f64, f64)> = cycle
            .parts
            .iter()
            .map(|part| (part[0], 1.0 - 1.96 * (2.0 / part[1]).sqrt(), 1.0 + 1.96 * (2.0 / part[1]).sqrt()))
            .collect();
        figure = figure.with(
            Panel::new(Axis::new("phase of the motion", "deg"), Axis::new("mean square", "1"))
                .with(Series::band("95 % of the mean square", SeriesRole::Bound, squares))
                .with(Series::line("mean square", SeriesRole::Estimate, over(|part| part[3])))
                .sharing_x(),
        );
    }
    // As steps: along the top of each bin.
    let steps = |of: fn(&[f64; 4]) -> f64| -> Vec<(f64, f64)> {
        found.histogram.shares().flat_map(|bin| [(bin[0], of(&bin)), (bin[1], of(&bin))]).collect()
    };
    figure.with(
        Panel::new(Axis::new("normalised innovation", "1"), Axis::new("share", "1"))
            .with(Series::line("innovations", SeriesRole::Estimate, steps(|bin| bin[2])))
            .with(Series::line("normal distribution", SeriesRole::Bound, steps(|bin| bin[3]))),
    )
}

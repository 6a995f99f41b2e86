//! The picture of a motion whose recording shows when angles were passed: all of it with its envelope, and how far off each passing is.

use super::figures::time_axis;
use crate::estimate::{PassedMark, RecordedPassing, StateSeries, Trajectory};
use crate::units::kind;
use crate::workflow::{RecordingOutcome, SegmentOutcome};
use kalmems_figures::{Axis, Figure, Panel, Series, SeriesRole};
use std::f64::consts::TAU;

/// A passing of an angle, beside what the reference or the filter says of it.
struct Passing {
    time_s: f64,
    /// The angle that was passed, in rad.
    angle: f64,
    /// The angle at that time by the reference, or by the filter, in rad.
    there: f64,
    /// What the time's standard deviation is worth in angle, in rad.
    sd: f64,
}

/// The whole motion with its envelope and the passings, and the passings' errors with the standard deviations that are claimed; `None` where the
/// recording shows no passing of an angle, or no filter has angle and rate.
pub(super) fn passings(
    recording: &RecordingOutcome,
    segment: &SegmentOutcome,
    trajectory: &Trajectory,
    prefix: &str,
) -> Option<Figure> {
    let angle = trajectory.states.iter().find(|state| state.kind.name == kind::ANGLE.name)?;
    let rate = trajectory.states.iter().find(|state| state.kind.name == kind::ANGULAR_RATE.name)?;
    let own = recording.reference.as_ref().and_then(|all| all.angles_of(&segment.estimate.segment).ok());
    let reference = own.as_ref().and_then(|all| all.iter().find(|one| one.states[0] == angle.name));
    let known = reference
        .map_or((&trajectory.time_s, &angle.mean), |reference| (&reference.time_s, &reference.angle));
    let found = |passing: &RecordedPassing| {
        let PassedMark::Angle(passed) = passing.of else { return None };
        let there = at(known, passing.time_s)?;
        let speed = at((&trajectory.time_s, &rate.mean), passing.time_s)?.abs();
        Some(Passing { time_s: passing.time_s, angle: passed, there, sd: passing.sd_s * speed })
    };
    let found: Vec<Passing> = segment.estimate.crossings.iter().filter_map(found).collect();
    if found.is_empty() {
        return None;
    }
    let by = if reference.is_some() { "the reference" } else { "the filter" };
    let caption = format!(
        "All of the recording: the angle with its envelope, √(θ² + (ω/2πf)²) at {:.1} Hz, and the angle where it was seen to be passed. Below, how \
         far {by} is from that angle at the time of each passing, with the standard deviation that is claimed of that time, in angle. \
         Of errors that are as claimed two thirds lie within the band.",
        segment.estimate.motion.frequency_hz
    );
    let angle_axis = || Axis::new("angle", "deg");
    let mut whole = Panel::new(time_axis(), angle_axis());
    if let Some(reference) = reference {
        let degrees = reference.time_s.iter().zip(&reference.angle).map(|(t, a)| (*t, a.to_degrees()));
        whole = whole.with(Series::line("reference", SeriesRole::Reference, degrees));
    }
    let over = |values: &[f64]| -> Vec<(f64, f64)> {
        trajectory.time_s.iter().zip(values).map(|(t, v)| (*t, v.to_degrees())).collect()
    };
    whole = whole.with(Series::line(&trajectory.name, SeriesRole::Estimate, over(&angle.mean)));
    let envelope = envelope(angle, rate, segment.estimate.motion.frequency_hz);
    let below: Vec<f64> = envelope.iter().map(|size| -size).collect();
    whole = whole
        .with(Series::line("envelope", SeriesRole::Bound, over(&envelope)))
        .with(Series::line("", SeriesRole::Bound, over(&below)))
        .with(Series::points(
            "angle passed",
            SeriesRole::Other,
            found.iter().map(|p| (p.time_s, p.angle.to_degrees())).collect::<Vec<_>>(),
        ));
    let claimed = found.iter().map(|p| (p.time_s, -p.sd.to_degrees(), p.sd.to_degrees()));
    let errors = Panel::new(time_axis(), Axis::new("angle at the passing less the one passed", "deg"))
        .with(Series::band(
            "± one standard deviation, as claimed",
            SeriesRole::Bound,
            claimed.collect::<Vec<_>>(),
        ))
        .with(Series::points(
            format!("by {by}"),
            SeriesRole::Estimate,
            found.iter().map(|p| (p.time_s, (p.there - p.angle).to_degrees())).collect::<Vec<_>>(),
        ))
        .with(Series::level("", SeriesRole::Bound, 0.0));
    Some(
        Figure::new(format!("{prefix}passings"), "Motion and passings", caption)
            .with(whole)
            .with(errors.sharing_x()),
    )
}

/// The amplitude of a sine of this frequency that has this angle and this rate.
fn envelope(angle: &StateSeries, rate: &StateSeries, frequency_hz: f64) -> Vec<f64> {
    let turn = TAU * frequency_hz;
    angle.mean.iter().zip(&rate.mean).map(|(a, r)| (a * a + (r / turn).powi(2)).sqrt()).collect()
}

/// A series at a time, along the straight line between its neighbours.
fn at((times, values): (&Vec<f64>, &Vec<f64>), time_s: f64) -> Option<f64> {
    let after = times.partition_point(|t| *t < time_s);
    let (before, after) = (after.checked_sub(1)?, after);
    let ([from, to], [a, b]) =
        ([*times.get(before)?, *times.get(after)?], [*values.get(before)?, *values.get(after)?]);
    let value = a + (b - a) * (time_s - from) / (to - from);
    value.is_finite().then_some(value)
}

#[cfg(test)]
mod tests {
    use super::at;

    #[test]
    fn a_series_between_its_samples_is_a_straight_line() {
        let (times, values) = (vec![0.0, 1.0, 2.0], vec![3.0, 5.0, f64::NAN]);
        assert_eq!(at((&times, &values), 0.25), Some(3.5));
        assert_eq!(at((&times, &values), 1.5), None);
        assert_eq!((at((&times, &values), -0.1), at((&times, &values), 2.1)), (None, None));
    }
}

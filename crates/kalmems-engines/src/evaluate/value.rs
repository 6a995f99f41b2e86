//! Errors of a quantity that is no angle: an acceleration, a position.

use super::reference::{TimePlace, place};
use super::{Accuracy, Claim, ErrorSeries};
use crate::estimate::{KnownState, StateSeries, Trajectory};
use crate::progress::Interruption;
use crate::signal::{cubic_between, hermite, usual_interval};
use crate::units::Kind;
use kalmems_core::Portable;
use serde::Serialize;
use std::collections::BTreeMap;

/// A state that a reference may know.
#[derive(Clone, Debug, PartialEq)]
pub struct ValueState {
    /// Its name among the states.
    pub name: &'static str,
    /// What it is.
    pub kind: &'static Kind,
    /// The state that is its rate, by which it is interpolated where a trajectory has it.
    pub rate: Option<&'static str>,
}

/// A quantity measured, or known, independently of the signal.
#[derive(Clone, Debug)]
pub struct ValueReference {
    /// The state of an estimate that it is compared with.
    pub state: &'static ValueState,
    /// When the instrument said so, less its delay, in s.
    pub time_s: Vec<f64>,
    /// The quantity in SI; not a number where it is missing.
    pub value: Vec<f64>,
    /// How accurate that is.
    pub accuracy: Accuracy,
}

/// The error of a quantity, in its SI unit.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ValueErrors {
    /// The unit, as column names have it.
    pub unit: &'static str,
    /// Its root mean square.
    pub rmse: f64,
    /// Its mean: estimate minus reference.
    pub bias: f64,
    /// The largest.
    pub largest: f64,
    /// The root mean square of the reference over that of the error, in dB; `None` where either is 0.
    pub snr_db: Option<f64>,
    /// The slope of the line that the estimate follows over the reference, by least squares: 1 for an estimate without an
    /// error of its scale (Chen, dissertation, 2018, equations 59 to 61, with the column of ones that they need);
    /// `None` where the reference does not vary.
    pub scale_factor: Option<f64>,
    /// Where that line is at 0, in the unit; `None` where the reference does not vary.
    pub offset: Option<f64>,
    /// Samples compared.
    pub samples: usize,
    /// The share of them within three standard deviations; `None` for a model that claims none.
    pub within_three_sigma: Option<f64>,
    /// The comparison of the errors with their claimed standard deviations; `None` for a model that claims none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub claim: Option<Claim>,
    /// The error over time, for plots.
    #[serde(skip)]
    pub error: ErrorSeries,
}

/// Errors by the name of the state.
pub type ErrorsByState = BTreeMap<&'static str, ValueErrors>;

/// Compares a trajectory with each reference from a time on; without an entry where not one sample can be compared.
pub fn evaluate_values(
    trajectory: &Trajectory,
    references: &[ValueReference],
    from_s: f64,
    stop: &Interruption,
) -> ErrorsByState {
    let known = references.iter().map(|one| (one.state.name, &one.time_s[..], &one.value[..]));
    let turned = turned_to(trajectory, known, from_s);
    let trajectory = turned.as_ref().unwrap_or(trajectory);
    let one = |reference: &ValueReference| {
        if trajectory.time_s.is_empty() {
            return None;
        }
        let of = |trajectory: &Trajectory| {
            let state = trajectory.state(reference.state.name)?;
            let rate = reference.state.rate.and_then(|rate| trajectory.state(rate));
            Some((state.name, errors(trajectory, (state, rate), reference, (from_s, stop))?))
        };
        let own = of(trajectory)?;
        let place = trajectory.states.iter().position(|state| state.name == reference.state.name)?;
        if !trajectory.hides_sign(place) {
            return Some(own);
        }
        // Nothing has stated the sign: the reference does.
        let mirrored = of(&trajectory.mirrored_in(place))?;
        Some(if mirrored.1.rmse < own.1.rmse { mirrored } else { own })
    };
    references.iter().filter_map(one).collect()
}

/// The answer after the hidden turns that bring it nearest to references, states with their times in s and values, from a time in s on; `None` if no
/// turn of theirs is hidden.
pub(super) fn turned_to<'a>(
    trajectory: &Trajectory,
    references: impl Iterator<Item = (&'a str, &'a [f64], &'a [f64])>,
    from_s: f64,
) -> Option<Trajectory> {
    if trajectory.hidden_turns.is_empty() {
        return None;
    }
    let times = &trajectory.time_s[..];
    let usual = usual_interval(times);
    let place_of = |name: &str| trajectory.states.iter().position(|state| state.name == name);
    let of = references.filter_map(|(name, time_s, values)| {
        let place = place_of(name).filter(|place| trajectory.hides_turn(*place))?;
        let from = time_s.partition_point(|t| *t < from_s * (1.0 - 1e-12));
        Some((place, &time_s[from..], &values[from..]))
    });
    let of: Vec<(usize, &[f64], &[f64])> = of.collect();
    let mean = |trajectory: &Trajectory, place_of_state: usize, time: f64| {
        let means = &trajectory.states[place_of_state].mean;
        match place(times, usual, time) {
            TimePlace::At(k) => means[k],
            TimePlace::Before { next, .. } => cubic_between(times, |k| means[k], next, time),
            TimePlace::Nowhere => f64::NAN,
        }
    };
    let own: Vec<_> = (of.iter())
        .map(|(_, time_s, _)| move |of: &Trajectory, place: usize, k: usize| mean(of, place, time_s[k]))
        .collect();
    let known =
        of.iter().zip(&own).map(|((place, _, values), own)| KnownState { place: *place, values, own });
    trajectory.turned_to(&known.collect::<Vec<_>>())
}

fn errors(
    trajectory: &Trajectory,
    (state, rate): (&StateSeries, Option<&StateSeries>),
    reference: &ValueReference,
    (from_s, stop): (f64, &Interruption),
) -> Option<ValueErrors> {
    let times = &trajectory.time_s[..];
    let usual = usual_interval(times);
    let ends = |values: &[f64], next: usize| values.get(next - 1).copied().zip(values.get(next).copied());
    // Between two samples the cubic by the rates, or that through the four samples around where there are none: a straight
    // line would take 3 · 10⁻⁵ off a sine that is sampled 370 times per cycle.
    let mean = |time| match place(times, usual, time) {
        TimePlace::At(k) => state.mean[k],
        TimePlace::Before { next, spacing, share } => {
            let (from, to) = ends(&state.mean, next).unwrap_or((f64::NAN, f64::NAN));
            match rate.and_then(|rate| ends(&rate.mean, next)) {
                Some(rates) => hermite((from, rates.0), (to, rates.1), spacing, share),
                None if from.is_finite() && to.is_finite() => {
                    let through = cubic_between(times, |k| state.mean[k], next, time);
                    if through.is_finite() { through } else { from + share * (to - from) }
                }
                None => f64::NAN,
            }
        }
        TimePlace::Nowhere => f64::NAN,
    };
    let deviation = |time| match place(times, usual, time) {
        TimePlace::At(k) => state.sd.get(k).copied().unwrap_or(f64::NAN),
        TimePlace::Before { next, .. } => ends(&state.sd, next).map_or(f64::NAN, |(a, b)| a.max(b)),
        TimePlace::Nowhere => f64::NAN,
    };
    let mut series = ErrorSeries::default();
    let mut truth = Vec::new();
    // Half an ulp of a decimal time must not decide about a sample.
    let from = reference.time_s.partition_point(|t| *t < from_s * (1.0 - 1e-12));
    for (k, (time, known)) in reference.time_s[from..].iter().zip(&reference.value[from..]).enumerate() {
        if stop.is_requested_at(k) {
            return None;
        }
        let error = mean(*time) - known;
        if error.is_finite() {
            series.time_s.push(*time);
            series.error.push(error);
            truth.push(*known);
            if !state.sd.is_empty() {
                series.sd.push(deviation(*time));
            }
        }
    }
    let samples = truth.len();
    let average = |values: &mut dyn Iterator<Item = f64>| values.sum::<f64>() / samples as f64;
    let square = average(&mut series.error.iter().map(|e| e * e));
    let snr_db = 10.0 * (average(&mut truth.iter().map(|t| t * t)) / square).portable_log10();
    let line = line(&truth, &series.error);
    let place = trajectory.states.iter().position(|own| own.name == state.name);
    let claim =
        place.and_then(|place| Claim::of(&series, &truth, (trajectory, place), reference.accuracy, stop));
    (samples > 0).then(|| ValueErrors {
        unit: state.unit,
        rmse: square.sqrt(),
        bias: average(&mut series.error.iter().copied()),
        largest: series.error.iter().fold(0.0, |most, e| most.max(e.abs())),
        snr_db: snr_db.is_finite().then_some(snr_db),
        scale_factor: line.map(|[slope, _]| 1.0 + slope),
        offset: line.map(|[_, offset]| offset),
        samples,
        within_three_sigma: claim.map(|claim| claim.within),
        claim,
        error: series,
    })
}

/// Slope and height at 0 of the line through points.
fn line(x: &[f64], y: &[f64]) -> Option<[f64; 2]> {
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let (x0, y0) = (mean(x), mean(y));
    let product: f64 = x.iter().zip(y).map(|(x, y)| (x - x0) * (y - y0)).sum();
    let slope = product / x.iter().map(|x| (x - x0).powi(2)).sum::<f64>();
    slope.is_finite().then_some([slope, y0 - slope * x0])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimate::{StateName, TrajectoryKind};
    use crate::units::kind;

    static POSITION: ValueState =
        ValueState { name: "position", kind: &kind::LENGTH, rate: Some("velocity") };

    const STATES: [StateName; 2] =
        [("position", "m", &kind::LENGTH), ("velocity", "m_per_s", &kind::VELOCITY)];

    #[test]
    fn errors_are_counted_after_the_settling_time() {
        let time_s: Vec<f64> = (0..100).map(f64::from).collect();
        let mut trajectory = Trajectory::blank(
            ("ekf", "EKF"),
            TrajectoryKind::Filtered,
            (&time_s, &time_s, &(0..time_s.len())),
            &STATES,
        );
        // 3 nm and −1 nm in turn, after errors of 1 µm in the first ten samples.
        for (k, t) in time_s.iter().enumerate() {
            let off = if k < 10 {
                1e-6
            } else if k % 2 == 0 {
                3e-9
            } else {
                -1e-9
            };
            trajectory.states[0].mean[k] = 1e-3 + 1e-6 * t + off;
            trajectory.states[0].sd[k] = 0.5e-9;
        }
        let value = time_s.iter().map(|t| 1e-3 + 1e-6 * t).collect();
        let references = [ValueReference { state: &POSITION, time_s, value, accuracy: Accuracy::default() }];
        let all = evaluate_values(&trajectory, &references, 10.0, &Interruption::never());
        let errors = &all["position"];
        assert!((errors.rmse - 5_f64.sqrt() * 1e-9).abs() < 1e-15, "{errors:?}");
        assert!((errors.bias - 1e-9).abs() < 1e-15 && (errors.largest - 3e-9).abs() < 1e-15);
        assert_eq!((errors.samples, errors.within_three_sigma), (90, Some(0.5)));
        assert!(evaluate_values(&trajectory, &references, 1e3, &Interruption::never()).is_empty());
    }

    #[test]
    fn the_rate_interpolates_between_samples() {
        let time_s: Vec<f64> = (0..50).map(|k| 0.1 * f64::from(k)).collect();
        let mut trajectory = Trajectory::blank(
            ("ekf", "EKF"),
            TrajectoryKind::Filtered,
            (&time_s, &time_s, &(0..time_s.len())),
            &STATES,
        );
        for (k, t) in time_s.iter().enumerate() {
            (trajectory.states[0].mean[k], trajectory.states[1].mean[k]) = t.sin_cos();
        }
        let time_s: Vec<f64> = time_s[..49].iter().map(|t| t + 0.05).collect();
        let value = time_s.iter().map(|t| t.sin()).collect();
        let all = evaluate_values(
            &trajectory,
            &[ValueReference { state: &POSITION, time_s, value, accuracy: Accuracy::default() }],
            0.0,
            &Interruption::never(),
        );
        // The cubic is off by h⁴/384; the straight line were, by h²/8.
        let bound = 0.1_f64.powi(4) / 384.0;
        assert!(
            (0.9 * bound..=1.01 * bound).contains(&all["position"].largest),
            "{:e}",
            all["position"].largest
        );
    }
}

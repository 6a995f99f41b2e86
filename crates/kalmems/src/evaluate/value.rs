//! Errors of a quantity that is no angle: an acceleration, a displacement.

use super::ErrorSeries;
use super::reference::{Place, place};
use crate::estimate::{StateSeries, Trajectory};
use crate::signal::usual_interval;
use crate::units::Kind;
use serde::Serialize;
use std::collections::BTreeMap;

/// A state that a reference may know.
#[derive(Debug)]
pub struct ValueState {
    /// Its name among the states.
    pub name: &'static str,
    /// What it is.
    pub kind: &'static Kind,
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
    /// Where that line is at 0, in the unit; `None` likewise.
    pub offset: Option<f64>,
    /// Samples compared.
    pub samples: usize,
    /// The share of them within three standard deviations; `None` for a model that claims none.
    pub within_three_sigma: Option<f64>,
    /// The error over time, for plots.
    #[serde(skip)]
    pub error: ErrorSeries,
}

/// Errors by the name of the state.
pub type ErrorsByState = BTreeMap<&'static str, ValueErrors>;

/// Compares a trajectory with each reference from a time on; without an entry where not one sample can be compared.
pub fn evaluate_values(trajectory: &Trajectory, references: &[ValueReference], from_s: f64) -> ErrorsByState {
    let one = |reference: &ValueReference| {
        let state = trajectory.state(reference.state.name)?;
        Some((state.name, errors(&trajectory.time_s, state, reference, from_s)?))
    };
    references.iter().filter_map(one).collect()
}

fn errors(
    times: &[f64],
    state: &StateSeries,
    reference: &ValueReference,
    from_s: f64,
) -> Option<ValueErrors> {
    let usual = usual_interval(times);
    // Between two samples the straight line: the quantity is sampled more than finely enough for an estimate of it.
    let between = |values: &[f64], time| match place(times, usual, time) {
        Place::At(k) => values.get(k).copied().unwrap_or(f64::NAN),
        Place::Before { next, share, .. } => {
            let ends = values.get(next - 1).zip(values.get(next));
            ends.map_or(f64::NAN, |(a, b)| a + share * (b - a))
        }
        Place::Nowhere => f64::NAN,
    };
    let mut series = ErrorSeries::default();
    let mut truth = Vec::new();
    // Half an ulp of a decimal time must not decide about a sample.
    let from = reference.time_s.partition_point(|t| *t < from_s * (1.0 - 1e-12));
    for (time, known) in reference.time_s[from..].iter().zip(&reference.value[from..]) {
        let error = between(&state.mean, *time) - known;
        if error.is_finite() {
            series.time_s.push(*time);
            series.error.push(error);
            truth.push(*known);
            if !state.sd.is_empty() {
                series.sd.push(between(&state.sd, *time));
            }
        }
    }
    let samples = truth.len();
    let mean = |values: &mut dyn Iterator<Item = f64>| values.sum::<f64>() / samples as f64;
    let square = mean(&mut series.error.iter().map(|e| e * e));
    let snr_db = 10.0 * (mean(&mut truth.iter().map(|t| t * t)) / square).log10();
    let line = line(&truth, &series.error);
    let within = series.error.iter().zip(&series.sd).filter(|(e, s)| e.abs() <= 3.0 * **s).count();
    (samples > 0).then(|| ValueErrors {
        unit: state.unit,
        rmse: square.sqrt(),
        bias: mean(&mut series.error.iter().copied()),
        largest: series.error.iter().fold(0.0, |most, e| most.max(e.abs())),
        snr_db: snr_db.is_finite().then_some(snr_db),
        scale_factor: line.map(|[slope, _]| 1.0 + slope),
        offset: line.map(|[_, offset]| offset),
        samples,
        within_three_sigma: (!series.sd.is_empty()).then(|| within as f64 / samples as f64),
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

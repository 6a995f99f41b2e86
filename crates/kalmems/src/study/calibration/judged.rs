//! What one run says of each filter's claims.

use super::prior::DrawnDeviation;
use crate::estimate::{Trajectory, TrajectoryKind};
use crate::evaluate::{Claim, ErrorSeries, MotionErrors, ParameterAnswer};
use crate::results::{EstimatorMetrics, Metrics};
use crate::workflow::{Outcome, SegmentOutcome};
use serde::{Deserialize, Serialize};

/// How many standard deviations the levels of coverage have.
pub(super) const LEVELS: [f64; 3] = [1.0, 2.0, 3.0];

/// One filter, or its smoother, in one run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(in super::super) struct RunClaims {
    pub(super) recording: String,
    pub(super) segment: String,
    pub(super) estimator: String,
    pub(super) name: String,
    /// How far the verdict trusts it; `None` of what makes no claim.
    pub(super) grade: Option<String>,
    /// What was tested, and whether the test fails.
    pub(super) tests: Vec<(String, bool)>,
    pub(super) claims: Vec<NormalizedErrors>,
}

/// Errors of one quantity in one run, over the standard deviation that is claimed of them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(in super::super) struct NormalizedErrors {
    pub(super) quantity: String,
    /// How many errors were compared.
    pub(super) errors: u64,
    /// How many independent ones they are worth.
    pub(super) independent: f64,
    /// How many of them are within each of the levels.
    pub(super) within: [u64; LEVELS.len()],
    /// (truth − estimate)/sd at samples so far apart that they have next to nothing to do with each other.
    pub(super) deviates: Vec<f64>,
}

/// The most errors of one quantity that are taken from one run.
const KEPT: usize = 16;

/// How many times as long as a square of an error lasts two errors are apart. A swing whose errors decay as e^(−t/T) has squares
/// that last T/2: four times that leaves a correlation of 0.14, and 0.02 of what is counted in bins.
pub(super) const APART: f64 = 4.0;

/// A deviation that is shown as larger than this tells no more.
const MOST: f64 = 1e6;

/// What a run says of the claims of all of its filters, with the parameters that were drawn for it.
pub(in super::super) fn judged(
    outcome: &Outcome,
    metrics: &Metrics,
    drawn: &[DrawnDeviation],
) -> Vec<RunClaims> {
    let mut all = Vec::new();
    for (recording, of_recording) in outcome.recordings.iter().zip(&metrics.recordings) {
        for (segment, of_segment) in recording.segments.iter().zip(&of_recording.segments) {
            let estimators = segment.estimate.trajectories.iter().zip(&of_segment.estimators);
            for (place, (trajectory, estimator)) in estimators.enumerate() {
                if trajectory.claims() {
                    all.push(RunClaims {
                        recording: of_recording.name.clone(),
                        segment: of_segment.label.clone(),
                        estimator: estimator.key.clone(),
                        name: estimator.name.clone(),
                        grade: estimator.grade.map(|grade| grade.words().to_owned()),
                        tests: tests(estimator),
                        claims: claims((segment, place), trajectory, estimator, drawn),
                    });
                }
            }
        }
    }
    all
}

/// Each test of the verdict by its name, and whether it fails.
fn tests(estimator: &EstimatorMetrics) -> Vec<(String, bool)> {
    let mut tests: Vec<(String, bool)> = estimator
        .tests
        .iter()
        .map(|found| {
            let name = serde_json::to_value(found.test).ok();
            let name = name.as_ref().and_then(|name| name.as_str()).unwrap_or_default();
            (name.replace('_', " "), found.fails())
        })
        .collect();
    if !estimator.parameters.is_empty() {
        let fails = estimator.parameters.iter().any(|parameter| parameter.fault.is_some());
        tests.push(("parameters".to_owned(), fails));
    }
    if estimator.errors.is_some() || !estimator.values.is_empty() {
        tests.push(("reference".to_owned(), estimator.broken_claims().next().is_some()));
    }
    tests
}

fn claims(
    (segment, place): (&SegmentOutcome, usize),
    trajectory: &Trajectory,
    estimator: &EstimatorMetrics,
    drawn: &[DrawnDeviation],
) -> Vec<NormalizedErrors> {
    let angles = segment.errors.get(place).into_iter().flatten().flat_map(MotionErrors::each);
    let angles = angles.map(|errors| (errors.of, &errors.error, errors.angle.claim));
    let values = segment.values.get(place).into_iter().flatten();
    let values = values.map(|(name, errors)| (*name, &errors.error, errors.claim));
    let mut claims: Vec<NormalizedErrors> = angles
        .chain(values)
        .filter_map(|(name, series, claim)| Some(NormalizedErrors::of(name, series, claim?)))
        .collect();
    // A smoother has the parameters of its filter.
    if trajectory.kind == TrajectoryKind::Filtered {
        let answers = estimator.parameters.iter();
        claims.extend(answers.filter_map(|answer| NormalizedErrors::of_parameter(answer, drawn)));
    }
    claims
}

impl NormalizedErrors {
    /// Of errors over time.
    fn of(quantity: &str, series: &ErrorSeries, claim: Claim) -> Self {
        let mut within = [0; LEVELS.len()];
        let mut deviates = Vec::new();
        for (error, sd) in series.error.iter().zip(&series.sd) {
            let deviate = -error / sd;
            if deviate.is_nan() {
                continue;
            }
            deviates.push(deviate.clamp(-MOST, MOST));
            for (count, level) in within.iter_mut().zip(LEVELS) {
                *count += u64::from(deviate.abs() <= level);
            }
        }
        let errors = deviates.len();
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // between 1 and KEPT
        let kept = (claim.independent / APART).clamp(1.0, KEPT as f64) as usize;
        // The middles of as many equally long parts.
        let places = (0..kept).map(|part| (2 * part + 1) * errors / (2 * kept));
        let deviates = places.filter_map(|place| deviates.get(place).copied()).collect();
        let quantity = quantity.to_owned();
        Self { quantity, errors: errors as u64, independent: claim.independent, within, deviates }
    }

    /// Of a parameter at the end; `None` of one that was not drawn.
    fn of_parameter(answer: &ParameterAnswer, drawn: &[DrawnDeviation]) -> Option<Self> {
        let truth = drawn.iter().find(|drawn| drawn.name == answer.name)?;
        let deviate = ((truth.deviation - answer.end) / answer.end_sd).clamp(-MOST, MOST);
        let within = LEVELS.map(|level| u64::from(deviate.abs() <= level));
        let quantity = answer.name.to_owned();
        (!deviate.is_nan()).then(|| Self {
            quantity,
            errors: 1,
            independent: 1.0,
            within,
            deviates: vec![deviate],
        })
    }
}

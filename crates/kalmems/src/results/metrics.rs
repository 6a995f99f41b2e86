//! The figures of an estimate.

use super::answer::answers;
use super::arbitrary::ArbitraryBranches;
use super::{QuantityAnswer, Verdict};
use crate::diagnose::{FoundNoise, InputFault, NumberCheck, ScaleNote};
use crate::estimate::{
    Lock, NisConsistency, ParameterCorrelation, SampleCounts, SegmentEstimate, SignalConsistency,
    StretchSummary, Trajectory, TrajectoryKind,
};
use crate::evaluate::{
    ErrorsByState, Grade, Judgement, MotionErrors, ParameterAnswer, Rejections, StepErrors, TestResult,
    UncertaintyBudget, ValueState,
};
use crate::recording::{Finding, StretchPlace, TimeOrigin};
use crate::signal::Sine;
use crate::workflow::{Outcome, SegmentOutcome};
use kalmems_core::Portable;
use serde::{Serialize, Serializer};

/// All figures of an experiment; durations are not among them, so that the same input gives the same bytes.
#[derive(Clone, Debug, Serialize)]
pub struct Metrics {
    /// Counts up where a key of `metrics.json` changes its meaning or goes; new keys may come without.
    pub schema_version: u32,
    /// The experiment's name.
    pub experiment: String,
    /// The rig's.
    pub rig: &'static str,
    /// The answers, a sentence each, as a run prints them first.
    pub answer: Vec<String>,
    /// What the device tells that is no angle; the first is what it is for.
    #[serde(skip)]
    pub values: &'static [ValueState],
    /// The numbers of the device's table that are stated without an uncertainty, by their keys below it: no answer takes into account that
    /// they may be others.
    pub held_as_exact: Vec<String>,
    /// What the signal does not determine of the device, and what that does to the answer; of the first filter that it could tell it.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub scale_notes: Vec<ScaleNote>,
    /// What no test of the innovations can see, by the equations of the device, in whole sentences.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub unseen: Vec<String>,
    /// A fault of the channels that explains why the first filter loses the signal.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub input_fault: Option<InputFault>,
    /// Noises that the experiment left to its recording.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub noise_from_recording: Vec<FoundNoise>,
    /// One per recording.
    pub recordings: Vec<RecordingMetrics>,
}

/// Those of a recording.
#[derive(Clone, Debug, Serialize)]
pub struct RecordingMetrics {
    /// Its name.
    pub name: String,
    /// Its file.
    pub file: String,
    /// Where its times count from, where that is not zero of its clock.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub origin: Option<TimeOrigin>,
    /// What was found in it that does not keep it from being used.
    pub diagnosis: Vec<FindingText>,
    /// The file of its reference, where there is one.
    pub reference: Option<String>,
    /// What was found in that one.
    pub reference_diagnosis: Vec<FindingText>,
    /// What became of the stretches of its records, where some were cut.
    #[serde(skip_serializing_if = "StretchSummary::is_empty")]
    pub stretches: StretchSummary,
    /// One per segment.
    pub segments: Vec<SegmentMetrics>,
}

/// A finding, and the sentence that says it.
#[derive(Clone, Debug, Serialize)]
pub struct FindingText {
    /// The sentence.
    pub message: String,
    /// The finding.
    #[serde(flatten)]
    pub finding: Finding,
}

/// Those of a segment.
#[derive(Clone, Debug, Serialize)]
pub struct SegmentMetrics {
    /// Its label; empty where the recording has one segment.
    pub label: String,
    /// Which stretch of its record it is, where that was cut before it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stretch: Option<StretchPlace>,
    /// How long it is, in s.
    pub duration_s: f64,
    /// How much of that is not scored, in s.
    pub skip_s: f64,
    /// How fast the device moves, in Hz.
    pub motion_hz: f64,
    /// The drive, where it is a steady sine.
    pub drive: Option<DriveMetrics>,
    /// The axes beside the one that `drive` and `motion_hz` are of.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub other_axes: Vec<AxisMetrics>,
    /// Whether the signal is the same for the mirrored motion.
    #[serde(skip)]
    pub sign_is_hidden: bool,
    /// What the signals do not tell and nothing states: which of both an estimate has is arbitrary, and a reference is compared with the one that is
    /// nearer to it.
    #[serde(flatten)]
    pub arbitrary: ArbitraryBranches,
    /// What a reader of the figures has to know and cannot see from them.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub remarks: Vec<String>,
    /// Of several filters whose answers pass the one whose predictions of signal and crossings are the likeliest.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub likeliest: Option<FilterSelection>,
    /// One per filter.
    pub estimators: Vec<EstimatorMetrics>,
}

/// A choice between filters by the recording alone.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FilterSelection {
    /// The filter, as a key.
    pub key: String,
    /// The filter, for people.
    pub name: String,
    /// Σ ln p of what it was shown, given what came before: the signal, and the angle at the crossings. Each sample is predicted
    /// before the filter sees it, so that states and parameters have no part of what they are judged by.
    pub log_likelihood: f64,
    /// By how much that of the next filter is smaller; `None` where no other passes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ahead: Option<f64>,
}

impl FilterSelection {
    /// Whether the next filter is as good as told by these numbers: less than a factor of 20 in the likelihood is no difference.
    pub fn is_tied(&self) -> bool {
        self.ahead.is_some_and(is_tie)
    }
}

/// Whether a filter whose log-likelihood is larger by so much is as good as the next one.
pub(super) fn is_tie(ahead: f64) -> bool {
    ahead < 20_f64.portable_ln()
}

/// The choice between those filters whose answer passes; `None` where there is but one filter, or none passes.
fn likeliest(estimators: &[EstimatorMetrics]) -> Option<FilterSelection> {
    let predicts = |e: &&EstimatorMetrics| e.kind == TrajectoryKind::Filtered && e.grade.is_some();
    let claims = |e: &EstimatorMetrics| {
        predicts(&e) && e.passes() && e.counts.without_signal == estimators[0].counts.without_signal
    };
    // Densities of different samples are not compared.
    let mut signals = estimators.iter().filter(predicts).map(|e| &e.signals);
    let first = signals.next();
    if estimators.iter().filter(predicts).count() < 2 || signals.any(|other| Some(other) != first) {
        return None;
    }
    let mut all: Vec<(f64, &EstimatorMetrics)> = (estimators.iter())
        .filter(|e| claims(e))
        .filter_map(|e| e.log_likelihood().map(|l| (l, e)))
        .collect();
    // A filter that has lost the signal, or had stopped, leaves the samples until it has settled again out of the sum.
    let least_lost = all.iter().map(|(_, e)| e.counts.lost).min();
    all.retain(|(_, e)| Some(e.counts.lost) == least_lost);
    all.sort_by(|a, b| b.0.total_cmp(&a.0));
    let (log_likelihood, best) = *all.first()?;
    let ahead = all.get(1).map(|(next, _)| log_likelihood - next);
    Some(FilterSelection { key: best.key.clone(), name: best.name.clone(), log_likelihood, ahead })
}

/// One axis of several.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct AxisMetrics {
    /// The name of its angle.
    pub angle: &'static str,
    /// How fast it moves, in Hz.
    pub motion_hz: f64,
    /// Its part of the drive, where that is a steady sine.
    pub drive: Option<DriveMetrics>,
}

/// The sine of a drive.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct DriveMetrics {
    /// Its mean in V.
    pub offset_v: f64,
    /// Its amplitude in V.
    pub amplitude_v: f64,
    /// Its frequency in Hz.
    pub frequency_hz: f64,
}

/// Those of a filter.
#[derive(Clone, Debug, Serialize)]
pub struct EstimatorMetrics {
    /// The filter, as a key.
    pub key: String,
    /// The filter, for people.
    pub name: String,
    /// What its answer rests on.
    #[serde(skip)]
    pub kind: TrajectoryKind,
    /// The result of its mean NIS, its lock and its sign alone, one of the parts of the grade; kept for programs that read it.
    pub verdict: Verdict,
    /// How far its answer can be trusted, by all tests; `None` of a method that claims no standard deviation. Tables and `--strict` use it.
    pub grade: Option<Grade>,
    /// What the tests of its innovations find after the settling time; none of what makes no claim.
    #[serde(skip_serializing_if = "Vec::is_empty", serialize_with = "by_test")]
    pub tests: Vec<TestResult>,
    /// What its gate rejected, and when it was open, after the settling time.
    #[serde(skip_serializing_if = "Rejections::is_empty")]
    pub rejections: Rejections,
    /// What became of its parameters that are states.
    #[serde(skip_serializing_if = "Vec::is_empty", serialize_with = "by_name")]
    pub parameters: Vec<ParameterAnswer>,
    /// How the errors of these hang together at the end.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub parameter_correlations: Vec<ParameterCorrelation>,
    /// What of its claims is due to what, by the state; where something of the device is stated as uncertain.
    #[serde(skip_serializing_if = "Vec::is_empty", serialize_with = "by_state")]
    pub uncertainty_budget: Vec<UncertaintyBudget>,
    /// What it says of what the device is for, after the settling time.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub answer: Vec<QuantityAnswer>,
    /// The signs and half turns that are arbitrary in its answer, in words.
    #[serde(skip)]
    pub arbitrary: Vec<String>,
    /// The errors against the reference, after the settling time; `None` where there is nothing to compare.
    pub errors: Option<MotionErrors>,
    /// The errors of states that are no angles, by the name of the state, against the reference after the settling time.
    #[serde(skip_serializing_if = "ErrorsByState::is_empty")]
    pub values: ErrorsByState,
    /// The mean NIS after the settling time; `None` for a model that makes no claim.
    pub consistency: Option<NisConsistency>,
    /// The same by each of the signals that correct it, where there are several.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub by_signal: Vec<SignalConsistency>,
    /// What its steps from sample to sample add to its errors; none where they are exact.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub step_errors: Option<StepErrors>,
    /// Whether it followed the motion.
    pub lock: Lock,
    /// Σ ln p of the angle at the crossings of a threshold; 0 where there are none.
    #[serde(skip_serializing_if = "is_zero")]
    pub crossings_log_likelihood: f64,
    /// What happened to the samples.
    pub counts: SampleCounts,
    /// Samples after the settling time.
    #[serde(skip)]
    scored: usize,
    /// The signals that correct it, of a device that can have several.
    #[serde(skip)]
    signals: Vec<String>,
    /// Whether the answer was mirrored to have the stated sign.
    pub mirrored: bool,
    /// Where and why it stopped, if it did.
    pub failure: Option<String>,
    /// How long a step took, in s; a measurement, and no part of the figures.
    #[serde(skip)]
    pub seconds_per_step: f64,
}

impl EstimatorMetrics {
    /// Σ ln p of what it was shown after the settling time, the crossings included; `None` for what makes no claim.
    pub fn log_likelihood(&self) -> Option<f64> {
        self.consistency.as_ref().map(|c| c.log_likelihood + self.crossings_log_likelihood)
    }
}

/// Events of a lock that are listed; a filter that is lost again and again is lost.
const LISTED: usize = 1000;

impl SegmentMetrics {
    /// The key of the filter to trust, where one predicts better than the others; where several are as likely the first of them is as
    /// good as any.
    pub fn trusted(&self) -> Option<&str> {
        self.likeliest
            .as_ref()
            .filter(|likeliest| !likeliest.is_tied())
            .map(|likeliest| likeliest.key.as_str())
    }

    /// The filter whose answer comes first: of the best grade, then the likeliest where one is, then the one with the fewest parameters as
    /// states.
    pub fn best(&self) -> Option<&EstimatorMetrics> {
        let is_trusted = |one: &EstimatorMetrics| self.trusted() == Some(one.key.as_str());
        let smoothed = |one: &EstimatorMetrics| one.kind != TrajectoryKind::Filtered;
        let judged = self.estimators.iter().filter(|one| one.grade.is_some());
        judged.min_by_key(|one| (one.grade, !is_trusted(one), smoothed(one), one.parameters.len()))
    }

    /// The key of the filter whose answer comes first.
    pub fn best_key(&self) -> Option<&str> {
        self.best().map(|best| best.key.as_str())
    }

    /// Takes those of the segment's next part in.
    pub(super) fn pool(&mut self, later: Self) {
        self.duration_s += later.duration_s;
        for remark in later.remarks {
            if !self.remarks.contains(&remark) {
                self.remarks.push(remark);
            }
        }
        for (own, later) in self.estimators.iter_mut().zip(later.estimators) {
            own.pool(later);
        }
        self.likeliest = likeliest(&self.estimators);
    }
}

impl EstimatorMetrics {
    /// Draws the verdict and the grade from all that is known.
    fn judge(&mut self) {
        let (errors, consistency) = (self.errors.as_ref(), self.consistency.as_ref());
        self.verdict = Verdict::of(self.kind, (self.failure.is_some(), &self.lock), errors, consistency);
        let SampleCounts { lost, samples, .. } = self.counts;
        // Of a short recording all that is left after the settling time may be lost, and be less than half.
        let is_mostly_lost = 2 * lost > samples || (lost > 0 && lost >= self.scored);
        if is_mostly_lost && self.verdict.is_of_an_estimate() {
            self.verdict = Verdict::LostLock;
        }
        self.grade = self.graded();
    }

    fn pool(&mut self, later: Self) {
        let weight = |counts: &SampleCounts| counts.samples as f64;
        let (own, others) = (weight(&self.counts), weight(&later.counts));
        self.seconds_per_step =
            (self.seconds_per_step * own + later.seconds_per_step * others) / (own + others).max(1.0);
        self.counts.add(&later.counts);
        self.scored += later.scored;
        match (&mut self.errors, &later.errors) {
            (Some(errors), Some(later)) => errors.pool(later),
            (None, Some(_)) => self.errors.clone_from(&later.errors),
            (_, None) => {}
        }
        if self.answer.is_empty() {
            self.answer.clone_from(&later.answer);
        } else {
            self.answer.iter_mut().zip(&later.answer).for_each(|(own, later)| own.pool(later));
        }
        for (name, errors) in later.values {
            match self.values.get_mut(name) {
                Some(own) => own.pool(&errors),
                None => drop(self.values.insert(name, errors)),
            }
        }
        self.consistency = match (self.consistency.take(), later.consistency) {
            (Some(own), Some(later)) => Some(own.pooled(&later)),
            (own, later) => own.or(later),
        };
        self.by_signal.iter_mut().zip(&later.by_signal).for_each(|(own, later)| own.pool(later));
        match (&mut self.step_errors, &later.step_errors) {
            (Some(own), Some(later)) => own.pool(later),
            (None, Some(_)) => self.step_errors = later.step_errors,
            (_, None) => {}
        }
        let room = LISTED.saturating_sub(self.lock.events.len());
        self.lock.events.extend(later.lock.events.into_iter().take(room));
        self.lock.lost = later.lock.lost;
        self.crossings_log_likelihood += later.crossings_log_likelihood;
        self.mirrored |= later.mirrored;
        // A filter that was started again has not failed.
        self.failure = later.failure;
        // They are of the whole, and come with its last part.
        (self.tests, self.parameters) = (later.tests, later.parameters);
        self.rejections = later.rejections;
        self.uncertainty_budget = later.uncertainty_budget;
        self.parameter_correlations = later.parameter_correlations;
        self.judge();
    }
}

fn by_test<S: Serializer>(tests: &[TestResult], to: S) -> Result<S::Ok, S::Error> {
    to.collect_map(tests.iter().map(|found| (found.test, found)))
}

fn by_state<S: Serializer>(budgets: &[UncertaintyBudget], to: S) -> Result<S::Ok, S::Error> {
    to.collect_map(budgets.iter().map(|budget| (budget.state, budget)))
}

fn by_name<S: Serializer>(parameters: &[ParameterAnswer], to: S) -> Result<S::Ok, S::Error> {
    to.collect_map(parameters.iter().map(|parameter| (parameter.name, parameter)))
}

#[allow(clippy::trivially_copy_pass_by_ref)] // as serde calls it
fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

impl Metrics {
    /// That of what is written now.
    pub const SCHEMA_VERSION: u32 = 1;

    /// Takes the figures from an outcome.
    pub fn of(outcome: &Outcome) -> Self {
        let recordings = outcome.recordings.iter().map(|recording| RecordingMetrics {
            name: recording.name.clone(),
            file: recording.recording.source().file.clone(),
            origin: recording.recording.source().origin.clone(),
            diagnosis: texts(recording.recording.diagnosis()),
            reference: recording.reference.as_ref().map(|r| r.recording().source().file.clone()),
            reference_diagnosis: (recording.reference.as_ref())
                .map_or_else(Vec::new, |r| texts(r.recording().diagnosis())),
            stretches: recording.stretches.clone(),
            segments: recording.segments.iter().map(|one| segment(one, recording.values)).collect(),
        });
        let metrics = Self {
            schema_version: Self::SCHEMA_VERSION,
            experiment: outcome.experiment.name.to_string(),
            rig: outcome.rig,
            answer: Vec::new(),
            values: outcome.recordings.first().map_or(&[], |recording| recording.values),
            held_as_exact: outcome.experiment.held_as_exact(),
            scale_notes: Vec::new(),
            unseen: Vec::new(),
            input_fault: None,
            noise_from_recording: Vec::new(),
            recordings: recordings.collect(),
        };
        metrics.answered()
    }

    /// The same with the answers of the filters as they are graded now.
    fn answered(mut self) -> Self {
        self.answer = answers(&self);
        self
    }

    /// The names of the filters in whose innovations no test finds anything in a recording.
    pub fn without_findings(&self) -> Vec<String> {
        without_findings(&self.recordings)
    }

    /// The same with what the beginning of the recordings says of the numbers that the filters are told.
    #[must_use]
    pub fn with_numbers(mut self, numbers: NumberCheck) -> Self {
        self.scale_notes = numbers.notes;
        self.unseen = numbers.unseen;
        self.input_fault = numbers.input_fault;
        if let Some(segment) = self.recordings.iter_mut().flat_map(|r| &mut r.segments).next() {
            for (filter, test) in numbers.tests {
                let named =
                    |own: &&mut EstimatorMetrics| own.name == filter && own.kind == TrajectoryKind::Filtered;
                if let Some(own) = segment.estimators.iter_mut().find(named) {
                    own.tests.push(test);
                    own.judge();
                }
            }
            segment.likeliest = likeliest(&segment.estimators);
        }
        self.answered()
    }

    /// The same with noises that were found from the recording.
    #[must_use]
    pub fn with_noise(self, noise_from_recording: Vec<FoundNoise>) -> Self {
        Self { noise_from_recording, ..self }
    }

    /// All filters of all segments.
    pub fn estimators(&self) -> impl Iterator<Item = &EstimatorMetrics> {
        self.recordings.iter().flat_map(|r| &r.segments).flat_map(|s| &s.estimators)
    }
}

pub(super) fn texts(findings: &[Finding]) -> Vec<FindingText> {
    let text = |finding: &Finding| FindingText { message: finding.to_string(), finding: finding.clone() };
    findings.iter().map(text).collect()
}

/// The names of the filters in whose innovations no test finds anything in one of these recordings, be the answer what a reference says or
/// not.
pub(super) fn without_findings(recordings: &[RecordingMetrics]) -> Vec<String> {
    let all =
        recordings.iter().flat_map(|recording| &recording.segments).flat_map(|segment| &segment.estimators);
    let is_sound = |one: &&EstimatorMetrics| {
        one.kind == TrajectoryKind::Filtered
            && one.grade.is_some()
            && one.verdict.is_of_an_estimate()
            && one.failing().next().is_none()
    };
    let mut names: Vec<String> = all.filter(is_sound).map(|one| one.name.clone()).collect();
    names.sort();
    names.dedup();
    names
}

/// Those of a segment, or of a part of one.
pub(super) fn segment(outcome: &SegmentOutcome, values: &[ValueState]) -> SegmentMetrics {
    let estimate = &outcome.estimate;
    let time = &estimate.segment.time;
    let errors = outcome.errors.iter().zip(&outcome.values);
    let estimators: Vec<EstimatorMetrics> = (estimate.trajectories.iter().zip(errors))
        .enumerate()
        .map(|(i, (trajectory, errors))| {
            let mut metrics = estimator(trajectory, errors, outcome.judgements.get(i), estimate);
            let scored = trajectory.scored_after(estimate.start_s, estimate.skip_s);
            metrics.answer = QuantityAnswer::all_of(trajectory, &scored, values, estimate);
            metrics
        })
        .collect();
    SegmentMetrics {
        label: estimate.segment.label.clone(),
        stretch: Some(estimate.segment.stretch).filter(|stretch| stretch.number > 1),
        duration_s: time.at(time.len().saturating_sub(1)) - time.start_s(),
        skip_s: estimate.skip_s,
        motion_hz: estimate.motion.frequency_hz,
        drive: estimate.drive.map(drive),
        other_axes: (estimate.other_axes.iter())
            .map(|axis| AxisMetrics {
                angle: axis.angle,
                motion_hz: axis.motion.frequency_hz,
                drive: axis.drive.map(drive),
            })
            .collect(),
        sign_is_hidden: estimate.sign_is_hidden,
        arbitrary: ArbitraryBranches::of(&estimate.trajectories),
        remarks: estimate.remarks.clone(),
        likeliest: likeliest(&estimators),
        estimators,
    }
}

fn drive(sine: Sine) -> DriveMetrics {
    DriveMetrics { offset_v: sine.offset, amplitude_v: sine.amplitude, frequency_hz: sine.frequency_hz }
}

pub(super) fn consistency(trajectory: &Trajectory, estimate: &SegmentEstimate) -> Option<NisConsistency> {
    if !trajectory.claims() {
        return None;
    }
    trajectory.consistency(trajectory.scored_after(estimate.start_s, estimate.skip_s))
}

fn estimator(
    trajectory: &Trajectory,
    (errors, values): (&Option<MotionErrors>, &ErrorsByState),
    judgement: Option<&Judgement>,
    estimate: &SegmentEstimate,
) -> EstimatorMetrics {
    let Judgement { tests, parameters, rejections, budgets, .. } = judgement.cloned().unwrap_or_default();
    let scored = trajectory.scored_after(estimate.start_s, estimate.skip_s);
    let lost = trajectory.lost_among(scored.clone());
    let scored_from_s = trajectory.time_s.get(scored.start).copied();
    let mut metrics = EstimatorMetrics {
        key: trajectory.key.clone(),
        name: trajectory.name.clone(),
        kind: trajectory.kind,
        verdict: Verdict::NoClaim,
        grade: None,
        tests,
        rejections,
        parameters,
        parameter_correlations: trajectory.parameter_correlations.clone(),
        uncertainty_budget: budgets,
        answer: Vec::new(),
        arbitrary: ArbitraryBranches::of(std::slice::from_ref(trajectory)).in_words(),
        errors: errors.clone(),
        values: values.clone(),
        consistency: consistency(trajectory, estimate),
        by_signal: if trajectory.claims() { trajectory.consistency_by_signal(&scored) } else { Vec::new() },
        signals: trajectory.signals().map(|signal| signal.name.clone()).collect(),
        step_errors: scored_from_s.and_then(|from_s| StepErrors::of(trajectory, from_s)),
        lock: trajectory.lock.clone(),
        crossings_log_likelihood: trajectory.crossings_log_likelihood,
        counts: SampleCounts { lost, ..trajectory.counts },
        scored: scored.len(),
        mirrored: trajectory.mirrored,
        failure: trajectory.failure.map(|f| format!("stopped at {} s: {}", f.time_s, f.why)),
        seconds_per_step: trajectory.seconds_per_step,
    };
    metrics.judge();
    metrics
}

//! The figures of an estimate.

use crate::estimate::{
    Consistency, Counts, Lock, LockEvent, SegmentEstimate, StretchSummary, Trajectory, TrajectoryKind,
    is_the_only_one,
};
use crate::evaluate::{ErrorsByState, MotionErrors, ValueState};
use crate::recording::{Finding, Origin, StretchPlace};
use crate::signal::Sine;
use crate::workflow::{Outcome, SegmentOutcome};
use serde::Serialize;

/// All figures of an experiment; durations are not among them, so that the same input gives the same bytes.
#[derive(Clone, Debug, Serialize)]
pub struct Metrics {
    /// The experiment's name.
    pub experiment: String,
    /// The rig's.
    pub rig: &'static str,
    /// What the device tells that is no angle; the first is what it is for.
    #[serde(skip)]
    pub values: &'static [ValueState],
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
    pub origin: Option<Origin>,
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
    /// What a reader of the figures has to know and cannot see from them.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub remarks: Vec<String>,
    /// The filter whose innovations of signal and crossings are the likeliest, where there are crossings.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub likeliest: Option<Likeliest>,
    /// One per filter.
    pub estimators: Vec<EstimatorMetrics>,
}

/// A choice between filters by the recording alone.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Likeliest {
    /// The filter, as a key.
    pub key: String,
    /// The filter, for people.
    pub name: String,
    /// Σ ln p of what it was shown, given what came before: the signal, and the angle at the crossings.
    pub log_likelihood: f64,
    /// By how much that of the next filter is smaller.
    pub ahead: f64,
}

/// The choice between those filters that claim something, none of which failed; where at least one was told of crossings.
fn likeliest(estimators: &[EstimatorMetrics]) -> Option<Likeliest> {
    if estimators.iter().all(|estimator| estimator.counts.crossings == 0) {
        return None;
    }
    let claims = |e: &EstimatorMetrics| {
        e.failure.is_none() && e.counts.without_signal == estimators[0].counts.without_signal
    };
    let mut all: Vec<(f64, &EstimatorMetrics)> = (estimators.iter())
        .filter(|e| claims(e))
        .filter_map(|e| e.log_likelihood().map(|l| (l, e)))
        .collect();
    all.sort_by(|a, b| b.0.total_cmp(&a.0));
    let [(first, best), (second, _), ..] = all[..] else { return None };
    let (key, name) = (best.key.clone(), best.name.clone());
    Some(Likeliest { key, name, log_likelihood: first, ahead: first - second })
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
    /// Whether to trust it.
    pub verdict: Verdict,
    /// The errors against the reference, after the settling time; `None` where there is nothing to compare.
    pub errors: Option<MotionErrors>,
    /// The errors of what is no angle, likewise, by the state.
    #[serde(skip_serializing_if = "ErrorsByState::is_empty")]
    pub values: ErrorsByState,
    /// The mean NIS after the settling time; `None` for a model that makes no claim.
    pub consistency: Option<Consistency>,
    /// Whether it followed the motion.
    pub lock: Lock,
    /// Σ ln p of the angle at the crossings of a threshold; 0 where there are none.
    #[serde(skip_serializing_if = "is_zero")]
    pub crossings_log_likelihood: f64,
    /// What happened to the samples.
    pub counts: Counts,
    /// Whether the answer was mirrored to have the stated sign.
    pub mirrored: bool,
    /// Where and why it stopped, if it did.
    pub failure: Option<String>,
    /// How long a step took, in s; a measurement, and no part of the figures.
    #[serde(skip)]
    pub seconds_per_step: f64,
}

/// Whether a filter's answer may be trusted, from the recording alone but for the sign.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The mean NIS lies in its 95 % interval.
    Consistent,
    /// It lies below: the filter is more careful than it needs to be.
    Cautious,
    /// It lies above: the filter claims more than it knows, or the model is wrong.
    Overconfident,
    /// It lost the signal or changed branch on the way. No figure of it is a good estimate.
    LostLock,
    /// It stopped before the end.
    Failed,
    /// The reference has the opposite sign of what the experiment states.
    WrongSign,
    /// It makes no claim that could be tested: the model alone, and the lock-in.
    NoClaim,
    /// The model alone, where it does not follow the signal. It had no lock to lose.
    Astray,
}

impl Verdict {
    /// In a word or two.
    pub const fn words(self) -> &'static str {
        match self {
            Self::Consistent => "consistent",
            Self::Cautious => "cautious",
            Self::Overconfident => "overconfident",
            Self::LostLock => "LOST LOCK",
            Self::Failed => "FAILED",
            Self::WrongSign => "WRONG SIGN",
            Self::NoClaim => "no claim",
            Self::Astray => "astray",
        }
    }

    /// Whether a strict run may pass with it.
    pub const fn passes(self) -> bool {
        matches!(self, Self::Consistent | Self::NoClaim | Self::Astray)
    }
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
    fn pool(&mut self, later: Self) {
        let weight = |counts: &Counts| counts.samples as f64;
        let (own, others) = (weight(&self.counts), weight(&later.counts));
        self.seconds_per_step =
            (self.seconds_per_step * own + later.seconds_per_step * others) / (own + others).max(1.0);
        self.counts.add(&later.counts);
        match (&mut self.errors, &later.errors) {
            (Some(errors), Some(later)) => errors.pool(later),
            (None, Some(_)) => self.errors.clone_from(&later.errors),
            (_, None) => {}
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
        let room = LISTED.saturating_sub(self.lock.events.len());
        self.lock.events.extend(later.lock.events.into_iter().take(room));
        self.crossings_log_likelihood += later.crossings_log_likelihood;
        self.mirrored |= later.mirrored;
        self.failure = self.failure.take().or(later.failure);
        self.verdict = verdict_by(
            self.kind,
            (self.failure.is_some(), &self.lock),
            self.errors.as_ref(),
            self.consistency.as_ref(),
        );
    }
}

#[allow(clippy::trivially_copy_pass_by_ref)] // as serde calls it
fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

/// The angles that a bad verdict is about, by their names among the states; none where it is about all there are.
pub(super) fn angles_of(verdict: Verdict, lock: &Lock, errors: Option<&MotionErrors>) -> Vec<&'static str> {
    let mut angles = Vec::new();
    match verdict {
        Verdict::LostLock | Verdict::Astray => {
            for event in &lock.events {
                match event {
                    LockEvent::Lost { .. } => return Vec::new(),
                    LockEvent::Flipped { of, .. } if !angles.contains(of) => angles.push(of),
                    LockEvent::Flipped { .. } => {}
                }
            }
        }
        Verdict::WrongSign => {
            let wrong = errors.into_iter().flat_map(MotionErrors::each).filter(|e| e.sign_disagrees);
            angles.extend(wrong.map(|e| e.of));
        }
        _ => {}
    }
    angles.retain(|angle| !is_the_only_one(angle));
    angles
}

impl EstimatorMetrics {
    /// The verdict in a word or two, with the angles that it is about where others are not concerned.
    pub(super) fn verdict_words(&self) -> String {
        words_with(self.verdict, &angles_of(self.verdict, &self.lock, self.errors.as_ref()))
    }
}

/// A verdict in words, about these angles, or about all where none is named.
pub(super) fn words_with(verdict: Verdict, angles: &[&str]) -> String {
    match angles {
        [] => verdict.words().to_owned(),
        angles => format!("{} of {}", verdict.words(), angles.join(" and ")),
    }
}

impl Metrics {
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
            segments: recording.segments.iter().map(segment).collect(),
        });
        Self {
            experiment: outcome.experiment.name.to_string(),
            rig: outcome.rig,
            values: outcome.recordings.first().map_or(&[], |recording| recording.values),
            recordings: recordings.collect(),
        }
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

/// Those of a segment, or of a part of one.
pub(super) fn segment(outcome: &SegmentOutcome) -> SegmentMetrics {
    let estimate = &outcome.estimate;
    let time = &estimate.segment.time;
    let errors = outcome.errors.iter().zip(&outcome.values);
    let estimators: Vec<EstimatorMetrics> = (estimate.trajectories.iter().zip(errors))
        .map(|(trajectory, (errors, values))| estimator(trajectory, (errors, values), estimate))
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
        remarks: estimate.remarks.clone(),
        likeliest: likeliest(&estimators),
        estimators,
    }
}

fn drive(sine: Sine) -> DriveMetrics {
    DriveMetrics { offset_v: sine.offset, amplitude_v: sine.amplitude, frequency_hz: sine.frequency_hz }
}

fn consistency(trajectory: &Trajectory, estimate: &SegmentEstimate) -> Option<Consistency> {
    if !trajectory.claims() {
        return None;
    }
    trajectory.consistency(trajectory.scored_after(estimate.start_s, estimate.skip_s))
}

/// Whether to trust a trajectory.
pub(super) fn verdict(
    trajectory: &Trajectory,
    errors: Option<&MotionErrors>,
    estimate: &SegmentEstimate,
) -> Verdict {
    let consistency = consistency(trajectory, estimate);
    verdict_by(
        trajectory.kind,
        (trajectory.failure.is_some(), &trajectory.lock),
        errors,
        consistency.as_ref(),
    )
}

fn verdict_by(
    kind: TrajectoryKind,
    (failed, lock): (bool, &Lock),
    errors: Option<&MotionErrors>,
    consistency: Option<&Consistency>,
) -> Verdict {
    if failed {
        return Verdict::Failed;
    }
    if !lock.held() {
        let alone = kind == TrajectoryKind::ModelAlone;
        return if alone { Verdict::Astray } else { Verdict::LostLock };
    }
    if errors.is_some_and(|e| e.each().any(|e| e.sign_disagrees)) {
        return Verdict::WrongSign;
    }
    match consistency {
        None => Verdict::NoClaim,
        Some(c) if c.holds() => Verdict::Consistent,
        Some(c) if c.mean_nis < c.lower => Verdict::Cautious,
        Some(_) => Verdict::Overconfident,
    }
}

fn estimator(
    trajectory: &Trajectory,
    (errors, values): (&Option<MotionErrors>, &ErrorsByState),
    estimate: &SegmentEstimate,
) -> EstimatorMetrics {
    EstimatorMetrics {
        key: trajectory.key.clone(),
        name: trajectory.name.clone(),
        kind: trajectory.kind,
        verdict: verdict(trajectory, errors.as_ref(), estimate),
        errors: errors.clone(),
        values: values.clone(),
        consistency: consistency(trajectory, estimate),
        lock: trajectory.lock.clone(),
        crossings_log_likelihood: trajectory.crossings_log_likelihood,
        counts: trajectory.counts,
        mirrored: trajectory.mirrored,
        failure: trajectory.failure.map(|f| format!("stopped at {} s: {}", f.time_s, f.why)),
        seconds_per_step: trajectory.seconds_per_step,
    }
}

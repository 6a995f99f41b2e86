//! Whether a filter's answer may be trusted.

use super::metrics::EstimatorMetrics;
use crate::estimate::{Lock, LockEvent, NisConsistency, TrajectoryKind, is_the_only_one};
use crate::evaluate::{
    Claim, DeviceUncertainty, Grade, InnovationTest, MotionErrors, ParameterAnswer, Rejections, TestResult,
};
use serde::{Deserialize, Serialize};

/// What a filter's mean NIS, its lock and the sign of its answer say.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The mean NIS lies in its 95 % interval.
    Consistent,
    /// It lies below: the filter is more careful than it needs to be.
    Cautious,
    /// It lies above: the filter claims more than it knows, or the model is wrong.
    Overconfident,
    /// It lost the signal for good, or for more than half of the samples, or changed branch on the way. No figure of it is a good estimate.
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

    /// Whether what it is about is an estimate of the motion, be it a good one or not.
    pub const fn is_of_an_estimate(self) -> bool {
        !matches!(self, Self::LostLock | Self::Failed | Self::Astray)
    }

    pub(super) fn of(
        kind: TrajectoryKind,
        (failed, lock): (bool, &Lock),
        errors: Option<&MotionErrors>,
        consistency: Option<&NisConsistency>,
    ) -> Self {
        if failed {
            return Self::Failed;
        }
        match kind {
            TrajectoryKind::ModelAlone if !lock.held() => return Self::Astray,
            TrajectoryKind::ModelAlone => {}
            _ if !lock.is_usable() => return Self::LostLock,
            _ => {}
        }
        if errors.is_some_and(|e| e.each().any(|e| e.sign_disagrees)) {
            return Self::WrongSign;
        }
        match consistency {
            None => Self::NoClaim,
            Some(c) if c.holds() => Self::Consistent,
            Some(c) if c.mean_nis < c.lower => Self::Cautious,
            Some(_) => Self::Overconfident,
        }
    }
}

/// The mean NIS from which on a claim is not doubtful but wrong: errors of the prediction that are 1.4 times as large as claimed.
const WRONG_NIS: f64 = 2.0;

/// How many times as large as claimed the mean square of a smoother's changes is from which on its answer is wrong: twice, root mean square, as of
/// errors against a reference.
const WRONG_CHANGES: f64 = 4.0;

/// The mean NIS up to which a claim is not careful but wrong: errors of the prediction that are less than a third as large as claimed. A filter that
/// is told so much noise averages over more samples than it should, and follows a change too late.
const UNUSUALLY_CAREFUL_NIS: f64 = 0.1;

/// What makes an answer doubtful beside the tests of its innovations, without a reference: in whole sentences, with the topic that explains each.
/// `estimate` grades by it, and `diagnose` asks by it whether there is something to explain.
pub(crate) fn doubts<'a>(
    parameters: &'a [ParameterAnswer],
    rejections: &'a Rejections,
    consistency: Option<&NisConsistency>,
) -> impl Iterator<Item = (String, &'static str)> + 'a {
    let of_parameters = parameters.iter().filter_map(|parameter| {
        let ParameterAnswer { name, end, end_sd, fault, .. } = parameter;
        Some((format!("`{name}`, {end:.2e} ± {end_sd:.1e} at the end, {}", (*fault)?), "uncertainty"))
    });
    let of_size = consistency.filter(|found| is_too_careful(found));
    let of_size = of_size.map(|found| {
        let text = format!(
            "the mean NIS of {:.3}: the filter claims innovations that are {:.1} times as large as they are, so that it averages over more samples \
             than it should; the stated noise or process noise is too large, and `from_recording` in the place of the noise finds it",
            found.mean_nis,
            found.mean_nis.sqrt().recip()
        );
        (text, "overconfident")
    });
    let of_gate = rejections.faults().map(|fault| (fault.to_string(), "outliers"));
    of_parameters.chain(of_gate).chain(of_size)
}

/// Whether a finding of a test shows a claim that is wrong by a large factor.
fn is_wrong(found: &TestResult) -> bool {
    match found.test {
        InnovationTest::MeanNis => found.size > WRONG_NIS,
        InnovationTest::Smoothing => found.size > WRONG_CHANGES,
        _ => false,
    }
}

/// The grade of a filter of which nothing is known but its innovations: what their tests find, and their mean NIS.
pub fn grade_of_innovations(tests: &[TestResult], consistency: &NisConsistency) -> Grade {
    let mut failing = tests.iter().filter(|found| found.fails()).peekable();
    let is_doubtful = failing.peek().is_some() || is_too_careful(consistency);
    match () {
        () if failing.any(is_wrong) => Grade::Failed,
        () if is_doubtful => Grade::Doubtful,
        () if consistency.holds() => Grade::Passes,
        () => Grade::PassesWithRemarks,
    }
}

/// Whether the claim is wrong because it is far larger than the innovations.
fn is_too_careful(consistency: &NisConsistency) -> bool {
    consistency.mean_nis < consistency.lower.min(UNUSUALLY_CAREFUL_NIS)
}

impl EstimatorMetrics {
    /// How far its answer can be trusted; `None` of what makes no claim.
    pub(super) fn graded(&self) -> Option<Grade> {
        match self.verdict {
            Verdict::Failed | Verdict::LostLock => return Some(Grade::NoEstimate),
            Verdict::WrongSign => return Some(Grade::Failed),
            Verdict::NoClaim | Verdict::Astray => return None,
            Verdict::Consistent | Verdict::Cautious | Verdict::Overconfident => {}
        }
        Some(if self.broken_claims().next().is_some() || self.failing().any(is_wrong) {
            Grade::Failed
        } else if self.failing().next().is_some()
            || self.contradicted_claims().any(|(_, claim)| claim.is_doubtful())
            || self.of_the_device().any(|number| number.contradicted().is_some())
            || self.doubts().next().is_some()
            || self.step_errors.is_some_and(|steps| steps.is_large())
        {
            Grade::Doubtful
        } else if self.verdict == Verdict::Consistent
            && !self.rejections.is_remarkable()
            && !self.step_errors.is_some_and(|steps| steps.is_remarkable())
            && self.contradicted_claims().next().is_none()
            && self.lock.events.is_empty()
        {
            Grade::Passes
        } else {
            Grade::PassesWithRemarks
        })
    }

    /// What makes it doubtful beside the tests of its innovations, without a reference; with the topic that explains it.
    pub(super) fn doubts(&self) -> impl Iterator<Item = (String, &'static str)> {
        doubts(&self.parameters, &self.rejections, self.consistency.as_ref())
    }

    /// What a reference shows to be wrong, by the name of the state.
    pub fn broken_claims(&self) -> impl Iterator<Item = (&'static str, Claim)> {
        self.contradicted_claims().filter(|(_, claim)| claim.fails())
    }

    /// What a reference shows to be further off than claimed by more than chance, by the name of the state.
    pub fn contradicted_claims(&self) -> impl Iterator<Item = (&'static str, Claim)> {
        let angles = self.errors.iter().flat_map(MotionErrors::each).map(|e| (e.of, e.angle.claim));
        let values = self.values.iter().map(|(name, errors)| (*name, errors.claim));
        let claims = angles.chain(values).filter_map(|(name, claim)| Some((name, claim?)));
        claims.filter(|(_, claim)| claim.is_contradicted() || claim.is_doubtful())
    }

    /// What the uncertain numbers of the device have in its claims, by the first state.
    pub fn of_the_device(&self) -> impl Iterator<Item = &DeviceUncertainty> {
        self.uncertainty_budget.first().into_iter().flat_map(|budget| &budget.device)
    }

    /// What the tests of its innovations find that is not by chance.
    pub fn failing(&self) -> impl Iterator<Item = &TestResult> {
        self.tests.iter().filter(|found| found.fails())
    }

    /// Whether a strict run may pass with it.
    pub fn passes(&self) -> bool {
        self.grade.is_none_or(|grade| grade < Grade::Doubtful)
    }

    /// The verdict in a word or two, with the angles that it is about where others are not concerned.
    pub(super) fn verdict_words(&self) -> String {
        let why = words_with(self.verdict, &angles_of(self.verdict, &self.lock, self.errors.as_ref()));
        match (self.grade, self.verdict) {
            (None, _) => why,
            (Some(grade), Verdict::Failed | Verdict::LostLock | Verdict::WrongSign) => {
                format!("{grade}: {why}")
            }
            (Some(grade), _) => grade.to_string(),
        }
    }
}

/// The angles that a bad verdict is about, by their names among the states; none where it is about all there are.
pub(super) fn angles_of(verdict: Verdict, lock: &Lock, errors: Option<&MotionErrors>) -> Vec<&'static str> {
    let mut angles = Vec::new();
    match verdict {
        Verdict::LostLock | Verdict::Astray => {
            for event in &lock.events {
                match event {
                    LockEvent::Lost { .. }
                    | LockEvent::Regained { .. }
                    | LockEvent::Stopped { .. }
                    | LockEvent::StartedAgain { .. } => return Vec::new(),
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

/// A verdict in words, about these angles, or about all where none is named.
pub(super) fn words_with(verdict: Verdict, angles: &[&str]) -> String {
    match angles {
        [] => verdict.words().to_owned(),
        angles => format!("{} of {}", verdict.words(), angles.join(" and ")),
    }
}

//! What a filter says of the recordings of a bench.

use super::bench::Judged;
use crate::config::Experiment;
use crate::estimate::{SegmentEstimate, Trajectory};
use crate::evaluate::{InnovationTest, SegmentJudge, TestResult};
use crate::fit::Innovations;
use crate::progress::Interruption;
use crate::results::doubts;
use crate::rigs::Rig;
use crate::signal::Sine;
use std::ops::Range;

/// Blocks of a segment, of which every second one is fitted.
const BLOCKS: f64 = 20.0;

/// The probability of a finding below which a cause leaves something unexplained. A verdict has to be right a million times; here one cause
/// of ten tests in a hundred may be missed, and what nearly fits is no cause.
const LEFT: f64 = 1e-3;

/// Standard deviations that a sample counts as which the filter has no prediction of.
const UNEXPLAINED: f64 = 10.0;

/// States of a motion along one axis: where it is, and how fast.
const MOTION: usize = 2;

/// Blocks of the recordings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum TrialBlocks {
    /// Those by which sizes are fitted.
    Fitted,
    /// Those by which causes are judged.
    HeldOut,
    /// Both.
    All,
}

/// What is known of the sign of an answer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum AnswerSign {
    /// The signals or the experiment tell it.
    #[default]
    Known,
    /// Neither does.
    Arbitrary,
}

/// A part of an answer that a hidden turn changes together with other states.
#[derive(Clone, Debug)]
pub(super) struct TurnedAnswer {
    pub(super) trajectory: Trajectory,
    /// The place of the answer among its states, and the samples after the settling time.
    pub(super) place: usize,
    pub(super) scored: Range<usize>,
}

/// One run of the filter.
#[derive(Clone, Debug, Default)]
pub(super) struct DiagnosisTrial {
    /// The innovations after the settling time, of all signals.
    pub(super) innovations: Innovations,
    /// Whether an innovation is of a block that is fitted.
    is_fitted: Vec<bool>,
    /// When each was, in s, and whether it is of the first signal.
    pub(super) time_s: Vec<f64>,
    pub(super) is_of_first: Vec<bool>,
    /// The answer at each sample after the settling time, its claimed standard deviation, and the time in s.
    pub(super) answer: Vec<f64>,
    pub(super) answer_sd: Vec<f64>,
    pub(super) answer_time_s: Vec<f64>,
    /// Who tells the sign of the answer.
    pub(super) sign: AnswerSign,
    /// The period of an answer that comes round, half of it if the signals do not tell its half turns.
    pub(super) period: Option<f64>,
    /// The trajectories whose part the answer is, if the signals do not tell a turn that changes it.
    pub(super) turned: Vec<TurnedAnswer>,
    /// The name of the answer among the states, and its unit.
    pub(super) answer_name: &'static str,
    pub(super) answer_unit: &'static str,
    /// How many states the filter has.
    pub(super) states: usize,
    /// The unit of the first signal.
    pub(super) signal_unit: &'static str,
    /// The drive, where it is a steady sine.
    pub(super) drive: Option<Sine>,
    /// The states of the motion after the settling time: name, unit and value.
    pub(super) start: Vec<(&'static str, String, f64)>,
    /// The parameters that are states, where the filter ends: deviations from what the device's table says.
    pub(super) at_end: Vec<(&'static str, f64)>,
    /// What the tests find.
    pub(super) tests: Vec<TestResult>,
    /// Whether the filter lost the motion, and for how long of the time that is looked at, in s.
    loses_lock: bool,
    lost_s: f64,
    /// How long after the beginning of a segment its first sample corrects the filter, in s: of a start from the signal behind the samples
    /// that it is found from.
    begins_s: f64,
    /// Whether it stands in for the experiment as it is, with which the filter cannot be run.
    stands_in: bool,
    /// What makes the answer doubtful beside the tests.
    doubts: Vec<String>,
    /// Σ ln p of all samples after the settling time by what the filter takes each for: densities, by which filters of any law are compared.
    density: f64,
    updates: usize,
}

impl DiagnosisTrial {
    /// Takes what the filter says of a segment in; `None` where it stopped.
    pub(super) fn take(
        &mut self,
        (rig, experiment): (&dyn Rig, &Experiment),
        estimate: &SegmentEstimate,
        judged: Judged,
    ) -> Option<()> {
        let trajectory = estimate.trajectories.first()?;
        if !trajectory.stops.is_empty() {
            return None;
        }
        let scored = trajectory.scored_after(estimate.start_s, estimate.skip_s);
        let times = trajectory.time_s.get(scored.clone())?;
        let (first, last) = (times.first().copied()?, times.last().copied()?);
        let corrects =
            scored.clone().find(|k| trajectory.innovation.get(*k).is_some_and(|value| value.is_finite()));
        let begins = corrects.and_then(|k| trajectory.time_s.get(k)).copied().unwrap_or(first);
        self.begins_s = self.begins_s.max(begins - estimate.start_s);
        let is_fitted = |time: f64| {
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // one of a few blocks
            let block = (BLOCKS * (time - first) / (last - first)) as usize;
            block.is_multiple_of(2)
        };
        let signals = std::iter::once((&trajectory.innovation, &trajectory.innovation_sd))
            .chain(trajectory.further.iter().map(|signal| (&signal.innovation, &signal.sd)));
        let believed = trajectory.gate_nis.unwrap_or(f64::INFINITY).sqrt();
        let count = scored.len() * (1 + trajectory.further.len());
        self.innovations.value.reserve(count);
        self.innovations.variance.reserve(count);
        self.is_fitted.reserve(count);
        self.time_s.reserve(count);
        self.is_of_first.reserve(count);
        for (place, (innovation, sd)) in signals.enumerate() {
            let mut rejected = trajectory.rejected.iter().filter(|one| one.signal == place).peekable();
            for k in scored.clone() {
                let time = trajectory.time_s[k];
                let (value, sd) = match rejected.next_if(|one| one.sample == k) {
                    // As improbable as the most improbable sample that is taken, so that a change that has samples rejected gains nothing.
                    Some(one) => ((believed * one.sd).copysign(one.innovation), one.sd),
                    None => (*innovation.get(k)?, *sd.get(k)?),
                };
                self.innovations.value.push(value);
                self.innovations.variance.push(sd * sd);
                self.is_fitted.push(is_fitted(time));
                self.time_s.push(time);
                self.is_of_first.push(place == 0);
                self.updates += usize::from(value.is_finite());
            }
        }
        self.states = trajectory.states.len();
        self.signal_unit = crate::units::name(&estimate.signal_kind.dimension.to_string());
        if self.start.is_empty() {
            self.drive = estimate.drive;
            let of_motion = trajectory.states.iter().take(MOTION).filter_map(|state| {
                let unit = state.unit.replace("_per_", "/").replace("s2", "s^2");
                Some((state.name, unit, *state.mean.get(scored.start)?))
            });
            self.start = of_motion.collect();
        }
        let consistency = trajectory.consistency(scored.clone());
        self.density += consistency.as_ref().map_or(0.0, |found| found.log_likelihood);
        self.take_answer((rig, experiment), trajectory, scored);
        self.at_end = (trajectory.parameters.iter())
            .filter_map(|prior| Some((prior.name, *trajectory.state(prior.name)?.mean.last()?)))
            .collect();
        self.loses_lock |= !trajectory.lock.held();
        let spans = trajectory.lock.lost_spans.iter();
        self.lost_s += spans.map(|[from_s, to_s]| (to_s.min(last) - from_s.max(first)).max(0.0)).sum::<f64>();
        if judged == Judged::No {
            return Some(());
        }
        let mut judge = SegmentJudge::default();
        judge.take(estimate, &Interruption::never());
        let judgement = judge.of(&trajectory.key).unwrap_or_default();
        let doubts = doubts(&judgement.parameters, &judgement.rejections, consistency.as_ref());
        self.doubts.extend(doubts.map(|(text, _)| text));
        self.tests.extend(judgement.tests);
        Some(())
    }

    fn take_answer(
        &mut self,
        (rig, experiment): (&dyn Rig, &Experiment),
        trajectory: &Trajectory,
        scored: Range<usize>,
    ) {
        let angle = || rig.angles(experiment).first().map(|[angle, _]| *angle);
        let name = rig.values(experiment).first().map(|value| value.name).or_else(angle);
        let named = name.and_then(|name| trajectory.state(name));
        let Some(state) = named.or_else(|| trajectory.states.first()) else { return };
        (self.answer_name, self.answer_unit) = (state.name, state.unit);
        let place = trajectory.states.iter().position(|one| one.name == state.name);
        let is_hidden = place.is_some_and(|place| trajectory.hides_sign(place));
        self.period = place.and_then(|place| trajectory.period(place));
        self.period = self.period.map(|period| if is_hidden { 0.5 * period } else { period });
        let is_turned = place.filter(|place| trajectory.hides_turn(*place));
        let whole = is_turned.map(|place| (place, trajectory.clone(), scored.clone()));
        self.turned.extend(whole.map(|(place, trajectory, scored)| TurnedAnswer {
            trajectory,
            place,
            scored,
        }));
        let is_signed = is_hidden && self.period.is_none();
        self.sign = if is_signed { AnswerSign::Arbitrary } else { AnswerSign::Known };
        self.answer.extend(state.mean.get(scored.clone()).unwrap_or_default());
        self.answer_sd.extend(state.sd.get(scored.clone()).unwrap_or_default());
        self.answer_time_s.extend(&trajectory.time_s[scored]);
    }

    /// The run as a whole; `None` without a single innovation.
    pub(super) fn ended(self) -> Option<Self> {
        (self.updates > 0).then_some(self)
    }

    /// Σ ln p of the innovations in some of the blocks.
    pub(super) fn log_likelihood(&self, blocks: TrialBlocks) -> f64 {
        self.part(blocks).log_likelihood()
    }

    /// The mean of the innovations' squares over their claimed variances; 1 without one.
    pub(super) fn mean_nis(&self) -> f64 {
        let (count, sum) = self.squares();
        if count > 0.0 { sum / count } else { 1.0 }
    }

    /// How many innovations there are, and the sum of their squares over their claimed variances.
    pub(super) fn squares(&self) -> (f64, f64) {
        let in_sd = self.innovations.in_sd().into_iter().filter(|size| size.is_finite());
        in_sd.fold((0.0, 0.0), |(count, sum), size| (count + 1.0, sum + size * size))
    }

    /// The innovations in some of the blocks; the others are missing.
    pub(super) fn part(&self, blocks: TrialBlocks) -> Innovations {
        let is_in = |is_fitted: bool| match blocks {
            TrialBlocks::Fitted => is_fitted,
            TrialBlocks::HeldOut => !is_fitted,
            TrialBlocks::All => true,
        };
        let each = self.innovations.value.iter().zip(&self.is_fitted);
        let value = each.map(|(value, own)| if is_in(*own) { *value } else { f64::NAN }).collect();
        Innovations { value, variance: self.innovations.variance.clone() }
    }

    /// Whether an innovation, by its place, is of a block that is fitted.
    pub(super) fn is_fitted(&self, place: usize) -> bool {
        self.is_fitted.get(place).copied().unwrap_or(false)
    }

    /// The root mean square of what the filter claims of the innovations of the first signal, in its unit.
    pub(super) fn innovation_sd(&self) -> f64 {
        let variances = self.innovations.variance.iter().zip(&self.is_of_first);
        let (count, sum) = (variances.filter(|(variance, is_first)| **is_first && variance.is_finite()))
            .fold((0.0, 0.0), |(count, sum), (variance, _)| (count + 1.0, sum + variance));
        f64::sqrt(sum / f64::max(count, 1.0))
    }

    /// How many innovations there were.
    pub(super) const fn updates(&self) -> usize {
        self.updates
    }

    /// Whether the innovations ask for another number, once that is tested.
    pub(super) fn number_test(&self) -> Option<&TestResult> {
        self.tests.iter().find(|found| found.test == InnovationTest::Numbers)
    }

    /// What the tests find that is not by chance.
    pub(super) fn failing(&self) -> impl Iterator<Item = &TestResult> {
        self.tests.iter().filter(|found| found.fails())
    }

    /// What speaks against the answer, in whole sentences: the tests that fail, and what makes it doubtful beside them.
    pub(super) fn findings(&self) -> Vec<String> {
        self.failing().map(TestResult::to_string).chain(self.doubts.iter().cloned()).collect()
    }

    /// Σ ln p of all samples by what the filter takes each for.
    pub(super) const fn density(&self) -> f64 {
        self.density
    }

    /// The run in the place of that of the experiment as it is, with which the filter cannot be run: nothing follows from its answer or
    /// its slopes, and each sample counts as one that the filter does not explain.
    pub(super) fn standing_in(mut self) -> Self {
        let each = self.innovations.value.iter_mut().zip(&self.innovations.variance);
        each.filter(|(value, _)| value.is_finite()).for_each(|(value, s)| *value = UNEXPLAINED * s.sqrt());
        Self { stands_in: true, ..self }
    }

    /// Whether it is the run of an experiment, and stands in for none.
    pub(super) const fn is_its_own(&self) -> bool {
        !self.stands_in
    }

    /// Whether the filter follows the motion, be its answer right or not.
    pub(super) const fn follows(&self) -> bool {
        !self.loses_lock && !self.stands_in
    }

    /// For how long of the time that is looked at the filter had lost the motion, in s.
    pub(super) const fn lost_s(&self) -> f64 {
        self.lost_s
    }

    /// Whether nothing is left that would have to be explained: no test finds what a filter that is right shows less than once in a
    /// thousand times.
    pub(super) fn is_explained(&self) -> bool {
        self.passes() && self.tests.iter().all(|found| found.p_value > LEFT)
    }

    /// How long after the beginning of a segment the first sample that counts corrects the filter, in s.
    pub(super) const fn begins_s(&self) -> f64 {
        self.begins_s
    }

    /// Whether the filter's answer would pass.
    pub(super) fn passes(&self) -> bool {
        self.follows() && self.doubts.is_empty() && self.failing().next().is_none()
    }
}

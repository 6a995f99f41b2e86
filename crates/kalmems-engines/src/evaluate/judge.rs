//! The filters of a segment, judged by what they say themselves, part by part.

use super::budget::{BudgetRecord, UncertaintyBudget};
use super::innovations::{InnovationEvidence, InnovationRecord, TestResult};
use super::parameter::{ParameterAnswer, ParameterRecord};
use super::rejections::{RejectionRecord, Rejections};
use super::smoothed::SmoothingRecord;
use crate::estimate::{Lock, SegmentEstimate, Trajectory, TrajectoryKind};
use crate::progress::Interruption;

/// Judges the filters of one segment, in memory that does not grow with it.
#[derive(Clone, Default)]
pub struct SegmentJudge {
    /// One for each filter; a smoother has its filter's.
    filters: Vec<FilterJudge>,
    /// One for each answer that considers what is uncertain of the device, a smoother's too, with its place.
    budgets: Vec<(usize, BudgetRecord)>,
    /// One for each smoother, with its place.
    smoothers: Vec<(usize, SmoothingRecord)>,
}

/// What a filter says against itself, or for itself.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Judgement {
    /// What the tests of its innovations find.
    pub tests: Vec<TestResult>,
    /// What the innovations look like; none of what makes no claim.
    pub evidence: Option<InnovationEvidence>,
    /// What became of the parameters that are states.
    pub parameters: Vec<ParameterAnswer>,
    /// What its gate rejected.
    pub rejections: Rejections,
    /// What of its claims is due to what, where something of the device is stated as uncertain.
    pub budgets: Vec<UncertaintyBudget>,
}

/// The innovations of a signal: those of a cycle that has not ended wait until it is known whether the signal is lost in it.
#[derive(Clone)]
struct SignalJudgement {
    record: InnovationRecord,
    /// Times in s, innovations and their standard deviations.
    waiting: [Vec<f64>; 3],
}

impl SignalJudgement {
    fn of(record: InnovationRecord) -> Self {
        Self { record, waiting: Default::default() }
    }

    fn take(&mut self, new: [&[f64]; 3], lock: &Lock, stop: &Interruption) {
        if self.waiting[0].is_empty() && lock.undecided_from_s.is_none() {
            let [time_s, innovation, sd] = new;
            return self.record.take(time_s, innovation, sd, stop);
        }
        self.waiting.iter_mut().zip(new).for_each(|(waiting, new)| waiting.extend_from_slice(new));
        let [time_s, innovation, _] = &mut self.waiting;
        let until_s = lock.undecided_from_s.unwrap_or(f64::INFINITY);
        let known = time_s.partition_point(|t| *t < until_s);
        for (innovation, time_s) in innovation.iter_mut().zip(&*time_s) {
            if lock.is_lost_at(*time_s) {
                *innovation = f64::NAN;
            }
        }
        let [time_s, innovation, sd] = self.waiting.each_ref().map(|waiting| &waiting[..known]);
        self.record.take(time_s, innovation, sd, stop);
        self.waiting.iter_mut().for_each(|waiting| drop(waiting.drain(..known)));
    }
}

/// One filter.
#[derive(Clone)]
struct FilterJudge {
    key: String,
    innovations: SignalJudgement,
    /// Those of further signals, with their names.
    further: Vec<(String, SignalJudgement)>,
    whitens: bool,
    rejections: RejectionRecord,
    parameters: Vec<ParameterRecord>,
}

impl SegmentJudge {
    /// Takes what the filters say of new samples, those until the work is stopped; the innovations of the settling time are not judged.
    pub fn take(&mut self, estimate: &SegmentEstimate, stop: &Interruption) {
        let own = estimate.trajectories.iter().filter(|trajectory| is_of_its_own(trajectory));
        for (place, trajectory) in own.enumerate() {
            if self.filters.len() <= place {
                self.filters.push(FilterJudge::new(trajectory, estimate));
            }
            self.filters[place].take(trajectory, estimate, stop);
            stop.advance(trajectory.time_s.len());
        }
        self.take_smoothers(estimate, stop);
        for (place, trajectory) in estimate.trajectories.iter().enumerate() {
            let known = self.budgets.iter().position(|(own, _)| *own == place);
            let known = known.or_else(|| {
                self.budgets.push((place, BudgetRecord::of(trajectory)?));
                Some(self.budgets.len() - 1)
            });
            if let Some(known) = known
                && !trajectory.considered.is_empty()
            {
                let scored = trajectory.scored_after(estimate.start_s, estimate.skip_s);
                self.budgets[known].1.take(trajectory, scored, stop);
            }
        }
    }

    /// Takes what smoothers say, each of which comes after its filter.
    fn take_smoothers(&mut self, estimate: &SegmentEstimate, stop: &Interruption) {
        let scored = |of: &Trajectory| of.scored_after(estimate.start_s, estimate.skip_s);
        let mut filter = None;
        for (place, trajectory) in estimate.trajectories.iter().enumerate() {
            match (trajectory.kind, filter) {
                (TrajectoryKind::Filtered, _) => filter = Some(trajectory),
                (TrajectoryKind::Smoothed, Some(filter)) if trajectory.claims() && filter.claims() => {
                    if self.smoothers.last().is_none_or(|(last, _)| *last < place) {
                        self.smoothers.push((place, SmoothingRecord::default()));
                    }
                    if let Some((_, record)) = self.smoothers.iter_mut().find(|(own, _)| *own == place) {
                        record.take((filter, scored(filter)), (trajectory, scored(trajectory)), stop);
                    }
                }
                _ => {}
            }
        }
    }

    /// How many innovations there were, of the filter with most.
    pub fn count(&self) -> f64 {
        self.filters.iter().map(|filter| filter.innovations.record.count()).fold(0.0, f64::max)
    }

    /// What is known until now of the filter with this key.
    pub fn of(&self, key: &str) -> Option<Judgement> {
        self.filters.iter().find(|filter| filter.key == key).map(FilterJudge::judgement)
    }

    /// What is known until now, for each trajectory; nothing of what makes no claim.
    pub fn judgements(&self, estimate: &SegmentEstimate) -> Vec<Judgement> {
        let of = |filter: &FilterJudge| {
            let evidence = Some(filter.innovations.record.evidence());
            Judgement { evidence, ..filter.judgement() }
        };
        let found: Vec<Judgement> = self.filters.iter().map(of).collect();
        let mut filters = found.iter();
        let mut last = None;
        let each = estimate.trajectories.iter().enumerate().map(|(place, trajectory)| {
            if is_of_its_own(trajectory) {
                last = filters.next();
            }
            let mut found = last.filter(|_| trajectory.claims()).cloned().unwrap_or_default();
            if let Some((_, record)) = self.smoothers.iter().find(|(own, _)| *own == place) {
                found.tests.extend(record.test());
            }
            let budgets = self.budgets.iter().find(|(own, _)| *own == place);
            Judgement { budgets: budgets.map(|(_, record)| record.budgets()).unwrap_or_default(), ..found }
        });
        each.collect()
    }
}

/// Whether a trajectory's innovations are its own: those of a smoother are its filter's, which comes before it.
fn is_of_its_own(trajectory: &Trajectory) -> bool {
    trajectory.kind == TrajectoryKind::Filtered && trajectory.claims()
}

impl FilterJudge {
    fn new(trajectory: &Trajectory, estimate: &SegmentEstimate) -> Self {
        let axes = estimate.other_axes.iter().map(|axis| axis.motion);
        let motions = std::iter::once(estimate.motion).chain(axes).map(|motion| motion.frequency_hz);
        let parameters = trajectory.parameters.iter().filter_map(|prior| {
            trajectory.state(prior.name).map(|state| ParameterRecord::new(*prior, state.unit))
        });
        let rejections = RejectionRecord::new(motions.clone());
        let innovations = SignalJudgement::of(InnovationRecord::new(motions, estimate.start_s));
        let further = trajectory.further.iter().map(|signal| (signal.of.name.clone(), innovations.clone()));
        Self {
            key: trajectory.key.clone(),
            further: further.collect(),
            innovations,
            whitens: trajectory.whitens,
            rejections,
            parameters: parameters.collect(),
        }
    }

    fn take(&mut self, trajectory: &Trajectory, estimate: &SegmentEstimate, stop: &Interruption) {
        let scored = trajectory.scored_after(estimate.start_s, estimate.skip_s);
        let time_s = &trajectory.time_s[scored.clone()];
        let further = self.further.iter_mut().map(|(_, judged)| judged);
        for (signal, judged) in std::iter::once(&mut self.innovations).chain(further).enumerate() {
            let [innovation, sd] = trajectory.before_the_gate(signal);
            judged.take([time_s, &innovation[scored.clone()], &sd[scored.clone()]], &trajectory.lock, stop);
        }
        self.rejections.take(trajectory, estimate);
        for (record, prior) in self.parameters.iter_mut().zip(&trajectory.parameters) {
            if let Some(state) = trajectory.state(prior.name) {
                record.take(&trajectory.time_s, state);
            }
        }
    }

    fn judgement(&self) -> Judgement {
        Judgement {
            tests: self.tests(),
            evidence: None,
            parameters: self.parameters.iter().filter_map(ParameterRecord::answer).collect(),
            rejections: self.rejections.rejections(),
            budgets: Vec::new(),
        }
    }

    /// Each test where it finds most: at the first signal, or at a further one.
    fn tests(&self) -> Vec<TestResult> {
        let mut all = self.innovations.record.tests(self.whitens);
        for (of, judged) in &self.further {
            for found in judged.record.tests(self.whitens) {
                let found = TestResult { signal: Some(of.clone()), ..found };
                match all.iter_mut().find(|own| own.test == found.test) {
                    Some(own) if found.p_value < own.p_value => *own = found,
                    Some(_) => {}
                    None => all.push(found),
                }
            }
        }
        let looks = 1.0 + self.further.len() as f64;
        for found in &mut all {
            found.p_value = (looks * found.p_value).min(1.0);
        }
        all.sort_by_key(|found| found.test);
        all
    }
}

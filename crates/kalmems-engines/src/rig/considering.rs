//! An estimator beside which others are told what else the device may be.

use super::{Estimator, Rig};
use crate::config::{Experiment, VariedExperiment};
use crate::estimate::driven::InterpolationLag;
use crate::estimate::{
    DeviceParameter, DirectionInformation, EstimateError, NumberBits, Past, PastState, RowsAround,
    SegmentEstimate, SegmentPart, Trajectory, TrajectoryKind, is_at,
};
use crate::recording::Finding;
use std::sync::Arc;

/// What makes the estimator of an experiment.
pub(super) type EstimatorMaker<'m, 'a> =
    dyn Fn(&'a Experiment) -> Result<Box<dyn Estimator + 'a>, EstimateError> + 'm;

/// The estimator of an experiment, and beside it one for each direction of the device's uncertainty, so that what is uncertain and no
/// state of a filter enters its answers; see [`Trajectory::considered`]. It alone, of a device that is stated as exact.
pub(super) fn considering<'a>(
    rig: &(impl Rig + ?Sized),
    experiment: &'a Experiment,
    make: &EstimatorMaker<'_, 'a>,
) -> Result<Box<dyn Estimator + 'a>, EstimateError> {
    let make = |told: &'a Experiment| {
        let mut estimator = make(told)?;
        estimator.past().wait_for(InterpolationLag::of(told));
        Ok(estimator)
    };
    let own = make(experiment)?;
    let varied = experiment.varied()?;
    if varied.is_empty() {
        return Ok(own);
    }
    let beside = |varied: &'a VariedExperiment| {
        let number = varied.direction.name();
        let made = make(&varied.experiment);
        let estimator =
            made.map_err(|why| EstimateError::Varied { number: number.clone(), why: Box::new(why) })?;
        Ok(VariedEstimator { name: number.into(), varied, estimator })
    };
    let beside = varied.iter().map(beside).collect::<Result<Vec<VariedEstimator<'a>>, EstimateError>>()?;
    let parameters = rig.parameters(experiment);
    Ok(Box::new(Considering { own, beside, parameters, learnt: Vec::new(), told: Vec::new() }))
}

/// An estimator that is told one standard deviation more in one direction.
struct VariedEstimator<'a> {
    name: Arc<str>,
    varied: &'a VariedExperiment,
    estimator: Box<dyn Estimator + 'a>,
}

struct Considering<'a> {
    own: Box<dyn Estimator + 'a>,
    beside: Vec<VariedEstimator<'a>>,
    /// Those that can be states of a filter.
    parameters: &'static [DeviceParameter],
    /// What the innovations of each answer, by its key, have told in this segment.
    learnt: Vec<(String, DirectionInformation)>,
    /// What was remarked in this segment.
    told: Vec<String>,
}

impl VariedEstimator<'_> {
    /// Has its filters correct by the samples that those of the device as it is stated take: what one of them alone took would be in the
    /// difference of both.
    fn follow_rejections(&mut self, estimate: &SegmentEstimate) {
        let filters = self.varied.experiment.estimate.iter().flat_map(|estimate| &estimate.filters);
        let past = self.estimator.past();
        for (place, filter) in filters.enumerate() {
            let key = filter.name.key();
            let of_filter = |trajectory: &&Trajectory| {
                trajectory.key == key && trajectory.kind == TrajectoryKind::Filtered
            };
            if let Some(trajectory) = estimate.trajectories.iter().find(of_filter) {
                let rejected = trajectory.rejected.iter().map(|one| (one.time_s, one.signal));
                past.filter(place).follow_rejections(rejected);
            }
        }
    }

    /// Whether all numbers that its direction changes are states of this filter.
    fn is_state_of(&self, trajectory: &Trajectory, parameters: &[DeviceParameter]) -> bool {
        let tracked = trajectory
            .parameters
            .iter()
            .filter_map(|prior| parameters.iter().find(|parameter| parameter.name == prior.name));
        let written: Vec<&str> =
            tracked.flat_map(|parameter| parameter.written).map(|(key, _)| *key).collect();
        self.varied
            .direction
            .steps
            .iter()
            .all(|(number, _)| written.iter().any(|key| is_at(&number.name, key)))
    }
}

impl Considering<'_> {
    /// What an answer has learnt of these directions so far.
    fn learnt(&mut self, key: &str) -> &mut DirectionInformation {
        let place = self.learnt.iter().position(|(own, _)| own == key).unwrap_or_else(|| {
            self.learnt.push((key.to_owned(), DirectionInformation::default()));
            self.learnt.len() - 1
        });
        &mut self.learnt[place].1
    }

    /// The directions that a trajectory considers, with what the filters beside it say.
    fn considered<'t>(
        &self,
        trajectory: &Trajectory,
        varied: &'t [SegmentEstimate],
    ) -> Vec<(Arc<str>, &'t Trajectory)> {
        let each = self
            .beside
            .iter()
            .zip(varied)
            .filter(|(beside, _)| !beside.is_state_of(trajectory, self.parameters));
        let same = |estimate: &'t SegmentEstimate| {
            estimate.trajectories.iter().find(|other| other.key == trajectory.key)
        };
        each.filter_map(|(beside, estimate)| Some((Arc::clone(&beside.name), same(estimate)?))).collect()
    }

    /// Says once of each where one standard deviation is too much for what is linear.
    fn remark(&mut self, estimate: &mut SegmentEstimate, varied: &[SegmentEstimate]) {
        for trajectory in &estimate.trajectories {
            if !trajectory.claims() || !trajectory.lock.held() || trajectory.failure.is_some() {
                continue;
            }
            for (number, other) in self.considered(trajectory, varied) {
                if other.lock.held() && other.failure.is_none() {
                    continue;
                }
                let remark = format!(
                    "with `{number}` one standard deviation off `{}` does not follow the motion any more: the uncertainty that is claimed of it \
                     is no more than a hint; state a smaller one after `kalmems identify`, or make it a state",
                    trajectory.name
                );
                if !self.told.contains(&remark) {
                    self.told.push(remark.clone());
                    estimate.remarks.push(remark);
                }
            }
        }
    }
}

impl Estimator for Considering<'_> {
    fn wants(&self, label: &str) -> bool {
        self.own.wants(label)
    }

    fn around(&self, interval_s: f64) -> RowsAround {
        self.own.around(interval_s)
    }

    fn past(&mut self) -> &mut Past {
        self.own.past()
    }

    fn state(&mut self) -> PastState {
        let mut state = self.own.state();
        let numbers = |learnt: &DirectionInformation| learnt.numbers().map(NumberBits::from).collect();
        state.learnt = self.learnt.iter().map(|(key, learnt)| (key.clone(), numbers(learnt))).collect();
        state.varied = self.beside.iter_mut().map(|beside| beside.estimator.state()).collect();
        state
    }

    fn resume(&mut self, state: &PastState) {
        self.own.resume(state);
        for (beside, state) in self.beside.iter_mut().zip(&state.varied) {
            beside.estimator.resume(state);
        }
        let learnt = state.learnt.iter().filter_map(|(key, numbers)| {
            Some((
                key.clone(),
                DirectionInformation::read(&numbers.iter().copied().map(f64::from).collect::<Vec<f64>>())?,
            ))
        });
        self.learnt = learnt.collect();
    }

    fn take(&mut self, part: &SegmentPart) -> Result<SegmentEstimate, EstimateError> {
        if part.begins {
            self.learnt.clear();
            self.told.clear();
        }
        let mut estimate = self.own.take(part)?;
        let mut varied = Vec::with_capacity(self.beside.len());
        for beside in &mut self.beside {
            beside.follow_rejections(&estimate);
            varied.push(beside.estimator.take(part).map_err(|why| match why {
                EstimateError::Interrupted => why,
                why => EstimateError::Varied { number: beside.name.to_string(), why: Box::new(why) },
            })?);
        }
        self.remark(&mut estimate, &varied);
        let from_s = estimate.from_s();
        for trajectory in &mut estimate.trajectories {
            let considered = self.considered(trajectory, &varied);
            trajectory.consider(&considered, self.learnt(&trajectory.key.clone()), from_s);
        }
        if let Some((predictor, _)) = self.own.past().phase_predictor()
            && let Some(trajectory) = estimate.trajectories.iter().find(|one| one.key == predictor.key())
        {
            predictor.consider(|told_s, rate| trajectory.moved_phases(told_s, rate));
        }
        Ok(estimate)
    }

    fn conclude(&mut self, place: &str, diagnosis: &[Finding]) -> Result<(), EstimateError> {
        self.own.conclude(place, diagnosis)
    }
}

//! The estimates of one segment.

use super::course::ThresholdCourse;
use super::crossings::Crossing;
use super::filters::FilterSettings;
use super::plant::MirrorPlant;
use super::settings::Settings;
use crate::estimate::{
    EstimateError, Lookahead, ModelAlone, Motion, Progress, Trajectory, TrajectoryKind, follow, judge_lock,
    smooth,
};
use crate::rigs::shared_scanner::data::SegmentData;
use kalmems_core::augmentation::AugmentationError;
use kalmems_core::{Covariance, Ekf, Filter};

/// One segment as the filters see it.
#[derive(Clone, Copy)]
pub struct Samples<'a> {
    /// Time, signal and drive.
    pub data: &'a SegmentData<'a>,
    /// dV/dt at each sample in V/s; not a number where it is not known.
    pub drive_slope: &'a [f64],
    /// The crossings, in the order of time.
    pub crossings: &'a [Crossing],
    /// How fast the device moves.
    pub motion: Motion,
}

/// Runs the wanted filters over a segment.
pub fn estimate(
    settings: &Settings,
    samples: Samples,
    progress: &dyn Progress,
) -> Result<Vec<Trajectory>, EstimateError> {
    let mut all = Vec::new();
    for filter in &settings.filters {
        let mut trajectories = one(&Task { settings, filter, samples, progress })?;
        let data = samples.data;
        let start_s = data.time_s.first().copied().unwrap_or(0.0) + settings.skip_s;
        for trajectory in &mut trajectories {
            trajectory.lock = judge_lock(trajectory, data.signal, &[("angle", samples.motion)], start_s);
            if filter.is_model {
                for state in &mut trajectory.states {
                    // What claims no uncertainty; zeros would look like a claim.
                    state.sd.clear();
                }
            }
        }
        all.append(&mut trajectories);
    }
    Ok(all)
}

/// One filter over one segment.
struct Task<'a> {
    settings: &'a Settings,
    filter: &'a FilterSettings,
    samples: Samples<'a>,
    progress: &'a dyn Progress,
}

/// Chooses the model by how many states the filter has: once per segment, so that the loops inside know their types.
fn one(task: &Task) -> Result<Vec<Trajectory>, EstimateError> {
    match task.filter.tracked.len() {
        0 => task.run::<0, 2>(),
        1 => task.run::<1, 3>(),
        2 => task.run::<2, 4>(),
        3 => task.run::<3, 5>(),
        _ => task.run::<4, 6>(),
    }
}

impl Task<'_> {
    fn run<const A: usize, const N: usize>(&self) -> Result<Vec<Trajectory>, EstimateError> {
        let filter = self.filter;
        let wrong = |why: AugmentationError| EstimateError::Model { filter: filter.name.clone(), why };
        let plant = MirrorPlant::<A>::new(&self.settings.hardware, filter).map_err(wrong)?;
        let course = ThresholdCourse::<A, N>::new(
            &plant,
            (self.settings.hardware.noise_variance, self.settings.judged_angle()),
            self.samples.data,
            self.samples.drive_slope,
            filter,
            self.samples.crossings,
        );
        let mut course = course.map_err(wrong)?;
        let (mean, sd) = filter.start::<N>();
        if filter.is_model {
            let mut trajectories = self.follow(&mut course, &ModelAlone::new(mean))?;
            for trajectory in &mut trajectories {
                trajectory.kind = TrajectoryKind::ModelAlone;
            }
            return Ok(trajectories);
        }
        self.follow(&mut course, &Ekf::new(mean, Covariance::from_standard_deviations(sd)))
    }

    /// The filtered trajectory, and the smoothed ones that are wanted.
    fn follow<F: Filter<f64, N> + Copy, const A: usize, const N: usize>(
        &self,
        course: &mut ThresholdCourse<'_, A, N>,
        start: &F,
    ) -> Result<Vec<Trajectory>, EstimateError> {
        let filter = self.filter;
        let names = (filter.key.as_str(), filter.name.as_str());
        let filtered = follow(names, *start, course, &filter.states(), self.progress);
        let mut filtered = filtered.ok_or(EstimateError::Interrupted)?;
        filtered.crossings_log_likelihood = course.crossings_log_likelihood();
        let mut trajectories = vec![filtered];
        let whole = filter.smooth.then_some((Lookahead::Whole, "smoothed"));
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        // positive; beyond the segment is its end
        let samples = |lag_s: f64| (lag_s / self.samples.data.interval_s).round() as usize;
        let lagged = filter.lag_s.map(|lag_s| (Lookahead::Samples(samples(lag_s)), "lagged"));
        for (lookahead, word) in whole.into_iter().chain(lagged) {
            let (key, name) = (format!("{}_{word}", filter.key), format!("{}, {word}", filter.name));
            trajectories.push(smooth((&key, &name), start, course, &trajectories[0], lookahead));
        }
        Ok(trajectories)
    }
}

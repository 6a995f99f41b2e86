//! The estimates of one segment.

use super::course::ThresholdCourse;
use super::crossings::Crossing;
use super::filters::FilterSettings;
use super::plant::MirrorPlant;
use super::settings::Settings;
use crate::config::Method;
use crate::estimate::driven::DrivenSegment;
use crate::estimate::{
    EstimateError, FilterPast, ModelAlone, Motion, Past, Trajectory, TrajectoryKind, answers,
};
use crate::progress::Progress;
use kalmems_core::augmentation::AugmentationError;
use kalmems_core::{Covariance, Ekf, Filter};

/// One segment as the filters see it: signal, drive and the crossings that were found.
#[derive(Clone, Copy)]
pub struct Samples<'a> {
    /// Time, signal and drive.
    pub data: &'a DrivenSegment<'a>,
    /// dV/dt at each sample in V/s; not a number where it is not known.
    pub drive_slope: &'a [f64],
    /// The crossings, in the order of time.
    pub crossings: &'a [Crossing],
    /// Which row of the segment the first one is.
    pub first: usize,
    /// How fast the device moves.
    pub motion: Motion,
}

/// Runs the filters of the settings over the new samples of a segment, and judges the lock of each trajectory.
///
/// The past is [`Past::default`] at the beginning of a segment, and is kept from one part of it to the next.
pub fn estimate(
    settings: &Settings,
    samples: Samples,
    past: &mut Past,
    progress: &dyn Progress,
) -> Result<Vec<Trajectory>, EstimateError> {
    let mut all = Vec::new();
    let (data, axes) = (samples.data, [("angle", samples.motion)]);
    let start_s = data.scored_from(settings.skip_s);
    for (index, filter) in settings.filters.iter().enumerate() {
        let past = past.filter(index);
        let mut trajectories = one(&Task { settings, filter, samples, progress }, past)?;
        for (answer, trajectory) in trajectories.iter_mut().enumerate() {
            trajectory.lock = past.answer(answer).judge.judge(trajectory, &axes, start_s, data.samples.ends);
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
fn one(task: &Task, past: &mut FilterPast) -> Result<Vec<Trajectory>, EstimateError> {
    match task.filter.basics.tracked.len() {
        0 => task.run::<0, 2>(past),
        1 => task.run::<1, 3>(past),
        2 => task.run::<2, 4>(past),
        3 => task.run::<3, 5>(past),
        _ => task.run::<4, 6>(past),
    }
}

impl Task<'_> {
    fn run<const A: usize, const N: usize>(
        &self,
        past: &mut FilterPast,
    ) -> Result<Vec<Trajectory>, EstimateError> {
        let filter = self.filter;
        let wrong = |why: AugmentationError| filter.basics.no_model(why);
        let plant = MirrorPlant::<A>::new(&self.settings.hardware, filter).map_err(wrong)?;
        let course = ThresholdCourse::<A, N>::new(
            &plant,
            (self.settings.hardware.noise_variance, self.settings.judged_angle()),
            self.samples.data,
            self.samples.drive_slope,
            filter,
            (self.samples.crossings, self.samples.first),
        );
        let mut course = course.map_err(wrong)?;
        let (mean, sd) = filter.start::<N>();
        if filter.basics.method == Method::Model {
            let mut trajectories = self.answers(&mut course, past, ModelAlone::new(mean))?;
            for trajectory in &mut trajectories {
                trajectory.kind = TrajectoryKind::ModelAlone;
                trajectory.claim_nothing();
            }
            return Ok(trajectories);
        }
        self.answers(&mut course, past, Ekf::new(mean, Covariance::from_standard_deviations(sd)))
    }

    fn answers<F: Filter<f64, N> + Clone + Send + 'static, const A: usize, const N: usize>(
        &self,
        course: &mut ThresholdCourse<'_, A, N>,
        past: &mut FilterPast,
        start: F,
    ) -> Result<Vec<Trajectory>, EstimateError> {
        let course = (course, &self.samples.data.samples);
        answers((&self.filter.basics, past), || Ok(start), course, &self.filter.states(), self.progress)
    }
}

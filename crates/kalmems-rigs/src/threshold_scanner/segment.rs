//! The estimates of one segment.

use super::course::ThresholdCourse;
use super::crossings::Crossing;
use super::filters::FilterSettings;
use super::plant::MirrorPlant;
use super::settings::Settings;
use crate::config::Method;
use crate::estimate::driven::DrivenSegment;
use crate::estimate::{EstimateError, FilterPast, Motion, Past, Trajectory, answers};
use crate::progress::Progress;
use kalmems_core::augmentation::AugmentationError;

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
        let mut trajectories = Task { settings, filter, samples, progress }.run(past)?;
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

impl Task<'_> {
    fn run(&self, past: &mut FilterPast) -> Result<Vec<Trajectory>, EstimateError> {
        let filter = self.filter;
        let wrong = |why: AugmentationError| filter.basics.no_model(why);
        let plant = MirrorPlant::new(&self.settings.hardware, filter).map_err(wrong)?;
        let course = ThresholdCourse::new(
            &plant,
            (self.settings.hardware.noise_variance, self.settings.judged_angle()),
            self.samples.data,
            self.samples.drive_slope,
            filter,
            (self.samples.crossings, self.samples.first),
        );
        let mut course = course.map_err(wrong)?;
        let way = (&mut course as _, &self.samples.data.samples);
        let states = filter.states();
        let start = || Ok(filter.start());
        let mut trajectories = answers((&filter.basics, past), start, way, &states, self.progress)?;
        if filter.basics.method == Method::Model {
            trajectories.iter_mut().for_each(Trajectory::mark_model_alone);
        }
        Ok(trajectories)
    }
}

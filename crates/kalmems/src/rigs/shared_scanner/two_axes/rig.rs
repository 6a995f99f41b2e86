//! The rig of a scanner with two axes.

use super::hardware::second_axis;
use super::outlook::outlook;
use super::segment::{TwoAxisEstimate, estimate};
use super::settings::Settings;
use super::simulation::simulation;
use crate::config::{ConfigError, Device, Experiment};
use crate::estimate::{Axis, EstimateError, Progress, SegmentEstimate};
use crate::evaluate::{Extent, MotionErrors, Reference, evaluate_motion};
use crate::outlook::Outlook;
use crate::recording::{Layout, Recording};
use crate::rigs::Rig;
use crate::rigs::shared_scanner::{columns, estimate_driven, wanted};
use crate::simulate::{SimulateError, Simulation};

/// The rig.
pub struct TwoAxesRig;

/// The names of each axis's angle and rate.
const ANGLES: [[&str; 2]; 2] = [["angle_x", "rate_x"], ["angle_y", "rate_y"]];

impl Rig for TwoAxesRig {
    fn name(&self) -> &'static str {
        "shared_scanner.second_axis"
    }

    fn takes(&self, device: &Device) -> bool {
        second_axis(device).is_some()
    }

    fn wanted(&self, experiment: &Experiment) -> Result<Vec<usize>, ConfigError> {
        Settings::of(experiment)?;
        wanted(experiment)
    }

    fn layout(&self, experiment: &Experiment, index: usize) -> Result<Layout, ConfigError> {
        Ok(experiment.recording(index)?.layout(&columns(experiment, index)?))
    }

    fn angles(&self) -> &'static [[&'static str; 2]] {
        &ANGLES
    }

    fn estimate(
        &self,
        experiment: &Experiment,
        index: usize,
        recording: &Recording,
        progress: &dyn Progress,
    ) -> Result<Vec<SegmentEstimate>, EstimateError> {
        let settings = Settings::of(experiment)?;
        estimate_driven((experiment, index), recording, settings.skip_s, |place, data| {
            let TwoAxisEstimate { drive, trajectories } = estimate(&settings, place, data, progress)?;
            let [x, y] = drive.motions();
            let axis = |axis: usize, (angle, motion)| Axis { angle, motion, drive: Some(drive.tones[axis]) };
            Ok(((axis(0, x), vec![axis(1, y)]), trajectories))
        })
    }

    fn outlook(&self, experiment: &Experiment) -> Result<Outlook, SimulateError> {
        outlook(experiment)
    }

    fn simulate(&self, experiment: &Experiment) -> Result<Box<dyn Simulation>, SimulateError> {
        simulation(experiment)
    }

    fn evaluate(&self, estimate: &SegmentEstimate, references: &[Reference]) -> Vec<Option<MotionErrors>> {
        let from_s = estimate.from_s();
        let first = (ANGLES[0][0], estimate.motion, estimate.drive.as_ref());
        let others = estimate.other_axes.iter().map(|axis| (axis.angle, axis.motion, axis.drive.as_ref()));
        let axes: Vec<_> = std::iter::once(first).chain(others).collect();
        let errors = |trajectory| {
            let mut found = axes.iter().filter_map(|(angle, motion, drive)| {
                let reference = references.iter().find(|reference| reference.states[0] == *angle)?;
                let extent = Extent { from_s, motion_hz: motion.frequency_hz, drive: *drive };
                evaluate_motion(trajectory, reference, extent)
            });
            let mut first = found.next()?;
            first.other_angles = found.collect();
            Some(first)
        };
        estimate.trajectories.iter().map(errors).collect()
    }
}

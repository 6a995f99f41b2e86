//! The rig of a scanner with two axes.

use super::hardware::second_axis;
use super::outlook::outlook;
use super::segment::{Samples, TwoAxisEstimate, estimate};
use super::settings::Settings;
use super::simulation::simulation;
use crate::config::{ConfigError, Device, Experiment};
use crate::estimate::{EstimateError, Motion, Progress};
use crate::evaluate::{Extent, MotionErrors, Reference, evaluate_motion};
use crate::outlook::Outlook;
use crate::recording::{Layout, Recording};
use crate::rigs::shared_scanner::drive::Drive;
use crate::rigs::shared_scanner::{columns, wanted};
use crate::rigs::{Axis, Rig, SegmentEstimate};
use crate::simulate::{SimulateError, Simulation};
use crate::units::kind;

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
        let [drive_column, signal_column] = columns(experiment, index)?;
        let drive = recording.column_of(drive_column, &kind::VOLTAGE)?;
        let signal = recording.column_of(signal_column, &kind::VOLTAGE)?;
        let mut estimates = Vec::new();
        for segment in recording.segments() {
            let place = match segment.label.as_str() {
                "" => recording.source().file.clone(),
                label => format!("{}, segment `{label}`", recording.source().file),
            };
            let time_s = segment.time.to_vec();
            let samples = Samples {
                place: &place,
                time_s: &time_s,
                drive: drive.of(segment),
                signal: signal.of(segment),
            };
            if !samples.signal.iter().any(|y| y.is_finite()) {
                return Err(EstimateError::NoSignal { place, column: signal_column.to_owned() });
            }
            let interval_s = segment.time.interval_s().unwrap_or(f64::NAN);
            if let Some((first_s, count)) = Drive::new(&time_s, samples.drive, interval_s).unknown(interval_s)
            {
                let column = drive_column.to_owned();
                return Err(EstimateError::DriveUnknown { place, column, count, first_s });
            }
            let TwoAxisEstimate { drive, trajectories } = estimate(&settings, samples, progress)?;
            let [x, y] = drive.tones.map(|tone| {
                let motion = Motion { frequency_hz: 0.5 * tone.frequency_hz, is_driven: true };
                (motion, tone)
            });
            let span = time_s.last().zip(time_s.first()).map_or(0.0, |(last, first)| last - first);
            let slower = x.0.frequency_hz.min(y.0.frequency_hz);
            if span < settings.skip_s + 10.0 / slower {
                return Err(EstimateError::TooShort { place, found_s: span, skip_s: settings.skip_s });
            }
            estimates.push(SegmentEstimate {
                segment: segment.clone(),
                drive_column: drive_column.to_owned(),
                signal_column: signal_column.to_owned(),
                drive: Some(x.1),
                motion: x.0,
                other_axes: vec![Axis { angle: ANGLES[1][0], motion: y.0, drive: Some(y.1) }],
                skip_s: settings.skip_s,
                trajectories,
            });
        }
        Ok(estimates)
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

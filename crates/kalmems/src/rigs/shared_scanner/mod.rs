//! The shared-electrode scanner: one comb drives a resonant mirror and senses its tilt.
//!
//! Chen et al., Motion Estimation for a Compact Electrostatic Micro-scanner via Shared Driving and Sensing
//! Electrodes in Endomicroscopy, 2020. The mirror is driven parametrically; a carrier on the same electrodes,
//! demodulated, gives a voltage that is affine in the capacitance and even in the angle.

mod circuit;
mod export;
mod filters;
pub mod identification;
mod lock_in;
mod outlook;
mod past;
mod plant;
mod reproduction;
mod ring_down;
mod segment;
mod settings;
mod simulation;
pub mod two_axes;

use super::Rig;
use crate::config::{ConfigError, Device, DriveSource, Experiment, Role};
use crate::estimate::driven::DrivenSegment;
use crate::estimate::{Axis, EstimateError, Progress, SegmentEstimate, Trajectory, estimate_segments};
use crate::evaluate::{Extent, MotionErrors, Reference, evaluate_motion};
use crate::export::{ExportError, Filter};
use crate::identify::{Identification, IdentifyError};
use crate::outlook::Outlook;
use crate::recording::{Layout, Recording};
use crate::reproduce::Program;
use crate::simulate::{SimulateError, Simulation};
use crate::units::kind;
pub use outlook::CycleBound;
use ring_down::RingDownSimulation;
use settings::Settings;

/// The rig.
pub struct SharedScannerRig;

/// The channels that an estimate needs.
const MEANINGS: [&str; 2] = ["drive", "signal"];

impl Rig for SharedScannerRig {
    fn name(&self) -> &'static str {
        "shared_scanner"
    }

    fn takes(&self, device: &Device) -> bool {
        matches!(device, Device::SharedScanner(scanner) if scanner.second_axis.is_none())
    }

    fn wanted(&self, experiment: &Experiment) -> Result<Vec<usize>, ConfigError> {
        Settings::of(experiment)?;
        wanted(experiment)
    }

    fn layout(&self, experiment: &Experiment, index: usize) -> Result<Layout, ConfigError> {
        Ok(experiment.recording(index)?.layout(&columns(experiment, index)?))
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
            let motion = data.motion(settings.hardware.natural_hz());
            data.require_cycles(place, settings.skip_s, motion.frequency_hz)?;
            let trajectories = segment::estimate(&settings, data, place, progress)?;
            let axis = Axis { angle: "angle", motion, drive: data.drive.sine().copied() };
            Ok(((axis, Vec::new()), trajectories))
        })
    }

    fn outlook(&self, experiment: &Experiment) -> Result<Outlook, SimulateError> {
        outlook::outlook(experiment)
    }

    fn simulate(&self, experiment: &Experiment) -> Result<Box<dyn Simulation>, SimulateError> {
        match experiment.simulate.as_ref().map(|simulate| &simulate.drive) {
            Some(DriveSource::RingDown(drive)) => Ok(Box::new(RingDownSimulation::of(experiment, drive)?)),
            _ => simulation::simulation(experiment),
        }
    }

    fn identify(
        &self,
        experiment: &Experiment,
        progress: &dyn Progress,
    ) -> Result<Identification, IdentifyError> {
        identification::identify(experiment, progress)
    }

    fn evaluate(&self, estimate: &SegmentEstimate, references: &[Reference]) -> Vec<Option<MotionErrors>> {
        let extent = Extent {
            from_s: estimate.from_s(),
            motion_hz: estimate.motion.frequency_hz,
            drive: estimate.drive.as_ref(),
        };
        let errors = |t| references.first().and_then(|reference| evaluate_motion(t, reference, extent));
        estimate.trajectories.iter().map(errors).collect()
    }

    fn exported(&self, experiment: &Experiment, place: usize) -> Result<(Filter, [String; 2]), ExportError> {
        let index = self.wanted(experiment)?.first().copied().unwrap_or(0);
        Ok((export::exported(experiment, place)?, columns(experiment, index)?.map(str::to_owned)))
    }

    fn reproduction(&self) -> Option<&'static Program> {
        Some(&reproduction::PROGRAM)
    }
}

/// What is said of a segment: its first axis, the others, and what the filters make of them.
type Answer = ((Axis, Vec<Axis>), Vec<Trajectory>);

/// Estimates every segment of a recording of one axis or two; `each` is given a name of the segment for messages.
fn estimate_driven(
    (experiment, index): (&Experiment, usize),
    recording: &Recording,
    skip_s: f64,
    each: impl Fn(&str, &DrivenSegment) -> Result<Answer, EstimateError>,
) -> Result<Vec<SegmentEstimate>, EstimateError> {
    let [drive_column, signal_column] = columns(experiment, index)?;
    estimate_segments(recording, recording.segments(), (signal_column, &kind::VOLTAGE), skip_s, |segment| {
        let (axes, trajectories) =
            each(segment.place, &DrivenSegment::of(recording, segment, drive_column)?)?;
        Ok(segment.estimated_under(drive_column, axes, trajectories))
    })
}

/// The recordings that are estimated, their channels checked.
fn wanted(experiment: &Experiment) -> Result<Vec<usize>, ConfigError> {
    let wanted = experiment.to_estimate(&[Role::Test, Role::SteadyState])?;
    for index in &wanted {
        columns(experiment, *index)?;
    }
    Ok(wanted)
}

fn columns(experiment: &Experiment, index: usize) -> Result<[&str; 2], ConfigError> {
    let key = crate::config::Key::from("recording").index(index).child("channels");
    experiment.columns(key, &experiment.recording(index)?.channels, MEANINGS)
}

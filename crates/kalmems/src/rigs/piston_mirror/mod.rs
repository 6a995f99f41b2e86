//! The piston mirror: a mirror before a plate, its distance read by a carrier through their capacitance.
//!
//! Faller and Zangl, Feasibility Considerations on an Inkjet-Printed Capacitive Position Sensor for Electrostatically
//! Actuated Resonant MEMS-Mirror Systems, 2017. One sample of the capacitance tells the position to a few tenths of a
//! micrometre; that the motion is a sinusoid makes nanometres of it.

mod bound;
mod course;
mod data;
mod metamodel;
mod phasor;
mod plates;
mod segment;
mod settings;
mod simulation;
mod start;

use super::{Rig, SegmentEstimate};
use crate::config::{ConfigError, Device, Experiment, Fault, Key, Role};
use crate::estimate::{EstimateError, Progress};
use crate::evaluate::{MotionErrors, PositionErrors, Reference, evaluate_position};
use crate::outlook::Outlook;
use crate::recording::{Layout, Recording};
use crate::simulate::{SimulateError, Simulation};
use crate::units::kind;
pub use bound::{MotionBound, motion_bound};
pub use data::SegmentData;
pub use metamodel::{DegreeError, Metamodel, MetamodelError, OutsideTable, fit_table};
pub use plates::{COEFFICIENTS, Plates, distance_at};
use settings::Settings;
pub use start::{BatchStart, NoBatchStart, batch_fit, batch_start, canonical};

/// The rig.
pub struct PistonMirrorRig;

/// The channels that an estimate needs.
const MEANINGS: [&str; 1] = ["signal"];

impl Rig for PistonMirrorRig {
    fn name(&self) -> &'static str {
        "piston_mirror"
    }

    fn takes(&self, device: &Device) -> bool {
        matches!(device, Device::PistonMirror(_))
    }

    fn wanted(&self, experiment: &Experiment) -> Result<Vec<usize>, ConfigError> {
        Settings::of(experiment)?;
        let wanted: Vec<usize> = (0..experiment.recordings.len())
            .filter(|i| experiment.recordings[*i].role == Role::Test)
            .collect();
        if wanted.is_empty() {
            let why = "no recording has the role `test`; those are estimated".to_owned();
            return Err(experiment.error("recording", Fault::Value { why }));
        }
        for index in &wanted {
            column(experiment, *index)?;
        }
        Ok(wanted)
    }

    fn layout(&self, experiment: &Experiment, index: usize) -> Result<Layout, ConfigError> {
        Ok(experiment.recording(index)?.layout(&[column(experiment, index)?]))
    }

    fn angles(&self) -> &'static [[&'static str; 2]] {
        &[["position", "velocity"]]
    }

    fn estimate(
        &self,
        experiment: &Experiment,
        index: usize,
        recording: &Recording,
        progress: &dyn Progress,
    ) -> Result<Vec<SegmentEstimate>, EstimateError> {
        let settings = Settings::of(experiment)?;
        let name = column(experiment, index)?;
        let signal = recording.column_of(name, &kind::CAPACITANCE)?;
        let mut estimates = Vec::new();
        for segment in recording.segments() {
            let place = match segment.label.as_str() {
                "" => recording.source().file.clone(),
                label => format!("{}, segment `{label}`", recording.source().file),
            };
            let time_s = segment.time.to_vec();
            let span = time_s.last().zip(time_s.first()).map_or(0.0, |(last, first)| last - first);
            let too_short =
                || EstimateError::TooShort { place: place.clone(), found_s: span, skip_s: settings.skip_s };
            let interval_s = segment.time.interval_s().ok_or_else(too_short)?;
            let data = SegmentData {
                time_s: &time_s,
                signal: signal.of(segment),
                interval_s,
                noise_variance: settings.hardware.noise_variance(interval_s),
            };
            if !data.signal.iter().any(|y| y.is_finite()) {
                return Err(EstimateError::NoSignal { place, column: name.to_owned() });
            }
            let (trajectories, motion) = segment::estimate(&settings, &data, &place, progress)?;
            if span < settings.skip_s + 10.0 / motion.frequency_hz {
                return Err(too_short());
            }
            estimates.push(SegmentEstimate {
                segment: segment.clone(),
                drive_column: String::new(),
                signal_column: name.to_owned(),
                drive: None,
                motion,
                other_axes: Vec::new(),
                skip_s: settings.skip_s,
                parts: 1,
                trajectories,
            });
        }
        Ok(estimates)
    }

    fn outlook(&self, experiment: &Experiment) -> Result<Outlook, SimulateError> {
        let why = "what can be said of a piston mirror before a recording is not built yet".to_owned();
        Err(experiment.error("device", Fault::Value { why }).into())
    }

    fn simulate(&self, experiment: &Experiment) -> Result<Box<dyn Simulation>, SimulateError> {
        Ok(Box::new(simulation::PhasorSimulation::of(experiment)?))
    }

    /// A position has no errors of an angle; see [`Rig::evaluate_positions`].
    fn evaluate(&self, estimate: &SegmentEstimate, _: &[Reference]) -> Vec<Option<MotionErrors>> {
        vec![None; estimate.trajectories.len()]
    }

    fn evaluate_positions(
        &self,
        estimate: &SegmentEstimate,
        references: &[Reference],
    ) -> Vec<Option<PositionErrors>> {
        let errors =
            |t| references.first().and_then(|reference| evaluate_position(t, reference, estimate.from_s()));
        estimate.trajectories.iter().map(errors).collect()
    }
}

fn column(experiment: &Experiment, index: usize) -> Result<&str, ConfigError> {
    let key = Key::from("recording").index(index).child("channels");
    let [signal] = experiment.columns(key, &experiment.recording(index)?.channels, MEANINGS)?;
    Ok(signal)
}

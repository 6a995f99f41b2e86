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

use super::Rig;
use crate::config::{ConfigError, Device, Experiment, Fault, Key, Role};
use crate::estimate::{EstimateError, Progress, SegmentEstimate, estimate_segments};
use crate::evaluate::{MotionErrors, Reference, ValueState};
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

/// Cycles of the motion that have to follow the settling time.
const CYCLES: f64 = 10.0;

/// What no innovation shows.
const SCALE: &str = "a wrong gain of the readout or a wrong reference distance scales amplitude and position, and the \
                     mean NIS cannot see it";

/// What a reference may know; the first is what the instrument is for.
static VALUES: [ValueState; 2] = [
    ValueState { name: "position", kind: &kind::LENGTH, rate: Some("velocity") },
    ValueState { name: "velocity", kind: &kind::VELOCITY, rate: None },
];

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
        &[]
    }

    fn values(&self) -> &'static [ValueState] {
        &VALUES
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
        estimate_segments(recording, (name, &kind::CAPACITANCE), settings.skip_s, |segment| {
            let data = SegmentData {
                time_s: segment.time_s,
                signal: segment.signal,
                interval_s: segment.interval_s,
                noise_variance: settings.hardware.noise_variance(segment.interval_s),
            };
            let (trajectories, motion) = segment::estimate(&settings, &data, segment.place, progress)?;
            segment.require_after_settling(CYCLES / motion.frequency_hz)?;
            let estimate = segment.estimated(motion, trajectories);
            Ok(SegmentEstimate { remarks: vec![SCALE.to_owned()], ..estimate })
        })
    }

    fn outlook(&self, experiment: &Experiment) -> Result<Outlook, SimulateError> {
        let why = "what can be said of a piston mirror before a recording is not built yet".to_owned();
        Err(experiment.error("device", Fault::Value { why }).into())
    }

    fn simulate(&self, experiment: &Experiment) -> Result<Box<dyn Simulation>, SimulateError> {
        Ok(Box::new(simulation::PhasorSimulation::of(experiment)?))
    }

    /// It has no angle; see [`Rig::values`].
    fn evaluate(&self, estimate: &SegmentEstimate, _: &[Reference]) -> Vec<Option<MotionErrors>> {
        vec![None; estimate.trajectories.len()]
    }
}

fn column(experiment: &Experiment, index: usize) -> Result<&str, ConfigError> {
    let key = Key::from("recording").index(index).child("channels");
    let [signal] = experiment.columns(key, &experiment.recording(index)?.channels, MEANINGS)?;
    Ok(signal)
}

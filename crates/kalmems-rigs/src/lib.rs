//! The published systems, one room each, and the job that they do from end to end.
//!
//! To add one: a folder here, a device table in [`kalmems_engines::config`], and one line in [`ALL`].

pub mod accelerometer;
pub mod micro_stage;
pub mod piston_mirror;
pub mod shared_scanner;
pub mod threshold_scanner;
pub mod workflow;

pub use kalmems_engines::rig::{Estimator, Rig};

use kalmems_engines::{
    circuit, config, estimate, evaluate, export, fit, identify, outlook, progress, recording, signal,
    simulate, units,
};

use config::{ConfigError, Experiment, Fault};

/// Every rig that is built.
// Statics would be compiled into the unit tests with all that they name.
pub const ALL: &[&dyn Rig] = &[
    &accelerometer::AccelerometerRig,
    &micro_stage::MicroStageRig,
    &piston_mirror::PistonMirrorRig,
    &shared_scanner::SharedScannerRig,
    &shared_scanner::two_axes::TwoAxesRig,
    &threshold_scanner::ThresholdScannerRig,
];

/// The rig for an experiment's device.
pub fn of(experiment: &Experiment) -> Result<&'static dyn Rig, ConfigError> {
    ALL.iter().copied().find(|rig| rig.takes(&experiment.device)).ok_or_else(|| {
        let built: Vec<&str> = ALL.iter().map(|rig| rig.name()).collect();
        let why = format!(
            "this device can be described, but nothing is built for it yet; built are: {}",
            built.join(", ")
        );
        experiment.error("device", Fault::Value { why })
    })
}

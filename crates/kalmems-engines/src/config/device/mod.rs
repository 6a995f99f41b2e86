//! The devices that can be described, one file each.

mod accelerometer;
mod circuit;
mod micro_stage;
mod piston_mirror;
mod second_axis;
mod shared_scanner;
mod threshold_scanner;

pub use accelerometer::{
    AccelerationPrior, Accelerometer, ForceFeedback, OneBit, ParallelPlates, ProofMass, SwitchedReadout,
};
pub use circuit::{
    DetectorSource, DiodeDetector, HighPassFilter, ModulatedCircuit, SquareLawDetector, SynchronousDetector,
};
pub use micro_stage::{
    DriveFeedthrough, Electrode, Gyroscope, MicroStage, PistonMode, RateCorrection, StageResonator,
    Vibrometer,
};
pub use piston_mirror::{
    CapacitanceReadout, CarrierFrontEnd, DistanceSeries, DrivenPlate, PistonMirror, SurroundingGas,
};
pub use second_axis::SecondAxis;
pub use shared_scanner::{Carrier, DemodulatedReadout, GaussianComb, Resonator, SharedScanner};
pub use threshold_scanner::{
    CombGeometry, CombShape, DetectedAngle, MirrorResonator, PositionDetector, SensingComb, SquareDrive,
    ThresholdScanner, TransimpedanceReadout,
};

use super::Key;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The device, by its rig.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[allow(clippy::large_enum_variant)] // there is one per experiment
pub enum Device {
    /// A scanner whose comb drives and senses at once.
    SharedScanner(SharedScanner),
    /// A scanner whose signal tells most when the angle passes a threshold.
    ThresholdScanner(ThresholdScanner),
    /// A stage that shakes a gyroscope to calibrate it.
    MicroStage(MicroStage),
    /// A force-rebalance accelerometer.
    Accelerometer(Accelerometer),
    /// A piston mirror for a Fourier-transform spectrometer.
    PistonMirror(PistonMirror),
}

impl Device {
    /// What no single value can be blamed for: the key, and what is wrong.
    pub(super) fn check(&self) -> Result<(), (Key, String)> {
        match self {
            Self::MicroStage(stage) => stage.check(),
            Self::PistonMirror(mirror) => mirror.check(),
            Self::ThresholdScanner(scanner) => scanner.check(),
            Self::SharedScanner(_) | Self::Accelerometer(_) => Ok(()),
        }
    }
}

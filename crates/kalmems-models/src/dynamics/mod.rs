//! How devices move.

mod accelerometer;
mod comb_driven;
mod drive_gain;
mod duffing;
mod electrostatic;
mod gas_damping;
mod gauss_markov;
mod mirror;
mod parametric;
mod phasor;
mod piezo_stage;
mod proof_mass;
mod resonator;
mod two_axis;
mod uncertain;

pub use accelerometer::{Accelerometer, CarrierDriven, SensedAcceleration, StaticPullIn};
pub use comb_driven::CombDrivenMirror;
pub use drive_gain::DriveGain;
pub use duffing::Duffing;
pub use electrostatic::{torque, torque_slope};
pub use gas_damping::GasDamping;
pub use gauss_markov::GaussMarkov;
pub use mirror::MirrorResonator;
pub use parametric::ParametricScanner;
pub use phasor::{DriftingPhasor, SteadyPhasor};
pub use piezo_stage::{PiezoStage, TiltAndPiston};
pub use proof_mass::ProofMass;
pub use resonator::TorsionalResonator;
pub use two_axis::{TwoAxisDriveGain, TwoAxisScanner};
pub use uncertain::UncertainMechanics;

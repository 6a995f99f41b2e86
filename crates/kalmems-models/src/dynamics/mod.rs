//! How devices move.

mod comb_driven;
mod drive_gain;
mod duffing;
mod electrostatic;
mod mirror;
mod parametric;
mod resonator;
mod two_axis;

pub use comb_driven::CombDrivenMirror;
pub use drive_gain::DriveGain;
pub use duffing::Duffing;
pub use electrostatic::{torque, torque_slope};
pub use mirror::MirrorResonator;
pub use parametric::ParametricScanner;
pub use resonator::TorsionalResonator;
pub use two_axis::{TwoAxisDriveGain, TwoAxisScanner};

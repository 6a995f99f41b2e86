//! How devices move.

mod duffing;
mod electrostatic;
mod parametric;
mod resonator;

pub use duffing::Duffing;
pub use electrostatic::{torque, torque_slope};
pub use parametric::ParametricScanner;
pub use resonator::TorsionalResonator;

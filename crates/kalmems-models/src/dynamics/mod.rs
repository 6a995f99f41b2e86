//! How devices move.

mod electrostatic;
mod parametric;
mod resonator;

pub use electrostatic::torque;
pub use parametric::ParametricScanner;
pub use resonator::TorsionalResonator;

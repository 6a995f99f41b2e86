//! Capacitance as a function of motion.

mod curve;
mod differential;
mod fingers;
mod gauss_legendre;
mod gaussian;
mod tilting_plate;

pub use curve::{CombCurve, CurveShape};
pub use differential::{DifferentialPlates, FixedPlate};
pub use fingers::CombFingers;
pub use gaussian::GaussianComb;
pub use tilting_plate::{Contact, TiltingPlate};

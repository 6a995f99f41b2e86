//! Capacitance as a function of motion.

mod gauss_legendre;
mod gaussian;
mod tilting_plate;

pub use gaussian::GaussianComb;
pub use tilting_plate::{Contact, TiltingPlate};

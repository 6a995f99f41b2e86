//! Capacitance as a function of motion.

mod gaussian;

pub use gaussian::GaussianComb;

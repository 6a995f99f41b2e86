//! Nonlinear least squares: parameters from data, with how well they are known.

mod error;
mod levenberg;
mod likelihood;
mod outcome;
mod outliers;
mod profile;
mod regression;
mod shooting;
#[cfg(test)]
mod tests;
mod triangle;

pub use error::FitError;
pub use levenberg::{Bounds, FitSettings, fit};
pub use likelihood::{Innovations, MostLikely, Score, most_likely};
pub use outcome::{Derived, Direction, Fit};
pub use outliers::{outliers, outliers_beside};
pub use profile::profile;
pub use regression::{ByDual, Law, Regression};
pub use shooting::{Shooting, ShootingError, Unknown};

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
pub use levenberg::{FitSettings, ParameterBounds, fit, fit_until};
pub use likelihood::{InnovationScore, Innovations, MostLikely, most_likely};
pub use outcome::{DerivedNumber, Fit, ParameterDirection};
pub use outliers::{outliers, outliers_of_stated};
pub use profile::profile;
pub use regression::{ByDual, Regression, ResidualLaw};
pub use shooting::{Shooting, ShootingError, Unknown};

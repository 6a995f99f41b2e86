//! Measurement uncertainty as the Joint Committee for Guides in Metrology has it: JCGM 100:2008 (GUM) and its supplement
//! JCGM 101:2008 on the propagation of distributions.
//!
//! A result is a function of inputs. Each [`Input`] has a value, a distribution, a standard uncertainty, degrees of freedom, a
//! source, and the sensitivity of the result to it. A [`Budget`] combines them with their correlations to a combined standard
//! uncertainty, effective degrees of freedom, a coverage factor and an expanded uncertainty; [`propagated`] draws the inputs
//! instead and needs no linear model.
//! Nothing here knows what is calibrated.

mod budget;
mod correlated_draws;
mod input;
mod standard_uncertainty;
mod trials;

pub use budget::{Budget, Combined, coverage_factor, coverage_probability};
pub use correlated_draws::{chi_by_freedom, correlated_normals, shared_error};
pub(crate) use input::or_null;
pub use input::{Distribution, Evaluation, Input};
pub use standard_uncertainty::{StandardUncertainty, StatedCorrelations};
pub use trials::{PropagatedResult, PropagationComparison, compared, propagated};

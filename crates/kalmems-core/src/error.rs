//! What a filter refuses.

use core::fmt;

/// Why a filter did not take a step; its state is then as it was before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FilterError {
    /// A component of the measurement is infinite or not a number. Skip the update where a sample is missing.
    NonFiniteMeasurement,
    /// The prediction, its Jacobian or the corrected state became infinite or not a number: the model was
    /// evaluated outside its range, or an input is not finite.
    NonFiniteState,
    /// The innovation covariance is not positive definite: the measurement noise must be positive.
    InnovationNotPositive,
    /// The state covariance is not positive definite: the start covariance and the process noise must make it
    /// so in every direction that sigma points are drawn in.
    CovarianceNotPositive,
}

impl fmt::Display for FilterError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NonFiniteMeasurement => "the measurement is not a finite number",
            Self::NonFiniteState => "the state would become infinite or not a number",
            Self::InnovationNotPositive => "the innovation covariance is not positive definite",
            Self::CovarianceNotPositive => "the state covariance is not positive definite",
        })
    }
}

impl core::error::Error for FilterError {}

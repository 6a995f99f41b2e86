//! What a fit refuses.

/// Why there is no fit.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FitError {
    /// There are fewer residuals than free parameters.
    #[error(
        "{residuals} residuals cannot determine {parameters} parameters; give more data or hold some parameters"
    )]
    TooFew {
        /// Residuals there are.
        residuals: usize,
        /// Parameters that are free.
        parameters: usize,
    },
    /// A residual or a derivative at the start is infinite or not a number.
    #[error("residual {index} is not finite at the start {start:?}; start elsewhere or check the data")]
    NotFiniteAtStart {
        /// Which residual, from 0.
        index: usize,
        /// The start.
        start: Vec<f64>,
    },
    /// The start or the bounds are not usable.
    #[error("parameter {index} starts at {start}, outside its bounds {low} to {high}")]
    OutsideBounds {
        /// Which parameter, from 0.
        index: usize,
        /// Where it starts.
        start: f64,
        /// Its lower bound.
        low: f64,
        /// Its upper bound.
        high: f64,
    },
    /// The steps did not become small.
    #[error(
        "the fit found no minimum within {iterations} iterations (sum of squares {sum_of_squares:.3e}): the model does not describe the \
         recording with values near the stated ones; check signs, units and the values of the file"
    )]
    NotConverged {
        /// Iterations done.
        iterations: usize,
        /// Where it stands.
        parameters: Vec<f64>,
        /// The sum of squares there.
        sum_of_squares: f64,
    },
    /// It was stopped.
    #[error("the fit was interrupted")]
    Interrupted,
}

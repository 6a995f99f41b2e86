//! The filters.
//!
//! Each holds a [`Gaussian`] and offers `predict` over one [`Process`] step and `update` with
//! one [`Measurement`]. A step that cannot be taken is refused with a
//! [`FilterError`] and leaves the state as it was.

use crate::{Covariance, FilterError, Measurement, Process, Scalar};

mod extended;
mod gaussian;
mod kalman;
mod unscented;

pub use extended::Ekf;
pub use gaussian::{Gaussian, Innovation};
pub use kalman::Kalman;
pub use unscented::{SigmaPoints, Ukf};

/// What the nonlinear filters have in common, so that one loop over a recording serves them all.
///
/// ```
/// use kalmems_core::{Covariance, Ekf, Filter, LinearMeasurement, Mat, SigmaPoints, Ukf};
/// fn level(mut filter: impl Filter<f64, 1>, ys: &[f64]) -> f64 {
///     let seen = LinearMeasurement { matrix: Mat([[1.0]]) };
///     for y in ys {
///         // A refused measurement leaves the state as it was.
///         let _ = filter.update(&seen, &[*y], &Covariance::from_variances([1.0]));
///     }
///     filter.mean()[0]
/// }
/// let start = Covariance::from_variances([1e6]);
/// let ys = [3.0, f64::NAN, 5.0];
/// assert!((level(Ekf::new([0.0], start), &ys) - 4.0).abs() < 1e-4);
/// assert!((level(Ukf::new([0.0], start, SigmaPoints::standard()), &ys) - 4.0).abs() < 1e-4);
/// ```
pub trait Filter<T: Scalar, const N: usize> {
    /// The mean of the state.
    fn mean(&self) -> &[T; N];

    /// The covariance of the state.
    fn covariance(&self) -> &Covariance<T, N>;

    /// Moves the state by one step.
    fn predict<P: Process<T, N>>(&mut self, process: &P, u: &P::Input) -> Result<(), FilterError>;

    /// Corrects the state with a measurement `y` of noise covariance `r`.
    fn update<H: Measurement<T, N, M>, const M: usize>(
        &mut self,
        measurement: &H,
        y: &[T; M],
        r: &Covariance<T, M>,
    ) -> Result<Innovation<T, M>, FilterError>;
}

//! The linear Kalman filter.

use super::{Gaussian, Innovation};
use crate::update::Always;
use crate::{Covariance, FilterError, LinearMeasurement, LinearProcess, Scalar};

/// The Kalman filter of a linear process and linear measurements.
///
/// ```
/// use kalmems_core::{Covariance, Kalman, LinearMeasurement, LinearProcess, Mat};
/// // A level that walks at random, seen with noise.
/// let walk = LinearProcess::<f64, 1, 0> {
///     transition: Mat::identity(),
///     input: Mat::zero(),
///     noise: Covariance::from_variances([1.0]).into(),
/// };
/// let level = LinearMeasurement { matrix: Mat([[1.0]]) };
/// let mut filter = Kalman::new([0.0], Covariance::from_variances([1.0]));
/// filter.predict(&walk, &[])?;
/// let innovation = filter.update(&level, &[2.0], &Covariance::from_variances([2.0]))?;
/// assert_eq!(innovation.nis, 1.0); // 2² over 1 + 1 + 2
/// assert_eq!(filter.mean(), &[1.0]);
/// # Ok::<(), kalmems_core::FilterError>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Kalman<T, const N: usize> {
    state: Gaussian<T, N>,
}

impl<T: Scalar, const N: usize> Kalman<T, N> {
    /// Starts from a mean and its covariance.
    pub const fn new(mean: [T; N], covariance: Covariance<T, N>) -> Self {
        Self { state: Gaussian { mean, covariance } }
    }

    /// The mean of the state.
    #[inline(always)]
    pub const fn mean(&self) -> &[T; N] {
        &self.state.mean
    }

    /// The covariance of the state.
    #[inline(always)]
    pub const fn covariance(&self) -> &Covariance<T, N> {
        &self.state.covariance
    }

    /// Moves the state by one step: Φ·x + Γ·u, Φ·P·Φᵀ + Q.
    #[inline(always)]
    pub fn predict<const U: usize>(
        &mut self,
        process: &LinearProcess<T, N, U>,
        u: &[T; U],
    ) -> Result<(), FilterError> {
        self.state.propagate(process, u).map(|_| ())
    }

    /// Corrects the state with a measurement `y` of noise covariance `r`.
    #[inline(always)]
    pub fn update<const M: usize>(
        &mut self,
        measurement: &LinearMeasurement<T, N, M>,
        y: &[T; M],
        r: &Covariance<T, M>,
    ) -> Result<Innovation<T, M>, FilterError> {
        let predicted = measurement.matrix.times_vector(&self.state.mean);
        self.state.correct::<LinearMeasurement<T, N, M>, M>((y, &predicted), &measurement.matrix, r, &Always)
    }
}

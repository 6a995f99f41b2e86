//! What a step adds to the uncertainty.

use crate::{Cholesky, Covariance, Mat, Scalar};

/// The covariance Q that the process noise adds over one step, with a root: Q = W·Wᵀ.
///
/// Both are computed once, when the step is made; filters in square-root form use the root alone.
///
/// ```
/// use kalmems_core::{Covariance, Mat, ProcessNoise};
/// let q = ProcessNoise::from(Covariance::from_lower(Mat([[4.0, 0.0], [2.0, 1.0]])));
/// assert_eq!(q.root(), &Mat([[2.0, 0.0], [1.0, 0.0]])); // singular: one source moves both states
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProcessNoise<T, const N: usize> {
    covariance: Covariance<T, N>,
    root: Mat<T, N, N>,
}

impl<T: Scalar, const N: usize> ProcessNoise<T, N> {
    /// No noise: the step is exact.
    #[inline(always)]
    pub fn none() -> Self {
        Self { covariance: Covariance::zero(), root: Mat::zero() }
    }

    /// Q, from its lower triangle, with a root W that was found before: Q = W·Wᵀ, lower triangular.
    #[inline(always)]
    pub fn with_root(covariance: Mat<T, N, N>, root: Mat<T, N, N>) -> Self {
        Self { covariance: Covariance::from_lower(covariance), root }
    }

    /// Q.
    #[inline(always)]
    pub const fn covariance(&self) -> &Covariance<T, N> {
        &self.covariance
    }

    /// W, lower triangular.
    #[inline(always)]
    pub const fn root(&self) -> &Mat<T, N, N> {
        &self.root
    }
}

impl<T: Scalar, const N: usize> From<Covariance<T, N>> for ProcessNoise<T, N> {
    #[inline(always)]
    fn from(covariance: Covariance<T, N>) -> Self {
        Self { covariance, root: Cholesky::of_semidefinite(&covariance) }
    }
}

//! The lower Cholesky factor.

use super::{Mat, sum};
use crate::{Covariance, Mask, Scalar};

/// P = L·Lᵀ with L lower triangular.
#[derive(Clone, Copy, Debug)]
pub struct Cholesky<T: Scalar, const N: usize> {
    /// L; zeros above the diagonal. Not meaningful where `positive` is not set.
    pub factor: Mat<T, N, N>,
    /// Whether every pivot was positive and finite.
    pub positive: T::Mask,
}

impl<T: Scalar, const N: usize> Cholesky<T, N> {
    /// Factors a covariance. A pivot that is not positive is told in `positive`, not repaired.
    #[inline(always)]
    pub fn of(covariance: &Covariance<T, N>) -> Self {
        let mut l = Mat::<T, N, N>::zero();
        let mut positive = T::of(0.0).is_finite();
        for j in 0..N {
            let pivot = covariance.get(j, j) - sum(j, |k| l.0[j][k].sq());
            positive = positive.and(pivot.gt(T::of(0.0))).and(pivot.is_finite());
            let root = pivot.sqrt();
            let recip = root.recip();
            l.0[j][j] = root;
            for i in (j + 1)..N {
                l.0[i][j] = (covariance.get(i, j) - sum(j, |k| l.0[i][k] * l.0[j][k])) * recip;
            }
        }
        Self { factor: l, positive }
    }

    /// L of a covariance that may be singular: a column whose pivot is not positive is zero.
    ///
    /// Exact for what is positive semi-definite; anything else has no such factor, and a filter that is given
    /// it is wrong from the start.
    #[inline(always)]
    pub fn of_semidefinite(covariance: &Covariance<T, N>) -> Mat<T, N, N> {
        let mut l = Mat::<T, N, N>::zero();
        let zero = T::of(0.0);
        for j in 0..N {
            let pivot = covariance.get(j, j) - sum(j, |k| l.0[j][k].sq());
            let positive = pivot.gt(zero);
            let root = T::select(positive, pivot, zero).sqrt();
            let recip = T::select(positive, root, T::of(1.0)).recip();
            l.0[j][j] = root;
            for i in (j + 1)..N {
                let entry = (covariance.get(i, j) - sum(j, |k| l.0[i][k] * l.0[j][k])) * recip;
                l.0[i][j] = T::select(positive, entry, zero);
            }
        }
        l
    }
}

//! Correlated measurement noise, taken apart.

use super::Mat;
use super::ldl::UnitLower;
use crate::notation::{matrix, sum, vector};
use crate::{Covariance, Scalar};

/// R = L·D·Lᵀ with L unit lower triangular and D ≥ 0: the components of L⁻¹·y have uncorrelated noise of
/// variances D.
///
/// Unlike [`Ldl`](super::Ldl) it allows components without noise.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Decorrelation<T: Scalar, const M: usize> {
    /// L.
    pub lower: UnitLower<T, M>,
    /// D.
    pub diagonal: [T; M],
    /// Whether R was positive semi-definite and finite; nothing else here means anything where not.
    pub semidefinite: bool,
}

impl<T: Scalar, const M: usize> Decorrelation<T, M> {
    /// Factors a noise covariance. A pivot that is zero must have a column of zeros below it.
    #[inline(always)]
    pub fn of(covariance: &Covariance<T, M>) -> Self {
        let zero = T::of(0.0);
        let mut l = Mat::<T, M, M>::identity();
        let mut d = [zero; M];
        let mut semidefinite = zero.is_finite();
        for j in 0..M {
            d[j] = covariance.get(j, j) - sum!(j, |k| l.0[j][k].sq() * d[k]);
            semidefinite = semidefinite & !d[j].lt(zero) & d[j].is_finite();
            let positive = d[j].gt(zero);
            let recip = T::select(positive, d[j], T::of(1.0)).recip();
            for i in (j + 1)..M {
                let entry = covariance.get(i, j) - sum!(j, |k| l.0[i][k] * l.0[j][k] * d[k]);
                let nothing = !(entry.lt(zero) | entry.gt(zero));
                semidefinite = semidefinite && (positive | nothing) & entry.is_finite();
                l.0[i][j] = entry * recip;
            }
        }
        Self { lower: UnitLower(l), diagonal: d, semidefinite }
    }

    /// L⁻¹·A.
    #[inline(always)]
    #[must_use]
    pub fn of_rows<const N: usize>(&self, a: &Mat<T, M, N>) -> Mat<T, M, N> {
        let columns: [[T; M]; N] = vector!(|j| self.lower.inverse_times(&vector!(|i| a.0[i][j])));
        matrix!(|i, j| columns[j][i])
    }
}

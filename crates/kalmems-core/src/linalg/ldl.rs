//! The square-root-free factorisation of an innovation covariance.

use super::Mat;
use crate::notation::{less, sum};
use crate::{Covariance, Scalar};

/// S = L·D·Lᵀ with L unit lower triangular and D diagonal.
///
/// Without square roots: one measurement needs one reciprocal, and needs no special case.
#[derive(Clone, Copy, Debug)]
pub struct Ldl<T: Scalar, const M: usize> {
    lower: UnitLower<T, M>,
    /// D.
    pub diagonal: [T; M],
    /// 1/D.
    pub(crate) recip: [T; M],
    /// Whether every entry of D was positive and finite; nothing else here means anything where not.
    pub positive: bool,
}

/// A lower triangular matrix L with ones on its diagonal.
#[derive(Clone, Copy, Debug)]
pub(crate) struct UnitLower<T, const M: usize>(pub Mat<T, M, M>);

impl<T: Scalar, const M: usize> UnitLower<T, M> {
    /// L⁻¹·v.
    #[inline(always)]
    #[must_use]
    pub fn inverse_times(&self, v: &[T; M]) -> [T; M] {
        let mut x = *v;
        for i in 0..M {
            x[i] = x[i] - sum!(i, |k| self.0.0[i][k] * x[k]);
        }
        x
    }
}

impl<T: Scalar, const M: usize> Ldl<T, M> {
    /// Factors a covariance.
    #[inline(always)]
    pub fn of(covariance: &Covariance<T, M>) -> Self {
        let mut l = Mat::<T, M, M>::identity();
        let mut d = [T::of(1.0); M];
        let mut recip = d;
        let mut positive = T::of(0.0).is_finite();
        for j in 0..M {
            d[j] = less!(covariance.get(j, j), j, |k| l.0[j][k].sq() * d[k]);
            recip[j] = d[j].recip();
            // The reciprocal is positive where the pivot is and is not infinite: cheaper than a look at its bits.
            positive = positive & d[j].gt(T::of(0.0)) & recip[j].gt(T::of(0.0));
            for i in (j + 1)..M {
                l.0[i][j] = less!(covariance.get(i, j), j, |k| l.0[i][k] * l.0[j][k] * d[k]) * recip[j];
            }
        }
        Self { lower: UnitLower(l), diagonal: d, recip, positive }
    }

    /// L⁻¹·v: components that are uncorrelated, with variances D, where v has covariance S.
    #[inline(always)]
    #[must_use]
    pub fn decorrelate(&self, v: &[T; M]) -> [T; M] {
        self.lower.inverse_times(v)
    }

    /// S⁻¹·v.
    #[inline(always)]
    #[must_use]
    pub fn solve(&self, v: &[T; M]) -> [T; M] {
        let UnitLower(lower) = &self.lower;
        let mut x = *v;
        for i in 0..M {
            x[i] = less!(x[i], i, |k| lower.0[i][k] * x[k]);
        }
        for i in 0..M {
            x[i] = x[i] * self.recip[i];
        }
        for i in (0..M).rev() {
            // Over the indices themselves: with an offset a build for size keeps a bounds check.
            for k in (i + 1)..M {
                x[i] = x[i] - lower.0[k][i] * x[k];
            }
        }
        x
    }
}

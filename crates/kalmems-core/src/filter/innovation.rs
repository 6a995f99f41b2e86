//! What a measurement said against its prediction.

use crate::linalg::Ldl;
use crate::notation::{sum, vector};
use crate::{Covariance, Scalar};

/// What a measurement said against its prediction.
#[derive(Clone, Copy, Debug)]
pub struct Innovation<T: Scalar, const M: usize> {
    /// y − h(x): measured minus predicted.
    pub residual: [T; M],
    /// S = H·P·Hᵀ + R, its covariance if the filter is right.
    pub covariance: Covariance<T, M>,
    /// The normalised innovation squared rᵀ·S⁻¹·r: on average `M` if the filter is right.
    pub nis: T,
    /// Where the state was corrected: neither refused nor declined by a policy.
    pub taken: bool,
    /// D of S = L·D·Lᵀ.
    pivots: [T; M],
}

/// ln 2π.
const LN_2PI: f64 = 1.837_877_066_409_345_5;

impl<T: Scalar, const M: usize> Innovation<T, M> {
    /// The innovation and the factors of its covariance `s`.
    #[inline(always)]
    pub(crate) fn new(y: &[T; M], predicted: &[T; M], s: Covariance<T, M>) -> (Self, Ldl<T, M>) {
        let residual: [T; M] = vector!(|i| y[i] - predicted[i]);
        let ldl = Ldl::of(&s);
        let weighted = ldl.solve(&residual);
        let nis = sum!(M, |i| residual[i] * weighted[i]);
        (Self { residual, covariance: s, nis, taken: ldl.positive, pivots: ldl.diagonal }, ldl)
    }

    /// The innovation from what was found one component at a time, each given the ones before it: its NIS, and
    /// its variances, which are the pivots of S.
    #[inline(always)]
    pub(crate) fn of_pivots(residual: [T; M], covariance: Covariance<T, M>, nis: T, pivots: [T; M]) -> Self {
        let zero = T::of(0.0);
        let mut positive = zero.is_finite();
        for pivot in &pivots {
            positive = positive & pivot.gt(zero) & pivot.is_finite();
        }
        Self { residual, covariance, nis, taken: positive, pivots }
    }

    /// ln p(y | past) = −½·(M·ln 2π + ln det S + NIS).
    #[inline(always)]
    pub fn log_likelihood(&self) -> T {
        let ln_det = sum!(M, |i| self.pivots[i].ln());
        -(T::of(M as f64 * LN_2PI) + ln_det + self.nis).half()
    }
}

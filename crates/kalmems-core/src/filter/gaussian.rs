//! The state of knowledge, and the two steps that all filters share.

use crate::linalg::{Ldl, sum};
use crate::{Covariance, FilterError, Mask, Mat, Scalar};
use core::array;

/// A Gaussian over the state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gaussian<T, const N: usize> {
    /// Its mean.
    pub mean: [T; N],
    /// Its covariance.
    pub covariance: Covariance<T, N>,
}

/// What a measurement said against its prediction.
#[derive(Clone, Copy, Debug)]
pub struct Innovation<T: Scalar, const M: usize> {
    /// y − h(x): measured minus predicted.
    pub residual: [T; M],
    /// S = H·P·Hᵀ + R, its covariance if the filter is right.
    pub covariance: Covariance<T, M>,
    /// The normalised innovation squared rᵀ·S⁻¹·r: on average `M` if the filter is right.
    pub nis: T,
    /// ln p(y | past) = −½·(M·ln 2π + ln det S + NIS).
    pub log_likelihood: T,
}

/// Why lanes were refused; each mask is set where that happened.
pub(super) struct Refusal<T: Scalar> {
    pub measurement: T::Mask,
    pub innovation: T::Mask,
    pub covariance: T::Mask,
    pub state: T::Mask,
}

impl<T: Scalar> Refusal<T> {
    /// The first reason, where any lane was refused.
    #[inline(always)]
    pub fn to_error(&self) -> Result<(), FilterError> {
        if self.measurement.any() {
            Err(FilterError::NonFiniteMeasurement)
        } else if self.covariance.any() {
            Err(FilterError::CovarianceNotPositive)
        } else if self.innovation.any() {
            Err(FilterError::InnovationNotPositive)
        } else if self.state.any() {
            Err(FilterError::NonFiniteState)
        } else {
            Ok(())
        }
    }
}

impl<T: Scalar, const N: usize> Gaussian<T, N> {
    /// Whether mean and covariance are finite.
    #[inline(always)]
    pub(super) fn is_finite(&self) -> T::Mask {
        self.mean.iter().fold(self.covariance.is_finite(), |finite, m| finite.and(m.is_finite()))
    }

    /// Takes `next` where it may be, and keeps itself elsewhere.
    #[inline(always)]
    pub(super) fn replace(&mut self, next: &Self, taken: T::Mask) {
        self.mean = array::from_fn(|i| T::select(taken, next.mean[i], self.mean[i]));
        self.covariance = Covariance::select(taken, &next.covariance, &self.covariance);
    }

    /// The prediction with a linear or linearised step: mean f(x), covariance F·P·Fᵀ + Q.
    #[inline(always)]
    pub(super) fn propagate(
        &mut self,
        mean: [T; N],
        f: &Mat<T, N, N>,
        q: &Covariance<T, N>,
    ) -> Result<(), FilterError> {
        let next = Self { mean, covariance: self.covariance.transformed(f).plus(q) };
        self.accept(&next)
    }

    /// Takes a prediction where it is finite; says so where it is not.
    #[inline(always)]
    pub(super) fn accept(&mut self, next: &Self) -> Result<(), FilterError> {
        let finite = next.is_finite();
        self.replace(next, finite);
        if finite.all() { Ok(()) } else { Err(FilterError::NonFiniteState) }
    }

    /// The correction with a linear or linearised measurement.
    ///
    /// K = P·Hᵀ·S⁻¹ and P⁺ = (I − K·H)·P·(I − K·H)ᵀ + K·R·Kᵀ (Joseph's form, positive semi-definite whatever the
    /// rounding of K).
    #[inline(always)]
    pub(super) fn correct<const M: usize>(
        &mut self,
        y: &[T; M],
        predicted: &[T; M],
        h: &Mat<T, M, N>,
        r: &Covariance<T, M>,
    ) -> Result<Innovation<T, M>, FilterError> {
        let p = &self.covariance;
        // H·P, whose transpose times S⁻¹ is the gain.
        let hp: Mat<T, M, N> = Mat::from_fn(|i, j| sum(N, |k| h.0[i][k] * p.get(k, j)));
        let s = Covariance::lower(|i, j| r.get(i, j) + sum(N, |k| hp.0[i][k] * h.0[j][k]));
        let (innovation, ldl) = innovation(y, predicted, s);
        let gain: [[T; M]; N] = array::from_fn(|i| ldl.solve(&array::from_fn(|j| hp.0[j][i])));

        let a: Mat<T, N, N> =
            Mat::from_fn(|i, j| T::of(if i == j { 1.0 } else { 0.0 }) - sum(M, |k| gain[i][k] * h.0[k][j]));
        let kr: Mat<T, N, M> = Mat::from_fn(|i, j| sum(M, |k| gain[i][k] * r.get(k, j)));
        let ap: Mat<T, N, N> = Mat::from_fn(|i, j| sum(N, |k| a.0[i][k] * p.get(k, j)));
        let next = Self {
            mean: array::from_fn(|i| self.mean[i] + sum(M, |k| gain[i][k] * innovation.residual[k])),
            covariance: Covariance::lower(|i, j| {
                sum(N, |k| ap.0[i][k] * a.0[j][k]) + sum(M, |k| kr.0[i][k] * gain[j][k])
            }),
        };
        let no = T::of(0.0).is_finite().not();
        self.finish(y, &next, ldl.positive, no)?;
        Ok(innovation)
    }

    /// Takes a correction where nothing speaks against it, and names the reason where something does.
    #[inline(always)]
    pub(super) fn finish<const M: usize>(
        &mut self,
        y: &[T; M],
        next: &Self,
        innovation_positive: T::Mask,
        covariance_refused: T::Mask,
    ) -> Result<(), FilterError> {
        let finite_y = y.iter().fold(T::of(0.0).is_finite(), |finite, y| finite.and(y.is_finite()));
        let finite = next.is_finite();
        self.replace(next, finite_y.and(finite).and(innovation_positive).and(covariance_refused.not()));
        Refusal::<T> {
            measurement: finite_y.not(),
            innovation: innovation_positive.not(),
            covariance: covariance_refused,
            state: finite.not(),
        }
        .to_error()
    }
}

/// ln 2π.
const LN_2PI: f64 = 1.837_877_066_409_345_5;

/// The innovation and the factors of its covariance.
#[inline(always)]
pub(super) fn innovation<T: Scalar, const M: usize>(
    y: &[T; M],
    predicted: &[T; M],
    s: Covariance<T, M>,
) -> (Innovation<T, M>, Ldl<T, M>) {
    let residual: [T; M] = array::from_fn(|i| y[i] - predicted[i]);
    let ldl = Ldl::of(&s);
    let weighted = ldl.solve(&residual);
    let nis = sum(M, |i| residual[i] * weighted[i]);
    let constant = T::of(M as f64 * LN_2PI);
    let log_likelihood = -(constant + ldl.ln_det() + nis).half();
    (Innovation { residual, covariance: s, nis, log_likelihood }, ldl)
}

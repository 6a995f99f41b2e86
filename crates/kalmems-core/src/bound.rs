//! The posterior Cramér–Rao bound: the accuracy that no estimator can beat on average.

use crate::linalg::{Ldl, epsilon};
use crate::notation::{lower, matrix, sum, vector};
use crate::{Cholesky, Covariance, FilterError, Mat, Scalar};

/// The bound on the covariance of the state, from sample to sample.
///
/// The recursion of Tichavský, Muravchik and Nehorai (IEEE Trans. Signal Processing 46, 1386, 1998) for
/// x′ = f(x) + w, y = h(x) + v with Gaussian w and v, with the Jacobians F and H at the true states:
///
/// J′ = D₂₂ − D₁₂ᵀ·(J + D₁₁)⁻¹·D₁₂, D₁₁ = E[FᵀQ⁻¹F], D₁₂ = −E\[F\]ᵀQ⁻¹, D₂₂ = Q⁻¹ + E[HᵀR⁻¹H].
///
/// It is held here as the covariance P = J⁻¹. With F̄ = E\[F\] and the spread Σ = D₁₁ − F̄ᵀQ⁻¹F̄ the matrix
/// inversion lemma makes of it, term by term the same,
///
/// P ← (P⁻¹ + Σ)⁻¹, P ← F̄·P·F̄ᵀ + Q, P ← (P⁻¹ + E[HᵀR⁻¹H])⁻¹,
///
/// where only Σ knows the inverse of Q. (P⁻¹ + J)⁻¹ is L·(I + Lᵀ·J·L)⁻¹·Lᵀ with P = L·Lᵀ: no inverse of P
/// either.
///
/// Two forms:
/// - Along one trajectory Σ = 0: [`advance`](Self::advance) and [`observe`](Self::observe) with the Jacobians
///   along the truth. It is the covariance that an extended Kalman filter would state if it were linearised
///   at the truth, for any Q, singular or zero. For a linear system it is the bound, and the Kalman filter
///   attains it. For a nonlinear one without process noise it is the bound for this one trajectory (Taylor,
///   IEEE Trans. Automatic Control 24, 343, 1979); with process noise it is close to that where F changes
///   little within the uncertainty, and no bound in the strict sense.
/// - Over an ensemble of true trajectories: [`advance_mean`](Self::advance_mean) with [`MeanTransition`] and
///   [`observe_mean`](Self::observe_mean) with [`MeanInformation`], averages at the same time over the
///   ensemble. This is the posterior bound. It needs a positive definite Q, noise in every state, and is far
///   below what can be reached where that noise is tiny: such a Q says that a step tells all of the state
///   that made it.
///
/// ```
/// use kalmems_core::bound::CramerRao;
/// use kalmems_core::{Covariance, Mat};
/// // A level that walks at random: the bound is the Kalman filter's variance.
/// let q = Covariance::from_variances([1.0_f64]);
/// let mut bound = CramerRao::new(Covariance::from_variances([1.0]));
/// bound.advance(&Mat([[1.0]]), &q);
/// bound.observe(&Mat([[1.0]]), &Covariance::from_variances([2.0]))?;
/// assert!((bound.covariance().get(0, 0) - 1.0).abs() < 1e-15); // 1/(1/(1 + 1) + 1/2)
/// # Ok::<(), kalmems_core::FilterError>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct CramerRao<T, const N: usize> {
    covariance: Covariance<T, N>,
}

impl<T: Scalar, const N: usize> CramerRao<T, N> {
    /// Starts from the covariance of the true state before anything is measured.
    pub const fn new(prior: Covariance<T, N>) -> Self {
        Self { covariance: prior }
    }

    /// P: no estimator's mean square error is below it.
    pub const fn covariance(&self) -> &Covariance<T, N> {
        &self.covariance
    }

    /// One step along one trajectory: P ← F·P·Fᵀ + Q.
    pub fn advance(&mut self, f: &Mat<T, N, N>, q: &Covariance<T, N>) {
        self.covariance = self.covariance.transformed(f).plus(q);
    }

    /// One measurement along one trajectory, with its Jacobian and noise covariance.
    #[inline(always)]
    pub fn observe<const M: usize>(
        &mut self,
        h: &Mat<T, M, N>,
        r: &Covariance<T, M>,
    ) -> Result<(), FilterError> {
        let mut information = MeanInformation::none();
        information.add(h, r)?;
        self.observe_mean(&information)
    }

    /// One step of an ensemble.
    #[inline(always)]
    pub fn advance_mean(&mut self, steps: &MeanTransition<T, N>) -> Result<(), FilterError> {
        let sharpened = self.informed(&steps.spread)?;
        self.covariance = sharpened.transformed(&steps.mean).plus(&steps.q);
        Ok(())
    }

    /// One measurement of an ensemble.
    #[inline(always)]
    pub fn observe_mean(&mut self, information: &MeanInformation<T, N>) -> Result<(), FilterError> {
        self.covariance = self.informed(&information.mean)?;
        Ok(())
    }

    /// (P⁻¹ + J)⁻¹ = L·(I + Lᵀ·J·L)⁻¹·Lᵀ.
    #[inline(always)]
    fn informed(&self, information: &Covariance<T, N>) -> Result<Covariance<T, N>, FilterError> {
        let l = Cholesky::of_semidefinite(&self.covariance);
        let transposed = matrix!(|i, j| l.0[j][i]);
        let gained = information.transformed(&transposed);
        let ldl = Ldl::of(&gained.plus(&Covariance::from_variances([T::of(1.0); N])));
        let rows: [[T; N]; N] = l.0.map(|row| ldl.decorrelate(&row));
        let next = lower!(|i, j| sum!(N, |k| rows[i][k] * rows[j][k] / ldl.diagonal[k]));
        if ldl.positive & next.is_finite() { Ok(next) } else { Err(FilterError::CovarianceNotPositive) }
    }
}

/// What the steps of an ensemble have in common at one time: E\[F\], and the spread E[(F − E\[F\])ᵀ·Q⁻¹·(F −
/// E\[F\])].
///
/// The spread is summed as deviations from the running mean (Welford's way), not as a difference of large
/// sums.
#[derive(Clone, Copy, Debug)]
pub struct MeanTransition<T: Scalar, const N: usize> {
    q: Covariance<T, N>,
    inverse: Covariance<T, N>,
    count: T,
    mean: Mat<T, N, N>,
    spread: Covariance<T, N>,
}

impl<T: Scalar, const N: usize> MeanTransition<T, N> {
    /// No trajectory yet. Refused where Q is not positive definite, but for rounding.
    pub fn new(q: &Covariance<T, N>) -> Result<Self, FilterError> {
        let ldl = Ldl::of(q);
        // A singular Q has pivots that are rounding, of either sign.
        let rounding = epsilon::<T>() * T::of(64.0 * N as f64);
        let regular = (0..N).all(|i| ldl.diagonal[i].gt(q.get(i, i) * rounding));
        if !(ldl.positive && regular) {
            return Err(FilterError::CovarianceNotPositive);
        }
        let columns: [[T; N]; N] = Mat::<T, N, N>::identity().0.map(|unit| ldl.solve(&unit));
        let inverse = lower!(|i, j| columns[j][i]);
        Ok(Self { q: *q, inverse, count: T::of(0.0), mean: Mat::zero(), spread: Covariance::zero() })
    }

    /// One more trajectory, with the Jacobian of its step at its true state.
    #[inline(always)]
    pub fn add(&mut self, f: &Mat<T, N, N>) {
        let before = self.count;
        self.count = before + T::of(1.0);
        let recip = self.count.recip();
        let deviation = matrix!(|i, j| f.0[i][j] - self.mean.0[i][j]);
        self.mean = self.mean.plus(&deviation.scaled(recip));
        let transposed: Mat<T, N, N> = matrix!(|i, j| deviation.0[j][i]);
        let square = self.inverse.transformed(&transposed);
        self.spread = lower!(|i, j| (self.spread.get(i, j) + square.get(i, j) * recip) * (before * recip));
    }
}

/// E[HᵀR⁻¹H]: what a measurement tells of the state on average over an ensemble.
#[derive(Clone, Copy, Debug)]
pub struct MeanInformation<T, const N: usize> {
    count: T,
    mean: Covariance<T, N>,
}

impl<T: Scalar, const N: usize> MeanInformation<T, N> {
    /// No trajectory yet.
    pub fn none() -> Self {
        Self { count: T::of(0.0), mean: Covariance::zero() }
    }

    /// One more trajectory, with the Jacobian of the measurement at its true state and the noise covariance
    /// there.
    #[inline(always)]
    pub fn add<const M: usize>(&mut self, h: &Mat<T, M, N>, r: &Covariance<T, M>) -> Result<(), FilterError> {
        let noise = Ldl::of(r);
        if !noise.positive {
            return Err(FilterError::InnovationNotPositive);
        }
        self.count = self.count + T::of(1.0);
        let recip = self.count.recip();
        let columns: [[T; M]; N] = vector!(|j| vector!(|m| h.0[m][j]));
        let weighted: [[T; M]; N] = columns.map(|column| noise.solve(&column));
        self.mean = lower!(|i, j| {
            let information = sum!(M, |m| columns[i][m] * weighted[j][m]);
            self.mean.get(i, j) + (information - self.mean.get(i, j)) * recip
        });
        Ok(())
    }
}

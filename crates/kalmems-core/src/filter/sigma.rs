//! Sigma points: what a function makes of a Gaussian.

use crate::linalg::sum;
use crate::{Mat, Scalar};
use core::array;

/// How the sigma points of an unscented filter are spread (van der Merwe's scaled form).
///
/// λ = α²·(n + κ) − n; the centre weighs λ/(n + λ) in the mean, and 1 − α² + β more in the covariance; the
/// others weigh 1/(2(n + λ)) each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SigmaPoints<T> {
    /// The spread around the mean; 1 puts the points where κ alone says.
    pub alpha: T,
    /// What is known of the distribution's tails; 2 is right for a Gaussian.
    pub beta: T,
    /// The second spread; n + κ must be positive.
    pub kappa: T,
}

impl<T: Scalar> SigmaPoints<T> {
    /// α = 1, β = 2, κ = 1: points beyond one standard deviation, all weights positive.
    pub fn standard() -> Self {
        Self { alpha: T::of(1.0), beta: T::of(2.0), kappa: T::of(1.0) }
    }
}

/// The numbers that follow from a choice of [`SigmaPoints`].
#[derive(Clone, Copy, Debug)]
pub(super) struct Weights<T> {
    /// √(n + λ): how many standard deviations out the points lie.
    pub spread: T,
    /// The weight of each outer point.
    pub outer: T,
    /// The weight of the centre in a covariance.
    pub centre: T,
}

impl<T: Scalar> SigmaPoints<T> {
    /// The weights for `N` states.
    #[inline(always)]
    pub(super) fn weights<const N: usize>(&self) -> Weights<T> {
        let n = T::of(N as f64);
        let total = self.alpha.sq() * (n + self.kappa);
        Weights {
            spread: total.sqrt(),
            outer: total.twice().recip(),
            centre: T::of(1.0) - n / total + T::of(1.0) - self.alpha.sq() + self.beta,
        }
    }
}

/// What a function makes of the centre and of the pairs around it.
pub(super) struct Points<T, const N: usize, const K: usize> {
    pub centre: [T; K],
    pub plus: [[T; K]; N],
    pub minus: [[T; K]; N],
}

impl<T: Scalar, const N: usize> Points<T, N, N> {
    /// The points themselves.
    #[inline(always)]
    pub fn around(x: &[T; N], offsets: &[[T; N]; N]) -> Self {
        Self {
            centre: *x,
            plus: array::from_fn(|j| array::from_fn(|i| x[i] + offsets[j][i])),
            minus: array::from_fn(|j| array::from_fn(|i| x[i] - offsets[j][i])),
        }
    }
}

impl<T: Scalar, const N: usize, const K: usize> Points<T, N, K> {
    /// What a function makes of them.
    #[inline(always)]
    pub fn through(x: &[T; N], offsets: &[[T; N]; N], f: impl Fn(&[T; N]) -> [T; K]) -> Self {
        Self {
            centre: f(x),
            plus: array::from_fn(|j| f(&array::from_fn(|i| x[i] + offsets[j][i]))),
            minus: array::from_fn(|j| f(&array::from_fn(|i| x[i] - offsets[j][i]))),
        }
    }
}

impl<T: Scalar> Weights<T> {
    /// How far out the points lie: the scaled columns of a factor.
    #[inline(always)]
    pub fn offsets<const N: usize>(&self, factor: &Mat<T, N, N>) -> [[T; N]; N] {
        array::from_fn(|j| array::from_fn(|i| factor.0[i][j] * self.spread))
    }

    /// The weighted mean, as a correction to the centre: exact to rounding however large the weights are.
    #[inline(always)]
    pub fn mean<const N: usize, const K: usize>(&self, points: &Points<T, N, K>) -> [T; K] {
        let c = &points.centre;
        array::from_fn(|i| {
            c[i] + sum(N, |j| (points.plus[j][i] - c[i]) + (points.minus[j][i] - c[i])) * self.outer
        })
    }

    /// Weighted sums of products of deviations: covariances and cross-covariances.
    #[inline(always)]
    pub fn moment<const N: usize, const A: usize, const B: usize>(
        &self,
        (a, a_mean): (&Points<T, N, A>, &[T; A]),
        (b, b_mean): (&Points<T, N, B>, &[T; B]),
        (i, k): (usize, usize),
    ) -> T {
        let centre = (a.centre[i] - a_mean[i]) * (b.centre[k] - b_mean[k]) * self.centre;
        centre
            + sum(N, |j| {
                ((a.plus[j][i] - a_mean[i]) * (b.plus[j][k] - b_mean[k]))
                    .mac(a.minus[j][i] - a_mean[i], b.minus[j][k] - b_mean[k])
            }) * self.outer
    }
}

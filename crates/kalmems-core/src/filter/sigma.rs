//! Sigma points: what a function makes of a Gaussian.

use crate::linalg::unrolled;
use crate::notation::{sum, vector};
use crate::{Mat, NumericMeasurement, NumericProcess, Scalar};

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
    #[inline(always)]
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

/// How far each pair of points lies from the centre: the scaled columns of a lower triangular factor. Column `j`
/// moves the states from `j` on, and is neither read nor added above.
pub(super) struct Offsets<T, const N: usize>([[T; N]; N]);

impl<T: Scalar, const N: usize> Offsets<T, N> {
    /// x plus column `j`.
    #[inline(always)]
    fn above(&self, x: &[T; N], j: usize) -> [T; N] {
        vector!(|i| if i < j { x[i] } else { x[i] + self.0[j][i] })
    }

    /// x less column `j`.
    #[inline(always)]
    fn below(&self, x: &[T; N], j: usize) -> [T; N] {
        vector!(|i| if i < j { x[i] } else { x[i] - self.0[j][i] })
    }

    /// Where each point goes in one step.
    #[inline(always)]
    pub fn step<P: NumericProcess<T, N>>(
        &self,
        x: &[T; N],
        process: &P,
        u: &P::Input,
    ) -> PerSigmaPoint<T, N, N> {
        let centre = process.moved(x, u);
        let mut points = PerSigmaPoint { centre, plus: [centre; N], minus: [centre; N] };
        unrolled!(j < N {
            points.plus[j] = process.moved(&self.above(x, j), u);
            points.minus[j] = process.moved(&self.below(x, j), u);
        });
        points
    }

    /// What a sensor reads at each point. A pair that moves no state the sensor sees reads what the centre reads.
    #[inline(always)]
    pub fn read<H: NumericMeasurement<T, N, M>, const M: usize>(
        &self,
        x: &[T; N],
        measurement: &H,
    ) -> PerSigmaPoint<T, N, M> {
        let centre = measurement.expected(x);
        let mut points = PerSigmaPoint { centre, plus: [centre; N], minus: [centre; N] };
        unrolled!(j < N {
            if sees::<T, H, N, M>(j) {
                points.plus[j] = measurement.expected(&self.above(x, j));
                points.minus[j] = measurement.expected(&self.below(x, j));
            }
        });
        points
    }

    /// What deviations are left when a linear law F of the offsets is taken from them.
    #[inline(always)]
    pub fn unexplained<const K: usize>(
        &self,
        d: &PerSigmaPoint<T, N, K>,
        f: &Mat<T, K, N>,
    ) -> PerSigmaPoint<T, N, K> {
        PerSigmaPoint {
            centre: d.centre,
            plus: vector!(|j| vector!(|i| d.plus[j][i] - self.through(f, i, j))),
            minus: vector!(|j| vector!(|i| d.minus[j][i] + self.through(f, i, j))),
        }
    }

    /// Component `i` of F times column `j`.
    #[inline(always)]
    fn through<const K: usize>(&self, f: &Mat<T, K, N>, i: usize, j: usize) -> T {
        sum!(N, |k| k >= j, |k| f.0[i][k] * self.0[j][k])
    }

    /// The deviations of the points themselves, less what a gain explains of them by those seen.
    #[inline(always)]
    pub fn corrected<const M: usize>(
        &self,
        seen: &PerSigmaPoint<T, N, M>,
        gain: &Mat<T, N, M>,
    ) -> PerSigmaPoint<T, N, N> {
        let (plus, minus) = (&seen.plus, &seen.minus);
        PerSigmaPoint {
            centre: vector!(|i| -along(gain, i, &seen.centre)),
            plus: vector!(|j| vector!(|i| {
                let rest = along(gain, i, &plus[j]);
                if i < j { -rest } else { self.0[j][i] - rest }
            })),
            minus: vector!(|j| vector!(|i| {
                let rest = along(gain, i, &minus[j]);
                if i < j { -rest } else { -self.0[j][i] - rest }
            })),
        }
    }
}

/// Row `i` of a gain times a deviation.
#[inline(always)]
fn along<T: Scalar, const N: usize, const M: usize>(gain: &Mat<T, N, M>, i: usize, d: &[T; M]) -> T {
    sum!(M, |k| gain.0[i][k] * d[k])
}

/// Whether a measurement sees what column `j` of a lower triangular factor moves.
#[inline(always)]
pub(super) fn sees<T: Scalar, H: NumericMeasurement<T, N, M>, const N: usize, const M: usize>(
    j: usize,
) -> bool {
    (0..M).any(|m| (j..N).any(|i| H::sees(m, i)))
}

/// Something of every sigma point: of the centre, and of the pairs around it.
pub(super) struct PerSigmaPoint<T, const N: usize, const K: usize> {
    pub centre: [T; K],
    pub plus: [[T; K]; N],
    pub minus: [[T; K]; N],
}

impl<T: Scalar, const N: usize, const K: usize> PerSigmaPoint<T, N, K> {
    /// The points' deviations from a mean.
    #[inline(always)]
    pub fn deviations(&self, mean: &[T; K]) -> Self {
        Self {
            centre: vector!(|i| self.centre[i] - mean[i]),
            plus: vector!(|j| vector!(|i| self.plus[j][i] - mean[i])),
            minus: vector!(|j| vector!(|i| self.minus[j][i] - mean[i])),
        }
    }
}

impl<T: Scalar> Weights<T> {
    /// The points' offsets, from a lower triangular factor of the covariance.
    #[inline(always)]
    pub fn offsets<const N: usize>(&self, factor: &Mat<T, N, N>) -> Offsets<T, N> {
        Offsets(vector!(|j| { vector!(|i| if i < j { T::of(0.0) } else { factor.0[i][j] * self.spread }) }))
    }

    /// The weighted mean, as a correction to the centre: exact to rounding however large the weights are. Pairs
    /// that have not moved are passed over.
    #[inline(always)]
    pub fn mean<const N: usize, const K: usize>(
        &self,
        points: &PerSigmaPoint<T, N, K>,
        moved: impl Fn(usize) -> bool,
    ) -> [T; K] {
        let c = &points.centre;
        vector!(|i| {
            let pairs = sum!(N, |j| moved(j), |j| (points.plus[j][i] - c[i]) + (points.minus[j][i] - c[i]));
            c[i] + pairs * self.outer
        })
    }

    /// The weighted sum of products of two components' deviations: one entry of a covariance.
    #[inline(always)]
    pub fn moment<const N: usize, const K: usize>(
        &self,
        d: &PerSigmaPoint<T, N, K>,
        (i, k): (usize, usize),
    ) -> T {
        let pairs = sum!(N, |j| (d.plus[j][i] * d.plus[j][k]).mac(d.minus[j][i], d.minus[j][k]));
        (d.centre[i] * d.centre[k] * self.centre).mac(pairs, self.outer)
    }

    /// The covariance of state `i` with what deviates by `d` in component `k`. The centre does not deviate, and
    /// its pairs do by the offsets.
    #[inline(always)]
    pub fn cross<const N: usize, const K: usize>(
        &self,
        offsets: &Offsets<T, N>,
        d: &PerSigmaPoint<T, N, K>,
        (i, k): (usize, usize),
        moved: impl Fn(usize) -> bool,
    ) -> T {
        sum!(i + 1, |j| moved(j), |j| offsets.0[j][i] * (d.plus[j][k] - d.minus[j][k])) * self.outer
    }
}

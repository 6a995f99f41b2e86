//! The unscented Kalman filter.

use super::gaussian::Refusal;
use super::{Filter, Gaussian, Innovation, Link};
use crate::linalg::{Ldl, sum};
use crate::update::{Correction, Policy};
use crate::{Cholesky, Covariance, FilterError, Mask, Mat, Measurement, Process, Scalar};
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

/// The unscented Kalman filter with additive noise: sigma points through the models, no Jacobian.
///
/// The points are drawn anew from the predicted mean and covariance before an update. Without that, process
/// noise would be missing from them, and on a linear system the filter would differ from the Kalman filter.
///
/// ```
/// use kalmems_core::{Covariance, Filter, LinearMeasurement, LinearProcess, Mat, SigmaPoints, Ukf};
/// let walk = LinearProcess::<f64, 1, 0> {
///     transition: Mat::identity(),
///     input: Mat::zero(),
///     noise: Covariance::from_variances([1.0]).into(),
/// };
/// let level = LinearMeasurement { matrix: Mat([[1.0]]) };
/// let mut filter = Ukf::new([0.0], Covariance::from_variances([1.0]), SigmaPoints::standard());
/// filter.predict(&walk, &[])?;
/// let innovation = filter.update(&level, &[2.0], &Covariance::from_variances([2.0]))?;
/// assert!((innovation.nis - 1.0).abs() < 1e-15);
/// # Ok::<(), kalmems_core::FilterError>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Ukf<T, const N: usize> {
    state: Gaussian<T, N>,
    /// √(n + λ): how many standard deviations out the points lie.
    spread: T,
    /// The weight of each outer point.
    outer: T,
    /// The weight of the centre in a covariance.
    centre: T,
}

/// What a function makes of the centre and of the pairs around it.
struct Points<T, const N: usize, const K: usize> {
    centre: [T; K],
    plus: [[T; K]; N],
    minus: [[T; K]; N],
}

impl<T: Scalar, const N: usize> Ukf<T, N> {
    /// Starts from a mean and its covariance.
    pub fn new(mean: [T; N], covariance: Covariance<T, N>, points: SigmaPoints<T>) -> Self {
        let n = T::of(N as f64);
        let total = points.alpha.sq() * (n + points.kappa);
        let outer = total.twice().recip();
        Self {
            state: Gaussian { mean, covariance },
            spread: total.sqrt(),
            outer,
            centre: T::of(1.0) - n / total + T::of(1.0) - points.alpha.sq() + points.beta,
        }
    }

    /// The columns of the scaled Cholesky factor, and whether there is one.
    #[inline(always)]
    fn offsets(&self) -> ([[T; N]; N], T::Mask) {
        let cholesky = Cholesky::of(&self.state.covariance);
        let l = &cholesky.factor;
        (array::from_fn(|j| array::from_fn(|i| l.0[i][j] * self.spread)), cholesky.positive)
    }

    /// The points themselves.
    #[inline(always)]
    fn around(x: &[T; N], offsets: &[[T; N]; N]) -> Points<T, N, N> {
        Points {
            centre: *x,
            plus: array::from_fn(|j| array::from_fn(|i| x[i] + offsets[j][i])),
            minus: array::from_fn(|j| array::from_fn(|i| x[i] - offsets[j][i])),
        }
    }

    /// What a function makes of them.
    #[inline(always)]
    fn through<const K: usize>(
        &self,
        offsets: &[[T; N]; N],
        f: impl Fn(&[T; N]) -> [T; K],
    ) -> Points<T, N, K> {
        let x = &self.state.mean;
        Points {
            centre: f(x),
            plus: array::from_fn(|j| f(&array::from_fn(|i| x[i] + offsets[j][i]))),
            minus: array::from_fn(|j| f(&array::from_fn(|i| x[i] - offsets[j][i]))),
        }
    }

    /// The weighted mean, as a correction to the centre: exact to rounding however large the weights are.
    #[inline(always)]
    fn mean_of<const K: usize>(&self, points: &Points<T, N, K>) -> [T; K] {
        let c = &points.centre;
        array::from_fn(|i| {
            c[i] + sum(N, |j| (points.plus[j][i] - c[i]) + (points.minus[j][i] - c[i])) * self.outer
        })
    }

    /// Weighted sums of products of deviations: covariances and cross-covariances.
    #[inline(always)]
    fn moment<const A: usize, const B: usize>(
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

impl<T: Scalar, const N: usize> Filter<T, N> for Ukf<T, N> {
    /// The mean of the state.
    #[inline(always)]
    fn mean(&self) -> &[T; N] {
        &self.state.mean
    }

    /// The covariance of the state.
    #[inline(always)]
    fn covariance(&self) -> Covariance<T, N> {
        self.state.covariance
    }

    #[inline(always)]
    fn predict_linked<P: Process<T, N>>(
        &mut self,
        process: &P,
        u: &P::Input,
    ) -> Result<Link<T, N>, FilterError> {
        let before = self.state.covariance;
        let x = self.state.mean;
        let (offsets, positive) = self.offsets();
        let points = self.through(&offsets, |x| process.step(x, u));
        let mean = self.mean_of(&points);
        let q = process.noise().covariance();
        let next = Gaussian {
            mean,
            covariance: Covariance::lower(|i, k| {
                self.moment((&points, &mean), (&points, &mean), (i, k)) + q.get(i, k)
            }),
        };
        let taken = self.state.accept(&next, &Refusal { covariance: positive.not(), ..Refusal::none() })?;

        // The regression of the new state on the old: F = Cov(x′, x)·P⁻¹.
        let sources = Self::around(&x, &offsets);
        let ldl = Ldl::of(&before);
        let transition = Mat(array::from_fn(|i| {
            ldl.solve(&array::from_fn(|k| self.moment((&points, &mean), (&sources, &x), (i, k))))
        }));
        // Ω from what the regression leaves at each point: a sum of squares, where the difference P⁻ − F·P·Fᵀ
        // would leave rounding of the size of P⁻ in place of a small Ω.
        let left = |to: &[T; N], offset: &dyn Fn(usize) -> T| -> [T; N] {
            array::from_fn(|i| to[i] - mean[i] - sum(N, |k| transition.0[i][k] * offset(k)))
        };
        let residuals = Points {
            centre: left(&points.centre, &|_| T::of(0.0)),
            plus: array::from_fn(|j| left(&points.plus[j], &|k| offsets[j][k])),
            minus: array::from_fn(|j| left(&points.minus[j], &|k| -offsets[j][k])),
        };
        let zero = [T::of(0.0); N];
        let noise = Covariance::lower(|i, k| {
            self.moment((&residuals, &zero), (&residuals, &zero), (i, k)) + q.get(i, k)
        });
        Ok(Link { transition, noise, taken })
    }

    /// The covariance is summed from the corrected points, P⁺ = Σ w·(δx − K·δy)(δx − K·δy)ᵀ + K·R·Kᵀ: the same
    /// as P − K·S·Kᵀ, but positive semi-definite by construction.
    #[inline(always)]
    fn update_where<H: Measurement<T, N, M>, const M: usize>(
        &mut self,
        measurement: &H,
        y: &[T; M],
        r: &Covariance<T, M>,
        policy: &impl Policy<T, N>,
    ) -> Result<Innovation<T, M>, FilterError> {
        let (offsets, positive) = self.offsets();
        let x = self.state.mean;
        let xs = Self::around(&x, &offsets);
        let ys = self.through(&offsets, |x| measurement.predict(x));
        let predicted = self.mean_of(&ys);
        let s =
            Covariance::lower(|i, k| self.moment((&ys, &predicted), (&ys, &predicted), (i, k)) + r.get(i, k));
        let (mut innovation, ldl) = Innovation::new(y, &predicted, s);
        let gain: [[T; M]; N] = array::from_fn(|i| {
            ldl.solve(&array::from_fn(|k| self.moment((&xs, &x), (&ys, &predicted), (i, k))))
        });
        let correction = Correction {
            change: array::from_fn(|i| sum(M, |k| gain[i][k] * innovation.residual[k])),
            variance: array::from_fn(|i| self.state.covariance.get(i, i)),
        };
        let wanted = policy.take(&innovation, &correction);
        let refused = Refusal {
            innovation: ldl.positive.not(),
            covariance: positive.not(),
            ..Refusal::of_measurement(y)
        };
        if !wanted.and(refused.mask().not()).any() {
            innovation.taken = wanted.and(refused.mask().not());
            return refused.to_error().map(|()| innovation);
        }

        let zero = [T::of(0.0); N];
        let corrected = |xs: &[T; N], ys: &[T; M]| -> [T; N] {
            array::from_fn(|i| xs[i] - x[i] - sum(M, |k| gain[i][k] * (ys[k] - predicted[k])))
        };
        let deviations = Points {
            centre: corrected(&xs.centre, &ys.centre),
            plus: array::from_fn(|j| corrected(&xs.plus[j], &ys.plus[j])),
            minus: array::from_fn(|j| corrected(&xs.minus[j], &ys.minus[j])),
        };
        let kr: [[T; M]; N] = array::from_fn(|i| array::from_fn(|j| sum(M, |k| gain[i][k] * r.get(k, j))));
        let next = Gaussian {
            mean: array::from_fn(|i| x[i] + correction.change[i]),
            covariance: Covariance::lower(|i, k| {
                self.moment((&deviations, &zero), (&deviations, &zero), (i, k))
                    + sum(M, |l| kr[i][l] * gain[k][l])
            }),
        };
        innovation.taken = self.state.finish(&next, wanted, &refused)?;
        Ok(innovation)
    }
}

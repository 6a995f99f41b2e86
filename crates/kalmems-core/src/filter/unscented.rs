//! The unscented Kalman filter.

use super::gaussian::Refusal;
use super::linearized::held_state;
use super::sigma::{Offsets, PerSigmaPoint, SigmaPoints, Weights, sees};
use super::{Filter, Gaussian, Innovation, StateTransition};
use crate::linalg::{Ldl, Semidefinite, epsilon, times_inverse};
use crate::notation::{lower, matrix, sum, vector};
use crate::update::{Correction, Policy};
use crate::{Cholesky, Covariance, FilterError, Mat, NumericMeasurement, NumericProcess, Scalar};

/// The unscented Kalman filter with additive noise: sigma points through the models, no Jacobian.
///
/// The points are drawn anew from the predicted mean and covariance before an update. Without that, process
/// noise would be missing from them, and on a linear system the filter would differ from the Kalman filter. The covariance may be singular.
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
    weights: Weights<T>,
}

impl<T: Scalar, const N: usize> Ukf<T, N> {
    /// Starts from a mean and its covariance.
    pub fn new(mean: [T; N], covariance: Covariance<T, N>, points: SigmaPoints<T>) -> Self {
        Self { state: Gaussian { mean, covariance }, weights: points.weights::<N>() }
    }

    /// How far the points lie out, whether there are such, and the factor of a covariance that is singular.
    #[inline(always)]
    fn offsets(&self) -> (Offsets<T, N>, bool, Option<Mat<T, N, N>>) {
        let cholesky = Cholesky::of(&self.state.covariance);
        if cholesky.positive {
            return (self.weights.offsets(&cholesky.factor), true, None);
        }
        let (root, is_one) = self.root_of_singular();
        (self.weights.offsets(&root), is_one, Some(root))
    }

    /// The factor L of a covariance that is singular to rounding, and whether it is one: L·Lᵀ must be the covariance again.
    #[cold]
    #[inline(never)]
    fn root_of_singular(&self) -> (Mat<T, N, N>, bool) {
        let p = &self.state.covariance;
        let Semidefinite { root, mut sound } = Semidefinite::of(p);
        let rounding = (epsilon::<T>() * T::of(64.0 * N as f64)).sq();
        let again = root.times_transposed(&root);
        let beyond: Mat<T, N, N> =
            matrix!(|i, j| { (again.0[i][j] - p.get(i, j)).sq() - rounding * p.get(i, i) * p.get(j, j) });
        for beyond in beyond.0.iter().flatten() {
            sound &= !beyond.gt(T::of(0.0));
        }
        (root, sound)
    }

    /// The regression of the new state on an old one whose covariance L·Lᵀ is singular, from the differences of pairs of points; zero along what was known.
    #[cold]
    #[inline(never)]
    fn regression_of_singular(
        &self,
        deviations: &PerSigmaPoint<T, N, N>,
        factor: &Mat<T, N, N>,
    ) -> Mat<T, N, N> {
        let part = (self.weights.spread.twice()).recip();
        let differences = matrix!(|i, j| (deviations.plus[j][i] - deviations.minus[j][i]) * part);
        times_inverse(&differences, factor)
    }
}

impl<T: Scalar, const N: usize> Filter<T, N> for Ukf<T, N> {
    held_state!(covariance);

    #[inline(always)]
    fn predict_linked<P: NumericProcess<T, N>>(
        &mut self,
        process: &P,
        u: &P::Input,
    ) -> Result<StateTransition<T, N>, FilterError> {
        let before = self.state.covariance;
        let (offsets, positive, singular) = self.offsets();
        let points = offsets.step(&self.state.mean, process, u);
        let mean = self.weights.mean(&points, |_| true);
        let deviations = points.deviations(&mean);
        let q = process.noise_added().covariance();
        let next = Gaussian {
            mean,
            covariance: lower!(|i, k| self.weights.moment(&deviations, (i, k)) + q.get(i, k)),
        };
        self.state.accept(&next, Refusal { covariance: !positive, ..Refusal::none() })?;

        // The regression of the new state on the old: F = Cov(x′, x)·P⁻¹.
        let transition = if let Some(factor) = singular {
            self.regression_of_singular(&deviations, &factor)
        } else {
            let ldl = Ldl::of(&before);
            Mat(vector!(|i| {
                ldl.solve(&vector!(|k| self.weights.cross(&offsets, &deviations, (k, i), |_| true)))
            }))
        };
        // Ω from what the regression leaves at each point: a sum of squares, where the difference P⁻ − F·P·Fᵀ
        // would leave rounding of the size of P⁻ in place of a small Ω.
        let residuals = offsets.unexplained(&deviations, &transition);
        let noise = lower!(|i, k| self.weights.moment(&residuals, (i, k)) + q.get(i, k));
        Ok(StateTransition { transition, noise })
    }

    /// The covariance is summed from the corrected points, P⁺ = Σ w·(δx − K·δy)(δx − K·δy)ᵀ + K·R·Kᵀ: the same
    /// as P − K·S·Kᵀ, but positive semi-definite by construction.
    #[inline(always)]
    fn update_where<H: NumericMeasurement<T, N, M>, const M: usize>(
        &mut self,
        measurement: &H,
        y: &[T; M],
        r: &Covariance<T, M>,
        policy: &impl Policy<T, N>,
    ) -> Result<Innovation<T, M>, FilterError> {
        let (offsets, positive, _) = self.offsets();
        let x = self.state.mean;
        let points = offsets.read::<H, M>(&x, measurement);
        let predicted = self.weights.mean(&points, sees::<T, H, N, M>);
        let seen = points.deviations(&predicted);
        let s = lower!(|i, k| self.weights.moment(&seen, (i, k)) + r.get(i, k));
        let (mut innovation, ldl) = Innovation::new(y, &predicted, s);
        let gain: Mat<T, N, M> = Mat(vector!(|i| {
            let cross = vector!(|k| self.weights.cross(&offsets, &seen, (i, k), sees::<T, H, N, M>));
            ldl.solve(&cross)
        }));
        let correction = Correction {
            change: vector!(|i| sum!(M, |k| gain.0[i][k] * innovation.residual[k])),
            variance: vector!(|i| self.state.covariance.get(i, i)),
        };
        let wanted = policy.take(&innovation, &correction);
        let refused =
            Refusal { innovation: !ldl.positive, covariance: !positive, ..Refusal::of_measurement(y) };
        refused.to_error()?;
        innovation.taken = wanted;
        if !wanted {
            return Ok(innovation);
        }

        let deviations = offsets.corrected(&seen, &gain);
        let kr: Mat<T, N, M> = matrix!(|i, j| sum!(M, |k| gain.0[i][k] * r.get(k, j)));
        let next = Gaussian {
            mean: vector!(|i| x[i] + correction.change[i]),
            covariance: lower!(|i, k| {
                self.weights.moment(&deviations, (i, k)) + sum!(M, |l| kr.0[i][l] * gain.0[k][l])
            }),
        };
        self.state.accept(&next, refused)?;
        Ok(innovation)
    }
}

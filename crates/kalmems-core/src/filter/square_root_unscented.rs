//! The unscented Kalman filter in square-root form.

use super::factored::Factored;
use super::gaussian::Refusal;
use super::linearized::held_state;
use super::sigma::{PerSigmaPoint, SigmaPoints, Weights};
use super::square_root::sees;
use super::{Filter, Innovation, StateTransition};
use crate::linalg::{Contraction, Decorrelation, inverse_times, times_inverse, triangularize};
use crate::notation::{lower, matrix, sum, vector};
use crate::update::Policy;
use crate::{Covariance, FilterError, Mat, NumericMeasurement, NumericProcess, Scalar};

/// The unscented Kalman filter that holds a factor of its covariance instead: P = S·Sᵀ, S lower triangular.
///
/// The same points and weights as the [`Ukf`](crate::Ukf), and the same answer to rounding. What a function
/// makes of the points is taken apart into the differences of each pair, o_j = √(w/2)·(y⁺_j − y⁻_j), and their
/// bends, e_j = √(w/2)·(y⁺_j + y⁻_j − 2·y_0). Then
///
/// Σ w·(y − ȳ)(y − ȳ)ᵀ = Σ o_j·o_jᵀ + Σ e_j·e_jᵀ + 2w·(β − α²)·(Σ e_j)(Σ e_j)ᵀ
///
/// without the weight of the centre, whose size −n/α² costs digits where α is small. The last term is drawn into
/// the bends, e_j + γ·Σ e, unless β < −α²·κ/n; only then it takes something away, and a step in which that
/// cannot be done is refused with [`CovarianceNotPositive`](FilterError::CovarianceNotPositive).
///
/// A step makes [o, e, W] triangular. A measurement sees the state through its differences o, which are what
/// H·S is to the extended filter, and its bends add to R; the correction is that of
/// [`SquareRootEkf`](crate::SquareRootEkf). The covariance may be singular. R must be positive semi-definite
/// by itself.
///
/// The idea of a square-root unscented filter is van der Merwe's and Wan's (ICASSP 2001); theirs takes the
/// correction out by downdates.
///
/// ```
/// use kalmems_core::{Covariance, Filter, LinearMeasurement, Mat, SigmaPoints, SquareRootUkf};
/// let start = Covariance::from_variances([1e14_f32]);
/// let mut filter = SquareRootUkf::new([0.0], start, SigmaPoints::standard());
/// let level = LinearMeasurement { matrix: Mat([[1.0]]) };
/// filter.update(&level, &[3.0], &Covariance::from_variances([1.0]))?;
/// assert!((filter.factor()[(0, 0)] - 1.0).abs() < 1e-6);
/// # Ok::<(), kalmems_core::FilterError>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct SquareRootUkf<T, const N: usize> {
    state: Factored<T, N>,
    weights: Weights<T>,
    /// √(w/2).
    root: T,
    /// γ: how much of Σ e is added to each bend.
    shared: T,
    /// What is taken away beside: the root of the factor of (Σ e)(Σ e)ᵀ; zero in all but odd choices of points.
    removed: T,
}

/// What a function makes of the points: its mean, and the columns of a factor of its covariance.
struct TransformedPoints<T, const N: usize, const K: usize> {
    mean: [T; K],
    /// o, one column for each pair.
    differences: Mat<T, K, N>,
    /// e + γ·Σ e.
    bends: Mat<T, K, N>,
    /// What is taken away.
    removed: [T; K],
}

impl<T: Scalar, const N: usize> SquareRootUkf<T, N> {
    /// Starts from a mean and its covariance, which may be singular.
    #[inline(always)]
    pub fn new(mean: [T; N], covariance: Covariance<T, N>, points: SigmaPoints<T>) -> Self {
        Self::with(Factored::of_covariance(mean, &covariance), points)
    }

    /// Starts from a mean and a root A of its covariance A·Aᵀ, triangular or not.
    pub fn from_factor(mean: [T; N], root: &Mat<T, N, N>, points: SigmaPoints<T>) -> Self {
        Self::with(Factored::of_root(mean, root), points)
    }

    fn with(state: Factored<T, N>, points: SigmaPoints<T>) -> Self {
        let zero = T::of(0.0);
        let n = T::of(N as f64);
        let weights = points.weights::<N>();
        // I + c·1·1ᵀ = (I + γ·1·1ᵀ)² needs 1 + c·n ≥ 0; what is missing there is removed.
        let along = T::of(1.0) + (points.beta - points.alpha.sq()) * weights.outer.twice() * n;
        let short = along.lt(zero);
        Self {
            state,
            weights,
            root: weights.outer.half().sqrt(),
            shared: (T::select(short, zero, along).sqrt() - T::of(1.0)) / n,
            removed: (T::select(short, -along, zero) / n).sqrt(),
        }
    }

    /// S: lower triangular, not negative on its diagonal.
    #[inline(always)]
    pub const fn factor(&self) -> &Mat<T, N, N> {
        &self.state.factor
    }

    #[inline(always)]
    fn spread<const K: usize>(&self, points: &PerSigmaPoint<T, N, K>) -> TransformedPoints<T, N, K> {
        let c = &points.centre;
        let bends: Mat<T, K, N> =
            matrix!(|i, j| ((points.plus[j][i] - c[i]) + (points.minus[j][i] - c[i])) * self.root);
        let all: [T; K] = vector!(|i| sum!(N, |j| bends.0[i][j]));
        TransformedPoints {
            mean: self.weights.mean(points, |_| true),
            differences: matrix!(|i, j| (points.plus[j][i] - points.minus[j][i]) * self.root),
            bends: matrix!(|i, j| bends.0[i][j] + all[i] * self.shared),
            removed: vector!(|i| all[i] * self.removed),
        }
    }

    /// Whether anything is taken away.
    #[inline(always)]
    fn removes(&self) -> bool {
        self.removed.gt(T::of(0.0))
    }
}

impl<T: Scalar, const N: usize> Filter<T, N> for SquareRootUkf<T, N> {
    held_state!(covariance());

    #[inline(always)]
    fn predict_linked<P: NumericProcess<T, N>>(
        &mut self,
        process: &P,
        u: &P::Input,
    ) -> Result<StateTransition<T, N>, FilterError> {
        let offsets = self.weights.offsets(&self.state.factor);
        let next = self.spread(&offsets.step(&self.state.mean, process, u));
        let noise = process.noise_added();
        let mut factor = triangularize(next.differences, next.bends, *noise.root());
        let mut refused = Refusal::none();
        if self.removes() {
            // P − v·vᵀ = L·(I − z·zᵀ)·Lᵀ with z = L⁻¹·v, possible where zᵀ·z < 1.
            let z = inverse_times(&factor, &next.removed);
            let left = T::of(1.0) - sum!(N, |k| z[k].sq());
            refused.covariance = !left.gt(T::of(0.0)) & next.finite();
            factor = Contraction::new(z, left, |_| true).applied(factor, |_| true, |i, j| i >= j);
        }

        // The regression of the new state on the old, Cov(x′, x)·P⁻¹ = o·Sᵀ·(S·Sᵀ)⁻¹, leaves the bends.
        let link = StateTransition {
            transition: times_inverse(&next.differences, &self.state.factor),
            noise: lower!(|i, k| next.bent(i, k) + noise.covariance().get(i, k)),
        };
        let state = Factored { mean: next.mean, factor };
        self.state.take(&state, refused)?;
        Ok(link)
    }

    #[inline(always)]
    fn update_where<H: NumericMeasurement<T, N, M>, const M: usize>(
        &mut self,
        measurement: &H,
        y: &[T; M],
        r: &Covariance<T, M>,
        policy: &impl Policy<T, N>,
    ) -> Result<Innovation<T, M>, FilterError> {
        let offsets = self.weights.offsets(&self.state.factor);
        let seen = self.spread(&offsets.read::<H, M>(&self.state.mean, measurement));
        let noise = lower!(|i, k| seen.bent(i, k) + r.get(i, k));
        let apart = Decorrelation::of(&noise);
        let own = Decorrelation::of(r).semidefinite;
        let refused = Refusal {
            innovation: !own,
            covariance: own && !apart.semidefinite & seen.finite(),
            ..Refusal::none()
        };
        self.state.correct(
            (y, &seen.mean),
            &seen.differences,
            sees::<T, H, N, M>,
            (&noise, &apart),
            policy,
            refused,
        )
    }
}

impl<T: Scalar, const N: usize, const K: usize> TransformedPoints<T, N, K> {
    /// What the bends add to the covariance.
    #[inline(always)]
    fn bent(&self, i: usize, k: usize) -> T {
        sum!(N, |j| self.bends.0[i][j] * self.bends.0[k][j]) - self.removed[i] * self.removed[k]
    }

    /// Where the function was finite at every point.
    #[inline(always)]
    fn finite(&self) -> bool {
        self.differences.is_finite() & self.bends.is_finite()
    }
}

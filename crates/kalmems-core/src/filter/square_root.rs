//! The extended Kalman filter in square-root form.

use super::factored::Factored;
use super::gaussian::Refusal;
use super::linearized::held_state;
use super::{Filter, Innovation, StateTransition};
use crate::linalg::{Decorrelation, triangularize};
use crate::notation::{matrix, sum};
use crate::update::Policy;
use crate::{Covariance, FilterError, Mat, NumericMeasurement, NumericProcess, Scalar};

/// The extended Kalman filter that holds a factor of its covariance instead: P = S·Sᵀ, S lower triangular.
///
/// It is the [`Ekf`](crate::Ekf), and on linear models the Kalman filter, to rounding. But a factor needs half
/// the digits that a covariance needs, and its product with itself cannot lose definiteness: where a start is
/// vague by 10¹⁴ against a measurement's variance, `f32` still serves.
///
/// - A step makes [Φ·S, W] triangular, with Q = W·Wᵀ, by rotations (Givens). Reflections or orthogonalisation
///   need fewer square roots, but lose what is small beside what is large.
/// - A correction makes [[√R, H·S], [0, S]] triangular by rotations in Carlson's form (AIAA Journal 11, 1259,
///   1973): a component of the measurement costs one square root and one division for each column of S it sees,
///   none for √R. It sees column j if it depends on a state i ≥ j: put the states that are measured first.
///
/// [`NonFiniteState`](FilterError::NonFiniteState), [`NonFiniteMeasurement`](FilterError::NonFiniteMeasurement) and
/// [`InnovationNotPositive`](FilterError::InnovationNotPositive) are refused; R must be positive semi-definite
/// by itself, since it must have a root.
///
/// ```
/// use kalmems_core::{Covariance, Filter, LinearMeasurement, Mat, SquareRootEkf};
/// let mut filter = SquareRootEkf::new([0.0_f32], Covariance::from_variances([1e14]));
/// let level = LinearMeasurement { matrix: Mat([[1.0]]) };
/// filter.update(&level, &[3.0], &Covariance::from_variances([1.0]))?;
/// assert!((filter.factor()[(0, 0)] - 1.0).abs() < 1e-6);
/// # Ok::<(), kalmems_core::FilterError>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct SquareRootEkf<T, const N: usize> {
    state: Factored<T, N>,
}

impl<T: Scalar, const N: usize> SquareRootEkf<T, N> {
    /// Starts from a mean and its covariance, which may be singular.
    #[inline(always)]
    pub fn new(mean: [T; N], covariance: Covariance<T, N>) -> Self {
        Self { state: Factored::of_covariance(mean, &covariance) }
    }

    /// Starts from a mean and a root A of its covariance A·Aᵀ, triangular or not.
    pub fn from_factor(mean: [T; N], root: &Mat<T, N, N>) -> Self {
        Self { state: Factored::of_root(mean, root) }
    }

    /// S: lower triangular, not negative on its diagonal.
    #[inline(always)]
    pub const fn factor(&self) -> &Mat<T, N, N> {
        &self.state.factor
    }
}

impl<T: Scalar, const N: usize> Filter<T, N> for SquareRootEkf<T, N> {
    held_state!(covariance());

    #[inline(always)]
    fn predict_linked<P: NumericProcess<T, N>>(
        &mut self,
        process: &P,
        u: &P::Input,
    ) -> Result<StateTransition<T, N>, FilterError> {
        let (mean, transition) = process.linearized(&self.state.mean, u);
        let s = &self.state.factor;
        let moved =
            matrix!(|i, j| { sum!(N, |k| k >= j && P::links(i, k), |k| transition.0[i][k] * s.0[k][j]) });
        let factor = triangularize(moved, Mat::<T, N, 0>::zero(), *process.noise_added().root());
        self.state.take(&Factored { mean, factor }, Refusal::none())?;
        Ok(StateTransition { transition, noise: *process.noise_added().covariance() })
    }

    #[inline(always)]
    fn update_where<H: NumericMeasurement<T, N, M>, const M: usize>(
        &mut self,
        measurement: &H,
        y: &[T; M],
        r: &Covariance<T, M>,
        policy: &impl Policy<T, N>,
    ) -> Result<Innovation<T, M>, FilterError> {
        let (predicted, h) = measurement.linearized(&self.state.mean);
        let s = &self.state.factor;
        let f = matrix!(|i, j| sum!(N, |k| k >= j && H::sees(i, k), |k| h.0[i][k] * s.0[k][j]));
        let apart = Decorrelation::of(r);
        let refused = Refusal { innovation: !apart.semidefinite, ..Refusal::none() };
        self.state.correct((y, &predicted), &f, sees::<T, H, N, M>, (r, &apart), policy, refused)
    }
}

/// Whether component `i` may see column `j` of a lower triangular factor.
#[inline(always)]
pub(super) fn sees<T: Scalar, H: NumericMeasurement<T, N, M>, const N: usize, const M: usize>(
    i: usize,
    j: usize,
) -> bool {
    (j..N).any(|k| H::sees(i, k))
}

//! The extended Kalman filter with states that are considered but not estimated.

use super::gaussian::{Refusal, WeighedMeasurement};
use super::linearized::linearized_filter;
use super::{Filter, Gaussian, Innovation, StateTransition};
use crate::notation::{matrix, vector};
use crate::update::Policy;
use crate::{Covariance, FilterError, NumericMeasurement, NumericProcess, Scalar};

/// The extended Kalman filter with consider states: uncertain parameters that no measurement corrects.
///
/// They are states like any other in the models, often with the constant dynamics of an
/// [`Augmented`](crate::Augmented) one. Their uncertainty reaches the prediction, the innovation and, by the
/// correlations, the other states; but their rows of the gain are zero:
///
/// K = P·Hᵀ·S⁻¹ with zeros for what is considered, P⁺ = (I − K·H)·P·(I − K·H)ᵀ + K·R·Kᵀ
///
/// (Schmidt, Advances in Control Systems 3, 293, 1966; Joseph's form is right for any gain). The estimate then
/// says how uncertain it is on account of parameters that the data cannot, or should not, tell. A filter that
/// takes such a parameter as known is overconfident.
///
/// ```
/// use kalmems_core::{Covariance, Filter, LinearMeasurement, Mat, SchmidtEkf};
/// // A level, and a sensor whose offset is known to ±1 and must not be learnt from it.
/// let start = Covariance::from_variances([1e6, 1.0]);
/// let mut filter = SchmidtEkf::new([0.0, 0.0], start, [false, true]);
/// let seen = LinearMeasurement { matrix: Mat([[1.0, 1.0]]) };
/// for _ in 0..1000 {
///     filter.update(&seen, &[5.0], &Covariance::from_variances([0.01]))?;
/// }
/// // However often it is read, the level is no better known than the offset.
/// assert!((filter.covariance().standard_deviation(0) - 1.0_f64).abs() < 1e-3);
/// assert_eq!((filter.mean()[1], filter.covariance().get(1, 1)), (0.0, 1.0));
/// # Ok::<(), kalmems_core::FilterError>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct SchmidtEkf<T, const N: usize> {
    state: Gaussian<T, N>,
    considered: [bool; N],
}

impl<T: Scalar, const N: usize> SchmidtEkf<T, N> {
    /// Starts from a mean and its covariance; which states are considered and not estimated.
    pub const fn new(mean: [T; N], covariance: Covariance<T, N>, considered: [bool; N]) -> Self {
        Self { state: Gaussian { mean, covariance }, considered }
    }
}

impl<T: Scalar, const N: usize> Filter<T, N> for SchmidtEkf<T, N> {
    linearized_filter!();

    #[inline(always)]
    fn update_where<H: NumericMeasurement<T, N, M>, const M: usize>(
        &mut self,
        measurement: &H,
        y: &[T; M],
        r: &Covariance<T, M>,
        policy: &impl Policy<T, N>,
    ) -> Result<Innovation<T, M>, FilterError> {
        let (predicted, h) = measurement.linearized(&self.state.mean);
        let WeighedMeasurement { mut innovation, gain: full, .. } =
            self.state.weigh::<H, M>((y, &predicted), &h, r);
        let gain = matrix!(|i, j| if self.considered[i] { T::of(0.0) } else { full.0[i][j] });
        let correction = self.state.correction(&gain, &innovation.residual);
        let wanted = policy.take(&innovation, &correction);
        let refused = Refusal { innovation: !innovation.taken, ..Refusal::of_measurement(y) };
        refused.to_error()?;
        innovation.taken = wanted;
        if !wanted {
            return Ok(innovation);
        }
        let next = Gaussian {
            mean: vector!(|i| self.state.mean[i] + correction.change[i]),
            covariance: self.state.joseph::<H, M>(&gain, &h, r),
        };
        self.state.accept(&next, refused)?;
        Ok(innovation)
    }
}

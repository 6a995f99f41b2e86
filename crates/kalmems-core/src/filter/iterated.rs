//! The iterated extended Kalman filter.

use super::gaussian::{Refusal, WeighedMeasurement};
use super::linearized::linearized_filter;
use super::{Filter, Gaussian, Innovation, StateTransition};
use crate::notation::vector;
use crate::update::Policy;
use crate::{Covariance, FilterError, NumericMeasurement, NumericProcess, Scalar};

/// The extended Kalman filter that linearises a measurement again where it leads: `STEPS` Gauss–Newton steps
/// towards the most probable state given the prediction and the measurement.
///
/// With x̄ and P predicted, x_0 = x̄, and H_i and K_i the Jacobian and the gain at x_i,
///
/// x_{i+1} = x̄ + K_i·(y − h(x_i) − H_i·(x̄ − x_i)),
///
/// and the covariance from the last gain and Jacobian in Joseph's form (Bell and Cathey, IEEE Trans. Automatic
/// Control 38, 294, 1993). One step is the [`Ekf`](crate::Ekf); on a linear measurement so are all. The steps
/// are not damped: where a measurement bends so much that they do not converge, the last one stands.
///
/// The innovation, and with it the policy's decision, is that at the prediction.
///
/// ```
/// use kalmems_core::{Covariance, Ekf, Filter, IteratedEkf, Measurement, Over, Scalar};
/// /// y = x².
/// struct Square;
/// impl<T: Scalar> Measurement<T, 1, 1> for Square {
///     fn predict<S: Over<T>>(&self, x: &[S; 1]) -> [S; 1] {
///         [x[0].sq()]
///     }
/// }
/// let start = Covariance::from_variances([1.0]);
/// let r = Covariance::from_variances([1e-4_f64]);
/// let mut once = Ekf::new([1.0], start);
/// let mut again = IteratedEkf::<_, 1, 10>::new([1.0], start, 1e-6);
/// once.update(&Square, &[9.0], &r)?;
/// again.update(&Square, &[9.0], &r)?;
/// assert!((once.mean()[0] - 3.0).abs() > 1.9);
/// assert!((again.mean()[0] - 3.0).abs() < 1e-4);
/// # Ok::<(), kalmems_core::FilterError>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct IteratedEkf<T, const N: usize, const STEPS: usize> {
    state: Gaussian<T, N>,
    tolerance: T,
}

impl<T: Scalar, const N: usize, const STEPS: usize> IteratedEkf<T, N, STEPS> {
    /// Starts from a mean and its covariance. The steps end after one that moved no state by more than
    /// `tolerance` times its predicted standard deviation; at zero only where one moved nothing.
    pub const fn new(mean: [T; N], covariance: Covariance<T, N>, tolerance: T) -> Self {
        const { assert!(STEPS > 0, "an update takes at least one step") };
        Self { state: Gaussian { mean, covariance }, tolerance }
    }
}

impl<T: Scalar, const N: usize, const STEPS: usize> Filter<T, N> for IteratedEkf<T, N, STEPS> {
    linearized_filter!();

    #[inline(always)]
    fn update_where<H: NumericMeasurement<T, N, M>, const M: usize>(
        &mut self,
        measurement: &H,
        y: &[T; M],
        r: &Covariance<T, M>,
        policy: &impl Policy<T, N>,
    ) -> Result<Innovation<T, M>, FilterError> {
        let prior = self.state;
        let (predicted, mut h) = measurement.linearized(&prior.mean);
        let WeighedMeasurement { mut innovation, mut gain, .. } = prior.weigh::<H, M>((y, &predicted), &h, r);
        let correction = prior.correction(&gain, &innovation.residual);
        let wanted = policy.take(&innovation, &correction);
        let mut refused = Refusal { innovation: !innovation.taken, ..Refusal::of_measurement(y) };
        refused.to_error()?;
        innovation.taken = wanted;
        if !wanted {
            return Ok(innovation);
        }

        let mut mean: [T; N] = vector!(|i| prior.mean[i] + correction.change[i]);
        let mut still = self.moves(&prior.mean, &mean);
        for _ in 1..STEPS {
            if !still {
                break;
            }
            let (at, jacobian) = measurement.linearized(&mean);
            // What the linearisation at this point says of the prediction.
            let offset: [T; N] = vector!(|i| prior.mean[i] - mean[i]);
            let moved = jacobian.times_vector(&offset);
            let expected = vector!(|i| at[i] + moved[i]);
            let WeighedMeasurement { innovation: next_innovation, gain: next_gain, .. } =
                prior.weigh::<H, M>((y, &expected), &jacobian, r);
            refused.innovation |= !next_innovation.taken;
            let change = prior.correction(&next_gain, &next_innovation.residual).change;
            let next: [T; N] = vector!(|i| prior.mean[i] + change[i]);
            (h, gain) = (jacobian, next_gain);
            still = self.moves(&mean, &next);
            mean = next;
        }
        let next = Gaussian { mean, covariance: prior.joseph::<H, M>(&gain, &h, r) };
        self.state.accept(&next, refused)?;
        Ok(innovation)
    }
}

impl<T: Scalar, const N: usize, const STEPS: usize> IteratedEkf<T, N, STEPS> {
    /// Whether a step from one point to the next moved some state by more than the tolerance.
    #[inline(always)]
    fn moves(&self, from: &[T; N], to: &[T; N]) -> bool {
        let square = self.tolerance.sq();
        let mut moves = false;
        for i in 0..N {
            let variance = self.state.covariance.get(i, i);
            moves |= (to[i] - from[i]).sq().gt(square * variance);
        }
        moves
    }
}

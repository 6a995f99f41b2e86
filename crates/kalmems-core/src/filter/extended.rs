//! The extended Kalman filter.

use super::gaussian::{Refusal, WeighedMeasurement};
use super::linearized::linearized_filter;
use super::{Filter, Gaussian, Innovation, StateTransition};
use crate::update::Policy;
use crate::{Covariance, FilterError, NumericMeasurement, NumericProcess, Scalar};

/// The extended Kalman filter: models linearised at the current mean, the covariance in Joseph's form.
///
/// See the [crate's](crate) example.
#[derive(Clone, Copy, Debug)]
pub struct Ekf<T, const N: usize> {
    state: Gaussian<T, N>,
}

impl<T: Scalar, const N: usize> Ekf<T, N> {
    /// Starts from a mean and its covariance.
    pub const fn new(mean: [T; N], covariance: Covariance<T, N>) -> Self {
        Self { state: Gaussian { mean, covariance } }
    }
}

impl<T: Scalar, const N: usize> Ekf<T, N> {
    /// A prediction and an update with a measurement `y` of noise covariance `r`: bit by bit what
    /// [`predict`](Filter::predict) and [`update`](Filter::update) give one after the other, for a small processor.
    ///
    /// Whether the numbers are finite is looked at once, at the end: what is finite after an update was so before. Where
    /// the update is refused the prediction remains.
    #[inline(always)]
    pub fn step<P: NumericProcess<T, N>, H: NumericMeasurement<T, N, M>, const M: usize>(
        &mut self,
        (process, u): (&P, &P::Input),
        (measurement, y, r): (&H, &[T; M], &Covariance<T, M>),
    ) -> Result<Innovation<T, M>, FilterError> {
        let (mean, f) = process.linearized(&self.state.mean, u);
        let predicted = self.state.propagated(mean, &f, process);
        let (expected, h) = measurement.linearized(&predicted.mean);
        let WeighedMeasurement { mut innovation, gain, recip } =
            predicted.weigh::<H, M>((y, &expected), &h, r);
        let next = predicted.corrected::<H, M>(&innovation.residual, &gain, &h, r);
        // Where a pivot is +0 its reciprocal is positive, but no gain is finite.
        if next.zeros().finite_and_positive(&recip) {
            self.state.set(&next);
            innovation.taken = true;
            return Ok(innovation);
        }
        if !predicted.is_finite() {
            return Err(FilterError::NonFiniteState);
        }
        self.state = predicted;
        let refused = Refusal { innovation: !innovation.taken, state: true, ..Refusal::of_measurement(y) };
        refused.to_error().map(|()| innovation)
    }
}

impl<T: Scalar, const N: usize> Filter<T, N> for Ekf<T, N> {
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
        self.state.correct::<H, M>((y, &predicted), &h, r, policy)
    }
}

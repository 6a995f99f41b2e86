//! The model without its sensor.

use kalmems_core::update::Policy;
use kalmems_core::{
    Covariance, Ekf, Filter, FilterError, Innovation, NumericMeasurement, NumericProcess, StateTransition,
};

/// The actuator model alone (the published papers' ACM): it predicts, and takes no notice of what is measured.
///
/// Its innovation is what the measurement would have said. It claims no uncertainty, so its covariance is zero
/// and its NIS weighs the innovation with the measurement noise alone.
#[derive(Clone, Copy, Debug)]
pub struct ModelAlone<const N: usize> {
    mean: [f64; N],
}

impl<const N: usize> ModelAlone<N> {
    /// Starts from a state.
    pub fn new(mean: [f64; N]) -> Self {
        Self { mean }
    }
}

impl<const N: usize> Filter<f64, N> for ModelAlone<N> {
    fn mean(&self) -> &[f64; N] {
        &self.mean
    }

    fn covariance(&self) -> Covariance<f64, N> {
        Covariance::zero()
    }

    fn predict_linked<P: NumericProcess<f64, N>>(
        &mut self,
        process: &P,
        u: &P::Input,
    ) -> Result<StateTransition<f64, N>, FilterError> {
        let (next, transition) = process.linearized(&self.mean, u);
        if !next.iter().all(|x| x.is_finite()) {
            return Err(FilterError::NonFiniteState);
        }
        self.mean = next;
        Ok(StateTransition { transition, noise: Covariance::zero() })
    }

    fn update_where<H: NumericMeasurement<f64, N, M>, const M: usize>(
        &mut self,
        measurement: &H,
        y: &[f64; M],
        r: &Covariance<f64, M>,
        policy: &impl Policy<f64, N>,
    ) -> Result<Innovation<f64, M>, FilterError> {
        // A filter that knows its state exactly takes nothing from a measurement.
        Ekf::new(self.mean, Covariance::zero()).update_where(measurement, y, r, policy)
    }
}

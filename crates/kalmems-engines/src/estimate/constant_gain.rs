//! A filter whose gain does not change.

use kalmems_core::update::{Correction, Policy};
use kalmems_core::{
    Covariance, Ekf, Filter, FilterError, FixedGain, Innovation, Mat, NumericMeasurement, NumericProcess,
    OperatingPoint, StateTransition,
};

/// A [`FixedGain`] for the loop that serves all filters, on a signal of one number.
///
/// It claims the covariances in which the error of its gain settles. They do not follow the measurements, so that
/// nothing can be smoothed with them; the link between two states is that of the point it was computed at.
#[derive(Clone, Copy, Debug)]
pub struct ConstantGain<const N: usize> {
    mean: [f64; N],
    gain: [f64; N],
    predicted: Covariance<f64, N>,
    filtered: Covariance<f64, N>,
    transition: Mat<f64, N, N>,
    noise: Covariance<f64, N>,
}

impl<const N: usize> ConstantGain<N> {
    /// The gain and the start of `filter`, which was computed at `point`.
    pub fn new(filter: &FixedGain<f64, N, 1>, point: &OperatingPoint<f64, N, 1>) -> Self {
        Self {
            mean: *filter.mean(),
            gain: filter.gain().0.map(|[entry]| entry),
            predicted: *filter.predicted_covariance(),
            filtered: *filter.filtered_covariance(),
            transition: point.transition,
            noise: point.process_noise,
        }
    }

    /// What of a residual it adds to each state.
    pub fn gain(&self) -> &[f64; N] {
        &self.gain
    }

    /// The variance of an innovation at a state, where a sample has this variance.
    pub fn innovation_variance<H: NumericMeasurement<f64, N, 1>>(
        &self,
        (measurement, at): (&H, &[f64; N]),
        variance: f64,
    ) -> f64 {
        let (_, slopes) = measurement.linearized(at);
        self.predicted.transformed(&slopes).get(0, 0) + variance
    }
}

/// Which gain for all times.
#[derive(Clone, Copy, Debug)]
pub enum GainOf {
    /// That in which the Kalman filter settles.
    Settled,
    /// That of the continuous Kalman filter, with what each sample says held until the next.
    Continuous,
    /// That which gives the error poles of this corner in rad/s.
    Poles(f64),
}

/// Takes no correction: for the innovation alone, of a filter that corrects by a gain of its own.
#[derive(Clone, Copy, Debug)]
pub struct Never;

impl<const N: usize> Policy<f64, N> for Never {
    fn take<const M: usize>(&self, _: &Innovation<f64, M>, _: &Correction<f64, N>) -> bool {
        false
    }
}

impl<const N: usize> Filter<f64, N> for ConstantGain<N> {
    fn mean(&self) -> &[f64; N] {
        &self.mean
    }

    fn covariance(&self) -> Covariance<f64, N> {
        self.filtered
    }

    fn predict_linked<P: NumericProcess<f64, N>>(
        &mut self,
        process: &P,
        u: &P::Input,
    ) -> Result<StateTransition<f64, N>, FilterError> {
        self.mean = finite(process.moved(&self.mean, u))?;
        Ok(StateTransition { transition: self.transition, noise: self.noise })
    }

    fn update_where<H: NumericMeasurement<f64, N, M>, const M: usize>(
        &mut self,
        measurement: &H,
        y: &[f64; M],
        r: &Covariance<f64, M>,
        policy: &impl Policy<f64, N>,
    ) -> Result<Innovation<f64, M>, FilterError> {
        const { assert!(M == 1, "the gain is for one number") };
        let mut innovation = Ekf::new(self.mean, self.predicted).update_where(measurement, y, r, &Never)?;
        let [residual, ..] = innovation.residual[..] else { return Err(FilterError::NonFiniteMeasurement) };
        let change = self.gain.map(|gain| gain * residual);
        let variance = std::array::from_fn(|i| self.predicted.get(i, i));
        innovation.taken = policy.take(&innovation, &Correction { change, variance });
        if innovation.taken {
            self.mean = finite(std::array::from_fn(|i| self.mean[i] + change[i]))?;
        }
        Ok(innovation)
    }
}

fn finite<const N: usize>(mean: [f64; N]) -> Result<[f64; N], FilterError> {
    if mean.iter().all(|x| x.is_finite()) { Ok(mean) } else { Err(FilterError::NonFiniteState) }
}

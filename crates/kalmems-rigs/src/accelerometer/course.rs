//! How a filter gets from one sample of the accelerometer to the next.

use super::data::{AccelerometerSegment, ModelInput};
use super::instrument::{DividedStep, Instrument, ObserverStep};
use super::noise_estimate::NoiseEstimate;
use crate::estimate::{
    Bridge, Course, Filtering, MeasurementSensor, ProcessTransition, SampleCounts, Transition, by_signal,
};
use kalmems_core::{ContinuousDiscrete, Dynamics, Euler, FilterError, Innovation, Scaled};

/// How far an interval may be from the usual one and still be stepped as such, relative to it: well below what
/// times written in decimals round to.
const SAME: f64 = 1e-6;

/// How a filter predicts over the usual interval.
pub trait Prediction<D: Dynamics<f64, N>, const N: usize> {
    /// By an input and the sample before, which is not a number where it is missing. `None` where it cannot, so that the
    /// plain step is taken.
    fn predict(
        &self,
        filter: &mut dyn Filtering,
        input: D::Input,
        sample: f64,
    ) -> Option<Result<(), FilterError>>;

    /// Takes so many steps over this interval from here on; whether shorter ones are closer to the motion.
    fn divide(&mut self, _: (&Instrument<D, N>, f64), _: usize) -> bool {
        false
    }
}

impl<D: Dynamics<f64, N, Input: ModelInput> + Copy, const N: usize> Prediction<D, N> for DividedStep<D, N> {
    fn predict(
        &self,
        filter: &mut dyn Filtering,
        input: D::Input,
        _: f64,
    ) -> Option<Result<(), FilterError>> {
        Some((0..self.parts).try_for_each(|_| filter.predict(&UnderInput { step: self, input })))
    }

    fn divide(&mut self, (instrument, interval_s): (&Instrument<D, N>, f64), steps: usize) -> bool {
        if steps != self.parts {
            *self = instrument.divided(interval_s, steps);
        }
        true
    }
}

/// A step over a part of the interval.
struct UnderInput<'a, D: Dynamics<f64, N>, const N: usize> {
    step: &'a DividedStep<D, N>,
    input: D::Input,
}

impl<D: Dynamics<f64, N>, const N: usize> Transition for UnderInput<'_, D, N> {
    fn advance(&self, x: &[f64], to: &mut [f64]) {
        ProcessTransition::new(&self.step.whole, &self.input).advance(x, to);
    }

    fn linearize(&self, x: &[f64], to: &mut [f64], jacobian: &mut [f64]) {
        ProcessTransition::new(&self.step.whole, &self.input).linearize(x, to, jacobian);
    }

    fn advance_in_halves(&self, x: &[f64], to: &mut [f64]) -> bool {
        let (half, mut middle) = (ProcessTransition::new(&self.step.half, &self.input), [0.0; N]);
        half.advance(x, &mut middle);
        half.advance(&middle, to);
        true
    }

    fn noise(&self, covariance: &mut [f64], root: &mut [f64]) {
        ProcessTransition::new(&self.step.whole, &self.input).noise(covariance, root);
    }
}

/// Over another interval the step of all devices is taken.
impl<D: Dynamics<f64, N>, const N: usize> Prediction<D, N> for Euler<Scaled<D, f64, N>, f64, N> {
    fn predict(
        &self,
        filter: &mut dyn Filtering,
        input: D::Input,
        _: f64,
    ) -> Option<Result<(), FilterError>> {
        Some(filter.predict(&ProcessTransition::new(self, &input)))
    }
}

/// The prediction of a hybrid filter: mean and covariance follow their differential equations.
pub struct Hybrid<D, const N: usize> {
    maker: ContinuousDiscrete<Scaled<D, f64, N>, f64, N>,
    interval_s: f64,
}

/// The longest step in fastest decays: five times shorter than what Runge and Kutta's method needs to be stable.
const LONGEST: f64 = 0.5;

impl<D: Dynamics<f64, N, Input: ModelInput> + Copy, const N: usize> Hybrid<D, N> {
    /// Over this interval.
    pub fn new(instrument: &Instrument<D, N>, interval_s: f64) -> Result<Self, kalmems_core::IntervalError> {
        let longest = (LONGEST / instrument.fastest()).min(interval_s);
        let maker = ContinuousDiscrete::new(instrument.dynamics, instrument.density, longest)?;
        Ok(Self { maker, interval_s })
    }
}

impl<D: Dynamics<f64, N>, const N: usize> Prediction<D, N> for Hybrid<D, N> {
    fn predict(
        &self,
        filter: &mut dyn Filtering,
        input: D::Input,
        _: f64,
    ) -> Option<Result<(), FilterError>> {
        // The interval was found to be one when the maker was.
        let mean = filter.mean().try_into().ok()?;
        let process = self.maker.over(self.interval_s, mean, |_| input).ok()?;
        Some(filter.predict(&ProcessTransition::new(&process, &())))
    }
}

impl<D: Dynamics<f64, N>, const N: usize> Prediction<D, N> for ObserverStep<D, N> {
    fn predict(
        &self,
        filter: &mut dyn Filtering,
        input: D::Input,
        sample: f64,
    ) -> Option<Result<(), FilterError>> {
        sample.is_finite().then(|| filter.predict(&ProcessTransition::new(self, &(input, [sample]))))
    }
}

/// Model and signal of one segment.
pub struct AccelerometerCourse<'a, D, S, const N: usize> {
    instrument: &'a Instrument<D, N>,
    data: &'a AccelerometerSegment<'a>,
    step: S,
    noise: Option<NoiseEstimate>,
    /// What it was before the first sample.
    first_noise: Option<NoiseEstimate>,
}

impl<'a, D, S, const N: usize> AccelerometerCourse<'a, D, S, N> {
    /// A way through this segment.
    pub fn new(instrument: &'a Instrument<D, N>, data: &'a AccelerometerSegment<'a>, step: S) -> Self {
        Self { instrument, data, step, noise: None, first_noise: None }
    }

    /// The same with the variance of a sample estimated on the way.
    #[must_use]
    pub fn with_noise(self, noise: Option<NoiseEstimate>) -> Self {
        Self { first_noise: noise.clone(), noise, ..self }
    }

    /// What was estimated of it.
    pub fn into_noise(self) -> Option<NoiseEstimate> {
        self.noise
    }
}

/// The time to sample `to` where it is not the usual one, what is missing in between counted.
pub fn unusual_interval(data: &AccelerometerSegment, to: usize, counts: &mut SampleCounts) -> Option<f64> {
    let interval = data.time_s[to] - data.time_s[to - 1];
    if (interval / data.interval_s - 1.0).abs() <= SAME {
        return None;
    }
    counts.bridged = counts.bridged.saturating_add(Bridge::over(interval, data.interval_s).missing);
    Some(interval)
}

impl<D, S, const N: usize> Course for AccelerometerCourse<'_, D, S, N>
where
    D: Dynamics<f64, N, Input: ModelInput> + Copy,
    S: Prediction<D, N>,
{
    fn time_s(&self) -> &[f64] {
        self.data.time_s
    }

    fn signal(&self) -> &[f64] {
        self.data.signal
    }

    fn divide(&mut self, steps: usize) -> bool {
        self.step.divide((self.instrument, self.data.interval_s), steps)
    }

    fn rewind(&mut self) {
        self.noise.clone_from(&self.first_noise);
    }

    fn advance(
        &mut self,
        filter: &mut dyn Filtering,
        to: usize,
        counts: &mut SampleCounts,
    ) -> Result<(), FilterError> {
        let input = ModelInput::after(self.data, to - 1);
        let unusual = unusual_interval(self.data, to, counts);
        if unusual.is_none()
            && let Some(taken) = self.step.predict(filter, input, self.data.signal[to - 1])
        {
            return taken;
        }
        let interval = unusual.unwrap_or(self.data.time_s[to] - self.data.time_s[to - 1]);
        filter.predict(&ProcessTransition::new(&self.instrument.over(interval), &input))
    }

    fn pass_over(&mut self) {
        if let Some(noise) = &mut self.noise {
            noise.add(None);
        }
    }

    fn correct(
        &mut self,
        filter: &mut dyn Filtering,
        k: usize,
        _: &mut SampleCounts,
    ) -> Result<Option<Innovation<f64, 1>>, FilterError> {
        let variance = self.noise.as_ref().map_or(self.instrument.noise_variance, NoiseEstimate::variance);
        let sensor = MeasurementSensor::<_, N>(&self.instrument.readout);
        let innovation = by_signal(filter, self.data.signal[k], (&sensor, variance))?;
        if let Some(noise) = &mut self.noise {
            // An outlier says nothing of the noise.
            noise.add(innovation.as_ref().filter(|innovation| innovation.taken));
        }
        Ok(innovation)
    }
}

//! A filter that remembers how it came here.

use super::AnyKnownStateStep;
use super::any_filter::StateFilter;
use super::engine::Filtering;
use super::gate::{Decisions, SampleGate};
use super::phase_prediction::{PhasePredictor, SizedStatePropagation, StatePropagation};
use super::step_watch::{STEP_ERROR_SAMPLES, StepFigure, StepWatch};
use super::transition::{KeptSensor, Sensor, Transition};
use kalmems_core::{FilterError, Gaussian, Innovation, Mat, StateTransition};

/// A filter that remembers how its state depends on the state before a few predictions: what a smoother needs.
pub(super) struct LinkedFilter<const N: usize> {
    filter: Box<dyn StateFilter<N>>,
    /// What it says of the mean, where slices are asked for.
    mean: [f64; N],
    link: Option<StateTransition<f64, N>>,
    watch: SampleGate,
    /// How far its steps lead it astray, where that is followed.
    steps: Option<StepWatch<N>>,
    /// On which side of each reset it is, where its device has some.
    reset_sides: Option<u32>,
}

impl<const N: usize> Clone for LinkedFilter<N> {
    fn clone(&self) -> Self {
        Self {
            filter: self.filter.copied(),
            mean: self.mean,
            link: self.link,
            watch: self.watch.clone(),
            steps: self.steps,
            reset_sides: self.reset_sides,
        }
    }
}

impl<const N: usize> From<&LinkedFilter<N>> for Gaussian<f64, N> {
    fn from(linked: &LinkedFilter<N>) -> Self {
        linked.gaussian()
    }
}

impl<const N: usize> LinkedFilter<N> {
    /// Without a prediction yet, and how it takes its samples.
    pub(super) fn new(filter: Box<dyn StateFilter<N>>, watch: SampleGate) -> Self {
        Self { mean: filter.known().mean, filter, link: None, watch, steps: None, reset_sides: None }
    }

    /// The same, with the error of its steps followed, be it of sigma points or not.
    #[must_use]
    pub(super) fn watching_steps(self, is_unscented: bool) -> Self {
        Self { steps: Some(StepWatch::new(is_unscented)), ..self }
    }

    /// The same, without.
    #[must_use]
    pub(super) fn without_step_watch(self) -> Self {
        Self { steps: None, ..self }
    }

    /// The error of its steps, and of how many samples, where these have become as many as are told at once.
    pub(super) fn due_step_error(&mut self) -> Option<(usize, StepFigure)> {
        let steps = self.steps.as_mut()?;
        let samples = steps.samples();
        if samples < STEP_ERROR_SAMPLES { None } else { steps.error().map(|error| (samples, error)) }
    }

    /// Goes on in shorter steps.
    pub(super) fn shorten_steps(&mut self) {
        if let Some(steps) = &mut self.steps {
            steps.shorten();
        }
    }

    /// Comes to a sample of this time in s.
    pub(super) fn at(&mut self, time_s: f64) {
        self.watch.at(time_s);
    }

    /// What it did with the present sample.
    pub(super) const fn watched(&self) -> &SampleGate {
        &self.watch
    }

    /// Follows what another run of the filter rejected, or decides by itself.
    pub(super) fn follow(&mut self, decided: Option<&Decisions>) {
        self.watch.follow(decided);
    }

    /// Goes on with another filter, and takes its samples as before.
    pub(super) fn put(&mut self, filter: Box<dyn StateFilter<N>>) {
        (self.mean, self.filter) = (filter.known().mean, filter);
    }

    /// What the filter knows.
    pub(super) fn gaussian(&self) -> Gaussian<f64, N> {
        self.filter.known()
    }

    /// How its state depends on that when it began to remember.
    pub(super) fn link(&self) -> Option<StateTransition<f64, N>> {
        self.link
    }

    /// Begins to remember anew.
    pub(super) fn forget(&mut self) {
        self.link = None;
    }
}

impl<const N: usize> LinkedFilter<N> {
    /// Takes the mean that a correction has led to.
    fn corrected(
        &mut self,
        sensor: &KeptSensor<'_, N>,
        innovation: &Result<Innovation<f64, 1>, FilterError>,
    ) {
        let mean = self.filter.mean();
        if let (Some(steps), Ok(innovation)) = (&mut self.steps, innovation) {
            steps.correct(sensor, (&self.mean, &mean), innovation.residual[0]);
        }
        self.mean = mean;
    }
}

impl<const N: usize> Filtering for LinkedFilter<N> {
    fn mean(&self) -> &[f64] {
        &self.mean
    }

    fn covariance(&self, to: &mut [f64]) {
        to.copy_from_slice(self.gaussian().covariance.lower_triangle().0.as_flattened());
    }

    fn predict(&mut self, transition: &dyn Transition) -> Result<(), FilterError> {
        let link = self.filter.step(transition)?;
        let mean = self.filter.mean();
        if let Some(steps) = &mut self.steps {
            steps.step(transition, (&self.mean, &mean), &link.transition);
        }
        self.mean = mean;
        self.link = Some(match &self.link {
            None => link,
            // x″ = F₂·(F₁·x + w₁) + w₂.
            Some(first) => StateTransition {
                transition: link.transition.times(&first.transition),
                noise: first.noise.transformed(&link.transition).plus(&link.noise),
            },
        });
        Ok(())
    }

    fn reset_sides(&self) -> Option<u32> {
        self.reset_sides
    }

    fn keep_reset_sides(&mut self, sides: Option<u32>) {
        self.reset_sides = sides;
    }

    fn part(&mut self) {
        self.link = Some(StateTransition { transition: Mat::zero(), noise: self.filter.known().covariance });
    }

    fn take_over(&mut self, known: &AnyKnownStateStep) -> Result<(), FilterError> {
        self.reset_sides = None;
        self.predict(known)
    }

    fn widen(&mut self, noise: &dyn Transition) -> Result<(), FilterError> {
        self.filter.step(noise).map(|_| self.mean = self.filter.mean())
    }

    fn update_within(
        &mut self,
        sensor: &dyn Sensor,
        y: f64,
        variance: f64,
        largest_nis: f64,
    ) -> Result<Innovation<f64, 1>, FilterError> {
        let sensor = KeptSensor::new(sensor);
        let innovation = self.filter.correct(&sensor, y, variance, largest_nis);
        self.corrected(&sensor, &innovation);
        innovation
    }

    fn update(
        &mut self,
        signal: usize,
        sensor: &dyn Sensor,
        y: f64,
        variance: f64,
    ) -> Result<Innovation<f64, 1>, FilterError> {
        let Self { filter, watch, .. } = self;
        let correct = |sensor: &dyn Sensor, y: f64, variance: f64, largest: f64| {
            filter.correct(sensor, y, variance, largest)
        };
        let sensor = KeptSensor::new(sensor);
        let innovation = watch.take(signal, (&sensor, y, variance), correct);
        self.corrected(&sensor, &innovation);
        innovation
    }

    fn take_step_error(&mut self, nis: f64) {
        if let Some(steps) = &mut self.steps {
            steps.take(&self.filter.known(), nis);
        }
    }

    fn step_error(&mut self) -> Option<StepFigure> {
        self.steps.as_mut().and_then(StepWatch::error)
    }

    fn watch(&mut self) -> Option<&mut SampleGate> {
        Some(&mut self.watch)
    }

    fn predict_phases(
        &self,
        predictor: &mut PhasePredictor,
        time_s: f64,
        onwards: Option<&dyn StatePropagation>,
    ) {
        let Gaussian { mean, covariance } = self.gaussian();
        let onward = onwards.map(SizedStatePropagation::<N>::new);
        let onward = onward.as_ref().map(|onward| onward as _);
        predictor.take(time_s, (&mean, &covariance), onward);
    }
}

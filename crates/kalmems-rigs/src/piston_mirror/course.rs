//! The mirror's way through one segment.

use super::data::PistonSegment;
use super::phasor::{Phasor, derived_with_harmonics};
use super::settings::HARMONICS;
use crate::estimate::driven::{ParameterAugmentedStep, ParameterStep};
use crate::estimate::{
    Bridge, Course, DerivedQuantities, Filtering, ProcessTransition, SampleCounts, Sensor, Tracked, by_signal,
};
use kalmems_core::{FilterError, Innovation};
use std::f64::consts::TAU;

/// Model and signal of one segment.
pub struct PhasorCourse<'a, P: Phasor<N>, const N: usize> {
    phasor: &'a P,
    data: &'a PistonSegment<'a>,
    usual: P::Process,
    sensor: Box<dyn Sensor + 'a>,
    /// The parameters behind the states of the motion, and their step over the usual interval.
    parameters: (&'a [Tracked], ParameterStep),
}

/// How far an interval may be from the usual one and still be stepped as such, relative to it: well below what
/// times written in decimals round to.
const SAME: f64 = 1e-6;

impl<'a, P: Phasor<N>, const N: usize> PhasorCourse<'a, P, N> {
    /// A way through this segment, read by this sensor.
    pub fn new(phasor: &'a P, data: &'a PistonSegment<'a>, sensor: Box<dyn Sensor + 'a>) -> Self {
        let usual = phasor.over(data.interval_s);
        Self { phasor, data, usual, sensor, parameters: (&[], held(&[], data.interval_s)) }
    }

    /// Likewise, with parameters as states that enter the sensor alone.
    #[must_use]
    pub fn with_parameters(self, tracked: &'a [Tracked]) -> Self {
        Self { parameters: (tracked, held(tracked, self.data.interval_s)), ..self }
    }

    fn step(
        &self,
        filter: &mut dyn Filtering,
        (process, held): (&P::Process, &ParameterStep),
        turns: f64,
    ) -> Result<(), FilterError> {
        match self.parameters.0 {
            [] => filter.predict(&ProcessTransition::new(process, &turns)),
            _ => filter.predict(&ParameterAugmentedStep { process, input: &turns, held }),
        }
    }
}

/// The step of these parameters over an interval in s.
fn held(tracked: &[Tracked], interval_s: f64) -> ParameterStep {
    ParameterStep::of(tracked.iter().map(|tracked| tracked.added), interval_s)
}

impl<P: Phasor<N>, const N: usize> Course for PhasorCourse<'_, P, N> {
    fn time_s(&self) -> &[f64] {
        self.data.time_s
    }

    fn signal(&self) -> &[f64] {
        self.data.signal
    }

    fn derived(&self) -> Option<DerivedQuantities> {
        let of_parameter = |name: &str| {
            let place = self.parameters.0.iter().position(|tracked| tracked.parameter.name == name);
            place.map(|place| N + place)
        };
        let harmonics = HARMONICS.map(of_parameter);
        let has_some = harmonics.iter().any(Option::is_some);
        Some(if has_some { derived_with_harmonics(harmonics) } else { self.phasor.derived() })
    }

    fn advance(
        &mut self,
        filter: &mut dyn Filtering,
        to: usize,
        counts: &mut SampleCounts,
    ) -> Result<(), FilterError> {
        let interval = self.data.time_s[to] - self.data.time_s[to - 1];
        let x = filter.mean();
        let turns = (x[2] / TAU + x[1] * interval).round();
        if (interval / self.data.interval_s - 1.0).abs() <= SAME {
            return self.step(filter, (&self.usual, &self.parameters.1), turns);
        }
        // The step is exact over any interval: a gap needs no more than one.
        counts.bridged = counts.bridged.saturating_add(Bridge::over(interval, self.data.interval_s).missing);
        let step = (&self.phasor.over(interval), &held(self.parameters.0, interval));
        self.step(filter, step, turns)
    }

    fn correct(
        &mut self,
        filter: &mut dyn Filtering,
        k: usize,
        _: &mut SampleCounts,
    ) -> Result<Option<Innovation<f64, 1>>, FilterError> {
        by_signal(filter, self.data.signal[k], (&*self.sensor, self.data.noise_variance))
    }
}

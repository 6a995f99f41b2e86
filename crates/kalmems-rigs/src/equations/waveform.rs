//! The signal around a crossing as the equations of a device give it.

use super::model::steps_over;
use super::own_device::OwnDevice;
use crate::crossings::CrossingWaveform;
use kalmems_core::{Nodes, Portable};
use kalmems_equations::{MOST_STATES, Motion, ReadoutProgram};

/// A measurement of a device that swings through the place of an event, at a rate: the state that the event is of passes it, and all others are at
/// rest. It moves as it does without an input.
pub struct EquationWaveform {
    motion: Motion,
    readout: ReadoutProgram,
    values: Vec<f64>,
    /// The state at the event, but for the rate.
    at: Vec<f64>,
    /// The state that is the rate.
    rate: usize,
    passes_hz: f64,
    interval_s: f64,
    /// Steps of an interval.
    steps: usize,
    /// The slope at a rate of 1, per sample, and the power of the rate that it goes with.
    slope: (f64, f64),
}

/// A part of a step over which a slope is taken as a difference.
const NEAR: f64 = 1e-3;
/// Corrections of a state that an event is sought at, and how near it is then, in its unit.
const CORRECTIONS: usize = 30;
const CLOSE: f64 = 1e-12;

impl EquationWaveform {
    /// Of an event that depends on one state whose rate is another one, and of a measurement that changes its value there; `None` for any other.
    pub fn of(own: &OwnDevice, (event, measure): (usize, usize), interval_s: f64) -> Option<Self> {
        let passes_hz = 2.0 * own.natural_hz()?;
        let program = own.device.event(event, &[]).ok()?;
        let places: Vec<usize> = program.sparsity().collect();
        let [place] = places[..] else { return None };
        let rate = rate_of(own, place)?;
        let at = place_of(own, &program, place)?;
        let steps = steps_over(own.pace(), interval_s)?;
        let (motion, readout) = (own.motion.clone(), own.device.readout(measure, &[]).ok()?);
        let (values, slope) = (own.values.clone(), (1.0, 1.0));
        let mut found = Self { motion, readout, values, at, rate, passes_hz, interval_s, steps, slope };
        let [one, two] = [1.0, 2.0].map(|rate| found.slope_at(rate));
        let (one, two) = (one?, two?);
        let power = (two / one).portable_log2();
        found.slope = (one, power);
        (one > 0.0 && power.is_finite() && power > 0.0).then_some(found)
    }

    /// The measurement over steps of a length in s from a place at a rate; so many of them.
    fn follow(&self, rate: f64, step_s: f64, steps: usize) -> Option<Vec<f64>> {
        let Self { motion, readout, .. } = self;
        let (mut work, mut reading) = (motion.work(&self.values), readout.work(&self.values));
        let tables = motion.runge_kutta(step_s);
        let inputs = [0.0; MOST_STATES];
        let inputs = inputs.get(..motion.takes().len())?;
        let nodes = Nodes { start: inputs, middle: inputs, end: inputs };
        let (mut state, mut next) = (self.at.clone(), self.at.clone());
        *state.get_mut(self.rate)? = rate;
        let mut values = vec![readout.read(&mut reading, &state, inputs)];
        for _ in 0..steps {
            motion.step(&mut work, &state, &nodes, &tables, &mut next);
            std::mem::swap(&mut state, &mut next);
            values.push(readout.read(&mut reading, &state, inputs));
        }
        Some(values)
    }

    /// How much the measurement changes per sample at the event, at this rate.
    fn slope_at(&self, rate: f64) -> Option<f64> {
        let step_s = NEAR * self.interval_s / self.steps as f64;
        let [behind, ahead] = [-step_s, step_s].map(|step_s| self.follow(rate, step_s, 1));
        let slope = (ahead?.last()? - behind?.last()?) / (2.0 * step_s) * self.interval_s;
        Some(slope.abs()).filter(|slope| slope.is_finite())
    }
}

/// The state that is the rate of another one, where there is one.
fn rate_of(own: &OwnDevice, place: usize) -> Option<usize> {
    let motion = &own.motion;
    let mut of_row = motion.sparsity().filter(|(row, _)| *row == place).map(|(_, column)| column);
    let (Some(rate), None) = (of_row.next(), of_row.next()) else { return None };
    let inputs = vec![0.0; own.device.inputs().len()];
    let mut work = motion.work(&own.values);
    let is_rate = [1.0, -2.5].into_iter().all(|value| {
        let (mut x, mut rates) = (own.rest.clone(), vec![0.0; own.rest.len()]);
        x[rate] = value;
        motion.rates(&mut work, &x, &inputs, &mut rates) && (rates[place] - value).abs() < CLOSE
    });
    (is_rate && rate != place).then_some(rate)
}

/// Where an event happens with all states but one at rest.
fn place_of(own: &OwnDevice, event: &ReadoutProgram, place: usize) -> Option<Vec<f64>> {
    let (mut x, mut work) = (own.rest.clone(), event.work(&own.values));
    let inputs = vec![0.0; own.device.inputs().len()];
    let mut slopes = vec![0.0; x.len()];
    for _ in 0..CORRECTIONS {
        let left = event.linearize(&mut work, &x, &inputs, &mut slopes) / slopes.get(place)?;
        x[place] -= left;
        if left.abs() <= CLOSE * x[place].abs().max(CLOSE) {
            return Some(x);
        }
    }
    None
}

impl CrossingWaveform for EquationWaveform {
    fn passes_hz(&self) -> f64 {
        self.passes_hz
    }

    /// By the power of the rate that the slope goes with: of h(θ)·θ̇ the second.
    fn rate(&self, slope: f64) -> f64 {
        let (of_one, power) = self.slope;
        (slope.abs() / of_one).portable_powf(power.recip())
    }

    fn slope(&self, rate: f64) -> f64 {
        let (of_one, power) = self.slope;
        of_one * rate.abs().portable_powf(power)
    }

    fn samples(&self, rate: f64, reach: usize) -> Vec<f64> {
        let step_s = self.interval_s / self.steps as f64;
        let [behind, ahead] = [-step_s, step_s].map(|step_s| {
            let values = self.follow(rate, step_s, reach * self.steps).unwrap_or_default();
            values.into_iter().step_by(self.steps).collect::<Vec<f64>>()
        });
        let level = ahead.first().copied().unwrap_or(f64::NAN);
        let all = behind.iter().skip(1).rev().chain(&ahead).map(|value| value - level);
        let mut all: Vec<f64> = all.collect();
        all.resize(2 * reach + 1, f64::NAN);
        all
    }
}

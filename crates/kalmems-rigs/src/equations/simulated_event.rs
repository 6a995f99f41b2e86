//! The events of a motion that is simulated: when they are, and when they are said to have been.

use super::own_device::OwnDevice;
use crate::signal::hermite;
use crate::simulate::WhiteNoise;
use kalmems_equations::{
    Device, EquationError, MOST_STATES, Motion, NoiseKind, ProgramNumbers, ReadoutProgram,
};
use std::collections::VecDeque;

/// The events whose noise is stated, by their places, with the variances of their times in s² and of their expressions.
pub fn recorded_events(own: &OwnDevice) -> Result<Vec<(usize, [f64; 2])>, EquationError> {
    let noise = own.device.noise(&own.values, &own.rest)?;
    let of = |(kind, size): &(NoiseKind, f64)| match kind {
        NoiseKind::EventTime { event } => Some((*event, [*size, 0.0])),
        NoiseKind::Event { event } => Some((*event, [0.0, *size])),
        _ => None,
    };
    let mut events: Vec<(usize, [f64; 2])> = noise.iter().filter_map(of).collect();
    events.sort_by_key(|(event, _)| *event);
    Ok(events)
}

/// An event on the way of a simulation.
pub struct SimulatedEvent {
    readout: ReadoutProgram,
    work: ProgramNumbers,
    variances: [f64; 2],
    noise: Option<WhiteNoise>,
    /// Time in s, value and rate of the expression where a step began.
    begun: [f64; 3],
    /// The times that are not recorded yet, in s.
    times: VecDeque<f64>,
}

/// Halvings by which a zero between two steps is found: to the last bit of the step.
const HALVINGS: usize = 60;

impl SimulatedEvent {
    /// The event at this place, with these variances of its time and its expression, and what its noise is made of, where there is any.
    pub fn of(
        device: &Device,
        event: usize,
        values: &[f64],
        (variances, noise): ([f64; 2], Option<WhiteNoise>),
    ) -> Result<Self, EquationError> {
        let readout = device.event(event, &[])?;
        let work = readout.work(values);
        Ok(Self { readout, work, variances, noise, begun: [f64::NAN; 3], times: VecDeque::new() })
    }

    /// Looks at the state where a step begins.
    pub fn begin(&mut self, motion: (&Motion, &mut ProgramNumbers), state: &[f64], at: (f64, &[f64])) {
        self.begun = self.look(motion, state, at);
    }

    /// Looks at the state where it ends.
    pub fn end(&mut self, motion: (&Motion, &mut ProgramNumbers), state: &[f64], at: (f64, &[f64])) {
        let [from_s, before, rate_before] = self.begun;
        let [to_s, after, rate_after] = self.look(motion, state, at);
        if !(before * after < 0.0 || (after == 0.0 && before != 0.0)) {
            return;
        }
        let step_s = to_s - from_s;
        let value = |part: f64| hermite((before, rate_before), (after, rate_after), step_s, part);
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            if value(middle) * before > 0.0 { low = middle } else { high = middle }
        }
        let mut time_s = from_s + step_s * high;
        if let Some(noise) = &mut self.noise {
            let [of_time, own] = self.variances;
            let rate = rate_before + (rate_after - rate_before) * high;
            time_s += noise.sample() * (of_time + own / (rate * rate)).sqrt();
        }
        if time_s.is_finite() {
            let place = self.times.partition_point(|other_s| *other_s <= time_s);
            self.times.insert(place, time_s);
        }
    }

    /// How long before this time in s, at which a row is recorded, the event was; not a number where it was not since the last row.
    pub fn ago(&mut self, time_s: f64) -> f64 {
        match self.times.front() {
            Some(first_s) if *first_s <= time_s => {
                self.times.pop_front().map_or(f64::NAN, |then_s| time_s - then_s)
            }
            _ => f64::NAN,
        }
    }

    fn look(
        &mut self,
        (motion, of_motion): (&Motion, &mut ProgramNumbers),
        state: &[f64],
        (time_s, inputs): (f64, &[f64]),
    ) -> [f64; 3] {
        let (mut slopes, mut rates) = ([0.0; MOST_STATES], [0.0; MOST_STATES]);
        let count = state.len().min(MOST_STATES);
        let value = self.readout.linearize(&mut self.work, state, inputs, &mut slopes[..count]);
        motion.rates(of_motion, state, inputs, &mut rates[..count]);
        [time_s, value, slopes.iter().zip(&rates).map(|(slope, rate)| slope * rate).sum()]
    }
}

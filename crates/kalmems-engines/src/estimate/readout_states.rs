//! What is between a device's signal and its recording, as states of any filter: an offset, a scale, the drive's feedthrough, a line of the
//! mains, coloured noise.
//!
//! With the states x of the device, h(x) of its sensor and the drive u the recording is
//! y = (1 + s)·h(x) + b + g·u + Σ (c·cos ωt + d·sin ωt) + n + white noise, with constants s, b, g, c and d that may drift as random walks, and the
//! Gauss-Markov process n of variance σ² and correlation time τ, n(t + Δt) = e^(−Δt/τ)·n(t) + w, var w = σ²·(1 − e^(−2Δt/τ)). A course is led with a
//! filter of all of them; it sees those of the device alone.

use super::engine::{Course, DerivedQuantities, Filtering, held_course};
use super::gate::SampleGate;
use super::phase_prediction::{PhasePredictor, StatePropagation};
use super::{
    AnyKnownStateStep, MOST_STATES, MeanAndCovariance, Reacquisition, SampleCounts, Sensor, StateName,
    StatePrior, Trajectory, Transition,
};
use crate::config::{AnyValue, ConfigError, Experiment, FilterTable, Key, MOST_LINES, Sign, TrackedState};
use crate::units::{Kind, kind};
use kalmems_core::Portable;
use kalmems_core::{FilterError, Innovation};
use std::f64::consts::TAU;

/// A state between the sensor and the recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReadoutState {
    name: StateName,
    enters: ReadoutEffect,
    /// Its first standard deviation, about 0.
    sd: f64,
    moves: Moves,
}

/// How it goes on from sample to sample.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Moves {
    /// As a random walk whose variance grows by so much per second.
    Walk(f64),
    /// With its first variance for ever, and so many s until e⁻¹ of it remains.
    Forgetting(f64),
}

/// How it enters the recording.
#[derive(Clone, Copy, Debug, PartialEq)]
enum ReadoutEffect {
    Offset,
    Scale,
    /// By the drive.
    Feedthrough,
    /// Of a line with this rate in rad/s.
    Cosine(f64),
    Sine(f64),
}

/// The names of the parts of lines, one after the other.
const LINES: [[&str; 2]; MOST_LINES] =
    [["line_cosine", "line_sine"], ["second_line_cosine", "second_line_sine"]];

impl ReadoutState {
    /// Those that the table of a filter asks for, of a signal that is a voltage or a capacitance.
    pub fn of(experiment: &Experiment, at: &Key, filter: &FilterTable) -> Result<Vec<Self>, ConfigError> {
        let Some(readout) = &filter.readout else { return Ok(Vec::new()) };
        let at = at.clone().child("readout");
        let mut all = Vec::new();
        let mut add =
            |key: Key, state: &TrackedState, names: &[(&'static str, ReadoutEffect)], of: SignalKind| {
                let (unit, kind, drifts) = of;
                let sd =
                    experiment.value(key.clone().child("start_sd"), &state.start_sd, kind, Sign::Positive)?;
                let drift = match &state.drift {
                    Some(drift) => experiment.value(key.child("drift"), drift, drifts, Sign::NotNegative)?,
                    None => 0.0,
                };
                all.extend(names.iter().map(|(name, enters)| Self {
                    name: (name, unit, kind),
                    enters: *enters,
                    sd,
                    moves: Moves::Walk(drift),
                }));
                Ok::<_, ConfigError>(())
            };
        if let Some(offset) = &readout.offset {
            let of = signal_kind(&offset.start_sd);
            add(at.clone().child("offset"), offset, &[("readout_offset", ReadoutEffect::Offset)], of)?;
        }
        if let Some(scale) = &readout.scale {
            let of = ("1", &kind::RATIO, &kind::RATIO_DRIFT);
            add(at.clone().child("scale"), scale, &[("readout_scale", ReadoutEffect::Scale)], of)?;
        }
        if let Some(feedthrough) = &readout.feedthrough {
            let of = ("1", &kind::RATIO, &kind::RATIO_DRIFT);
            let names = [("readout_feedthrough", ReadoutEffect::Feedthrough)];
            add(at.clone().child("feedthrough"), feedthrough, &names, of)?;
        }
        for (index, (line, [cosine, sine])) in readout.lines.iter().zip(LINES).enumerate() {
            let rate = TAU * line.frequency.si();
            let names = [(cosine, ReadoutEffect::Cosine(rate)), (sine, ReadoutEffect::Sine(rate))];
            let key = at.clone().child("lines").index(index);
            let size = line.size();
            add(key, &size, &names, signal_kind(&size.start_sd))?;
        }
        if let Some(noise) = &readout.coloured_noise {
            let (unit, kind, _) = signal_kind(&noise.sd);
            let key = at.child("coloured_noise").child("sd");
            let sd = experiment.value(key, &noise.sd, kind, Sign::Positive)?;
            let name = ("coloured_noise", unit, kind);
            all.push(Self {
                name,
                enters: ReadoutEffect::Offset,
                sd,
                moves: Moves::Forgetting(noise.time.si()),
            });
        }
        Ok(all)
    }

    /// Whether it is known only with the drive.
    pub fn needs_drive(&self) -> bool {
        self.enters == ReadoutEffect::Feedthrough
    }

    /// Its name in trajectories.
    pub const fn name(&self) -> StateName {
        self.name
    }

    /// What a time of so many s leaves of it, and the variance that it adds.
    fn after(&self, time_s: f64) -> (f64, f64) {
        match self.moves {
            Moves::Walk(drift) => (1.0, drift * time_s),
            Moves::Forgetting(correlation_s) => {
                let decay = -time_s / correlation_s;
                (decay.portable_exp(), -self.sd * self.sd * (2.0 * decay).portable_exp_m1())
            }
        }
    }

    /// Mean and standard deviation at first.
    pub const fn first(&self) -> (f64, f64) {
        (0.0, self.sd)
    }

    /// The same, as a search for a start takes it.
    pub const fn prior(&self) -> StatePrior {
        StatePrior { mean: 0.0, sd: Some(self.sd) }
    }
}

/// A unit as column names have it, what is measured in it, and what its drift is.
type SignalKind = (&'static str, &'static Kind, &'static Kind);

/// That of a capacitance where the value is one, else that of a voltage, which the value is then checked to be.
fn signal_kind(size: &AnyValue) -> SignalKind {
    if kind::CAPACITANCE.accepts(size.value().unit().dimension()) {
        ("F", &kind::CAPACITANCE, &kind::CAPACITANCE_DRIFT)
    } else {
        ("V", &kind::VOLTAGE, &kind::VOLTAGE_DRIFT)
    }
}

/// A course of a device on which a filter has these states behind the device's.
pub struct WithReadout<'a> {
    course: &'a mut dyn Course,
    states: &'a [ReadoutState],
}

impl<'a> WithReadout<'a> {
    /// Of this course.
    pub fn new(course: &'a mut dyn Course, states: &'a [ReadoutState]) -> Self {
        Self { course, states }
    }

    /// The course with a filter that shows the device's states alone, at a row to which it comes after so long in s.
    fn led<R>(
        &mut self,
        filter: &mut dyn Filtering,
        (k, after_s): (usize, f64),
        lead: impl FnOnce(&mut dyn Course, &mut dyn Filtering) -> R,
    ) -> R {
        let time_s = self.course.time_s().get(k).copied().unwrap_or(f64::NAN);
        let drive = self.course.drive(k).unwrap_or(0.0);
        let mut shown = DeviceStateFilter { filter, states: self.states, time_s, drive, after_s };
        lead(self.course, &mut shown)
    }
}

impl Course for WithReadout<'_> {
    held_course!();

    fn further_innovations(&self) -> &[[f64; 2]] {
        self.course.further_innovations()
    }

    fn reacquisition(&self) -> Option<Reacquisition> {
        self.course.reacquisition()
    }

    /// The course seeks a start of all states, as it does at the beginning.
    fn start_again(&mut self, row: usize, held: (f64, &[f64])) -> Option<MeanAndCovariance> {
        self.course.start_again(row, held)
    }

    fn advance(
        &mut self,
        filter: &mut dyn Filtering,
        to: usize,
        counts: &mut SampleCounts,
    ) -> Result<(), FilterError> {
        let time_s = self.course.time_s();
        let after_s = time_s[to] - time_s[to - 1];
        self.led(filter, (to, after_s), |course, filter| course.advance(filter, to, counts))
    }

    fn correct(
        &mut self,
        filter: &mut dyn Filtering,
        k: usize,
        counts: &mut SampleCounts,
    ) -> Result<Option<Innovation<f64, 1>>, FilterError> {
        self.led(filter, (k, 0.0), |course, filter| course.correct(filter, k, counts))
    }
}

/// A filter of all states as a course sees it that knows the device's.
struct DeviceStateFilter<'a> {
    filter: &'a mut dyn Filtering,
    states: &'a [ReadoutState],
    /// The time of the row in s.
    time_s: f64,
    /// The drive there.
    drive: f64,
    /// How long the readout's states have moved since the row before and are to be told it yet, in s.
    after_s: f64,
}

impl DeviceStateFilter<'_> {
    fn own(&self) -> usize {
        self.filter.mean().len().saturating_sub(self.states.len())
    }
}

impl<'a> DeviceStateFilter<'a> {
    fn through<'s>(&self, sensor: &'s dyn Sensor, is_recorded: bool) -> SensorWithReadout<'s>
    where
        'a: 's,
    {
        SensorWithReadout { sensor, states: self.states, time_s: self.time_s, drive: self.drive, is_recorded }
    }
}

impl Filtering for DeviceStateFilter<'_> {
    fn mean(&self) -> &[f64] {
        &self.filter.mean()[..self.own()]
    }

    fn covariance(&self, to: &mut [f64]) {
        let (own, all) = (self.own(), self.filter.mean().len());
        let mut whole = vec![0.0; all * all];
        self.filter.covariance(&mut whole);
        for (to, from) in to.chunks_mut(own.max(1)).zip(whole.chunks(all.max(1))) {
            to.copy_from_slice(&from[..to.len()]);
        }
    }

    fn predict(&mut self, transition: &dyn Transition) -> Result<(), FilterError> {
        // In a step that is taken in parts they move once.
        let after_s = std::mem::take(&mut self.after_s);
        self.filter.predict(&WithReadoutStates { transition, states: self.states, after_s })
    }

    fn widen(&mut self, noise: &dyn Transition) -> Result<(), FilterError> {
        self.filter.widen(&WithReadoutStates { transition: noise, states: self.states, after_s: 0.0 })
    }

    fn reset_sides(&self) -> Option<u32> {
        self.filter.reset_sides()
    }

    fn keep_reset_sides(&mut self, sides: Option<u32>) {
        self.filter.keep_reset_sides(sides);
    }

    fn part(&mut self) {
        self.filter.part();
    }

    fn take_over(&mut self, known: &AnyKnownStateStep) -> Result<(), FilterError> {
        self.filter.take_over(known)
    }

    /// What has no place among the signals, such as an angle at a crossing, is not read through the readout.
    fn update_within(
        &mut self,
        sensor: &dyn Sensor,
        y: f64,
        variance: f64,
        largest_nis: f64,
    ) -> Result<Innovation<f64, 1>, FilterError> {
        let sensor = self.through(sensor, false);
        self.filter.update_within(&sensor, y, variance, largest_nis)
    }

    fn update(
        &mut self,
        signal: usize,
        sensor: &dyn Sensor,
        y: f64,
        variance: f64,
    ) -> Result<Innovation<f64, 1>, FilterError> {
        let sensor = self.through(sensor, signal == 0);
        self.filter.update(signal, &sensor, y, variance)
    }

    fn watch(&mut self) -> Option<&mut SampleGate> {
        self.filter.watch()
    }

    /// Zero phases are predicted by filters of the motion alone.
    fn predict_phases(&self, _: &mut PhasePredictor, _: f64, _: Option<&dyn StatePropagation>) {}
}

/// A step of the device, and the readout's states behind its own.
struct WithReadoutStates<'a> {
    transition: &'a dyn Transition,
    states: &'a [ReadoutState],
    after_s: f64,
}

const SQUARE: usize = MOST_STATES * MOST_STATES;

impl WithReadoutStates<'_> {
    /// Where the readout's states go.
    fn advance_readout(&self, own: usize, x: &[f64], to: &mut [f64]) {
        for ((to, x), state) in to[own..].iter_mut().zip(&x[own..]).zip(self.states) {
            *to = state.after(self.after_s).0 * x;
        }
    }

    /// Puts a matrix of the device's states into one of all.
    fn spread(&self, to: &mut [f64], own: usize, of_readout: impl Fn(&ReadoutState) -> f64, from: &[f64]) {
        let all = own + self.states.len();
        to.fill(0.0);
        for (to, from) in to.chunks_mut(all.max(1)).zip(from.chunks(own.max(1))).take(own) {
            to[..own].copy_from_slice(from);
        }
        for (i, state) in (own..).zip(self.states) {
            to[i * all + i] = of_readout(state);
        }
    }
}

impl Transition for WithReadoutStates<'_> {
    fn advance(&self, x: &[f64], to: &mut [f64]) {
        let own = x.len() - self.states.len();
        self.transition.advance(&x[..own], &mut to[..own]);
        self.advance_readout(own, x, to);
    }

    fn linearize(&self, x: &[f64], to: &mut [f64], jacobian: &mut [f64]) {
        let own = x.len() - self.states.len();
        let mut room = [0.0; SQUARE];
        let of_device = &mut room[..own * own];
        self.transition.linearize(&x[..own], &mut to[..own], of_device);
        self.advance_readout(own, x, to);
        self.spread(jacobian, own, |state| state.after(self.after_s).0, of_device);
    }

    fn advance_in_halves(&self, x: &[f64], to: &mut [f64]) -> bool {
        let own = x.len() - self.states.len();
        self.advance_readout(own, x, to);
        self.transition.advance_in_halves(&x[..own], &mut to[..own])
    }

    fn is_smooth(&self) -> bool {
        self.transition.is_smooth()
    }

    fn noise(&self, covariance: &mut [f64], root: &mut [f64]) {
        let all = (0..=MOST_STATES).find(|n| n * n == covariance.len()).unwrap_or(0);
        let own = all - self.states.len().min(all);
        let (mut room, mut room_of_root) = ([0.0; SQUARE], [0.0; SQUARE]);
        let (of_device, of_root) = (&mut room[..own * own], &mut room_of_root[..own * own]);
        self.transition.noise(of_device, of_root);
        self.spread(covariance, own, |state| state.after(self.after_s).1, of_device);
        self.spread(root, own, |state| state.after(self.after_s).1.sqrt(), of_root);
    }

    fn moving(&self, states: usize) -> usize {
        self.transition.moving(states - self.states.len())
    }
}

/// A sensor, and what is between it and the recording.
struct SensorWithReadout<'a> {
    sensor: &'a dyn Sensor,
    states: &'a [ReadoutState],
    time_s: f64,
    drive: f64,
    is_recorded: bool,
}

impl SensorWithReadout<'_> {
    /// What is recorded where the sensor gives this, and its derivative by that.
    fn recorded(&self, given: f64, values: &[f64], slopes: &mut [f64]) -> (f64, f64) {
        slopes.fill(0.0);
        if !self.is_recorded {
            return (given, 1.0);
        }
        let (mut added, mut scale) = (0.0, 1.0);
        for ((state, value), slope) in self.states.iter().zip(values).zip(slopes) {
            *slope = match state.enters {
                ReadoutEffect::Offset => 1.0,
                ReadoutEffect::Scale => given,
                ReadoutEffect::Feedthrough => self.drive,
                ReadoutEffect::Cosine(rate) => (rate * self.time_s).portable_cos(),
                ReadoutEffect::Sine(rate) => (rate * self.time_s).portable_sin(),
            };
            match state.enters {
                ReadoutEffect::Scale => scale += value,
                _ => added += *slope * value,
            }
        }
        (scale * given + added, scale)
    }
}

impl Sensor for SensorWithReadout<'_> {
    fn read(&self, x: &[f64]) -> f64 {
        let own = x.len() - self.states.len();
        let mut room = [0.0; MOST_STATES];
        self.recorded(self.sensor.read(&x[..own]), &x[own..], &mut room[..self.states.len()]).0
    }

    fn linearize(&self, x: &[f64], slopes: &mut [f64]) -> f64 {
        let own = x.len() - self.states.len();
        let (of_device, of_readout) = slopes.split_at_mut(own);
        let given = self.sensor.linearize(&x[..own], of_device);
        let (recorded, scale) = self.recorded(given, &x[own..], of_readout);
        for slope in of_device {
            *slope *= scale;
        }
        recorded
    }
}

//! What is between a device's signal and its recording, as states of any filter: an offset, a scale, a line of the mains.
//!
//! With the states x of the device and h(x) of its sensor the recording is
//! y = (1 + s)·h(x) + b + Σ (c·cos ωt + d·sin ωt), with constants s, b, c and d that may drift as random walks. A course is led with a filter of all of
//! them; it sees those of the device alone.

use super::engine::{Course, DerivedQuantities, Filtering};
use super::gate::SampleGate;
use super::phase_prediction::{PhasePredictor, StatePropagation};
use super::{
    AnyKnownStateStep, MOST_STATES, SampleCounts, Sensor, StateName, StatePrior, Trajectory, Transition,
};
use crate::config::{ConfigError, Experiment, FilterTable, Key, MOST_LINES, Sign, TrackedState};
use crate::units::{Kind, kind};
use kalmems_core::Portable;
use kalmems_core::{FilterError, Innovation};
use std::f64::consts::TAU;

/// A constant between the sensor and the recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReadoutState {
    name: StateName,
    enters: ReadoutEffect,
    /// Its first standard deviation, about 0.
    sd: f64,
    /// By how much its variance grows per second.
    drift: f64,
}

/// How it enters the recording.
#[derive(Clone, Copy, Debug, PartialEq)]
enum ReadoutEffect {
    Offset,
    Scale,
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
                    drift,
                }));
                Ok::<_, ConfigError>(())
            };
        if let Some(offset) = &readout.offset {
            let of = signal_kind(offset);
            add(at.clone().child("offset"), offset, &[("readout_offset", ReadoutEffect::Offset)], of)?;
        }
        if let Some(scale) = &readout.scale {
            let of = ("1", &kind::RATIO, &kind::RATIO_DRIFT);
            add(at.clone().child("scale"), scale, &[("readout_scale", ReadoutEffect::Scale)], of)?;
        }
        for (index, (line, [cosine, sine])) in readout.lines.iter().zip(LINES).enumerate() {
            let rate = TAU * line.frequency.si();
            let names = [(cosine, ReadoutEffect::Cosine(rate)), (sine, ReadoutEffect::Sine(rate))];
            let key = at.clone().child("lines").index(index);
            let size = line.size();
            add(key, &size, &names, signal_kind(&size))?;
        }
        Ok(all)
    }

    /// Its name in trajectories.
    pub const fn name(&self) -> StateName {
        self.name
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
fn signal_kind(state: &TrackedState) -> SignalKind {
    if kind::CAPACITANCE.accepts(state.start_sd.value().unit().dimension()) {
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
        let mut shown = DeviceStateFilter { filter, states: self.states, time_s, after_s };
        lead(self.course, &mut shown)
    }
}

impl Course for WithReadout<'_> {
    fn time_s(&self) -> &[f64] {
        self.course.time_s()
    }

    fn signal(&self) -> &[f64] {
        self.course.signal()
    }

    fn further_signals(&self) -> Vec<String> {
        self.course.further_signals()
    }

    fn further_innovations(&self) -> &[[f64; 2]] {
        self.course.further_innovations()
    }

    fn derived(&self) -> Option<DerivedQuantities> {
        self.course.derived()
    }

    fn conclude(&self, trajectory: &mut Trajectory) {
        self.course.conclude(trajectory);
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
    /// How long the constants have drifted since the row before and are to be told it yet, in s.
    after_s: f64,
}

impl DeviceStateFilter<'_> {
    fn own(&self) -> usize {
        self.filter.mean().len().saturating_sub(self.states.len())
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
        // A step that is taken in parts drifts once.
        let after_s = std::mem::take(&mut self.after_s);
        self.filter.predict(&WithConstants { transition, states: self.states, after_s })
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
        let sensor =
            SensorWithReadout { sensor, states: self.states, time_s: self.time_s, is_recorded: false };
        self.filter.update_within(&sensor, y, variance, largest_nis)
    }

    fn update(
        &mut self,
        signal: usize,
        sensor: &dyn Sensor,
        y: f64,
        variance: f64,
    ) -> Result<Innovation<f64, 1>, FilterError> {
        let sensor =
            SensorWithReadout { sensor, states: self.states, time_s: self.time_s, is_recorded: signal == 0 };
        self.filter.update(signal, &sensor, y, variance)
    }

    fn watch(&mut self) -> Option<&mut SampleGate> {
        self.filter.watch()
    }

    /// Zero phases are predicted by filters of the motion alone.
    fn predict_phases(&self, _: &mut PhasePredictor, _: f64, _: Option<&dyn StatePropagation>) {}
}

/// A step of the device, and constants behind its states.
struct WithConstants<'a> {
    transition: &'a dyn Transition,
    states: &'a [ReadoutState],
    after_s: f64,
}

const SQUARE: usize = MOST_STATES * MOST_STATES;

impl WithConstants<'_> {
    /// Puts a matrix of the device's states into one of all.
    fn spread(&self, to: &mut [f64], own: usize, constants: impl Fn(&ReadoutState) -> f64, from: &[f64]) {
        let all = own + self.states.len();
        to.fill(0.0);
        for (to, from) in to.chunks_mut(all.max(1)).zip(from.chunks(own.max(1))).take(own) {
            to[..own].copy_from_slice(from);
        }
        for (i, state) in (own..).zip(self.states) {
            to[i * all + i] = constants(state);
        }
    }
}

impl Transition for WithConstants<'_> {
    fn advance(&self, x: &[f64], to: &mut [f64]) {
        let own = x.len() - self.states.len();
        self.transition.advance(&x[..own], &mut to[..own]);
        to[own..].copy_from_slice(&x[own..]);
    }

    fn linearize(&self, x: &[f64], to: &mut [f64], jacobian: &mut [f64]) {
        let own = x.len() - self.states.len();
        let mut room = [0.0; SQUARE];
        let of_device = &mut room[..own * own];
        self.transition.linearize(&x[..own], &mut to[..own], of_device);
        to[own..].copy_from_slice(&x[own..]);
        self.spread(jacobian, own, |_| 1.0, of_device);
    }

    fn noise(&self, covariance: &mut [f64], root: &mut [f64]) {
        let all = (0..=MOST_STATES).find(|n| n * n == covariance.len()).unwrap_or(0);
        let own = all - self.states.len().min(all);
        let (mut room, mut room_of_root) = ([0.0; SQUARE], [0.0; SQUARE]);
        let (of_device, of_root) = (&mut room[..own * own], &mut room_of_root[..own * own]);
        self.transition.noise(of_device, of_root);
        self.spread(covariance, own, |state| state.drift * self.after_s, of_device);
        self.spread(root, own, |state| (state.drift * self.after_s).sqrt(), of_root);
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
    is_recorded: bool,
}

impl SensorWithReadout<'_> {
    /// What is recorded where the sensor gives this, and its derivative by that.
    fn recorded(&self, given: f64, constants: &[f64], slopes: &mut [f64]) -> (f64, f64) {
        slopes.fill(0.0);
        if !self.is_recorded {
            return (given, 1.0);
        }
        let (mut added, mut scale) = (0.0, 1.0);
        for ((state, value), slope) in self.states.iter().zip(constants).zip(slopes) {
            *slope = match state.enters {
                ReadoutEffect::Offset => 1.0,
                ReadoutEffect::Scale => given,
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
        let (of_device, of_constants) = slopes.split_at_mut(own);
        let given = self.sensor.linearize(&x[..own], of_device);
        let (recorded, scale) = self.recorded(given, &x[own..], of_constants);
        for slope in of_device {
            *slope *= scale;
        }
        recorded
    }
}

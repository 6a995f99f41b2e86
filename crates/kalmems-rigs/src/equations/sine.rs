//! A motion that is a sine whose amplitude, frequency, phase and rest position are states, and how it is found in a signal.

use super::EquationColumns;
use super::course::SegmentChannel;
use super::inversion::{Inverse, InverseNumbers};
use super::names;
use super::own_device::OwnDevice;
use super::settings::EquationSettings;
use super::table::EquationsTable;
use super::trigger::{TriggerTable, motion_frequency};
use crate::estimate::{EstimateError, MotionRate, Past, RowsAround, SignalSegment, Trajectory};
use crate::signal::{fit_sine, fit_sine_at};
use crate::units::kind;
use kalmems_core::Portable;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// A quantity that moves as a sine about a rest: offset + amplitude·cos(phase), whose parts are states.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SineTable {
    /// The quantity, which a measurement reads.
    pub of: String,
    /// The quantity that is its rate, where there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rate: Option<String>,
    /// The state about which it swings.
    pub offset: String,
    /// The state that is its amplitude.
    pub amplitude: String,
    /// The state that is its frequency, in Hz.
    pub frequency: String,
    /// The state that is its phase, which comes round.
    pub phase: String,
    /// The state that is the rate of its amplitude, where there is one: a start takes it for 0 within 0.3 of the amplitude a minute, unless `start_sd`
    /// says otherwise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub amplitude_rate: Option<String>,
    /// States that a filter holds where neither its process noise nor its `start_sd` names them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub held: Vec<String>,
    /// A channel that rises so often in a cycle of the motion, where a recording may have one: it tells the frequency.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub trigger: Option<TriggerTable>,
}

/// The same of a device, by places.
pub struct QuantitySine {
    /// The quantity, and its rate.
    pub quantities: [Option<usize>; 2],
    /// The states that are amplitude, frequency, phase and rest.
    roles: [usize; 4],
    pub amplitude_rate: Option<usize>,
    held: Vec<usize>,
    /// The column of a trigger would be that of this channel.
    pub trigger: Option<TriggerTable>,
    /// Of each measurement that reads the quantity, what it means.
    inverses: Vec<(usize, Inverse)>,
}

/// Rows in which a sine is first sought; they are doubled until they hold so many cycles.
const FIRST_ROWS: usize = 400;
const CYCLES: f64 = 6.0;
/// Rows that a filter is started again by, at most, and the cycles that they are to hold.
const MOST_AGAIN: usize = 8192;
const CYCLES_AGAIN: f64 = 10.0;
/// Rows of a segment's beginning that a start may look at, at least.
const HEAD_ROWS: usize = 4096;
/// Cycles of the motion that have to follow the settling time.
pub const SCORED_CYCLES: f64 = 10.0;

impl QuantitySine {
    /// Of a device, where its table has one; what is wrong with it comes back with its key below the device's table.
    pub fn of(own: &OwnDevice, table: &EquationsTable) -> Result<Option<Self>, (&'static str, String)> {
        let Some(sine) = &table.sine else { return Ok(None) };
        let device = &own.device;
        let state = |key: &'static str, name: &str| {
            let known = || {
                device.states().iter().map(|named| format!("`{}`", named.name)).collect::<Vec<_>>().join(", ")
            };
            device
                .state(name)
                .ok_or_else(|| (key, format!("`{name}` is not a state; the states are {}", known())))
        };
        let quantity = |key: &'static str, name: &str| {
            let place = device.quantities().iter().position(|named| *named.name == *name);
            place.ok_or_else(|| (key, format!("`{name}` is not in the table `quantities`")))
        };
        let of = quantity("of", &sine.of)?;
        let rate = sine.rate.as_ref().map(|name| quantity("rate", name)).transpose()?;
        let roles = [
            state("amplitude", &sine.amplitude)?,
            state("frequency", &sine.frequency)?,
            state("phase", &sine.phase)?,
            state("offset", &sine.offset)?,
        ];
        let rate_of_amplitude = sine.amplitude_rate.as_ref();
        let amplitude_rate = rate_of_amplitude.map(|name| state("amplitude_rate", name)).transpose()?;
        let held = sine.held.iter().map(|name| state("held", name)).collect::<Result<_, _>>()?;
        if !is_sine(own, of, roles) {
            let [amplitude, _, phase, offset] = roles.map(|state| device.states()[state].name.clone());
            return Err(("of", format!("`{}` is not {offset} + {amplitude}*cos({phase})", sine.of)));
        }
        let mut inverses = Vec::new();
        for measure in 0..device.measures().len() {
            match Inverse::of(own, measure) {
                Ok(inverse) if inverse.quantity() == Some(of) => inverses.push((measure, inverse)),
                _ => {}
            }
        }
        if inverses.is_empty() {
            return Err(("of", format!("no measurement is one of `{}` alone", sine.of)));
        }
        Ok(Some(Self {
            quantities: [Some(of), rate],
            roles,
            amplitude_rate,
            held,
            trigger: sine.trigger.clone(),
            inverses,
        }))
    }

    /// The name of the quantity.
    pub fn name(&self, own: &OwnDevice) -> &'static str {
        let quantities = names::quantities(&own.device);
        self.quantities[0].and_then(|place| quantities.get(place)).map_or("", |(name, ..)| name)
    }

    /// The states that a filter holds unless it says otherwise.
    pub fn held(&self) -> &[usize] {
        &self.held
    }

    /// The state that is the frequency in Hz.
    pub fn frequency(&self) -> usize {
        self.roles[1]
    }

    /// The states that are amplitude, frequency, phase and rest.
    pub fn roles(&self) -> [usize; 4] {
        self.roles
    }

    /// Gives phases between −π and π.
    pub fn turn_back(&self, own: &OwnDevice, trajectories: &mut [Trajectory]) {
        let Some(phase) = own.device.states().get(self.roles[2]) else { return };
        let states = trajectories.iter_mut().flat_map(|trajectory| &mut trajectory.states);
        for state in states.filter(|state| *state.name == *phase.name) {
            state.mean.iter_mut().for_each(|phase| *phase -= TAU * (*phase / TAU - 0.5).ceil());
        }
    }

    /// Whether a state is told by the sine that is found.
    pub fn is_told(&self, state: usize) -> bool {
        self.roles.contains(&state)
    }

    /// The inverse of a measurement, where that reads the quantity.
    pub fn inverse(&self, measure: usize) -> Option<&Inverse> {
        self.inverses.iter().find(|(own, _)| *own == measure).map(|(_, inverse)| inverse)
    }

    /// What samples of a measurement mean, each by itself; not a number where they mean nothing.
    pub fn values(
        &self,
        own: &OwnDevice,
        (measure, noise_sd): (usize, f64),
        signal: &[f64],
    ) -> Option<Vec<f64>> {
        let inverse = self.inverse(measure)?;
        let mut work: InverseNumbers = inverse.work(&own.values);
        let inputs = vec![0.0; own.device.inputs().len()];
        let mut value = |y: &f64| {
            let found = y.is_finite().then(|| inverse.value_at(&mut work, &inputs, (*y, noise_sd)))?;
            found.map(|([value, _], _)| value)
        };
        let mut values: Vec<f64> = signal.iter().map(|y| value(y).unwrap_or(f64::NAN)).collect();
        leave_out_far(&mut values);
        Some(values)
    }
}

/// Deviations from the median, in the median of these, beyond which a value is none of a motion: a sine has 1.4.
const FAR: f64 = 8.0;

/// Leaves out what lies so far from the others that it is no value of a sine: where noise is as large as the signal, its inverse may be anything.
fn leave_out_far(values: &mut [f64]) {
    let median = |mut of: Vec<f64>| {
        let middle = of.len() / 2;
        (!of.is_empty()).then(|| *of.select_nth_unstable_by(middle, f64::total_cmp).1)
    };
    let finite =
        |values: &[f64]| values.iter().copied().filter(|value| value.is_finite()).collect::<Vec<f64>>();
    let Some(middle) = median(finite(values)) else { return };
    let Some(size) = median(finite(values).iter().map(|value| (value - middle).abs()).collect()) else {
        return;
    };
    values
        .iter_mut()
        .filter(|value| (**value - middle).abs() > FAR * size)
        .for_each(|value| *value = f64::NAN);
}

/// Whether a quantity is offset + amplitude·cos(phase) where all other states are 0.
fn is_sine(own: &OwnDevice, quantity: usize, [amplitude, _, phase, offset]: [usize; 4]) -> bool {
    let Ok(quantity) = own.device.quantity(quantity, &[]) else { return false };
    let inputs = vec![0.0; own.device.inputs().len()];
    [[0.7, 0.4, 1.9], [0.2, 2.9, 3.1], [1.3, -1.1, 2.3]].into_iter().all(|[a, p, rest]| {
        let mut x = vec![0.0; own.rest.len()];
        (x[amplitude], x[phase], x[offset]) = (a, p, rest);
        let read = quantity.read(&mut quantity.work(&own.values), &x, &inputs);
        (read - (rest + a * p.portable_cos())).abs() <= 1e-12
    })
}

/// A sine that was found in some rows: amplitude, frequency, phase at the first of them, and rest.
#[derive(Clone, Copy, Debug)]
pub struct FoundSine {
    /// Amplitude, frequency, phase and rest.
    pub of_roles: [f64; 4],
    /// The rows.
    pub end: usize,
}

impl FoundSine {
    /// Its frequency in Hz.
    pub fn frequency_hz(&self) -> f64 {
        self.of_roles[1]
    }
}

impl QuantitySine {
    /// The sine in the first of these rows, which grow until they hold six cycles; with a trigger's frequency in Hz where there is one.
    pub fn find(
        &self,
        own: &OwnDevice,
        (time_s, signal): (&[f64], &[f64]),
        measured: (usize, f64),
        (interval_s, motion_hz): (f64, Option<f64>),
    ) -> Option<FoundSine> {
        let mut rows = FIRST_ROWS;
        loop {
            let end = rows.min(signal.len());
            let values = self.values(own, measured, signal.get(..end)?)?;
            let first_s = time_s.first()?;
            let times: Vec<f64> = time_s.get(..end)?.iter().map(|t| t - first_s).collect();
            let sine = match motion_hz {
                Some(motion_hz) => fit_sine_at(&times, &values, motion_hz),
                None => fit_sine(&times, &values, interval_s),
            };
            let enough = |hz: f64| hz * interval_s * end as f64 >= CYCLES;
            if end == signal.len() || sine.is_some_and(|sine| enough(sine.frequency_hz)) {
                let sine = sine?;
                let of_roles = [sine.amplitude, sine.frequency_hz, sine.phase_rad, sine.offset];
                return Some(FoundSine { of_roles, end });
            }
            rows *= 2;
        }
    }

    /// Rows that a filter is started again by, where its motion has this frequency.
    pub fn rows_again(motion_hz: f64, interval_s: f64) -> usize {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a positive count, saturating
        let rows = (CYCLES_AGAIN / (motion_hz * interval_s)).ceil() as usize;
        rows.clamp(FIRST_ROWS, MOST_AGAIN)
    }

    /// Rows before new ones that a filter may be started again by.
    pub const ROWS_BEFORE: usize = MOST_AGAIN + 1;

    /// Rows of a segment's beginning that a start may look at, where filters settle for so long.
    pub fn head_rows(settling_s: f64, interval_s: f64) -> usize {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a positive count, saturating
        let rows = (settling_s / interval_s).ceil() as usize;
        rows.clamp(HEAD_ROWS, RowsAround::LONGEST_HEAD)
    }

    /// Refuses samples that are too far apart for a motion of a known frequency in Hz.
    pub fn require_fast_enough(
        &self,
        own: &OwnDevice,
        (place, interval_s, motion_hz): (&str, f64, f64),
        (measured, signal): ((usize, f64), &[f64]),
    ) -> Result<(), EstimateError> {
        let rate_hz = 1.0 / interval_s;
        if rate_hz > 2.0 * motion_hz {
            return Ok(());
        }
        let alias_hz = (motion_hz - rate_hz * (motion_hz / rate_hz).round()).abs();
        let values = self.values(own, measured, signal).unwrap_or_default();
        let finite = values.iter().filter(|value| value.is_finite());
        let (low, high) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
        let error = (high - low).max(0.0);
        let unit = self.quantities[0].and_then(|place| own.device.quantities().get(place));
        let unit = unit.map_or_else(String::new, |named| names::kind_of(named).dimension.to_string());
        let place = place.to_owned();
        Err(EstimateError::SampledTooSlowly { place, rate_hz, motion_hz, alias_hz, error, unit })
    }
}

impl QuantitySine {
    /// How fast it moves: by a trigger, or else by the first samples, or else by what the file says of a start.
    pub fn motion(
        &self,
        settings: &EquationSettings,
        columns: &EquationColumns,
        (segment, channels): (&SignalSegment, &[SegmentChannel]),
        past: &mut Past,
    ) -> Result<MotionRate, EstimateError> {
        let (time_s, interval_s) = (segment.time_s.as_slice(), segment.interval_s);
        let fresh = segment.fresh.clone();
        let head = fresh.start..fresh.end.min(fresh.start + Self::head_rows(settings.skip_s, interval_s));
        let is_driven = columns.trigger.is_some();
        if let Some(rate) = past.motion_rate {
            return Ok(MotionRate { frequency_hz: rate / TAU, is_driven });
        }
        let told = columns.trigger.zip(self.trigger.as_ref()).map(|(column, trigger)| {
            let values = segment.recording.column_of(column, &kind::VOLTAGE)?.of(segment.segment);
            let rows = (&time_s[head.clone()], &values[head.clone()]);
            motion_frequency(rows, trigger.rises, interval_s).map_err(|why| {
                let (place, column) = (segment.place.clone(), column.to_owned());
                EstimateError::Trigger { place, column, why: why.to_string() }
            })
        });
        let told = told.transpose()?;
        let stated = settings.filters.iter().find_map(|filter| filter.about_of(self.frequency()));
        let read = channels.iter().find(|channel| self.inverse(channel.measure).is_some());
        let read =
            read.map(|channel| ((channel.measure, channel.variance.sqrt()), &channel.signal[head.clone()]));
        if let Some((motion_hz, read)) = told.or(stated).zip(read) {
            self.require_fast_enough(&settings.own, (&segment.place, interval_s, motion_hz), read)?;
        }
        let found = || {
            let (measured, signal) = read?;
            Some(
                self.find(&settings.own, (&time_s[head.clone()], signal), measured, (interval_s, None))?
                    .frequency_hz(),
            )
        };
        let frequency_hz = told.or_else(found).or(stated).unwrap_or(f64::NAN);
        past.motion_rate = Some(TAU * frequency_hz);
        segment.require_after_settling(SCORED_CYCLES / frequency_hz)?;
        Ok(MotionRate { frequency_hz, is_driven })
    }
}

//! The line that an oscillation of a state makes in a measurement, by which a lock-in reads the oscillation.

use super::axes::window_s;
use super::course::SegmentChannel;
use super::filter_task::EquationFilterTask;
use super::input_part::InputPart;
use super::lines::{SeparateLines, separating_s};
use super::own_device::OwnDevice;
use super::table::EquationsTable;
use crate::estimate::{
    EstimateError, FilterPast, LockInWindows, StateName, Swing, Trajectory, amplitude_of_line, lock_in,
};
use crate::signal::{PortableComplex, Sine, fit_sine_at};
use kalmems_equations::{Motion, ProgramNumbers, ReadoutProgram};
use num_complex::Complex64;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::cell::RefCell;
use std::f64::consts::{PI, TAU};
use std::num::NonZeroU8;

/// An oscillation under a sinusoidal drive: what a lock-in has to know of a device beside its equations.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct OscillationTable {
    /// The state that oscillates; another state is its rate. Of two axes a list of both, each under a sine of its own: the drive is the sum of these, or each is
    /// an input.
    #[serde(with = "one_or_several")]
    #[schemars(schema_with = "one_or_several::schema")]
    pub of: Vec<String>,
    /// The harmonic of the oscillation at which the signal is read, 1 or 2; 1 if left out. A signal that is the same for both signs
    /// of the state has the second and not the first.
    #[serde(default = "once")]
    #[schemars(range(min = 1, max = 2))]
    pub harmonic: NonZeroU8,
    /// The cycles of the drive in one of the oscillation, 1 if left out: 2 under parametric excitation.
    #[serde(default = "once")]
    pub drive_cycles: NonZeroU8,
    /// Whether a filter that states `start_sd`, or none that claims anything, begins with `start = "from_signal"` at the oscillation that the first two
    /// cycles of its signal show, `start_sd` being how far that may be off; false if left out.
    #[serde(default, skip_serializing_if = "is_false")]
    pub starts: bool,
}

impl OscillationTable {
    /// The states that oscillate.
    pub fn states(&self) -> &[String] {
        &self.of
    }

    /// The cycles of the drive in one of the oscillation.
    pub fn drive_cycles(&self) -> f64 {
        self.drive_cycles.get().into()
    }
}

#[allow(clippy::trivially_copy_pass_by_ref)] // as serde asks it
fn is_false(stated: &bool) -> bool {
    !stated
}

fn once() -> NonZeroU8 {
    NonZeroU8::MIN
}

/// One name, or a list of several.
mod one_or_several {
    use schemars::{Schema, SchemaGenerator, json_schema};
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    #[derive(Deserialize)]
    #[serde(untagged, expecting = "expected the name of a state, or a list of names")]
    enum OneOrSeveral {
        One(String),
        Several(Vec<String>),
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<String>, D::Error> {
        Ok(match OneOrSeveral::deserialize(deserializer)? {
            OneOrSeveral::One(name) => vec![name],
            OneOrSeveral::Several(names) => names,
        })
    }

    pub fn serialize<S: Serializer>(names: &[String], serializer: S) -> Result<S::Ok, S::Error> {
        if let [name] = names { name.serialize(serializer) } else { names.serialize(serializer) }
    }

    pub fn schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "anyOf": [{ "type": "string" }, { "type": "array", "items": { "type": "string" } }] })
    }
}

/// Points of a cycle at which a measurement is read. What a sum of trapezoids leaves of a smooth periodic function falls
/// exponentially with them.
const POINTS: usize = 256;
/// The harmonics of lags and delays that are followed.
const HARMONICS: usize = 33;
/// Looks for the level about which a signal swings, at most.
const LEVELS: usize = 30;
/// How near the level is, relative to the line.
const NEAR: f64 = 1e-12;
/// The size of a line, relative to that of the signal, at which the search for its amplitude begins.
const SMALL: f64 = 1e-2;
/// Cycles from which a gain that turns with the swing takes that.
const FIRST_CYCLES: f64 = 4.0;
/// Doublings from the smallest amplitude in SI that is tried, and that amplitude.
const DOUBLINGS: i32 = 130;
const SMALLEST: f64 = 1e-24;

/// What a measurement shows of an oscillation x(t) = x₀ + A·sin φ of one state: its mean, and the complex amplitudes of the first
/// harmonic and of that which is read, Re(c·e^{inφ}).
#[derive(Clone, Copy, Debug)]
struct OscillationLine {
    mean: f64,
    first: Complex64,
    harmonic: Complex64,
}

/// A measurement of one oscillating state.
pub struct MeasuredOscillation {
    /// The measurement.
    pub measure: usize,
    /// Which of the states that oscillate it is of.
    axis: usize,
    motion: Motion,
    readout: ReadoutProgram,
    /// The state that oscillates, and its rate.
    pub states: [usize; 2],
    /// The states of lags and delays on which the measurement depends, and how their rates depend on each other.
    followers: Vec<usize>,
    coupling: Vec<f64>,
    rest: Vec<f64>,
    inputs: usize,
    harmonic: usize,
    /// e^{iφ} over a cycle.
    cycle: Vec<Complex64>,
}

impl MeasuredOscillation {
    /// Of a measurement, by its place, of a device that states the state that oscillates, by its place among these; why there is none.
    pub fn of(
        own: &OwnDevice,
        table: &EquationsTable,
        (measure, axis): (usize, usize),
    ) -> Result<Self, String> {
        let device = &own.device;
        let Some((stated, of)) = table.oscillation.as_ref().and_then(|all| Some((all, all.of.get(axis)?)))
        else {
            return Err("its equations say what signal a state makes, and not which state oscillates with the drive; write \
                        `[device.equations.oscillation]` with `of = \"…\"`, or use `ekf`"
                .to_owned());
        };
        let named = |state: usize| device.states().get(state).map(|n| n.name.to_string()).unwrap_or_default();
        let own_states = device.own_states();
        let [state, rate] = swinging(own, table, of)?;
        let other =
            own.axes.iter().flat_map(|axis| axis.states).filter(|place| *place != state && *place != rate);
        let others: Vec<usize> = other.collect();
        if stated.harmonic.get() > 2 {
            return Err(format!("`oscillation.harmonic` is {}; 1 and 2 can be read", stated.harmonic));
        }
        let wrong = |error: kalmems_equations::EquationError| error.to_string();
        let (motion, readout) = (&own.motion, device.readout(measure, &[]).map_err(wrong)?);
        let mut followers = Vec::new();
        let mut found: Vec<usize> = readout.sparsity().collect();
        while let Some(next) = found.pop() {
            if next == state || next == rate || others.contains(&next) || followers.contains(&next) {
                continue;
            }
            if next < own_states {
                return Err(format!(
                    "its measurement depends on `{}` as well, which an oscillation of `{of}` does not determine",
                    named(next)
                ));
            }
            followers.push(next);
            found.extend(motion.sparsity().filter(|(row, _)| *row == next).map(|(_, column)| column));
        }
        followers.sort_unstable();
        let states = device.states().len();
        let (mut rates, mut jacobian) = (vec![0.0; states], vec![0.0; states * states]);
        let inputs = vec![0.0; device.inputs().len()];
        let mut coupled = |followed: Option<f64>| -> Vec<f64> {
            let mut x = own.rest.clone();
            for state in &followers {
                x[*state] = followed.unwrap_or(x[*state]);
            }
            motion.linearize(&mut motion.work(&own.values), &x, &inputs, &mut rates, &mut jacobian);
            let of_row = |row: usize| followers.iter().map(move |column| row * states + column);
            followers.iter().flat_map(|row| of_row(*row)).map(|place| jacobian[place]).collect()
        };
        let coupling = coupled(None);
        // Slopes of what is linear are numbers, whatever the states are.
        if let Some(first) = followers.first().filter(|_| coupling != coupled(Some(0.7))) {
            return Err(format!(
                "what `{}` and the other lags and delays follow is not linear in them; a lock-in needs linear ones",
                named(*first)
            ));
        }
        let cycle = (0..POINTS).map(|k| Complex64::portable_cis(TAU * k as f64 / POINTS as f64));
        let all = Self {
            measure,
            axis,
            states: [state, rate],
            coupling,
            rest: own.rest.clone(),
            inputs: inputs.len(),
            harmonic: stated.harmonic.get().into(),
            cycle: cycle.collect(),
            motion: motion.clone(),
            readout,
            followers,
        };
        if let Some(other) = all.mixes(&own.values, &others) {
            return Err(format!(
                "its measurement is no sum of a part of `{of}` and one of `{}`, so that the lines of both are not distinguished; use `ekf`",
                named(other)
            ));
        }
        if all.depends_on_an_input(&own.values) {
            return Err("its measurement depends on an input itself, whose line would be taken for that of the motion; use `ekf`"
                .to_owned());
        }
        Ok(all)
    }

    /// Another state on which it depends how the measurement, or what a lag of it follows, grows with this one.
    fn mixes(&self, values: &[f64], others: &[usize]) -> Option<usize> {
        let mut work = self.work(values);
        let (states, inputs) = (self.rest.len(), vec![0.0; self.inputs]);
        let mut slopes_at = |other: Option<usize>| -> Vec<u64> {
            let mut x = self.rest.clone();
            x[self.states[0]] += 0.1;
            if let Some(place) = other {
                x[place] += 0.07;
            }
            let (mut of_readout, mut rates) = (vec![0.0; states], vec![0.0; states]);
            let mut jacobian = vec![0.0; states * states];
            self.readout.linearize(&mut work[1], &x, &inputs, &mut of_readout);
            self.motion.linearize(&mut work[0], &x, &inputs, &mut rates, &mut jacobian);
            let of = self.states.into_iter();
            of.flat_map(|own| {
                let followed = self.followers.iter().map(move |row| row * states + own);
                followed.map(|place| jacobian[place]).chain([of_readout[own]]).collect::<Vec<_>>()
            })
            .map(f64::to_bits)
            .collect()
        };
        let alone = slopes_at(None);
        others.iter().copied().find(|other| slopes_at(Some(*other)) != alone)
    }

    /// What is worked on, for the values of all parameters.
    pub fn work(&self, values: &[f64]) -> [ProgramNumbers; 2] {
        [self.motion.work(values), self.readout.work(values)]
    }

    /// Whether the measurement, or what a lag of it follows, is another one under another input.
    fn depends_on_an_input(&self, values: &[f64]) -> bool {
        let mut work = self.work(values);
        let mut rates = vec![0.0; self.rest.len()];
        let mut read = |size: f64, place: usize| -> Vec<u64> {
            let inputs: Vec<f64> = (0..self.inputs).map(|k| if k == place { size } else { 0.0 }).collect();
            self.motion.rates(&mut work[0], &self.rest, &inputs, &mut rates);
            let value = self.readout.read(&mut work[1], &self.rest, &inputs);
            let followed = self.followers.iter().map(|state| rates[*state]);
            followed.chain([value]).map(f64::to_bits).collect()
        };
        (0..self.inputs)
            .any(|place| [1.0, -0.7].into_iter().any(|size| read(size, place) != read(0.0, place)))
    }

    /// What the measurement shows of an oscillation about `level` with an amplitude, at a rate in rad/s.
    fn line(&self, work: &mut [ProgramNumbers; 2], level: f64, amplitude: f64, rate: f64) -> OscillationLine {
        let inputs = vec![0.0; self.inputs];
        let mut x = self.rest.clone();
        let place = |x: &mut [f64], at: Complex64| {
            x[self.states[0]] = level + amplitude * at.im;
            x[self.states[1]] = amplitude * rate * at.re;
        };
        let followed = self.followed(&mut work[0], &place, &inputs, rate);
        let count = self.followers.len();
        let values: Vec<f64> = (0..POINTS)
            .map(|k| {
                place(&mut x, self.cycle[k]);
                for (state, value) in self.followers.iter().zip(followed.iter().skip(k * count)) {
                    x[*state] = *value;
                }
                self.readout.read(&mut work[1], &x, &inputs)
            })
            .collect();
        let of = |harmonic| self.component(values.iter().copied(), harmonic);
        OscillationLine { mean: 0.5 * of(0).re, first: of(1), harmonic: of(self.harmonic) }
    }

    /// The complex amplitude of a harmonic of a function over a cycle; twice its mean for the harmonic 0.
    fn component(&self, values: impl Iterator<Item = f64>, harmonic: usize) -> Complex64 {
        let turned = |(k, value): (usize, f64)| self.cycle[(k * harmonic) % POINTS].conj() * value;
        values.enumerate().map(turned).sum::<Complex64>() * (2.0 / POINTS as f64)
    }

    /// The states of lags and delays over a cycle, point by point, when all has settled: they are linear, so that each harmonic of what
    /// they follow makes its own.
    fn followed(
        &self,
        work: &mut ProgramNumbers,
        place: &impl Fn(&mut [f64], Complex64),
        inputs: &[f64],
        rate: f64,
    ) -> Vec<f64> {
        let count = self.followers.len();
        if count == 0 {
            return Vec::new();
        }
        let (mut x, mut rates) = (self.rest.clone(), vec![0.0; self.rest.len()]);
        for state in &self.followers {
            x[*state] = 0.0;
        }
        let mut forced = Vec::with_capacity(POINTS * count);
        for at in &self.cycle {
            place(&mut x, *at);
            self.motion.rates(work, &x, inputs, &mut rates);
            forced.extend(self.followers.iter().map(|state| rates[*state]));
        }
        let mut followed = vec![0.0; POINTS * count];
        for harmonic in 0..HARMONICS {
            let of = |place: usize| forced.iter().skip(place).step_by(count).copied();
            let forcing: Vec<Complex64> =
                (0..count).map(|place| self.component(of(place), harmonic)).collect();
            let Some(made) = self.settled(harmonic as f64 * rate, forcing) else { continue };
            let share = if harmonic == 0 { 0.5 } else { 1.0 };
            for (k, to) in followed.chunks_exact_mut(count).enumerate() {
                let turned = self.cycle[(k * harmonic) % POINTS] * share;
                for (to, made) in to.iter_mut().zip(&made) {
                    *to += (made * turned).re;
                }
            }
        }
        followed
    }

    /// U of (i·ω − D)·U = F, by Gauss's elimination; `None` where there is none.
    fn settled(&self, rate: f64, mut forcing: Vec<Complex64>) -> Option<Vec<Complex64>> {
        let n = forcing.len();
        let mut matrix: Vec<Complex64> = self.coupling.iter().map(|slope| Complex64::from(-slope)).collect();
        (0..n).for_each(|i| matrix[i * n + i].im += rate);
        for column in 0..n {
            let size = |row: &usize| matrix[row * n + column].portable_norm();
            let pivot = (column..n).max_by(|a, b| size(a).total_cmp(&size(b)))?;
            (0..n).for_each(|k| matrix.swap(column * n + k, pivot * n + k));
            forcing.swap(column, pivot);
            for row in (0..n).filter(|row| *row != column) {
                let factor = matrix[row * n + column] / matrix[column * n + column];
                for k in column..n {
                    let taken = factor * matrix[column * n + k];
                    matrix[row * n + k] -= taken;
                }
                let taken = factor * forcing[column];
                forcing[row] -= taken;
            }
        }
        let settled: Vec<Complex64> = (0..n).map(|i| forcing[i] / matrix[i * n + i]).collect();
        settled.iter().all(|u| u.is_finite()).then_some(settled)
    }

    /// The oscillation in some samples, and how the line grows with the amplitude. An even harmonic is the same for both signs of the
    /// state: then the sign is that which lies nearer to the oscillation before, and of the first one that of the first harmonic, where
    /// there is any. `None` where there are too few samples, or more signal than an oscillation makes.
    pub fn swing(
        &self,
        work: &mut [ProgramNumbers; 2],
        (time_s, signal): (&[f64], &[f64]),
        motion_hz: f64,
        before: Option<&Swing>,
    ) -> Option<(Swing, f64)> {
        let rate = TAU * motion_hz;
        let seen = fit_sine_at(time_s, signal, self.harmonic as f64 * motion_hz)?;
        let mut level = before.map_or(self.rest[self.states[0]], |before| before.rest);
        let mut amplitude = self.amplitude(work, level, rate, (&seen, before))?;
        let mut line = self.line(work, level, amplitude, rate);
        // The mean of the signal tells the level, where the signal grows with the state.
        if self.harmonic == 1 {
            for _ in 0..LEVELS {
                let off = seen.offset - line.mean;
                let slope = self.slope(work, level, amplitude, rate)?;
                if slope == 0.0 || off.abs() <= NEAR * line.harmonic.portable_norm() {
                    break;
                }
                level += off / slope;
                amplitude = self.amplitude(work, level, rate, (&seen, before))?;
                line = self.line(work, level, amplitude, rate);
            }
        }
        let mut phase = (seen.phase_rad - line.harmonic.portable_arg()) / self.harmonic as f64;
        if self.harmonic == 2
            && before.is_none()
            && line.first.portable_norm() > NEAR * line.harmonic.portable_norm()
        {
            let first = fit_sine_at(time_s, signal, motion_hz)?;
            if (first.phase_rad - phase - line.first.portable_arg()).cos() < 0.0 {
                phase += PI;
            }
        }
        let swing = Swing { rest: level, amplitude, rate, phase };
        let swing = if self.harmonic == 2 { swing.nearest_to(before) } else { swing };
        let grows = line.harmonic.portable_norm() / amplitude;
        (level.is_finite() && phase.is_finite() && grows.is_finite()).then_some((swing, grows))
    }

    /// The amplitude that makes a line of this size.
    fn amplitude(
        &self,
        work: &mut [ProgramNumbers; 2],
        level: f64,
        rate: f64,
        (seen, before): (&Sine, Option<&Swing>),
    ) -> Option<f64> {
        let size = seen.amplitude;
        let work = RefCell::new(work);
        let line = |amplitude: f64| {
            self.line(&mut work.borrow_mut(), level, amplitude, rate).harmonic.portable_norm()
        };
        let small = |amplitude: f64| line(amplitude) < SMALL * size;
        let near =
            before.map(|before| 0.5 * before.amplitude).filter(|near| *near > 0.0 && line(*near) < size);
        let unit = near.or_else(|| {
            // By large steps first, which do not lead over the amplitudes at which a line is large: of a comb these are 2¹¹ apart and more, and behind
            // them the line is small again.
            let mut doublings = 0;
            let after = |doublings: i32| SMALLEST * 2.0_f64.powi(doublings);
            for step in [8, 2, 1] {
                while doublings + step <= DOUBLINGS && small(after(doublings + step)) {
                    doublings += step;
                }
            }
            (doublings < DOUBLINGS).then(|| after(doublings))
        })?;
        amplitude_of_line(size, [unit, f64::MAX], line)
    }

    /// How fast the mean grows with the level.
    fn slope(&self, work: &mut [ProgramNumbers; 2], level: f64, amplitude: f64, rate: f64) -> Option<f64> {
        let step = 1e-4 * amplitude;
        let [above, below] =
            [level + step, level - step].map(|level| self.line(work, level, amplitude, rate).mean);
        let slope = (above - below) / (2.0 * step);
        let size = self.line(work, level, amplitude, rate).harmonic.portable_norm() / amplitude;
        slope.is_finite().then_some(if slope.abs() < 1e-3 * size { 0.0 } else { slope })
    }
}

/// A state that oscillates, by its name, and the state that is its rate; why it is none.
pub fn swinging(own: &OwnDevice, table: &EquationsTable, name: &str) -> Result<[usize; 2], String> {
    let place = |name: &str| own.device.state(name).filter(|state| *state < own.device.own_states());
    let Some(state) = place(name) else {
        return Err(format!("`oscillation.of` is `{name}`, which is not a state of the device"));
    };
    let Some(rate) = table.derivative.get(name).and_then(|text| place(text.trim())) else {
        return Err(format!(
            "`{name}` has no state for its rate: write a state `v` and `{name} = \"v\"` in `[device.equations.derivative]`"
        ));
    };
    Ok([state, rate])
}

/// Why samples show no oscillation of several states.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LineError {
    /// The lines of both cannot be told apart in them.
    #[error(
        "the first samples do not tell the lines of the two axes apart; take a longer recording, or move the drives apart"
    )]
    Inseparable,
    /// One of them does not move, or too little.
    #[error(
        "`{state}`: its line in the signal is {line:.2e} {unit}, and its standard deviation {sd:.1e} {unit}; expected five times that; it stands still, \
         or the recording is too short"
    )]
    NoMotion {
        /// Its name.
        state: String,
        /// The amplitude of the line.
        line: f64,
        /// Its standard deviation.
        sd: f64,
        /// The unit of the signal.
        unit: String,
    },
    /// The line is larger than any oscillation makes it.
    #[error(
        "`{state}`: its line in the signal is {line:.3} {unit}, more than an oscillation of it makes; check gain and capacitances, or what else the signal is of"
    )]
    TooLarge {
        /// Its name.
        state: String,
        /// The amplitude of the line.
        line: f64,
        /// The unit of the signal.
        unit: String,
    },
}

/// How many standard deviations of a line its amplitude has at least.
const LEAST_LINE: f64 = 5.0;

/// The mean of what several measurements show, each with a weight.
#[derive(Debug, Default)]
struct Mean {
    weight: f64,
    level: f64,
    phasor: Complex64,
}

impl Mean {
    fn add(&mut self, swing: &Swing, weight: f64) {
        self.weight += weight;
        self.level += weight * swing.rest;
        self.phasor += Complex64::portable_polar(weight * swing.amplitude, swing.phase);
    }

    fn swing(&self, rate: f64) -> Option<Swing> {
        let phasor = self.phasor / self.weight;
        let swing = Swing {
            rest: self.level / self.weight,
            amplitude: phasor.portable_norm(),
            rate,
            phase: phasor.portable_arg(),
        };
        (self.weight > 0.0 && swing.amplitude.is_finite()).then_some(swing)
    }
}

/// The lines of several states in samples, each alone; `None` of one state.
fn apart(
    of: &[&MeasuredOscillation],
    samples: (&[f64], &[f64]),
    motions_hz: &[f64],
) -> Result<Option<SeparateLines>, LineError> {
    let ([first, second], [first_hz, second_hz]) = (of, motions_hz) else { return Ok(None) };
    let lines_hz = [first.harmonic as f64 * first_hz, second.harmonic as f64 * second_hz];
    SeparateLines::of(samples, lines_hz).map(Some).ok_or(LineError::Inseparable)
}

impl EquationFilterTask<'_> {
    /// The signal of a channel without what inputs add to it.
    pub fn without_inputs<'a>(&self, channel: &SegmentChannel<'a>) -> Cow<'a, [f64]> {
        let Some(mut part) = InputPart::of(self.own, channel.measure) else { return channel.signal.into() };
        let of = (self.data.time_s, &*self.data.inputs, &*self.data.bends);
        part.taken_off(self.own, of, (channel.signal, self.data.samples.interval_s)).into()
    }

    /// How fast each oscillating state moves in Hz: as its sine drives it, or as it is free to.
    pub fn motions_hz(&self) -> Vec<f64> {
        match self.data.sines {
            _ if self.own.axes.is_empty() => vec![self.data.motion.frequency_hz],
            Some(sines) => sines.motions(self.own).map(|motion| motion.frequency_hz).into(),
            None => self.own.axes.iter().map(|axis| axis.natural_hz).collect(),
        }
    }

    /// What it shows of each oscillating state in some samples of a channel.
    fn lines_of<'a>(
        &'a self,
        channel: &SegmentChannel,
    ) -> impl Iterator<Item = &'a MeasuredOscillation> + use<'a> {
        let measure = channel.measure;
        self.filter.oscillations.iter().filter(move |of| of.measure == measure)
    }

    /// The oscillations that the first cycles of its signal show, of a device whose table says what a line means; their signs are those that lie nearer to
    /// others. `None` where the table does not say it.
    pub fn first_swings(&self, before: &[Swing]) -> Result<Option<Vec<Swing>>, LineError> {
        let data = self.data;
        let first = self.channels().first().and_then(|place| data.channels.get(*place));
        let (Some(channel), Some(begin_s)) = (first, data.time_s.first()) else { return Ok(None) };
        let (found, motions_hz) = (self.lines_of(channel).collect::<Vec<_>>(), self.motions_hz());
        if found.len() != motions_hz.len() || !data.motion.is_driven {
            return Ok(None);
        }
        let shown_s = if self.own.axes.is_empty() {
            FIRST_CYCLES / data.motion.frequency_hz
        } else {
            window_s(self.own)
        };
        let end = data.time_s.partition_point(|time_s| *time_s < begin_s + shown_s);
        let signal = self.without_inputs(channel);
        let (Some(time_s), Some(signal)) = (data.time_s.get(..end), signal.get(..end)) else {
            return Ok(None);
        };
        let apart = apart(&found, (time_s, signal), &motions_hz)?;
        let unit = self
            .own
            .device
            .measures()
            .get(channel.measure)
            .map_or_else(String::new, |own| own.unit_text.to_string());
        let mut swings = Vec::new();
        for ((of, motion_hz), place) in found.into_iter().zip(motions_hz).zip(0..) {
            let alone = apart.as_ref().map_or(signal, |apart| &apart.signals[of.axis]);
            let seen = || {
                fit_sine_at(time_s, alone, of.harmonic as f64 * motion_hz)
                    .map_or(f64::NAN, |sine| sine.amplitude)
            };
            let state = || self.own.device.states()[of.states[0]].name.to_string();
            if let Some(sd) =
                apart.as_ref().map(|apart| apart.amplitude_sd).filter(|sd| seen() < LEAST_LINE * sd)
            {
                return Err(LineError::NoMotion { state: state(), line: seen(), sd, unit });
            }
            let swing = of.swing(&mut of.work(&self.own.values), (time_s, alone), motion_hz, None);
            let Some((swing, _)) = swing else {
                if apart.is_none() {
                    return Ok(None);
                }
                return Err(LineError::TooLarge { state: state(), line: seen(), unit });
            };
            swings.push(swing.nearest_to(before.get(place)));
        }
        Ok(Some(swings))
    }

    /// Cycle by cycle, the oscillation that the lines of the signals show: the mean of all channels, by what the noise of their samples
    /// leaves of each. Of two axes, in windows that tell their lines apart.
    pub fn lock_in(&self, past: &mut FilterPast, states: &[StateName]) -> Result<Trajectory, EstimateError> {
        let (basics, data, oscillations) = (&self.filter.basics, self.data, &self.filter.oscillations);
        // Where nothing drives it, it moves as it is free to.
        let moves = data.motion.is_driven || self.own.natural_hz().is_some() && self.own.axes.is_empty();
        if oscillations.is_empty() || !moves {
            let (place, filter) = (data.place.to_owned(), basics.name.clone());
            return Err(EstimateError::NoSteadyDrive { place, filter });
        }
        if past.numbers.is_empty() && !self.own.axes.is_empty() {
            past.numbers = self.motions_hz();
        }
        let motions_hz = if self.own.axes.is_empty() { self.motions_hz() } else { past.numbers.clone() };
        let channels: Vec<&SegmentChannel> =
            self.channels().into_iter().filter_map(|place| data.channels.get(place)).collect();
        let alone: Vec<Cow<'_, [f64]>> =
            channels.iter().map(|channel| self.without_inputs(channel)).collect();
        let signals: Vec<&[f64]> = alone.iter().map(|signal| &**signal).collect();
        let windows = LockInWindows {
            time_s: data.time_s,
            signals: &signals,
            samples: &data.samples,
            start_s: data.start_s,
            length_s: self.length_s(&motions_hz)?,
        };
        let own = oscillations.iter().take(motions_hz.len()).flat_map(|of| of.states);
        let own: Vec<StateName> = own.filter_map(|state| states.get(state).copied()).collect();
        let read: Vec<_> = channels
            .iter()
            .map(|channel| {
                let of: Vec<_> = self.lines_of(channel).collect();
                let work: Vec<_> = of.iter().map(|of| RefCell::new(of.work(&self.own.values))).collect();
                (of, work, channel.variance)
            })
            .collect();
        let detect = |time_s: &[f64], signals: &[&[f64]], before: &[Swing]| {
            let mut before: Vec<Option<Swing>> = before.iter().copied().map(Some).collect();
            before.resize(motions_hz.len(), None);
            let mut means: Vec<Mean> = motions_hz.iter().map(|_| Mean::default()).collect();
            for ((of, work, variance), signal) in read.iter().zip(signals) {
                let Ok(apart) = apart(of, (time_s, signal), &motions_hz) else { continue };
                for (of, work) in of.iter().zip(work) {
                    let alone = apart.as_ref().map_or(*signal, |apart| &apart.signals[of.axis]);
                    let (before, motion_hz) = (before.get_mut(of.axis)?, *motions_hz.get(of.axis)?);
                    let found = of.swing(&mut work.borrow_mut(), (time_s, alone), motion_hz, before.as_ref());
                    let Some((swing, grows)) = found else { continue };
                    means.get_mut(of.axis)?.add(&swing, grows * grows / variance);
                    *before = before.or(Some(swing));
                }
            }
            means.iter().zip(&motions_hz).map(|(mean, hz)| mean.swing(TAU * hz)).collect()
        };
        Ok(lock_in((basics, past), &windows, &own, detect))
    }

    /// How long a window of a lock-in is in s: a cycle of the motion, and of two axes as many as tell their lines apart.
    fn length_s(&self, motions_hz: &[f64]) -> Result<f64, EstimateError> {
        let first = self.filter.oscillations.first().map_or(1.0, |of| of.harmonic as f64);
        let [x, y] = *motions_hz else {
            return Ok(motions_hz.first().copied().unwrap_or(f64::NAN).recip());
        };
        let (length_s, longest_s) = (separating_s([first * x, first * y]), window_s(self.own));
        if length_s <= longest_s {
            return Ok(length_s);
        }
        let why = format!(
            "the lock-in `{}` would need windows of {length_s:.2e} s to tell the lines of the two drives and of their harmonics apart; \
             both axes are taken to swing steadily for {longest_s:.0e} s at most: move the drives apart, or use `ekf`",
            self.filter.basics.name
        );
        Err(EstimateError::Unfit { place: self.data.place.to_owned(), why })
    }
}

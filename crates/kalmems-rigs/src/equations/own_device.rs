//! A device with the values of its parameters, and how it moves when it is left alone.

use super::angles;
use super::axes::DrivenAxis;
use super::correction::StateCorrection;
use super::feedthrough::InputFeedthrough;
use super::interpolation::Interpolation;
use super::model::pace;
use super::names;
use super::oscillation::OscillationTable;
use super::range::{QuantityRange, ranges};
use super::table::{EquationsTable, refused};
use crate::config::{ConfigError, ExpectedEntry, Experiment, FilterStart, Key, Quantity};
use crate::estimate::{StateName, TurnedStates};
use kalmems_equations::{Device, EquationError, Mode, Motion, Named, NoiseKind, StateTurn, modes};
use std::sync::Arc;

/// A device with the values of its parameters, and how it moves when it is left alone.
pub struct OwnDevice {
    /// Its equations.
    pub device: Arc<Device>,
    /// How it moves with its parameters as they are stated.
    pub motion: Motion,
    /// The values of its parameters in SI.
    pub values: Vec<f64>,
    /// The states that come round, with their periods.
    pub periods: Vec<(usize, f64)>,
    /// Its states, as trajectories name them.
    names: Vec<StateName>,
    /// The noises that its table states, each as it is at rest.
    noise: Vec<(NoiseKind, f64)>,
    /// The first of its own states that its first measurement depends on.
    read: Option<usize>,
    /// Where it rests without an input; 0 throughout where it rests nowhere.
    pub rest: Vec<f64>,
    /// Whether it rests there.
    pub rests: bool,
    /// The states that rest wherever they are: those that come round, and those whose rate no state changes, such as a resonance.
    held: Vec<bool>,
    /// How a small motion about that place goes, with a resonance that is a state where a filter of the experiment says that it is.
    pub modes: Vec<Mode>,
    /// How each input goes between two samples.
    pub between: Vec<Interpolation>,
    /// The bandwidth of each measurement in Hz before it is sampled; 0 where none is stated.
    pub bandwidths: Vec<f64>,
    /// The quantities that are described between some values alone.
    pub ranges: Vec<QuantityRange>,
    /// The states that are angles of a swing, in the order of the table, and their rates.
    angles: Vec<usize>,
    rates: Vec<usize>,
    /// The states that the drive moves each by a sine of its own, where the table names several.
    pub axes: Vec<DrivenAxis>,
    /// The state that it is for, where the table says so.
    answer: Option<usize>,
    /// The states whose size its table states, such as an acceleration that is to be measured.
    pub sized: Vec<usize>,
    /// The cycles of the drive in one of the motion.
    pub drive_cycles: f64,
    /// The signs of states that its measurements do not tell, half a turn of a state that comes round among them. That an amplitude has a sign
    /// which its phase undoes is none where the table of a sine says which states these are: there an amplitude is positive.
    pub hidden_signs: Vec<Vec<usize>>,
    /// The quantities that change their signs with each of these.
    pub odd_quantities: Vec<Vec<usize>>,
    /// The turns of states that its measurements do not tell.
    pub hidden_turns: Vec<Vec<TurnedStates>>,
    /// What filters call the measurements.
    pub signal_names: Vec<String>,
    /// What an input makes of the signals beside the motion.
    pub feedthrough: Option<InputFeedthrough>,
    /// What estimates are corrected by.
    pub corrections: Vec<StateCorrection>,
}

impl OwnDevice {
    /// Of an experiment.
    pub fn of(experiment: &Experiment) -> Result<Self, ConfigError> {
        Self::of_table(experiment, &*experiment.device_in_terms_of::<EquationsTable>()?)
    }

    /// The device that a table of an experiment describes.
    pub(super) fn of_table(experiment: &Experiment, table: &EquationsTable) -> Result<Self, ConfigError> {
        let device = table.device(experiment)?;
        let values = device.values();
        let stated = device.inputs().iter().take(device.own_inputs());
        let stated = stated.map(|input| table.interpolation.of(&input.name));
        // The rate of an input that jumps is as good or bad as its samples are dense.
        let rates = device.rated_inputs().iter().map(|_| Interpolation::default());
        let between = stated.chain(rates).collect();
        let about = stated_starts(experiment, &device);
        let bandwidth_hz = |named: &Named| table.bandwidth.get(&named.name).map_or(0.0, Quantity::si);
        let bandwidths = device.measures().iter().map(bandwidth_hz).collect();
        let ranges = ranges(experiment, table, &device)?;
        angles::check(experiment, table, &device)?;
        let angles = table.angles.iter().filter_map(|(angle, _)| device.state(angle)).collect();
        let rates = table.angles.iter().filter_map(|(_, rate)| device.state(rate.trim())).collect();
        let feedthrough = InputFeedthrough::of(experiment, table, &device)?;
        let corrections = StateCorrection::of(experiment, &table.correction, &device)?;
        let called = |named: &Named| {
            let other = table.channel_keys.iter().find(|(_, measure)| **measure == *named.name);
            other.map_or_else(|| named.name.to_string(), |(key, _)| key.clone())
        };
        let signal_names = device.measures().iter().map(called).collect();
        let own = Self::with(device, values, between, &about).map_err(|error| refused(experiment, &error))?;
        let axes = DrivenAxis::named(experiment, table, &own)?;
        let drive_cycles = table.oscillation.as_ref().map_or(1.0, OscillationTable::drive_cycles);
        // An oscillation is judged by the state that oscillates.
        let answer = table.answer_of(experiment, &own.device)?.filter(|_| table.oscillation.is_none());
        let sized = (0..own.device.states().len()).filter(|state| {
            own.device.states().get(*state).is_some_and(|named| table.usual.contains_key(&*named.name))
        });
        let sized = sized.collect();
        let mut own = Self { bandwidths, ranges, angles, rates, axes, drive_cycles, ..own };
        if let Some(sine) = &table.sine {
            let [amplitude, phase, offset] =
                [&sine.amplitude, &sine.phase, &sine.offset].map(|name| own.device.state(name));
            let has =
                |group: &[usize], state: Option<usize>| state.is_some_and(|state| group.contains(&state));
            own.hidden_signs
                .retain(|group| has(group, offset) || !has(group, amplitude) || !has(group, phase));
        }
        let odd = |group: &Vec<usize>| {
            let signs = own.device.signs_of_quantities(group).into_iter().enumerate();
            signs.filter(|(_, sign)| *sign == Some(-1.0)).map(|(place, _)| place).collect()
        };
        own.odd_quantities = own.hidden_signs.iter().map(odd).collect();
        Ok(Self { answer, sized, signal_names, feedthrough, corrections, ..own })
    }

    fn with(
        device: Arc<Device>,
        values: Vec<f64>,
        between: Vec<Interpolation>,
        about: &[Option<f64>],
    ) -> Result<Self, EquationError> {
        let motion = device.motion(&[])?;
        let mut work = motion.work(&values);
        let states = device.states().len();
        let inputs = vec![0.0; device.inputs().len()];
        // A state that comes round, or whose rate no state changes, rests wherever it is.
        let mut held = vec![false; states];
        let periods = device.periods(&values)?;
        for (state, _) in &periods {
            held[*state] = true;
        }
        for (state, is_held) in held.iter_mut().enumerate() {
            *is_held |= motion.sparsity().all(|(row, _)| row != state);
        }
        let found = motion.rest(&mut work, &vec![0.0; states], &held, &inputs);
        let rests = found.is_some();
        let rest = found.unwrap_or_else(|| vec![0.0; states]);
        let hidden_signs = device.hidden_signs();
        let of_state = |turn: StateTurn| TurnedStates { places: turn.places, rate: turn.rate };
        let hidden_turns = device.hidden_turns().into_iter();
        let hidden_turns = hidden_turns.map(|turn| turn.into_iter().map(of_state).collect()).collect();
        let modes = Vec::new();
        let noise = device.noise(&values, &rest)?;
        let read = device.readout(0, &[]).ok();
        let read = read.and_then(|read| read.sparsity().find(|state| *state < device.own_states()));
        let names = names::states(&device);
        let mut own = Self {
            device,
            motion,
            values,
            periods,
            names,
            noise,
            read,
            rest,
            rests,
            held,
            modes,
            between,
            bandwidths: Vec::new(),
            ranges: Vec::new(),
            angles: Vec::new(),
            rates: Vec::new(),
            axes: Vec::new(),
            answer: None,
            sized: Vec::new(),
            drive_cycles: 1.0,
            hidden_signs,
            hidden_turns,
            odd_quantities: Vec::new(),
            signal_names: Vec::new(),
            feedthrough: None,
            corrections: Vec::new(),
        };
        let about =
            about.iter().zip(&own.rest).map(|(about, rest)| about.unwrap_or(*rest)).collect::<Vec<_>>();
        own.modes = modes_of(&own.linear_about(&about), states);
        Ok(own)
    }

    /// Where it rests, with the states that rest wherever they are at these values.
    pub fn rest_about(&self, about: &[f64]) -> Vec<f64> {
        let mut rest = self.rest.clone();
        for ((rest, about), _) in rest.iter_mut().zip(about).zip(&self.held).filter(|(_, held)| **held) {
            *rest = *about;
        }
        rest
    }

    /// The slopes of its rates there, row by row, without an input.
    pub fn linear_about(&self, about: &[f64]) -> Vec<f64> {
        let states = self.rest.len();
        let (mut rates, mut jacobian) = (vec![0.0; states], vec![0.0; states * states]);
        let (at, inputs) = (self.rest_about(about), vec![0.0; self.device.inputs().len()]);
        self.motion.linearize(&mut self.motion.work(&self.values), &at, &inputs, &mut rates, &mut jacobian);
        jacobian
    }

    /// The variance of a sample of each measurement at a sampling rate in Hz, where one is stated; of one that varies as it is at rest. What a
    /// bandwidth lets through beyond half the sampling rate is folded into the samples.
    pub fn variances(&self, rate_hz: f64) -> Vec<Option<f64>> {
        let mut variances = vec![None; self.device.measures().len()];
        for (kind, size) in &self.noise {
            match *kind {
                NoiseKind::Variance { measure } => variances[measure] = Some(*size),
                NoiseKind::Density { measure } => {
                    let bandwidth_hz = self.bandwidths.get(measure).copied().unwrap_or(0.0);
                    variances[measure] = Some(size * bandwidth_hz.max(0.5 * rate_hz));
                }
                // Those of events are with what filters are told of them.
                NoiseKind::Rate { .. } | NoiseKind::EventTime { .. } | NoiseKind::Event { .. } => {}
            }
        }
        variances
    }

    /// The density of the noise of each state's rate, 0 where none is stated; of one that varies as it is at rest.
    pub fn densities(&self) -> Vec<f64> {
        densities(&self.noise, self.rest.len())
    }

    /// The frequency of its free motion in Hz: that of its slowest oscillation; of a device that does not oscillate, one by its
    /// slowest decay.
    pub fn natural_hz(&self) -> Option<f64> {
        let oscillating = self.modes.iter().filter(|mode| mode.oscillates()).map(Mode::frequency_hz);
        let decaying =
            self.modes.iter().map(|mode| mode.growth.abs() / std::f64::consts::TAU).filter(|hz| *hz > 0.0);
        oscillating.reduce(f64::min).or_else(|| decaying.reduce(f64::min))
    }

    /// The states at the start, of which some are stated: the others are at rest, and what lags and delays add follows them.
    pub fn started(&self, stated: &[Option<f64>]) -> Vec<f64> {
        let start: Vec<f64> =
            stated.iter().zip(&self.rest).map(|(stated, rest)| stated.unwrap_or(*rest)).collect();
        let is_held =
            |(place, stated): (usize, &Option<f64>)| place < self.device.own_states() || stated.is_some();
        let held: Vec<bool> = stated.iter().enumerate().map(is_held).collect();
        self.settled(&start, &held).unwrap_or(start)
    }

    /// Where the states settle that are not held, without an input.
    pub(super) fn settled(&self, start: &[f64], held: &[bool]) -> Option<Vec<f64>> {
        let mut work = self.motion.work(&self.values);
        self.motion.rest(&mut work, start, held, &vec![0.0; self.device.inputs().len()])
    }

    /// Steps per second that follow its motion.
    pub fn pace(&self) -> f64 {
        pace(&self.modes)
    }

    /// The state by which its motion is judged: its angle, or what it is for, or the first that a measurement reads, or else the first.
    pub fn judged(&self) -> usize {
        self.angles.first().copied().or(self.answer).or(self.read).unwrap_or(0)
    }

    /// Whether it has an angle.
    pub fn has_angle(&self) -> bool {
        !self.angles.is_empty()
    }

    /// The names of states that are exactly 0 at a place, in the middle of a symmetry of equations and signals, which they never leave.
    pub(super) fn symmetric_rest(&self, at: &[f64]) -> Option<String> {
        let is_zero = |state: &usize| at.get(*state) == Some(&0.0);
        let is_left_by_none = |group: &&Vec<usize>| group.iter().all(is_zero) && !self.comes_round(group);
        let group = self.hidden_signs.iter().find(is_left_by_none)?;
        let names = group.iter().filter_map(|state| self.device.states().get(*state));
        Some(names.map(|named| format!("`{}`", named.name)).collect::<Vec<_>>().join(" and "))
    }

    /// Whether one of these states comes round.
    pub(super) fn comes_round(&self, states: &[usize]) -> bool {
        self.periods.iter().any(|(state, _)| states.contains(state))
    }

    /// Whether the signals tell the sign of a state of this name.
    pub fn tells_sign(&self, name: &str) -> bool {
        let place = self.states().iter().position(|(own, ..)| *own == name);
        place.is_some_and(|place| !self.hidden_signs.iter().any(|group| group.contains(&place)))
    }

    /// Whether no signal tells the sign of an angle.
    pub fn hides_angle(&self) -> bool {
        let hidden = |angle: &usize| self.hidden_signs.iter().any(|group| group.contains(angle));
        self.angles.iter().any(hidden)
    }

    /// Its angles that swing, each with its rate: the axes of the table's oscillation, or else the first angle.
    pub fn swinging_angles(&self) -> Vec<[usize; 2]> {
        if !self.axes.is_empty() {
            return self.axes.iter().map(|axis| axis.states).collect();
        }
        self.angles.first().zip(self.rates.first()).map(|(angle, rate)| [*angle, *rate]).into_iter().collect()
    }

    /// How many swings its states are, each an angle and its rate behind it; 0 where there are others.
    pub fn swings(&self) -> usize {
        let named = if self.axes.is_empty() { self.angles.first().map_or(0, |_| 1) } else { self.axes.len() };
        let in_order = self.angles.iter().take(named).copied().eq((0..named).map(|place| 2 * place));
        if in_order && self.device.states().len() == 2 * named { named } else { 0 }
    }

    /// Its states, as trajectories name them.
    pub fn states(&self) -> &[StateName] {
        &self.names
    }
}

pub(super) fn densities(noise: &[(NoiseKind, f64)], states: usize) -> Vec<f64> {
    let mut densities = vec![0.0; states];
    for (kind, size) in noise {
        if let NoiseKind::Rate { state } = kind {
            densities[*state] = *size;
        }
    }
    densities
}

/// The modes of a linear motion; none where they are not known.
pub fn modes_of(linear: &[f64], states: usize) -> Vec<Mode> {
    modes(linear, states).unwrap_or_default()
}

/// Where the first filter that says so has each state at the start, be it `start` or `start_about`; what is wrong with it is found where that filter
/// is read.
pub fn stated_starts(experiment: &Experiment, device: &Device) -> Vec<Option<f64>> {
    let filters = experiment.estimate.iter().flat_map(|estimate| estimate.filters.iter().enumerate());
    let one = |entry: &ExpectedEntry| {
        filters.clone().find_map(|(index, filter)| {
            let values = match &filter.start {
                Some(FilterStart::Values(values)) => values,
                Some(FilterStart::FromSignal) | None => &filter.start_about,
            };
            let key = Key::from("estimate").child("filter").index(index).child(entry.name);
            experiment.value(key, values.get(entry.name)?, entry.kind, entry.sign).ok()
        })
    };
    names::entries(device).iter().map(one).collect()
}

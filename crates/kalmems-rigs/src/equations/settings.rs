//! From an experiment file to SI.

use super::angles;
use super::axes::DrivenAxis;
use super::correction::StateCorrection;
use super::events::{self, EventSettings, FilterEventUse};
use super::feedthrough::InputFeedthrough;
use super::first_peak::AngleSign;
use super::interpolation::Interpolation;
use super::inversion::Inverse;
use super::known::{KnownDevice, known_states};
use super::model::{EquationModel, RateDensity, StepRule, pace};
use super::names;
use super::oscillation::{MeasuredOscillation, OscillationTable};
use super::range::{QuantityRange, ranges};
use super::sine::QuantitySine;
use super::start::LaterStart;
use super::table::{EquationsTable, refused};
use super::threshold;
use crate::config::{
    ConfigError, ConfigFault, Estimate, ExpectedEntry, Experiment, FilterStart, FilterTable, Key, Method,
    Quantity, UncertainNumber, Values, Variant,
};
use crate::estimate::driven::combinations;
use crate::estimate::{
    DeviceParameter, FilterBasics, MeanAndCovariance, StateName, StatePrior, Tracked, process_noise,
    refuse_demodulator,
};
use crate::units::{Dimension, kind, name};
use kalmems_equations::{Device, EquationError, Mode, Motion, Named, NoiseKind, modes, vector_elements};
use std::sync::{Arc, OnceLock};

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
    /// The signs of states that its measurements do not tell.
    pub hidden_signs: Vec<Vec<usize>>,
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
        let own = Self { bandwidths, ranges, angles, rates, axes, drive_cycles, ..own };
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
    fn settled(&self, start: &[f64], held: &[bool]) -> Option<Vec<f64>> {
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
    fn symmetric_rest(&self, at: &[f64]) -> Option<String> {
        let is_zero = |state: &usize| at.get(*state) == Some(&0.0);
        let group = self.hidden_signs.iter().find(|group| group.iter().all(is_zero))?;
        let names = group.iter().filter_map(|state| self.device.states().get(*state));
        Some(names.map(|named| format!("`{}`", named.name)).collect::<Vec<_>>().join(" and "))
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

fn densities(noise: &[(NoiseKind, f64)], states: usize) -> Vec<f64> {
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

/// What the file says of the filters.
pub struct EquationSettings {
    /// The device.
    pub own: Arc<OwnDevice>,
    /// How long the filters have to settle, in s.
    pub skip_s: f64,
    /// The signs that the file states because no signal tells them.
    pub signs: Vec<AngleSign>,
    /// The sine that its motion is, where its table says so.
    pub sine: Option<QuantitySine>,
    /// The events whose times are looked for.
    pub events: Vec<EventSettings>,
    /// The filters.
    pub filters: Vec<EquationFilterSettings>,
    /// What is said of filters that do without something that the file states.
    pub remarks: Vec<String>,
}

/// What the file says of one filter.
pub struct EquationFilterSettings {
    /// What every filter has.
    pub basics: FilterBasics,
    /// The device as it knows it: with the low-passes of the readout or without, and without the states that it is given.
    pub own: Arc<OwnDevice>,
    /// The states that it is given as inputs behind the stated ones, by their places in the device.
    pub known: Vec<usize>,
    /// The measurements that correct it, by their places; none for all that the recording has.
    pub measures: Vec<usize>,
    /// The variance that it takes a sample of its one signal for, where that is not the noise's.
    pub signal_variance: Option<f64>,
    /// Over how long it estimates the variance of a sample of its one signal, in s, where it does.
    pub noise_memory_s: Option<f64>,
    /// What of the signal corrects it.
    pub variant: Variant,
    /// How it uses the events.
    pub events: Vec<FilterEventUse>,
    /// The state that its measurement tells, where each sample is taken by itself.
    pub inverse: Option<Inverse>,
    /// The oscillations that lines of its measurements tell, of each of them and of each axis, where it asks for these.
    pub oscillations: Vec<MeasuredOscillation>,
    /// The states that it holds, by the table of a sine, because nothing in the file moves them.
    held: Vec<usize>,
    start: EquationStart,
    later_start: OnceLock<LaterStart>,
    /// How large each state usually is, where the device's table says it.
    usual: Vec<Option<f64>>,
    /// The density of the noise of each state's rate, where the file says one here.
    density: Vec<Option<f64>>,
}

/// Where a filter starts.
enum EquationStart {
    /// At these states, with their standard deviations.
    Stated { mean: Vec<f64>, sd: Vec<f64> },
    /// At the oscillation that the first cycles of the signal show, which may be off by these standard deviations.
    Swing { sd: Vec<Option<f64>> },
    /// At what the first samples say, about these states where the file says some, with the standard deviations that are known before,
    /// where some are.
    Signal { about: Vec<Option<f64>>, sd: Vec<Option<f64>> },
}

impl EquationSettings {
    /// Reads and checks them.
    pub fn of(experiment: &Experiment) -> Result<Self, ConfigError> {
        let own = Arc::new(OwnDevice::of(experiment)?);
        let Some(estimate) = &experiment.estimate else {
            let remedy = "add the table `[estimate]` with `skip` and at least one `[[estimate.filter]]`";
            return Err(experiment.error("estimate", ConfigFault::MissingKey { remedy: remedy.to_owned() }));
        };
        let events = events::events(experiment, &own)?;
        if own.device.has_resets() && !events.is_empty() {
            let why = "the time of an event is followed back along the motion, which states that are set at once (`when`) interrupt; leave \
                       the events or the resets out"
                .to_owned();
            return Err(experiment.error("estimate.events", ConfigFault::Value { why }));
        }
        let (table, _) = EquationsTable::of(experiment)?;
        let signs = AngleSign::stated(experiment, estimate, (&own, &table))?;
        let sine = QuantitySine::of(&own, &table).map_err(|(key, why)| {
            experiment.error(Key::from("device.equations.sine").child(key), ConfigFault::Value { why })
        })?;
        let unused = unused_deviations(&table, estimate);
        let known = FilterDevices::of(experiment, estimate, (table, &own))?;
        let of = |index| {
            let device = known.of_filter(experiment, estimate, index)?;
            EquationFilterSettings::of(experiment, estimate, (&device, &events, sine.as_ref()), index)
        };
        let filters = (0..estimate.filters.len()).map(of).collect::<Result<_, _>>()?;
        let remarks = known.left_out(estimate).into_iter().chain(unused).collect();
        Ok(Self { skip_s: estimate.skip.si(), signs, sine, events, filters, remarks, own })
    }
}

/// Which filters state standard deviations of a start that the signal tells with its own, where some do.
fn unused_deviations(table: &EquationsTable, estimate: &Estimate) -> Option<String> {
    let starts_by_swing = table.oscillation.as_ref().is_some_and(|oscillation| oscillation.starts);
    let unused = |filter: &&FilterTable| {
        let from_signal = !matches!(filter.start, Some(FilterStart::Values(_)));
        table.start_tells_itself && !starts_by_swing && from_signal && !filter.start_sd.is_empty()
    };
    let names: Vec<String> =
        estimate.filters.iter().filter(unused).map(|filter| format!("`{}`", filter.name)).collect();
    (!names.is_empty()).then(|| {
        format!(
            "the `start_sd` of {} is not used: a start from the signal brings its own standard deviations; leave it out",
            names.join(", ")
        )
    })
}

/// The parameters that a filter may hold as uncertain: each by a factor, but for those whose deviation some filter of the
/// experiment states in the parameter's own unit, and for a number that is 0.
pub fn parameters(
    experiment: &Experiment,
    (table, device): (&EquationsTable, &Device),
) -> &'static [DeviceParameter] {
    let filters = || experiment.estimate.iter().flat_map(|estimate| &estimate.filters);
    let stated = experiment.stated_uncertain().unwrap_or_default();
    let is_added = |parameter: &kalmems_equations::Parameter| {
        let kind = names::kind_of(&parameter.named);
        let own = |filter: &FilterTable| {
            let Some(start_sd) = &filter.states.get(&*parameter.named.name)?.start_sd else {
                // No factor is taken of a number that is 0: what its table states is what it may be off by.
                let written = names::written(table, name(&parameter.named.name));
                let is_of = |number: &UncertainNumber| written.iter().any(|(key, _)| *key == number.name);
                return Some(stated.iter().any(|number| is_of(number) && number.value.si() == 0.0));
            };
            let dimension = start_sd.value().unit().dimension();
            Some(dimension != Dimension::NONE && kind.accepts(dimension))
        };
        filters().filter_map(own).any(|own| own)
    };
    let added: Vec<bool> = device.parameters().iter().map(is_added).collect();
    names::parameters((table, device), &added)
}

/// What a method takes that follows no motion: the inverse of a measurement, or the oscillations that measurements show. What the equations
/// cannot give the method is refused.
fn without_motion(
    (experiment, at, filter): (&Experiment, &Key, &FilterTable),
    (own, sine): (&OwnDevice, Option<&QuantitySine>),
    chosen: &[usize],
) -> Result<(Option<Inverse>, Vec<MeasuredOscillation>), ConfigError> {
    let refused = |why| experiment.error(at.clone().child("method"), ConfigFault::Value { why });
    match (filter.method, chosen) {
        (Method::EulerEkf, _) if own.device.has_resets() => {
            let why = "a step of Euler's method does not find where states are set at once (`when`); use `ekf` or `ukf`";
            Err(refused(why.to_owned()))
        }
        (Method::DirectInversion, [measure]) => {
            Ok((Some(Inverse::of(own, *measure).map_err(refused)?), Vec::new()))
        }
        (Method::DirectInversion, _) => {
            let why = "an inversion is that of one measurement; name it".to_owned();
            Err(experiment.error(at.clone().child("channels"), ConfigFault::Value { why }))
        }
        _ => {
            let table = experiment.device_in_terms_of::<EquationsTable>()?;
            let axes = own.axes.len().max(1);
            let all = chosen.iter().flat_map(|measure| (0..axes).map(|axis| (*measure, axis)));
            let of = |place| MeasuredOscillation::of(own, &table, place);
            let all = match filter.method {
                Method::LockIn if sine.is_none() => all.map(of).collect::<Result<_, _>>().map_err(refused)?,
                // A gain that turns with the swing takes that from the signal, and so does the search for a start of several axes, where the table says
                // what a line means.
                method if method.has_fixed_gain() && own.swings() > 0 || axes > 1 => {
                    all.map(of).collect::<Result<_, _>>().unwrap_or_default()
                }
                _ => Vec::new(),
            };
            Ok((None, all))
        }
    }
}

/// The device as filters may know it.
struct FilterDevices {
    table: Arc<EquationsTable>,
    own: Arc<OwnDevice>,
    /// The same with the low-passes of its readout, where some filter asks for them and there are some.
    demodulated: Option<(Arc<EquationsTable>, Arc<OwnDevice>)>,
    /// The same with states as inputs, as each filter is given them.
    known: Vec<Option<KnownDevice>>,
}

/// The device as one filter knows it, with the states that it is given as inputs.
struct FilterDevice<'a> {
    table: &'a EquationsTable,
    own: &'a Arc<OwnDevice>,
    known: &'a [usize],
}

impl FilterDevices {
    fn of(
        experiment: &Experiment,
        estimate: &Estimate,
        (table, own): (Arc<EquationsTable>, &Arc<OwnDevice>),
    ) -> Result<Self, ConfigError> {
        let asked = estimate.filters.iter().any(|filter| filter.demodulator);
        let other = table.demodulator.as_ref().and_then(|own| own.device.clone()).filter(|_| asked);
        let with = |table: Arc<EquationsTable>| {
            Ok((Arc::clone(&table), Arc::new(OwnDevice::of_table(experiment, &table)?)))
        };
        let demodulated = other.map(with).transpose()?;
        let given = |(index, filter): (usize, &FilterTable)| {
            let at = Key::from("estimate").child("filter").index(index);
            let known = known_states((experiment, &at, filter), &own.device)?;
            let of = |known| KnownDevice::of(experiment, (&table, &own.device), known);
            (!known.is_empty()).then(|| of(known)).transpose()
        };
        let known = estimate.filters.iter().enumerate().map(given).collect::<Result<_, _>>()?;
        Ok(Self { table, own: Arc::clone(own), demodulated, known })
    }

    /// Which filters do without the low-passes that the readout has, where some do.
    fn left_out(&self, estimate: &Estimate) -> Option<String> {
        self.table.demodulator.as_ref()?.device.as_ref()?;
        let without = estimate.filters.iter().filter(|filter| !filter.demodulator);
        let names: Vec<String> = without.map(|filter| format!("`{}`", filter.name)).collect();
        (!names.is_empty()).then(|| {
            format!(
                "the readout's `poles` are no part of the model of {}; with `demodulator = true` a filter has them",
                names.join(", ")
            )
        })
    }

    /// As the filter at this place knows it.
    fn of_filter(
        &self,
        experiment: &Experiment,
        estimate: &Estimate,
        index: usize,
    ) -> Result<FilterDevice<'_>, ConfigError> {
        let filter = &estimate.filters[index];
        let at = || Key::from("estimate").child("filter").index(index);
        let whole = |table, own| FilterDevice { table, own, known: &[] };
        let refused = |why: &str| {
            refuse_demodulator(experiment, (&at(), filter), why).map(|()| whole(&*self.table, &self.own))
        };
        if let Some(Some(KnownDevice { known, table, own })) = self.known.get(index) {
            refuse_demodulator(experiment, (&at(), filter), "with known states there is none")?;
            return Ok(FilterDevice { table, own, known });
        }
        match (&self.demodulated, &self.table.demodulator) {
            (Some(_), _) if filter.method.has_fixed_gain() => refused(
                "the gain for all of a swing is that of angle and rate alone; leave it out, or use `ekf`",
            ),
            (Some((table, own)), _) if filter.demodulator => Ok(whole(table, own)),
            (_, Some(known)) => refused(known.remedy),
            (_, None) => refused("this device has none; write a `lag` in its table"),
        }
    }
}

/// Whether a filter without a stated start begins at the oscillation that the first cycles of the signal show.
fn begins_by_swing(table: &EquationsTable, own: &OwnDevice, filter: &FilterTable) -> bool {
    let starts = table.oscillation.as_ref().is_some_and(|oscillation| oscillation.starts);
    starts && own.axes.is_empty() && !(filter.method.claims() && filter.start_sd.is_empty())
}

/// What is said of a demodulator stands for each of its low-passes, the states that lags add.
fn of_each_low_pass(device: &Device, values: &Values) -> Values {
    let mut all = values.clone();
    if let Some(value) = all.remove("demodulator") {
        let lags = device.states().iter().skip(device.own_states());
        all.extend(lags.map(|named| (named.name.to_string(), value.clone())));
    }
    all
}

impl EquationStart {
    /// At these states, of which some are stated, with these standard deviations.
    fn stated(
        experiment: &Experiment,
        at: &Key,
        own: &OwnDevice,
        (stated, sd): (Vec<Option<f64>>, Vec<Option<f64>>),
    ) -> Result<Self, ConfigError> {
        let mean = own.started(&stated);
        if let Some(names) = own.symmetric_rest(&mean) {
            let why = format!(
                "{names} are exactly 0; equations and signals are symmetric there, so that neither a filter nor the model would ever leave it; \
                 start from a small value, such as `1e-6`"
            );
            return Err(experiment.error(at.clone().child("start"), ConfigFault::Value { why }));
        }
        let deviations = names::deviations(&own.device);
        let missing = |missing: usize| missing_deviation(experiment, at, &deviations[missing]);
        let sd = following(own, &mean, sd).map_err(missing)?;
        Ok(Self::Stated { mean, sd })
    }
}

impl EquationFilterSettings {
    fn of(
        experiment: &Experiment,
        estimate: &Estimate,
        (of, events, sine): (&FilterDevice<'_>, &[EventSettings], Option<&QuantitySine>),
        index: usize,
    ) -> Result<Self, ConfigError> {
        let FilterDevice { table, own, known: given } = of;
        let (device, filter) = (&own.device, &estimate.filters[index]);
        let at = Key::from("estimate").child("filter").index(index);
        let refuse = |name: &str, why: String| {
            Err(experiment.error(at.clone().child(name), ConfigFault::Value { why }))
        };
        let entries = names::entries(device);
        let start = match &filter.start {
            Some(FilterStart::Values(values)) => Some(values),
            Some(FilterStart::FromSignal) | None => None,
        };
        let deviations = names::deviations(device);
        let of = |name: &str, values: &Values, known: &[ExpectedEntry]| {
            some(experiment, &at.clone().child(name), values, known)
        };
        let claims = filter.method.claims();
        let usual = some(experiment, &Key::from("device.equations.usual"), &table.usual, &deviations)?;
        let mut sd = if claims {
            let with_lags = filter.demodulator.then(|| of_each_low_pass(device, &filter.start_sd));
            of("start_sd", with_lags.as_ref().unwrap_or(&filter.start_sd), &deviations)?
        } else {
            vec![Some(0.0); entries.len()]
        };
        let by_swing = start.is_none() && begins_by_swing(table, own, filter);
        if start.is_none() && claims && !by_swing {
            if table.start_tells_itself {
                sd.fill(None);
            }
            sd.iter_mut().zip(&usual).for_each(|(sd, usual)| *sd = sd.or(*usual));
        }
        let (noise_key, noise) = process_noise(experiment, &at, filter)?;
        if claims {
            require_noises(experiment, table, (&noise_key, noise))?;
        }
        let density = some(experiment, &noise_key, noise, &names::densities(table, device))?;
        let is_moved = |state: &usize| density[*state].is_some() || sd[*state].is_some();
        let held = sine.map_or(&[][..], QuantitySine::held).iter().copied();
        let held: Vec<usize> = held.filter(|state| claims && !is_moved(state)).collect();
        let start = match start {
            None if by_swing => EquationStart::Swing { sd },
            None => {
                let about = of("start_about", &filter.start_about, &entries)?;
                EquationStart::Signal { about, sd: if claims { sd } else { vec![None; entries.len()] } }
            }
            Some(_) if !filter.start_about.is_empty() => {
                return refuse(
                    "start_about",
                    "`start` says where the filter starts; leave one of both out".to_owned(),
                );
            }
            Some(values) => {
                for state in &held {
                    sd[*state] = Some(0.0);
                }
                EquationStart::stated(experiment, &at, own, (of("start", values, &entries)?, sd))?
            }
        };
        let known = parameters(experiment, (table, device));
        let scales: Vec<f64> = known
            .iter()
            .zip(&own.values)
            .map(|(parameter, value)| if parameter.is_factor() { *value } else { 1.0 })
            .collect();
        let mut basics = FilterBasics::of(experiment, &at, filter, (known, &scales))?;
        if !given.is_empty() {
            let names: Vec<&str> = filter.known_states().1.collect();
            basics.name += &format!(", {} known", names.join(", "));
        }
        let variant = filter.variant.unwrap_or_default();
        if variant == Variant::Literal {
            // Its gain is not that of its innovations: these are larger than it claims when nothing is wrong with a sample.
            basics.taking.largest_nis = None;
        }
        threshold::check(experiment, (&at, filter))?;
        let measures = measures(experiment, &at, filter, own)?;
        let events = events::uses(experiment, own, events, (&at, filter))?;
        let all = 0..device.measures().len();
        let chosen = if measures.is_empty() { all.collect() } else { measures.clone() };
        let [signal_variance, noise_memory_s] = of_one_signal((experiment, &at, filter), device, &chosen)?;
        let (inverse, mut oscillations) = without_motion((experiment, &at, filter), (own, sine), &chosen)?;
        if by_swing && oscillations.is_empty() {
            let known = |measure: &usize| MeasuredOscillation::of(own, table, (*measure, 0)).ok();
            oscillations = chosen.iter().filter_map(known).collect();
        }
        // What the sine itself tells is not held by a start from it.
        let held = held.into_iter().filter(|state| sine.is_some_and(|sine| !sine.is_told(*state))).collect();
        Ok(Self {
            basics,
            own: Arc::clone(own),
            known: given.to_vec(),
            measures,
            signal_variance,
            noise_memory_s,
            variant,
            events,
            inverse,
            oscillations,
            held,
            start,
            later_start: OnceLock::new(),
            usual,
            density,
        })
    }

    /// What the file says of the states at the first sample; `None` where they come from the signal.
    pub fn stated(&self) -> Option<MeanAndCovariance> {
        let EquationStart::Stated { mean, sd } = &self.start else { return None };
        let own = mean.iter().copied().zip(sd.iter().copied());
        let parameters = self.basics.parameters().iter().map(|tracked| (0.0, tracked.sd));
        Some(MeanAndCovariance::apart(own.chain(parameters)))
    }

    /// How far the oscillation may be off that it starts at, of a filter that starts so.
    pub fn swing_sd(&self) -> Option<&[Option<f64>]> {
        let EquationStart::Swing { sd } = &self.start else { return None };
        Some(sd)
    }

    /// About where a state is at the start, where the file says it.
    pub fn about_of(&self, state: usize) -> Option<f64> {
        match &self.start {
            EquationStart::Stated { mean, .. } => mean.get(state).copied(),
            EquationStart::Swing { .. } => None,
            EquationStart::Signal { about, .. } => about.get(state).copied().flatten(),
        }
    }

    /// Where it begins, or where the search for its start does.
    fn about(&self) -> Vec<f64> {
        match &self.start {
            EquationStart::Stated { mean, .. } => mean.clone(),
            EquationStart::Swing { .. } => self.own.rest.clone(),
            EquationStart::Signal { about, .. } => {
                about.iter().zip(&self.own.rest).map(|(about, rest)| about.unwrap_or(*rest)).collect()
            }
        }
    }

    /// What is known of the states before the first sample, where the start comes from the signal: that they are about rest, or where the
    /// file says, as far as it says how far.
    pub fn prior(&self) -> Option<Vec<StatePrior>> {
        let EquationStart::Signal { sd, .. } = &self.start else { return None };
        let states = self.about().into_iter().zip(sd).map(|(mean, sd)| StatePrior { mean, sd: *sd });
        Some(self.holding(states.chain(self.basics.priors()).collect()))
    }

    /// The same, of which those that it holds are known.
    fn holding(&self, mut prior: Vec<StatePrior>) -> Vec<StatePrior> {
        for state in &self.held {
            prior[*state].sd = Some(0.0);
        }
        prior
    }

    /// How it is started again where it has lost the signal. It is found once, and not with each block of a stream.
    pub fn later_start(&self) -> &LaterStart {
        self.later_start.get_or_init(|| LaterStart::of(&self.own, self.prior_of_a_later_start()))
    }

    /// What is known of the states before a start that is sought later, since the signal was lost.
    pub fn prior_of_a_later_start(&self) -> Vec<StatePrior> {
        self.prior().unwrap_or_else(|| {
            let motion = self.own.rest.iter().zip(&self.usual);
            let motion = motion.map(|(rest, usual)| StatePrior { mean: *rest, sd: *usual });
            self.holding(motion.chain(self.basics.priors()).collect())
        })
    }

    /// The models that it runs on: one, but for a bank, whose models have its parameters off by their deviations.
    pub fn models(&self) -> Result<Vec<EquationModel>, EquationError> {
        if self.basics.method != Method::Bank {
            return Ok(vec![self.model(&[])?]);
        }
        combinations(&self.basics.tracked).iter().map(|shifts| self.model(shifts)).collect()
    }

    /// A model with its parameters off by so much.
    fn model(&self, shifts: &[f64]) -> Result<EquationModel, EquationError> {
        let own = &self.own;
        let mut values = own.values.clone();
        for (tracked, shift) in self.basics.tracked.iter().zip(shifts) {
            if let Some(place) = own.device.parameter(tracked.parameter.name) {
                values[place] += shift;
            }
        }
        let stated = densities(&own.device.noise(&values, &own.rest)?, own.rest.len());
        let varying = own.device.varying_noise(&[])?;
        let of_state = |(state, (stated, own)): (usize, (&f64, &Option<f64>))| match own {
            Some(own) => RateDensity::Held(*own),
            None if varying.iter().any(|(kind, _)| *kind == NoiseKind::Rate { state }) => {
                RateDensity::Varying
            }
            None => RateDensity::Held(*stated),
        };
        let density: Vec<_> = stated.iter().zip(&self.density).enumerate().map(of_state).collect();
        let rule =
            if self.basics.method == Method::EulerEkf { StepRule::Euler } else { StepRule::Exponential };
        let tracked: &[Tracked] = self.basics.parameters();
        let about = own.rest_about(&self.about());
        EquationModel::new(&own.device, &values, tracked, (&density, rule), (&own.rest, &about, own.pace()))
    }
}

/// Refuses a table of process noise in which a name of the device's own table is missing: what is left out would be none at all, which that has to say.
fn require_noises(
    experiment: &Experiment,
    table: &EquationsTable,
    (key, noise): (&Key, &Values),
) -> Result<(), ConfigError> {
    let Some((name, _)) = table.noise_keys.iter().find(|(name, _)| !noise.contains_key(*name)) else {
        return Ok(());
    };
    let remedy = format!("write the density, such as `{name} = \"1e4 rad^2/s^3\"`; 0 for none");
    Err(experiment.error(key.clone().child(name), ConfigFault::MissingKey { remedy }))
}

/// That a state's standard deviation at the start is missing.
fn missing_deviation(experiment: &Experiment, at: &Key, entry: &ExpectedEntry) -> ConfigError {
    let remedy =
        format!("write `{} = \"{}\"`: how well the state is known at first", entry.name, entry.kind.example);
    let key = at.clone().child("start_sd").child(entry.name);
    experiment.error(key, ConfigFault::MissingKey { remedy })
}

/// The values of a table, of which each may be left out. A key may be that of a vector, `x[1..6]`, all of whose elements have the value then.
pub(super) fn some(
    experiment: &Experiment,
    at: &Key,
    values: &Values,
    entries: &[ExpectedEntry],
) -> Result<Vec<Option<f64>>, ConfigError> {
    let mut all = vec![None; entries.len()];
    for (key, value) in values {
        let at = || at.clone().child(key);
        let refuse = |why| experiment.error(at(), ConfigFault::Value { why });
        for element in vector_elements(key).map_err(refuse)? {
            let Some(place) = entries.iter().position(|entry| entry.name == element.name) else {
                let known = entries.iter().map(|entry| entry.name);
                return Err(experiment.error(at(), ConfigFault::unknown_key(&element.name, known)));
            };
            let read = experiment.value(at(), value, entries[place].kind, entries[place].sign)?;
            if all[place].replace(read).is_some() {
                return Err(refuse(format!("`{}` has a value already", element.name)));
            }
        }
    }
    Ok(all)
}

/// Standard deviations of all states, where those of lags and delays may be left out: they follow the others as they do when all
/// has settled. The place of a state whose own is missing, where one is.
pub fn following(own: &OwnDevice, start: &[f64], sd: Vec<Option<f64>>) -> Result<Vec<f64>, usize> {
    let Some(first) = sd.iter().position(Option::is_none) else {
        return Ok(sd.into_iter().flatten().collect());
    };
    let first_follower = own.device.own_states();
    if first < first_follower {
        return Err(first);
    }
    let states = start.len();
    let held: Vec<bool> = sd.iter().map(Option::is_some).collect();
    let settled = |start: &[f64]| own.settled(start, &held);
    let at = settled(start);
    let mut all: Vec<f64> = sd.iter().map(|sd| sd.unwrap_or(0.0)).collect();
    for (known, sd) in sd.iter().enumerate().filter_map(|(state, sd)| sd.map(|sd| (state, sd))) {
        let mut moved = start.to_vec();
        moved[known] += sd;
        let Some((at, moved)) = at.as_ref().zip(settled(&moved)) else { return Err(first) };
        for state in (0..states).filter(|state| !held[*state]) {
            all[state] = (all[state] * all[state] + (moved[state] - at[state]).powi(2)).sqrt();
        }
    }
    Ok(all)
}

/// The variance that a filter takes a sample of its one signal for, and over how long in s it estimates that, where it does either.
fn of_one_signal(
    (experiment, at, filter): (&Experiment, &Key, &FilterTable),
    device: &Device,
    chosen: &[usize],
) -> Result<[Option<f64>; 2], ConfigError> {
    let found =
        [filter.signal_variance.as_ref().map(Quantity::si), filter.noise_memory.as_ref().map(Quantity::si)];
    let has_gain = filter.method.claims() && !filter.method.has_fixed_gain();
    let given =
        ["signal_variance", "noise_memory"].into_iter().zip(&found).find(|(_, given)| given.is_some());
    match given.and_then(|(key, _)| Some((key, refused_signal_variance(device, chosen, has_gain)?))) {
        Some((key, why)) => {
            Err(experiment.error(at.clone().child(key), ConfigFault::Value { why: why.to_owned() }))
        }
        None => Ok(found),
    }
}

/// Why a filter of these measurements has no use for a variance of its signal, where it has none.
fn refused_signal_variance(device: &Device, chosen: &[usize], has_gain: bool) -> Option<&'static str> {
    let in_volts = |measure: &usize| {
        let named = device.measures().get(*measure);
        named.is_some_and(|named| names::kind_of(named).dimension == kind::VOLTAGE.dimension)
    };
    if chosen.len() != 1 || !chosen.iter().all(in_volts) {
        return Some("it is for a filter of one signal in V; name that in `channels`, or leave it out");
    }
    (!has_gain).then_some("this method has no gain that a variance would change; leave it out, or use `ekf`")
}

/// The measurements that a filter names.
fn measures(
    experiment: &Experiment,
    at: &Key,
    filter: &FilterTable,
    own: &OwnDevice,
) -> Result<Vec<usize>, ConfigError> {
    let key = || at.clone().child("channels");
    let mut places = Vec::new();
    for name in &filter.channels {
        let place = own.signal_names.iter().position(|own| own == name);
        let Some(place) = place else {
            let known = own.signal_names.iter().map(String::as_str);
            return Err(experiment.error(key(), ConfigFault::unknown_word(name, known)));
        };
        if places.contains(&place) {
            let why = format!("`{name}` is named twice; a signal counts once");
            return Err(experiment.error(key(), ConfigFault::Value { why }));
        }
        places.push(place);
    }
    Ok(places)
}

//! A recording of a device of one's own that is computed.

use super::feedback::{Loop, loops};
use super::feedthrough_course::SimulatedFeedthrough;
use super::instrument::{InstrumentHistory, ShownQuantity, columns, instruments};
use super::model::steps_over;
use super::names;
use super::names::some;
use super::own_device::OwnDevice;
use super::simulated_event::{SimulatedEvent, recorded_events};
use super::table::{EquationsTable, refused};
use crate::config::{
    ConfigFault, DriveSource, Experiment, InputSource, Key, Sign, Simulate, SimulatedChannel,
};
use crate::recording::RecordingSource;
use crate::simulate::{
    Converter, Drive, SimulateError, SimulatedColumn, SimulatedInput, SimulatedSample, Simulation,
    SimulationStart, WhiteNoise, captured, drive_of, input_of, parts_of_all,
};
use crate::units::kind;
use kalmems_equations::{
    Device, EquationError, Motion, Named, NoiseKind, ProgramNumbers, Reading, ReadoutProgram, ResetStep,
    Resets, StepTables,
};
use std::collections::VecDeque;
use std::ops::{ControlFlow, Range};

/// A simulation by the equations: Runge and Kutta's method of fourth order in steps of the integration rate, behind each of which
/// the noise of the rates is added.
pub struct EquationSimulation {
    own: OwnDevice,
    /// The inputs, in the order of the device, the rates of some behind them.
    drives: Vec<Drive>,
    /// Those that follow a measurement.
    loops: Vec<Loop>,
    /// What one makes of the signals beside the motion.
    feedthrough: Option<SimulatedFeedthrough>,
    /// For how long they move the device before the recording begins, in s.
    before_s: f64,
    sources: Vec<RecordingSource>,
    start: Vec<f64>,
    simulate: Simulate,
    /// The density of the noise of each state's rate, and the variance of a sample of each measurement.
    noises: (Vec<f64>, Vec<f64>),
    /// How each measurement is sampled.
    sampling: Vec<Sampling>,
    periods: Vec<(usize, f64)>,
    /// The instruments that are recorded, behind what is measured.
    instruments: Vec<ShownQuantity>,
    /// The events that are recorded, behind these: their places, and the variances of their times and their expressions.
    events: Vec<(usize, [f64; 2])>,
    recorded: Vec<SimulatedColumn>,
    truth: Vec<SimulatedColumn>,
    /// The states that the first of them are; quantities follow.
    truth_of: Vec<usize>,
}

/// Steps before the recording between two looks at whether the motion is finite.
const LOOK: u64 = 1 << 16;

/// How a measurement is sampled.
#[derive(Clone, Copy, Debug)]
struct Sampling {
    /// A sample of it is taken at each so many rows, from the first one on.
    every: u64,
    first: u64,
    converter: Option<Converter>,
}

impl Sampling {
    /// Its sample in a row, as the converter has it, or not a number where the row has none; says where the analogue value is not finite.
    fn sample(&self, row: u64, is_finite: &mut bool, analogue: impl FnOnce() -> f64) -> f64 {
        let has_sample = row.checked_sub(self.first).is_some_and(|behind| behind.is_multiple_of(self.every));
        if !has_sample {
            return f64::NAN;
        }
        let analogue = analogue();
        *is_finite &= analogue.is_finite();
        self.converter.map_or(analogue, |converter| converter.round(analogue))
    }
}

/// The stated inputs of a device as an experiment drives them.
fn stated_inputs(
    experiment: &Experiment,
    simulate: &Simulate,
    device: &Device,
) -> Result<Vec<SimulatedInput>, SimulateError> {
    let stated = &device.inputs()[..device.own_inputs()];
    let named = match (&simulate.drive, stated) {
        (DriveSource::Inputs(named), _) => named,
        (_, []) => return Ok(Vec::new()),
        (DriveSource::RingDown(_), [input, ..]) => {
            let why = format!(
                "bias and feedback resistance of a ring-down are those of another device; write `[simulate.drive.inputs.{}.ring_down]`",
                input.name
            );
            return Err(experiment.error("simulate.drive.ring_down", ConfigFault::Value { why }).into());
        }
        (DriveSource::Capture(capture), [input])
            if names::kind_of(input).dimension == kind::VOLTAGE.dimension =>
        {
            return Ok(vec![captured(capture)]);
        }
        (_, [input]) if names::kind_of(input).dimension == kind::VOLTAGE.dimension => {
            let (drive, source) = drive_of(experiment, simulate)?;
            return Ok(vec![SimulatedInput { drive, source, before_s: 0.0 }]);
        }
        (_, inputs) => {
            let names: Vec<String> =
                inputs.iter().map(|input| format!("`{} = \"{}\"`", input.name, input.unit_text)).collect();
            let why = format!(
                "the device has the inputs {}; write a table for each, such as `[simulate.drive.inputs.{}.sine]`",
                names.join(" and "),
                inputs[0].name
            );
            return Err(experiment.error("simulate.drive", ConfigFault::Value { why }).into());
        }
    };
    let key = || Key::from("simulate.drive.inputs");
    if let Some(name) = named.keys().find(|name| stated.iter().all(|input| *input.name != ***name)) {
        let known = stated.iter().map(|input| &*input.name);
        return Err(experiment.error(key().child(name), ConfigFault::unknown_key(name, known)).into());
    }
    let one = |input: &Named| {
        let Some(source) = named.get(&*input.name) else {
            let remedy = format!(
                "write `{0} = \"none\"` in `[simulate.drive.inputs]` where it is zero, or a table such as \
                 `[simulate.drive.inputs.{0}.sine]`",
                input.name
            );
            return Err(experiment
                .error(key().child(&input.name), ConfigFault::MissingKey { remedy })
                .into());
        };
        input_of(experiment, simulate, (&input.name, names::kind_of(input)), source)
    };
    stated.iter().map(one).collect()
}

/// The rates of these inputs, as far as the equations need them.
fn rates(
    experiment: &Experiment,
    simulate: &Simulate,
    (device, inputs): (&Device, &[SimulatedInput]),
) -> Result<Vec<Drive>, SimulateError> {
    let is_closed = |name: &str| match &simulate.drive {
        DriveSource::Inputs(named) => matches!(named.get(name), Some(InputSource::Feedback(_))),
        _ => false,
    };
    let of = |input: &usize| {
        let name = &*device.inputs()[*input].name;
        inputs[*input].drive.rate().filter(|_| !is_closed(name)).ok_or_else(|| {
            let why = format!(
                "the equations need the time derivative of `{name}`, and this drive jumps; take another one, such as \
                 `[simulate.drive.inputs.{name}.sine]`"
            );
            experiment.error("simulate.drive", ConfigFault::Value { why }).into()
        })
    };
    device.rated_inputs().iter().map(of).collect()
}

/// How the measurements of a device are sampled.
fn sampling(
    experiment: &Experiment,
    simulate: &Simulate,
    device: &Device,
) -> Result<Vec<Sampling>, SimulateError> {
    let key = || Key::from("simulate.channels");
    let known = || device.measures().iter().map(|measure| &*measure.name);
    if let Some(name) = simulate.channels.keys().find(|name| known().all(|known| known != name.as_str())) {
        return Err(experiment.error(key().child(name), ConfigFault::unknown_key(name, known())).into());
    }
    let one = |measure: &Named| {
        let (at, kind) = (key().child(&measure.name), names::kind_of(measure));
        let SimulatedChannel { sampling_rate, first_row, adc } =
            simulate.channels.get(&*measure.name).cloned().unwrap_or_default();
        let every = sampling_rate.as_ref().map_or(1.0, |rate| simulate.sampling_rate.si() / rate.si());
        if !(every > 0.5 && (every - every.round()).abs() < 1e-6 * every) {
            let text = sampling_rate.as_ref().map_or("", |rate| rate.text());
            let why = format!(
                "`{text}` is not `{}` divided by a whole number; a channel is sampled at some of the rows of the recording",
                simulate.sampling_rate.text()
            );
            return Err(experiment.error(at.child("sampling_rate"), ConfigFault::Value { why }).into());
        }
        let converter = match (&adc, &simulate.adc) {
            (Some(adc), _) => {
                let at = at.child("adc");
                let level =
                    |name: &str, value| experiment.value(at.clone().child(name), value, kind, Sign::Any);
                let levels = [level("low", &adc.low)?, level("high", &adc.high)?];
                if levels[0] >= levels[1] {
                    let why = format!(
                        "`{}` is not above `low`, `{}`",
                        adc.high.value().text(),
                        adc.low.value().text()
                    );
                    return Err(experiment.error(at.child("high"), ConfigFault::Value { why }).into());
                }
                Some(Converter::new(adc.bits, levels))
            }
            (None, Some(adc)) if kind.dimension == kind::VOLTAGE.dimension => Some(Converter::of(adc)),
            (None, Some(_)) => {
                let why = format!(
                    "`{}` is measured in {}, and its levels are in V; write `[simulate.channels.{}.adc]` instead",
                    measure.name, measure.unit_text, measure.name
                );
                return Err(experiment.error("simulate.adc", ConfigFault::Value { why }).into());
            }
            (None, None) => None,
        };
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // positive, saturating
        Ok(Sampling { every: every.round().max(1.0) as u64, first: first_row.into(), converter })
    };
    device.measures().iter().map(one).collect()
}

impl EquationSimulation {
    /// As the experiment describes it.
    pub fn of(experiment: &Experiment) -> Result<Self, SimulateError> {
        let Some(simulate) = &experiment.simulate else {
            let remedy =
                "add the table `[simulate]` with a drive, such as `[simulate.drive.sine]`".to_owned();
            return Err(experiment.error("simulate", ConfigFault::MissingKey { remedy }).into());
        };
        let own = OwnDevice::of(experiment)?;
        let device = &own.device;
        let wrong = |error| SimulateError::from(refused(experiment, &error));
        let inputs = stated_inputs(experiment, simulate, device)?;
        let rates = rates(experiment, simulate, (device, &inputs))?;
        let loops = loops(experiment, simulate, &own)?;
        let feedthrough = SimulatedFeedthrough::of(experiment, &own, &inputs)?;
        let before_s = inputs.iter().map(|input| input.before_s).fold(0.0, f64::max);
        let sampling = sampling(experiment, simulate, device)?;
        let entries = names::entries(device);
        let stated = some(experiment, &Key::from("simulate.start"), &simulate.start, &entries)?;
        let start = own.started(&stated);
        let rate_hz = simulate.sampling_rate.si();
        let variances = own.variances(rate_hz).into_iter().map(|variance| variance.unwrap_or(0.0)).collect();
        let (densities, periods) = (own.densities(), own.periods.clone());
        let events = recorded_events(&own).map_err(wrong)?;
        let table = experiment.device_in_terms_of::<EquationsTable>()?;
        let of_recording = (rate_hz.recip(), simulate.samples());
        let instruments = instruments(experiment, (&table, &own), of_recording)?;
        let of_events = events.iter().map(|(event, _)| names::event_channel(&device.events()[*event]));
        let recorded = [
            names::channels(&device.inputs()[..device.own_inputs()]),
            names::channels(device.measures()),
            columns(&own, &instruments),
            of_events.collect(),
        ]
        .concat();
        let known = names::values(&table, device);
        let truth_of: Vec<usize> = known.iter().filter_map(|value| device.state(value.name)).collect();
        let of_states = truth_of.iter().map(|place| device.states()[*place].clone());
        let truth =
            names::channels(&of_states.chain(device.quantities().iter().cloned()).collect::<Vec<_>>());
        let (simulate, noises) = (simulate.clone(), (densities, variances));
        let (mut drives, sources): (Vec<_>, Vec<_>) =
            inputs.into_iter().map(|input| (input.drive, input.source)).unzip();
        drives.extend(rates);
        let sources = sources.into_iter().flatten().collect();
        Ok(Self {
            own,
            drives,
            loops,
            feedthrough,
            before_s,
            sources,
            start,
            simulate,
            noises,
            sampling,
            periods,
            instruments,
            events,
            recorded,
            truth,
            truth_of,
        })
    }
}

impl EquationSimulation {
    /// Steps per second and per sample: the stated rate, or a whole multiple of it that follows the fastest motion as well.
    fn steps(&self) -> Result<(f64, u64), SimulateError> {
        let stated_hz = self.simulate.integration_rate.si();
        let parts = steps_over(self.own.pace(), stated_hz.recip());
        let parts = parts.ok_or(SimulateError::NotFinite { time_s: 0.0 })?;
        Ok((stated_hz * parts as f64, self.simulate.steps_per_sample() * parts as u64))
    }

    /// How many streams of random numbers come before those of the rates: one for each measurement and instrument; those of events come behind.
    fn before_rates(&self) -> usize {
        self.own.device.measures().len() + self.instruments.len()
    }

    /// What the instruments look back on, empty; `None` without one.
    fn history(&self) -> Result<Option<InstrumentHistory>, EquationError> {
        let Self { own, simulate, instruments, .. } = self;
        let noises = streams(simulate.seed, own.device.measures().len(), instruments.len());
        let interval_s = simulate.sampling_rate.si().recip();
        InstrumentHistory::of(own, instruments, (noises, simulate.noise), interval_s)
    }

    /// Why a motion that was finite an interval ago is not any more.
    fn not_finite(&self, before: (&[f64], &[f64]), time_s: f64, interval_s: f64) -> SimulateError {
        let left = self.own.device.left_table(&self.own.values, before, interval_s);
        match left.ok().flatten() {
            Some(left) => {
                SimulateError::NotDescribed { time_s: (time_s - interval_s).max(0.0), why: left.to_string() }
            }
            None => SimulateError::NotFinite { time_s },
        }
    }

    /// Writes what is true of a sample: the states that an estimate may be compared with, and the quantities.
    fn write_truth(&self, (state, inputs): (&[f64], &[f64]), quantities: &mut [Reading], truth: &mut [f64]) {
        for (to, place) in truth.iter_mut().zip(&self.truth_of) {
            *to = state[*place];
        }
        for (to, quantity) in truth.iter_mut().skip(self.truth_of.len()).zip(quantities) {
            *to = quantity.read(state, inputs);
        }
    }

    /// What looks for the events that are recorded, with random numbers of its own for each.
    fn simulated_events(&self, noises: Vec<WhiteNoise>) -> Result<Vec<SimulatedEvent>, EquationError> {
        let each = self.events.iter().zip(noises).map(|((event, variances), noise)| {
            let noise = self.simulate.noise.then_some(noise);
            SimulatedEvent::of(&self.own.device, *event, &self.own.values, (*variances, noise))
        });
        each.collect()
    }
}

/// The sizes of the noises of a simulation: those that depend on states or inputs are as they are where a step begins (the sense of Itô), and
/// at the sample.
struct NoiseSizes {
    /// The standard deviation that the noise of each state's rate adds in a step.
    step_sd: Vec<f64>,
    /// That of a sample of each measurement.
    sample_sd: Vec<f64>,
    /// Those of the rates that vary, by the state.
    rates: Vec<(usize, Reading)>,
    /// Those of the measurements that vary, with what makes a variance of their sizes.
    measures: Vec<(usize, Reading, f64)>,
    step_s: f64,
}

impl NoiseSizes {
    /// In steps of this length in s, from the sizes at rest.
    fn of(simulation: &EquationSimulation, step_s: f64) -> Result<Self, EquationError> {
        let EquationSimulation { own, simulate, noises: (densities, variances), .. } = simulation;
        let (mut rates, mut measures) = (Vec::new(), Vec::new());
        for (kind, readout) in own.device.varying_noise(&[])? {
            let reading = Reading::new(readout, &own.values);
            match kind {
                NoiseKind::Rate { state } => rates.push((state, reading)),
                NoiseKind::Variance { measure } => measures.push((measure, reading, 1.0)),
                NoiseKind::Density { measure } => {
                    measures.push((measure, reading, 0.5 * simulate.sampling_rate.si()));
                }
                NoiseKind::EventTime { .. } | NoiseKind::Event { .. } => {}
            }
        }
        if !simulate.noise {
            let [step_sd, sample_sd] = [densities, variances].map(|all| vec![0.0; all.len()]);
            return Ok(Self { step_sd, sample_sd, rates: Vec::new(), measures: Vec::new(), step_s });
        }
        let step_sd = densities.iter().map(|density| (density * step_s).sqrt()).collect();
        let sample_sd = variances.iter().map(|variance| variance.sqrt()).collect();
        Ok(Self { step_sd, sample_sd, rates, measures, step_s })
    }

    /// Where a step begins.
    fn at_step(&mut self, drives: &[Drive], state: &[f64], (from_s, inputs): (f64, &mut [f64])) {
        if self.rates.is_empty() {
            return;
        }
        inputs_at(drives, from_s, inputs);
        for (place, reading) in &mut self.rates {
            self.step_sd[*place] = (reading.read(state, inputs) * self.step_s).sqrt();
        }
    }

    /// The standard deviations of the samples of all measurements.
    fn of_samples(&mut self, state: &[f64], inputs: &[f64]) -> &[f64] {
        for (place, reading, factor) in &mut self.measures {
            self.sample_sd[*place] = (reading.read(state, inputs) * *factor).sqrt();
        }
        &self.sample_sd
    }
}

/// The motion of a simulation, step by step, with what a step works on.
struct SimulatedMotion {
    motion: Motion,
    work: ProgramNumbers,
    tables: StepTables,
    resets: Option<Resets>,
    sizes: NoiseSizes,
    /// The random numbers of each rate.
    of_rates: Vec<WhiteNoise>,
    nodes: [Vec<f64>; 3],
    /// Which inputs a step asks for.
    takes: Vec<bool>,
    inputs: Vec<f64>,
    next: Vec<f64>,
}

impl SimulatedMotion {
    /// In steps of this length in s.
    fn of(
        simulation: &EquationSimulation,
        step_s: f64,
        of_rates: Vec<WhiteNoise>,
    ) -> Result<Self, EquationError> {
        let own = &simulation.own;
        let motion = own.motion.clone();
        let resets = own.device.resets(&own.values, (&motion, &[]))?;
        let takes = motion.takes().iter().map(|enters| *enters || resets.is_some()).collect();
        Ok(Self {
            work: motion.work(&own.values),
            tables: motion.tables(),
            resets,
            takes,
            sizes: NoiseSizes::of(simulation, step_s)?,
            of_rates,
            nodes: [const { Vec::new() }; 3],
            inputs: vec![0.0; simulation.drives.len()],
            next: simulation.start.clone(),
            motion,
        })
    }

    /// A step between two times in s, and behind it, or before it where something resets the states, the noise of the rates.
    fn advance(&mut self, drives: &[Drive], state: &mut Vec<f64>, from_to_s: (f64, f64)) {
        let Self { motion, work, tables, resets, sizes, of_rates, nodes, inputs, next, takes } = self;
        sizes.at_step(drives, state, (from_to_s.0, inputs));
        if let Some(resets) = resets {
            if resets.path().is_none() {
                let path = resets.sides_at(state, inputs);
                resets.set_path(Some(path));
            }
            // What noise moves past zero is reset in the step, so that no state is seen there.
            add_noise(state, &sizes.step_sd, of_rates);
        }
        parts_of_all((drives, takes), from_to_s, nodes, &mut |from_s, to_s, nodes| {
            let length_s = to_s - from_s;
            motion.set_runge_kutta(tables, length_s);
            let finite = motion.step(work, state, nodes, tables, next);
            if let Some(resets) = resets.as_mut().filter(|_| finite) {
                let set_tables = &mut |tables: &mut _, length_s| motion.set_runge_kutta(tables, length_s);
                let work = &mut *work;
                let mut step = ResetStep { motion, work, inputs: nodes, tables, length_s, set_tables };
                if !resets.follow(&mut step, state, next, &mut []) {
                    next.fill(f64::NAN);
                }
            }
            std::mem::swap(state, next);
        });
        if resets.is_none() {
            add_noise(state, &sizes.step_sd, of_rates);
        }
    }

    /// Takes whole turns off the states that come round.
    fn turn(&mut self, periods: &[(usize, f64)], state: &mut [f64]) {
        for (place, period) in periods {
            let turns = (state[*place] / period).floor();
            state[*place] -= period * turns;
            if let Some(resets) = self.resets.as_mut().filter(|_| turns != 0.0) {
                // It is on other sides without a motion.
                resets.set_path(None);
            }
        }
    }
}

/// How many rates follow each other in a row, each depending on the state of the next; more than four where they go round.
fn longest_row(motion: &Motion) -> usize {
    let depends: Vec<(usize, usize)> = motion.sparsity().collect();
    let mut reached: Vec<usize> = depends.iter().map(|(row, _)| *row).collect();
    let mut length = 0;
    while !reached.is_empty() && length <= 4 {
        length += 1;
        reached =
            depends.iter().filter(|(_, column)| reached.contains(column)).map(|(row, _)| *row).collect();
    }
    length
}

/// Adds the noise of the rates over a step.
fn add_noise(state: &mut [f64], sd: &[f64], chance: &mut [WhiteNoise]) {
    for ((state, sd), noise) in state.iter_mut().zip(sd).zip(chance) {
        // A size that is no number makes none of the state, which is reported.
        if *sd != 0.0 {
            *state += sd * noise.sample();
        }
    }
}

/// What is read of a device, by the places of it.
fn readings_of(
    own: &OwnDevice,
    places: Range<usize>,
    readout: fn(&Device, usize, &[usize]) -> Result<ReadoutProgram, EquationError>,
) -> Result<Vec<Reading>, EquationError> {
    places.map(|place| Ok(Reading::new(readout(&own.device, place, &[])?, &own.values))).collect()
}

/// So many streams of random numbers, from this one on.
fn streams(seed: u64, from: usize, count: usize) -> Vec<WhiteNoise> {
    (from..from + count).map(|stream| WhiteNoise::new(seed, stream as u64)).collect()
}

/// The inputs at a time in s.
fn inputs_at(drives: &[Drive], time_s: f64, inputs: &mut [f64]) {
    for (input, drive) in inputs.iter_mut().zip(drives) {
        *input = drive.at(time_s);
    }
}

impl Simulation for EquationSimulation {
    fn recorded(&self) -> &[SimulatedColumn] {
        &self.recorded
    }

    fn truth(&self) -> &[SimulatedColumn] {
        &self.truth
    }

    fn samples(&self) -> u64 {
        self.simulate.samples()
    }

    fn steps_per_s(&self) -> Option<f64> {
        self.steps().ok().map(|(rate_hz, _)| rate_hz)
    }

    fn sources(&self) -> &[RecordingSource] {
        &self.sources
    }

    /// Runge and Kutta's method is exact for rates that are linear and follow each other in no circle, four of them in a row at most.
    fn is_exact(&self) -> bool {
        let is_still = self.drives.is_empty() && self.noises.0.iter().all(|density| *density == 0.0);
        is_still
            && !self.own.device.has_resets()
            && self.own.motion.is_linear()
            && longest_row(&self.own.motion) <= 4
    }

    fn begin(&self) -> Result<SimulationStart, SimulateError> {
        let too_large = |_| SimulateError::NotFinite { time_s: 0.0 };
        let (rate_hz, steps) = self.steps()?;
        let streams = streams(self.simulate.seed, self.before_rates(), self.start.len());
        let mut moved = SimulatedMotion::of(self, rate_hz.recip(), streams).map_err(too_large)?;
        let mut history = self.history().map_err(too_large)?;
        let back = history.as_ref().map_or(0, |history| history.reach()[0]);
        let (mut state, mut inputs) = (self.start.clone(), vec![0.0; self.drives.len()]);
        // Before the recording, where an input asks for that.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // not negative, and saturating
        let steps_before = (self.before_s * rate_hz).round() as u64;
        if let Some(history) = &mut history {
            let begins_s = -(steps_before as f64 / rate_hz);
            let known = steps_before / steps;
            history.push_before((&state, begins_s), (back.saturating_sub(known), steps), &self.drives);
        }
        for left in (1..=steps_before).rev() {
            let from_to_s = (-(left as f64 / rate_hz), -((left - 1) as f64 / rate_hz));
            if let Some(history) =
                history.as_mut().filter(|_| left.is_multiple_of(steps) && left <= back * steps)
            {
                inputs_at(&self.drives, from_to_s.0, &mut inputs);
                history.push(&state, &inputs);
            }
            moved.advance(&self.drives, &mut state, from_to_s);
            moved.turn(&self.periods, &mut state);
            if left.is_multiple_of(LOOK) && !state.iter().all(|x| x.is_finite()) {
                return Err(SimulateError::NotFinite { time_s: -(left as f64 / rate_hz) });
            }
        }
        let past = history.as_ref().map(InstrumentHistory::past).unwrap_or_default();
        Ok(SimulationStart { state, noises: moved.of_rates, past })
    }

    fn run(&self, each: &mut dyn FnMut(&SimulatedSample) -> ControlFlow<()>) -> Result<(), SimulateError> {
        self.run_from(&self.begin()?, each)
    }

    fn run_from(
        &self,
        start: &SimulationStart,
        each: &mut dyn FnMut(&SimulatedSample) -> ControlFlow<()>,
    ) -> Result<(), SimulateError> {
        let Self { own, simulate, .. } = self;
        let too_large = |_| SimulateError::NotFinite { time_s: 0.0 };
        let mut readings =
            readings_of(own, 0..own.device.measures().len(), Device::readout).map_err(too_large)?;
        let mut quantities =
            readings_of(own, 0..own.device.quantities().len(), Device::quantity).map_err(too_large)?;
        let mut of_samples = streams(simulate.seed, 0, readings.len());
        let of_events = streams(simulate.seed, self.before_rates() + self.start.len(), self.events.len());
        let mut events = self.simulated_events(of_events).map_err(too_large)?;
        let (rate_hz, steps) = self.steps()?;
        let mut moved =
            SimulatedMotion::of(self, rate_hz.recip(), start.noises.clone()).map_err(too_large)?;
        let mut rates = moved.motion.work(&own.values);
        let interval_s = simulate.sampling_rate.si().recip();
        let mut state = start.state.clone();
        let mut recorded = vec![0.0; self.recorded.len()];
        let measured = self.recorded.len() - self.events.len();
        let mut truth = vec![0.0; self.truth.len()];
        let mut inputs = vec![0.0; self.drives.len()];
        let mut drives = self.drives.clone();
        let mut history = self.history().map_err(too_large)?;
        let ahead = history.as_ref().map_or(0, |history| history.reach()[1]);
        if let Some(history) = &mut history {
            start.past.iter().for_each(|[state, inputs]| history.push(state, inputs));
        }
        let mut step_count = 0_u64;
        let mut before = state.clone();
        // Rows that wait for what an instrument shows of them.
        let mut waiting: VecDeque<(f64, Vec<f64>, Vec<f64>)> = VecDeque::new();
        let of_instruments = own.device.own_inputs() + readings.len();
        let of_instruments = of_instruments..of_instruments + self.instruments.len();
        for k in 0..self.samples() + ahead {
            let time_s = k as f64 * interval_s;
            inputs_at(&drives, time_s, &mut inputs);
            let (of_inputs, of_measures) = recorded.split_at_mut(own.device.own_inputs());
            let mut finite = state.iter().chain(&inputs).all(|x| x.is_finite());
            let sample_sd = moved.sizes.of_samples(&state, &inputs);
            for (place, reading) in readings.iter_mut().enumerate() {
                // Each channel has random numbers of its own, whatever rows it is sampled at.
                let noise = sample_sd[place] * of_samples[place].sample();
                let share = self.feedthrough.as_ref().map_or(0.0, |of| of.share(place, time_s));
                let analogue = || reading.read(&state, &inputs) + share + noise;
                of_measures[place] = self.sampling[place].sample(k, &mut finite, analogue);
            }
            for closed in &self.loops {
                closed.answer(of_measures, &mut drives);
            }
            // A recording has what moves the device from its row on.
            inputs_at(&drives, time_s, of_inputs);
            if !self.loops.is_empty() {
                inputs_at(&drives, time_s, &mut inputs);
            }
            if !finite {
                return Err(self.not_finite((&before, &inputs), time_s, interval_s));
            }
            before.copy_from_slice(&state);
            for (to, event) in recorded[measured..].iter_mut().zip(&mut events) {
                *to = event.ago(time_s);
            }
            self.write_truth((&state, &inputs), &mut quantities, &mut truth);
            let of_quantity =
                |place: usize| truth.get(self.truth_of.len() + place).copied().unwrap_or(f64::NAN);
            let mut left = own.ranges.iter().filter_map(|range| range.left(of_quantity(range.quantity)));
            if let Some(why) = left.next() {
                return Err(SimulateError::NotDescribed { time_s, why });
            }
            let told = if let Some(history) = &mut history {
                history.push(&state, &inputs);
                if k < self.samples() {
                    waiting.push_back((time_s, recorded.clone(), truth.clone()));
                }
                let shown = if k >= ahead { waiting.pop_front() } else { None };
                match shown {
                    Some((time_s, mut recorded, truth)) => {
                        history.show(recorded.get_mut(of_instruments.clone()).unwrap_or_default());
                        each(&SimulatedSample { time_s, recorded: &recorded, truth: &truth })
                    }
                    None => ControlFlow::Continue(()),
                }
            } else {
                each(&SimulatedSample { time_s, recorded: &recorded, truth: &truth })
            };
            if told.is_break() {
                return Err(SimulateError::Interrupted);
            }
            for _ in 0..steps {
                let (from_s, to_s) = (step_count as f64 / rate_hz, (step_count + 1) as f64 / rate_hz);
                for event in &mut events {
                    inputs_at(&drives, from_s, &mut inputs);
                    event.begin((&moved.motion, &mut rates), &state, (from_s, &inputs));
                }
                moved.advance(&drives, &mut state, (from_s, to_s));
                step_count += 1;
                for event in &mut events {
                    inputs_at(&drives, to_s, &mut inputs);
                    event.end((&moved.motion, &mut rates), &state, (to_s, &inputs));
                }
            }
            moved.turn(&self.periods, &mut state);
        }
        Ok(())
    }
}

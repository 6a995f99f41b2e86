//! A recording of a device of one's own that is computed.

use super::model::{noises, steps_over};
use super::names;
use super::settings::OwnDevice;
use super::simulated_event::{SimulatedEvent, recorded_events};
use super::table::{EquationsTable, refused};
use crate::config::{Experiment, Fault, Simulate};
use crate::recording::Source;
use crate::simulate::{Channel, Converter, Drive, Sample, SimulateError, Simulation, WhiteNoise, drive_of};
use crate::units::kind;
use kalmems_core::Nodes;
use std::ops::ControlFlow;

/// A simulation by the equations: Runge and Kutta's method of fourth order in steps of the integration rate, behind each of which
/// the noise of the rates is added.
pub struct EquationSimulation {
    own: OwnDevice,
    drive: Option<Drive>,
    sources: Vec<Source>,
    start: Vec<f64>,
    simulate: Simulate,
    /// The density of the noise of each state's rate, and the variance of a sample of each measurement.
    noises: (Vec<f64>, Vec<f64>),
    periods: Vec<(usize, f64)>,
    /// The events that are recorded, behind what is measured: their places, and the variances of their times and their expressions.
    events: Vec<(usize, [f64; 2])>,
    recorded: Vec<Channel>,
    truth: Vec<Channel>,
    /// The states that they are.
    truth_of: Vec<usize>,
}

impl EquationSimulation {
    /// As the experiment describes it.
    pub fn of(experiment: &Experiment) -> Result<Self, SimulateError> {
        let Some(simulate) = &experiment.simulate else {
            let remedy =
                "add the table `[simulate]` with a drive, such as `[simulate.drive.sine]`".to_owned();
            return Err(experiment.error("simulate", Fault::MissingKey { remedy }).into());
        };
        let own = OwnDevice::of(experiment)?;
        let device = &own.device;
        let wrong = |error| SimulateError::from(refused(experiment, &error));
        let (drive, sources) = match device.inputs() {
            [] => (None, Vec::new()),
            [input] if names::kind_of(input).dimension == kind::VOLTAGE.dimension => {
                let (drive, source) = drive_of(experiment, simulate)?;
                (Some(drive), source.into_iter().collect())
            }
            inputs => {
                let names: Vec<String> = inputs
                    .iter()
                    .map(|input| format!("`{} = \"{}\"`", input.name, input.unit_text))
                    .collect();
                let why = format!(
                    "the device has the inputs {}; a drive is a voltage, and is simulated for a device with one input in V: make \
                     the others parameters, or scale the one by a parameter such as `force_per_volt`",
                    names.join(" and ")
                );
                return Err(experiment.error("simulate.drive", Fault::Value { why }).into());
            }
        };
        let entries = names::entries(device, crate::config::Sign::Any);
        let mut stated = vec![None; entries.len()];
        for (slot, entry) in stated.iter_mut().zip(&entries) {
            if let Some(value) = simulate.start.get(entry.name) {
                let key = crate::config::Key::from("simulate.start").child(entry.name);
                *slot = Some(experiment.value(key, value, entry.kind, entry.sign)?);
            }
        }
        let start = own.started(&stated);
        if let Some(name) =
            simulate.start.keys().find(|name| entries.iter().all(|entry| entry.name != name.as_str()))
        {
            let known = entries.iter().map(|entry| entry.name);
            let key = crate::config::Key::from("simulate.start").child(name);
            return Err(experiment.error(key, Fault::unknown_key(name, known)).into());
        }
        let rate_hz = simulate.sampling_rate.si();
        let (densities, variances) = noises(device, &own.values, rate_hz).map_err(wrong)?;
        let variances = variances.into_iter().map(|variance| variance.unwrap_or(0.0)).collect();
        let periods = device.periods(&own.values).map_err(wrong)?;
        let events = recorded_events(&own).map_err(wrong)?;
        let of_events = events.iter().map(|(event, _)| names::event_channel(&device.events()[*event]));
        let recorded =
            [names::channels(device.inputs()), names::channels(device.measures()), of_events.collect()]
                .concat();
        let known = names::values(&*experiment.device::<EquationsTable>()?, device);
        let truth_of: Vec<usize> = known.iter().filter_map(|value| device.state(value.name)).collect();
        let truth =
            truth_of.iter().flat_map(|place| names::channels(&device.states()[*place..=*place])).collect();
        let (simulate, noises) = (simulate.clone(), (densities, variances));
        Ok(Self { own, drive, sources, start, simulate, noises, periods, events, recorded, truth, truth_of })
    }
}

impl Simulation for EquationSimulation {
    fn recorded(&self) -> &[Channel] {
        &self.recorded
    }

    fn truth(&self) -> &[Channel] {
        &self.truth
    }

    fn samples(&self) -> u64 {
        self.simulate.samples()
    }

    fn sources(&self) -> &[Source] {
        &self.sources
    }

    fn outlook(&self) -> Option<String> {
        None
    }

    fn run(&self, each: &mut dyn FnMut(&Sample) -> ControlFlow<()>) -> Result<(), SimulateError> {
        let Self { own, simulate, .. } = self;
        let too_large = |_| SimulateError::NotFinite { time_s: 0.0 };
        let motion = own.device.motion(&[]).map_err(too_large)?;
        let mut work = motion.work(&own.values);
        let readouts = (0..own.device.measures().len()).map(|place| own.device.readout(place, &[]));
        let readouts = readouts.collect::<Result<Vec<_>, _>>().map_err(too_large)?;
        let mut readings: Vec<_> = readouts.iter().map(|readout| readout.work(&own.values)).collect();
        // One stream of random numbers for each measurement, and behind them one for each state.
        let streams = |from: usize, count: usize| -> Vec<WhiteNoise> {
            (0..count).map(|stream| WhiteNoise::new(simulate.seed, (from + stream) as u64)).collect()
        };
        let mut of_samples = streams(0, readouts.len());
        let mut of_rates = streams(readouts.len(), self.start.len());
        let of_events = streams(readouts.len() + self.start.len(), self.events.len());
        let mut watched = Vec::new();
        for ((event, variances), noise) in self.events.iter().zip(of_events) {
            let noise = simulate.noise.then_some(noise);
            let watch = SimulatedEvent::of(&own.device, *event, &own.values, (*variances, noise));
            watched.push(watch.map_err(too_large)?);
        }
        let converter = simulate.adc.as_ref().map(Converter::of);
        // The stated rate, or a whole multiple of it that follows the fastest motion as well.
        let Some(parts) = steps_over(own.pace(), simulate.integration_rate.si().recip()) else {
            return Err(SimulateError::NotFinite { time_s: 0.0 });
        };
        let rate_hz = simulate.integration_rate.si() * parts as f64;
        let steps = simulate.steps_per_sample() * parts as u64;
        let step_sd: Vec<f64> = self.noises.0.iter().map(|density| (density / rate_hz).sqrt()).collect();
        let sample_sd: Vec<f64> = self.noises.1.iter().map(|variance| variance.sqrt()).collect();
        let interval_s = simulate.sampling_rate.si().recip();
        let mut state = self.start.clone();
        let mut next = state.clone();
        let mut recorded = vec![0.0; self.recorded.len()];
        let measured = self.recorded.len() - self.events.len();
        let mut truth = vec![0.0; self.truth.len()];
        let mut step_count = 0_u64;
        for k in 0..self.samples() {
            let time_s = k as f64 * interval_s;
            let input = self.drive.as_ref().map(|drive| drive.at(time_s));
            let inputs = input.as_slice();
            recorded[..inputs.len()].copy_from_slice(inputs);
            for (place, readout) in readouts.iter().enumerate() {
                let clean = readout.read(&mut readings[place], &state, inputs);
                let noise = if simulate.noise { sample_sd[place] * of_samples[place].sample() } else { 0.0 };
                let analogue = clean + noise;
                recorded[inputs.len() + place] =
                    converter.map_or(analogue, |converter| converter.round(analogue));
            }
            if !state.iter().chain(&recorded[..measured]).all(|x| x.is_finite()) {
                return Err(SimulateError::NotFinite { time_s });
            }
            for (to, watched) in recorded[measured..].iter_mut().zip(&mut watched) {
                *to = watched.ago(time_s);
            }
            for (to, place) in truth.iter_mut().zip(&self.truth_of) {
                *to = state[*place];
            }
            if each(&Sample { time_s, recorded: &recorded, truth: &truth }).is_break() {
                return Err(SimulateError::Interrupted);
            }
            for _ in 0..steps {
                let (from_s, to_s) = (step_count as f64 / rate_hz, (step_count + 1) as f64 / rate_hz);
                let inputs_at = |time_s| self.drive.as_ref().map(|drive| drive.at(time_s));
                for watched in &mut watched {
                    watched.begin((&motion, &mut work), &state, (from_s, inputs_at(from_s).as_slice()));
                }
                let mut over = |from_s: f64, to_s: f64, nodes: &Nodes<&[f64]>| {
                    motion.step(&mut work, &state, nodes, to_s - from_s, &mut next);
                    std::mem::swap(&mut state, &mut next);
                };
                match &self.drive {
                    None => over(from_s, to_s, &Nodes::held(&[][..])),
                    Some(drive) => drive.parts(from_s, to_s, &mut |from_s, to_s, nodes| {
                        let [start, middle, end] = [[nodes.start], [nodes.middle], [nodes.end]];
                        over(from_s, to_s, &Nodes { start: &start[..], middle: &middle, end: &end });
                    }),
                }
                step_count += 1;
                if simulate.noise {
                    for ((state, sd), noise) in state.iter_mut().zip(&step_sd).zip(&mut of_rates) {
                        if *sd > 0.0 {
                            *state += sd * noise.sample();
                        }
                    }
                }
                for watched in &mut watched {
                    watched.end((&motion, &mut work), &state, (to_s, inputs_at(to_s).as_slice()));
                }
            }
            for (place, period) in &self.periods {
                state[*place] -= period * (state[*place] / period).floor();
            }
        }
        Ok(())
    }
}

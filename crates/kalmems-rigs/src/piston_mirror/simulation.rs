//! A recording of the mirror that is computed.

use super::driven::noise_deviation;
use super::phasor::{STATES, position_and_velocity};
use super::plates::last_term_m;
use super::settings::PistonHardware;
use crate::config::{
    ConfigError, ConfigFault, DriveSource, ExpectedEntry, Experiment, Quantity, Sign, Simulate,
};
use crate::simulate::{SimulateError, SimulatedColumn, SimulatedSample, Simulation, WhiteNoise};
use kalmems_core::Portable;
use std::f64::consts::TAU;
use std::ops::ControlFlow;

/// A motion with constant rates, as the file states it, seen through the capacitance with white noise.
pub struct PhasorSimulation {
    hardware: PistonHardware,
    /// [A, f, φ, d₀, Ȧ] at the first sample.
    start: [f64; 5],
    /// Amplitude in m and phase in rad of the second harmonic.
    harmonic: [f64; 2],
    samples: u64,
    interval_s: f64,
    noise_sd: f64,
    seed: u64,
}

/// The stream of the readout's noise.
const SIGNAL_NOISE: u64 = 0;

/// [A, f, φ, d₀, Ȧ] at the first sample, as the file states them.
pub fn start_of(experiment: &Experiment, simulate: &Simulate) -> Result<[f64; 5], ConfigError> {
    let positive = ["amplitude", "frequency", "offset"];
    let entries = STATES.map(|(name, _, kind)| {
        let sign = if positive.contains(&name) { Sign::Positive } else { Sign::Any };
        ExpectedEntry { name, kind, sign }
    });
    experiment.values("simulate.start", &simulate.start, entries)
}

impl PhasorSimulation {
    /// Reads and checks what the file says of the simulation.
    pub fn of(experiment: &Experiment) -> Result<Self, ConfigError> {
        let hardware = PistonHardware::of(experiment)?;
        let Some(simulate) = &experiment.simulate else {
            let remedy = "add the table `[simulate]` with `duration`, `sampling_rate`, `integration_rate`, `start` and \
                          `drive = { prescribed = {} }`"
                .to_owned();
            return Err(experiment.error("simulate", ConfigFault::MissingKey { remedy }));
        };
        let DriveSource::Prescribed(motion) = &simulate.drive else {
            let why =
                "a piston mirror is simulated by its motion; write `drive = { prescribed = {} }`".to_owned();
            return Err(experiment.error("simulate.drive", ConfigFault::Value { why }));
        };
        let start = start_of(experiment, simulate)?;
        let harmonic = [
            motion.second_harmonic.as_ref().map_or(0.0, Quantity::si),
            motion.second_harmonic_phase.as_ref().map_or(0.0, Quantity::si),
        ];
        let interval_s = simulate.sampling_rate.si().recip();
        let noise_sd = noise_deviation(experiment, simulate, &hardware, interval_s)?;
        let simulation = Self {
            hardware,
            start,
            harmonic,
            samples: simulate.samples(),
            interval_s,
            noise_sd,
            seed: simulate.seed,
        };
        let reach = start[0].max(start[0] + start[4] * simulate.duration.si()) + harmonic[0];
        let (nearest, farthest) = (start[3] - reach, start[3] + reach);
        if nearest <= 0.0 {
            let why = format!(
                "the mirror would come to {nearest:.3e} m from the electrode; expected a distance above 0 all along: \
                 an `amplitude` below `offset`"
            );
            return Err(experiment.error("simulate.start", ConfigFault::Value { why }));
        }
        let [near_end, far_end] = simulation.hardware.table_m;
        if nearest < near_end || farthest > far_end {
            let (outside, end) = if nearest < near_end { (nearest, near_end) } else { (farthest, far_end) };
            let why = format!(
                "the mirror would come to {outside:.4e} m, outside the table of its capacitance, which ends at {end:.4e} m;                  there the series may be wrong by {:.1e} m and more: take a smaller motion, or fit a longer table",
                last_term_m(&simulation.hardware.plates, outside)
            );
            return Err(experiment.error("simulate.start", ConfigFault::Value { why }));
        }
        Ok(simulation)
    }

    /// Position in m and velocity in m/s at a time in s.
    fn at(&self, time_s: f64) -> [f64; 2] {
        let [amplitude, frequency, phase, rest, drift] = self.start;
        let turns = frequency * time_s;
        let now = [amplitude + drift * time_s, frequency, phase + TAU * (turns - turns.floor()), rest, drift];
        let ([position, velocity], _) = position_and_velocity(&now);
        let (s, c) = (2.0 * now[2] + self.harmonic[1]).portable_sin_cos();
        let second = self.harmonic[0];
        [position + second * c, velocity - 2.0 * TAU * frequency * second * s]
    }
}

impl Simulation for PhasorSimulation {
    fn recorded(&self) -> &[SimulatedColumn] {
        &[SimulatedColumn { meaning: "signal", column: "cap_F" }]
    }

    fn truth(&self) -> &[SimulatedColumn] {
        &SimulatedColumn::POSITION_AND_VELOCITY
    }

    fn samples(&self) -> u64 {
        self.samples
    }

    fn run(&self, each: &mut dyn FnMut(&SimulatedSample) -> ControlFlow<()>) -> Result<(), SimulateError> {
        let mut noise = WhiteNoise::new(self.seed, SIGNAL_NOISE);
        for k in 0..self.samples {
            let time_s = k as f64 * self.interval_s;
            let [position, velocity] = self.at(time_s);
            let clean: f64 = self.hardware.plates.capacitance(position);
            let signal = clean + self.noise_sd * noise.sample();
            if each(&SimulatedSample { time_s, recorded: &[signal], truth: &[position, velocity] }).is_break()
            {
                return Err(SimulateError::Interrupted);
            }
        }
        Ok(())
    }
}

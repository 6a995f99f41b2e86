//! A recording of the mirror under its drive.

use super::settings::PistonHardware;
use crate::config::{ConfigError, ConfigFault, DriveSource, ExpectedEntry, Experiment, Sign, Simulate};
use crate::simulate::{
    Drive, SimulateError, SimulatedColumn, SimulatedSample, Simulation, Simulator, Stability, WhiteNoise,
    drive_of,
};
use crate::units::kind;
use kalmems_models::dynamics::ParametricScanner;
use std::ops::ControlFlow;

/// The mirror's motion by its equation, under a pulse-width modulated voltage at about twice its resonance, seen through
/// the capacitance with white noise; beside it the modulation as a trigger.
pub struct DrivenPistonSimulation {
    hardware: PistonHardware,
    device: ParametricScanner<f64>,
    drive: Drive,
    /// High and low of the drive in V: the trigger is 1 V where it is high.
    level: f64,
    /// [z, ż] at 0 s, from rest.
    start: [f64; 2],
    /// The distance at rest in m.
    rest: f64,
    integration_rate_hz: f64,
    steps_per_sample: u64,
    samples: u64,
    sampling_rate_hz: f64,
    noise_sd: f64,
    seed: u64,
}

/// The stream of the readout's noise.
const SIGNAL_NOISE: u64 = 0;

impl DrivenPistonSimulation {
    /// Reads and checks what the file says of the simulation.
    pub fn of(experiment: &Experiment, simulate: &Simulate) -> Result<Self, SimulateError> {
        let hardware = PistonHardware::of(experiment)?;
        let DriveSource::Square(square) = &simulate.drive else {
            let why = "a piston mirror is simulated by its motion or by its pulses; write `drive = { prescribed = {} }` or a \
                       table `[simulate.drive.square]`";
            return Err(experiment
                .error("simulate.drive", ConfigFault::Value { why: why.to_owned() })
                .into());
        };
        let Some(mechanics) = hardware.mechanics else {
            let remedy = "add the table `[device.piston_mirror.mirror]`, or prescribe the motion with \
                          `drive = { prescribed = {} }`"
                .to_owned();
            return Err(experiment
                .error("device.piston_mirror.mirror", ConfigFault::MissingKey { remedy })
                .into());
        };
        let entries = [
            ExpectedEntry { name: "displacement", kind: &kind::LENGTH, sign: Sign::Any },
            ExpectedEntry { name: "velocity", kind: &kind::VELOCITY, sign: Sign::Any },
            ExpectedEntry { name: "offset", kind: &kind::LENGTH, sign: Sign::Positive },
        ];
        let [displacement, velocity, rest] = experiment.values("simulate.start", &simulate.start, entries)?;
        let (drive, _) = drive_of(experiment, simulate)?;
        let interval_s = simulate.sampling_rate.si().recip();
        Ok(Self {
            hardware,
            device: mechanics.device(mechanics.pressure),
            drive,
            level: square.low.si().midpoint(square.high.si()),
            start: [displacement, velocity],
            rest,
            integration_rate_hz: simulate.integration_rate.si(),
            steps_per_sample: simulate.steps_per_sample(),
            samples: simulate.samples(),
            sampling_rate_hz: simulate.sampling_rate.si(),
            noise_sd: noise_deviation(experiment, simulate, &hardware, interval_s)?,
            seed: simulate.seed,
        })
    }
}

/// The standard deviation of the noise of a sample in F, where the file wants noise.
pub fn noise_deviation(
    experiment: &Experiment,
    simulate: &Simulate,
    hardware: &PistonHardware,
    interval_s: f64,
) -> Result<f64, ConfigError> {
    if !simulate.noise {
        return Ok(0.0);
    }
    if hardware.bandwidth_hz.is_some_and(|bandwidth_hz| bandwidth_hz < 0.5 / interval_s * (1.0 - 1e-9)) {
        let why = "below half of `simulate.sampling_rate`: noise that neighbouring samples share is not simulated; sample \
                   at no more than twice the bandwidth, or leave it out"
            .to_owned();
        return Err(experiment.error("device.piston_mirror.readout.bandwidth", ConfigFault::Value { why }));
    }
    Ok(hardware.noise_variance(interval_s).sqrt())
}

impl Simulation for DrivenPistonSimulation {
    fn recorded(&self) -> &[SimulatedColumn] {
        &[
            SimulatedColumn { meaning: "signal", column: "cap_F" },
            SimulatedColumn { meaning: "trigger", column: "trigger_V" },
        ]
    }

    fn truth(&self) -> &[SimulatedColumn] {
        &SimulatedColumn::POSITION_AND_VELOCITY
    }

    fn samples(&self) -> u64 {
        self.samples
    }

    fn outlook(&self) -> Option<String> {
        Stability::of(&self.device, &self.drive).map(|stability| stability.to_string())
    }

    fn run(&self, each: &mut dyn FnMut(&SimulatedSample) -> ControlFlow<()>) -> Result<(), SimulateError> {
        let mut simulator =
            Simulator::new(self.device, self.drive.clone(), self.integration_rate_hz, self.start);
        let mut noise = WhiteNoise::new(self.seed, SIGNAL_NOISE);
        for k in 0..self.samples {
            if k > 0 {
                (0..self.steps_per_sample).for_each(|_| simulator.step());
            }
            let time_s = k as f64 / self.sampling_rate_hz;
            let [displacement, velocity] = *simulator.state();
            let position = self.rest + displacement;
            if !(position > 0.0 && velocity.is_finite()) {
                return Err(SimulateError::NotFinite { time_s });
            }
            let signal = self.hardware.plates.capacitance(position) + self.noise_sd * noise.sample();
            let trigger = if simulator.drive() > self.level { 1.0 } else { 0.0 };
            let sample =
                SimulatedSample { time_s, recorded: &[signal, trigger], truth: &[position, velocity] };
            if each(&sample).is_break() {
                return Err(SimulateError::Interrupted);
            }
        }
        Ok(())
    }
}

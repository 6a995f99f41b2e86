//! A ring-down that is computed.

use super::identification::RingDownSettings;
use super::settings::{ScannerHardware, state_at};
use crate::config::{ConfigFault, Experiment, RecordingRole, RingDownDrive};
use crate::simulate::{
    Drive, SimulateError, SimulatedColumn, SimulatedSample, Simulation, Simulator, Stability, WhiteNoise,
    drive_of,
};
use kalmems_core::Measurement;
use kalmems_models::dynamics::ParametricScanner;
use kalmems_models::readout::BiasedComb;
use std::ops::ControlFlow;

/// The scanner driven by a sine and a carrier, then left to a constant bias: the recording begins at the switch and
/// holds the transimpedance stage's output; the reference is the optical one, with its noise.
///
/// From the switch on there is no carrier: at 500 kHz it would hide the current of the motion.
pub struct RingDownSimulation {
    hardware: ScannerHardware,
    settings: RingDownSettings,
    before: Drive,
    lasting_steps: u64,
    start: [f64; 2],
    integration_rate_hz: f64,
    steps_per_sample: u64,
    samples: u64,
    sampling_rate_hz: f64,
    signal_noise: f64,
    angle_noise: f64,
    seed: u64,
}

/// The streams of the two noises.
const SIGNAL_NOISE: u64 = 0;
const ANGLE_NOISE: u64 = 1;

impl RingDownSimulation {
    /// Reads and checks what the file says.
    pub fn of(experiment: &Experiment, drive: &RingDownDrive) -> Result<Self, SimulateError> {
        let Some(simulate) = &experiment.simulate else {
            let remedy = "add the table `[simulate]`".to_owned();
            return Err(experiment.error("simulate", ConfigFault::MissingKey { remedy }).into());
        };
        if simulate.adc.is_some() {
            let why =
                "a ring-down has two channels, and the converter is that of one; remove `[simulate.adc]`";
            return Err(experiment.error("simulate.adc", ConfigFault::Value { why: why.to_owned() }).into());
        }
        let integration_rate_hz = simulate.integration_rate.si();
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // not negative, and saturating
        let lasting_steps = (drive.lasting.si() * integration_rate_hz).round() as u64;
        let noise = if simulate.noise { 1.0 } else { 0.0 };
        Ok(Self {
            hardware: ScannerHardware::of(experiment)?,
            settings: RingDownSettings::of(experiment)?,
            before: drive_of(experiment, simulate)?.0,
            lasting_steps,
            start: state_at(experiment, "simulate.start", &simulate.start)?,
            integration_rate_hz,
            steps_per_sample: simulate.steps_per_sample(),
            samples: simulate.samples(),
            sampling_rate_hz: simulate.sampling_rate.si(),
            signal_noise: noise * drive.signal_noise.si(),
            angle_noise: noise * drive.angle_noise.si(),
            seed: simulate.seed,
        })
    }
}

impl Simulation for RingDownSimulation {
    fn recorded(&self) -> &[SimulatedColumn] {
        &[SimulatedColumn { meaning: "current_signal", column: "vo1_V" }]
    }

    fn truth(&self) -> &[SimulatedColumn] {
        &[SimulatedColumn { meaning: "angle", column: "angle_rad" }]
    }

    fn role(&self) -> RecordingRole {
        RecordingRole::RingDown
    }

    fn samples(&self) -> u64 {
        self.samples
    }

    fn outlook(&self) -> Option<String> {
        Stability::of(&self.hardware.scanner, &self.before).map(|stability| format!("before: {stability}"))
    }

    fn run(&self, each: &mut dyn FnMut(&SimulatedSample) -> ControlFlow<()>) -> Result<(), SimulateError> {
        let rate = self.integration_rate_hz;
        let mut driven = Simulator::new(self.hardware.scanner, self.before.clone(), rate, self.start);
        for _ in 0..self.lasting_steps {
            driven.step();
        }
        let free = ParametricScanner { carrier_mean_square: 0.0, ..self.hardware.scanner };
        let bias = Drive::Constant { level: self.settings.bias };
        let mut simulator = Simulator::new(free, bias, rate, *driven.state());
        let readout = BiasedComb {
            comb: free.comb,
            gain: self.settings.feedback_resistance * self.settings.bias,
            offset: 0.0,
            angle_offset: 0.0,
        };
        let mut noises = [SIGNAL_NOISE, ANGLE_NOISE].map(|stream| WhiteNoise::new(self.seed, stream));
        for k in 0..self.samples {
            if k > 0 {
                for _ in 0..self.steps_per_sample {
                    simulator.step();
                }
            }
            let time_s = k as f64 / self.sampling_rate_hz;
            if !simulator.state().iter().all(|x| x.is_finite()) {
                return Err(SimulateError::NotFinite { time_s });
            }
            let [signal, angle] = readout.predict(simulator.state());
            let signal = signal + self.signal_noise * noises[0].sample();
            let angle = angle + self.angle_noise * noises[1].sample();
            let sample = SimulatedSample { time_s, recorded: &[signal], truth: &[angle] };
            if each(&sample).is_break() {
                return Err(SimulateError::Interrupted);
            }
        }
        Ok(())
    }
}

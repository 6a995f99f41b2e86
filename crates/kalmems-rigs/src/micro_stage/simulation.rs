//! A recording of the stage that is computed.

use super::hardware::{StageHardware, noise_missing};
use crate::config::{ConfigError, ConfigFault, DriveSource, Experiment, Key, Quantity, StageConditions};
use crate::simulate::{SimulateError, SimulatedColumn, SimulatedSample, Simulation, WhiteNoise};
use kalmems_core::Portable;
use kalmems_models::capacitance::TiltingPlate;
use kalmems_models::dynamics::PiezoStage;
use kalmems_models::readout::PlateCurrent;
use std::f64::consts::TAU;
use std::ops::ControlFlow;

/// The stage in steady motion under a sine, seen through its four electrodes.
pub struct StageSimulation {
    hardware: StageHardware,
    /// Offset and amplitude in V, frequency in Hz and phase in rad of the drive.
    drive: [f64; 4],
    conditions: Conditions,
    samples: u64,
    interval_s: f64,
    duration_s: f64,
    noise: bool,
    seed: u64,
}

/// What the records are taken under.
#[derive(Clone, Copy, Debug)]
struct Conditions {
    /// The variance of a recorded sample's noise in V², where it is not that of the device table.
    noise_variance: Option<f64>,
    /// Ratio and phase in rad of the tilt about the other axis.
    off_axis: [f64; 2],
    /// By how much the gap in m and the gain, relative to it, change over the recording.
    drift: [f64; 2],
}

impl Conditions {
    fn of(table: Option<&StageConditions>) -> Self {
        let Some(table) = table else {
            return Self { noise_variance: None, off_axis: [0.0; 2], drift: [0.0; 2] };
        };
        Self {
            noise_variance: (table.single_shot_noise.as_ref())
                .map(|noise| noise.si() / f64::from(table.averages.unwrap_or(1))),
            off_axis: [
                table.off_axis_ratio.as_ref().map_or(0.0, Quantity::si),
                table.off_axis_phase.as_ref().map_or(0.0, Quantity::si),
            ],
            drift: [
                table.gap_drift.as_ref().map_or(0.0, Quantity::si),
                table.gain_drift.as_ref().map_or(0.0, Quantity::si),
            ],
        }
    }
}

/// What is recorded.
pub const RECORDED: [SimulatedColumn; 5] = [
    SimulatedColumn { meaning: "drive", column: "drive_V" },
    SimulatedColumn { meaning: "signal_1A", column: "cap1A_V" },
    SimulatedColumn { meaning: "signal_1B", column: "cap1B_V" },
    SimulatedColumn { meaning: "signal_2A", column: "cap2A_V" },
    SimulatedColumn { meaning: "signal_2B", column: "cap2B_V" },
];

/// What is true.
pub const TRUTH: [SimulatedColumn; 2] = [
    SimulatedColumn { meaning: "rate", column: "rate_rad_per_s" },
    SimulatedColumn { meaning: "angle", column: "angle_rad" },
];

/// The electrodes in the order of the columns.
const NAMES: [&str; 4] = ["1A", "1B", "2A", "2B"];

impl StageSimulation {
    /// Reads and checks what the file says of the simulation.
    pub fn of(experiment: &Experiment) -> Result<Self, ConfigError> {
        let hardware = StageHardware::of(experiment)?;
        let Some(simulate) = &experiment.simulate else {
            let remedy = "add the table `[simulate]` with `duration`, `sampling_rate`, `integration_rate`, `start = {}` and \
                          `[simulate.drive.sine]`"
                .to_owned();
            return Err(experiment.error("simulate", ConfigFault::MissingKey { remedy }));
        };
        let refuse = |name: &str, why: &str| {
            let key = Key::from("simulate").child(name);
            Err(experiment.error(key, ConfigFault::Value { why: why.to_owned() }))
        };
        let DriveSource::Sine(sine) = &simulate.drive else {
            return refuse(
                "drive",
                "a micro-stage is simulated under a steady sine; write `[simulate.drive.sine]`",
            );
        };
        if !simulate.start.is_empty() {
            return refuse(
                "start",
                "the stage is in steady motion from the first sample; write `start = {}`",
            );
        }
        if simulate.adc.is_some() {
            return refuse("adc", "no converter is built for the micro-stage; leave it out");
        }
        let names: Vec<&str> = hardware.channels.iter().map(|channel| channel.name.as_str()).collect();
        if names != NAMES {
            let why = format!(
                "found the electrodes {}; a simulation is of the four `1A`, `1B`, `2A` and `2B`",
                names.join(", ")
            );
            return Err(experiment.error("device.micro_stage.electrodes", ConfigFault::Value { why }));
        }
        if simulate.noise && simulate.stage.as_ref().is_none_or(|stage| stage.single_shot_noise.is_none()) {
            for channel in &hardware.channels {
                channel.noise_variance.ok_or_else(|| noise_missing(experiment, &channel.name))?;
            }
        }
        let simulation = Self {
            drive: [
                sine.offset.si(),
                sine.amplitude.si(),
                sine.frequency.si(),
                sine.phase.as_ref().map_or(0.0, Quantity::si),
            ],
            conditions: Conditions::of(simulate.stage.as_ref()),
            samples: simulate.samples(),
            interval_s: simulate.sampling_rate.si().recip(),
            duration_s: simulate.duration.si(),
            noise: simulate.noise,
            seed: simulate.seed,
            hardware,
        };
        simulation.require_apart(experiment)?;
        Ok(simulation)
    }

    /// Refuses a motion that closes a gap.
    fn require_apart(&self, experiment: &Experiment) -> Result<(), ConfigError> {
        let angle = self.steady(&self.hardware.stage).0;
        for channel in &self.hardware.channels {
            let plate = TiltingPlate {
                gap: channel.current.plate.gap + self.conditions.drift[0].min(0.0),
                ..channel.current.plate
            };
            let about_x = angle * self.conditions.off_axis[0];
            for (x, y) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
                if let Err(contact) = plate.checked(x * about_x, y * angle) {
                    let why = format!(
                        "at this amplitude the stage tilts by {angle:.3e} rad and touches electrode {}: its nearest corner \
                         would be {:.2e} m away; lower it",
                        channel.name, contact.clearance
                    );
                    let key =
                        ["drive", "sine", "amplitude"].into_iter().fold(Key::from("simulate"), Key::child);
                    return Err(experiment.error(key, ConfigFault::Value { why }));
                }
            }
        }
        Ok(())
    }

    /// Amplitude and phase against the drive's of what a mode does under it.
    fn steady(&self, mode: &PiezoStage<f64>) -> (f64, f64) {
        let (re, im) = mode.response(TAU * self.drive[2]);
        (self.drive[1] * re.portable_hypot(im), im.portable_atan2(re))
    }
}

impl Simulation for StageSimulation {
    fn recorded(&self) -> &[SimulatedColumn] {
        &RECORDED
    }

    fn truth(&self) -> &[SimulatedColumn] {
        &TRUTH
    }

    fn samples(&self) -> u64 {
        self.samples
    }

    fn run(&self, each: &mut dyn FnMut(&SimulatedSample) -> ControlFlow<()>) -> Result<(), SimulateError> {
        let mut noises: Vec<WhiteNoise> = (0..4).map(|stream| WhiteNoise::new(self.seed, stream)).collect();
        let rate = TAU * self.drive[2];
        let tilt = self.steady(&self.hardware.stage);
        let rise = self.hardware.piston.as_ref().map(|piston| self.steady(piston));
        let [ratio, off_phase] = self.conditions.off_axis;
        for k in 0..self.samples {
            let time_s = k as f64 * self.interval_s;
            // The drive is a sine, so that a mode's motion is one too.
            let phase = rate * time_s + self.drive[3];
            let wave = |(size, late): (f64, f64)| {
                let (sine, cosine) = (phase + late).portable_sin_cos();
                [size * sine, size * rate * cosine]
            };
            let ([angle, speed], other) = (wave(tilt), wave((ratio * tilt.0, tilt.1 + off_phase)));
            let [height, height_rate] = rise.map_or([0.0; 2], &wave);
            let (sine, cosine) = phase.portable_sin_cos();
            let drive = [self.drive[0] + self.drive[1] * sine, self.drive[1] * rate * cosine];
            let aged = time_s / self.duration_s;
            let mut recorded = [drive[0], 0.0, 0.0, 0.0, 0.0];
            for ((y, channel), noise) in
                recorded[1..].iter_mut().zip(&self.hardware.channels).zip(&mut noises)
            {
                let plate = channel.current.plate;
                let gap = plate.gap + self.conditions.drift[0] * aged;
                let current = PlateCurrent {
                    plate: TiltingPlate { gap: gap - height, ..plate },
                    gain: channel.current.gain * (1.0 + self.conditions.drift[1] * aged),
                };
                let tilted = current.voltage_of_both([other[0], angle], [other[1], speed]);
                let rising = -current.gain * current.plate.by_gap(angle) * height_rate;
                let [direct, slope] = channel.feedthrough.unwrap_or_default();
                *y = tilted + rising + direct * drive[0] + slope * drive[1];
                if self.noise {
                    let variance = self.conditions.noise_variance.or(channel.noise_variance).unwrap_or(0.0);
                    *y += variance.sqrt() * noise.sample();
                }
            }
            if each(&SimulatedSample { time_s, recorded: &recorded, truth: &[speed, angle] }).is_break() {
                return Err(SimulateError::Interrupted);
            }
        }
        Ok(())
    }
}

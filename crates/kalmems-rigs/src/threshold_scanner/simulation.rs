//! A recording of the scanner that is computed.

use super::hardware::ThresholdHardware;
use super::settings::state_at;
use crate::config::{CaptureDrive, ConfigFault, DriveSource, Experiment, Key, Quantity};
use crate::evaluate::BeamPosition;
use crate::recording::RecordingSource;
use crate::signal::hermite;
use crate::simulate::{
    Converter, Drive, Interruptions, SimulateError, SimulatedColumn, SimulatedSample, Simulation, Simulator,
    WhiteNoise, drive_of,
};
use crate::threshold_scanner::device::ThresholdScanner;
use kalmems_core::Measurement;
use kalmems_models::readout::Feedthrough;
use std::collections::VecDeque;
use std::f64::consts::TAU;
use std::ops::ControlFlow;

/// The scanner under a drive that may be cut off, its signal, and the position of its beam where there is a detector.
pub struct ThresholdSimulation {
    hardware: ThresholdHardware,
    /// The drive before the recording begins, and for how many steps; none where the recording begins at the start.
    before: Option<(Drive, u64)>,
    drive: Drive,
    sources: Vec<RecordingSource>,
    start: [f64; 2],
    integration_rate_hz: f64,
    steps_per_sample: u64,
    samples: u64,
    sampling_rate_hz: f64,
    converter: Option<Converter>,
    detector: Option<SimulatedDetector>,
    signal_noise: f64,
    seed: u64,
}

/// A position detector at work.
#[derive(Clone, Copy)]
struct SimulatedDetector {
    beam: BeamPosition,
    /// By how many samples it is late.
    late: f64,
    noise: f64,
}

/// The streams of the two noises.
const SIGNAL_NOISE: u64 = 0;
const POSITION_NOISE: u64 = 1;

const DRIVE: SimulatedColumn = SimulatedColumn { meaning: "drive", column: "drive_V" };
const SIGNAL: SimulatedColumn = SimulatedColumn { meaning: "signal", column: "cap_V" };
const POSITION: SimulatedColumn = SimulatedColumn { meaning: "position", column: "psd_V" };

impl ThresholdSimulation {
    /// Reads and checks what the file says of the simulation.
    pub fn of(experiment: &Experiment) -> Result<Self, SimulateError> {
        let hardware = ThresholdHardware::of(experiment)?;
        let Some(simulate) = &experiment.simulate else {
            let remedy = "add the table `[simulate]` with `duration`, `sampling_rate`, `integration_rate`, `start` \
                          and one drive, such as `[simulate.drive.capture]`";
            return Err(experiment
                .error("simulate", ConfigFault::MissingKey { remedy: remedy.to_owned() })
                .into());
        };
        let integration_rate_hz = simulate.integration_rate.si();
        let (before, drive, source) = if let DriveSource::Capture(capture) = &simulate.drive {
            let (before, drive) = captured(capture, integration_rate_hz);
            (Some(before), drive, None)
        } else {
            let (drive, source) = drive_of(experiment, simulate)?;
            (None, drive, source)
        };
        if matches!(drive, Drive::Square { .. }) && hardware.feedthrough != 0.0 {
            let why = "the current through the feedthrough capacitance has no bound where the drive jumps; use a drive \
                       that does not, or no feedthrough";
            let key = Key::from("simulate").child("drive").child("square");
            return Err(experiment.error(key, ConfigFault::Value { why: why.to_owned() }).into());
        }
        let sampling_rate_hz = simulate.sampling_rate.si();
        let noise = if simulate.noise { 1.0 } else { 0.0 };
        let device = experiment.device::<ThresholdScanner>()?;
        let detector = device.position_detector.as_ref().map(|detector| SimulatedDetector {
            beam: detector.beam(),
            late: detector.delay.as_ref().map_or(0.0, Quantity::si) * sampling_rate_hz,
            noise: noise * detector.noise_variance.si().sqrt(),
        });
        if detector.is_some_and(|detector| detector.late.abs() > simulate.samples() as f64) {
            let why = "the detector is later than the recording is long".to_owned();
            let key = Key::from("device.threshold_scanner.position_detector.delay");
            return Err(experiment.error(key, ConfigFault::Value { why }).into());
        }
        Ok(Self {
            signal_noise: noise * hardware.noise_variance.sqrt(),
            hardware,
            before,
            drive,
            sources: source.into_iter().collect(),
            start: state_at(experiment, "simulate.start", &simulate.start)?,
            integration_rate_hz,
            steps_per_sample: simulate.steps_per_sample(),
            samples: simulate.samples(),
            sampling_rate_hz,
            converter: simulate.adc.as_ref().map(Converter::of),
            detector,
            seed: simulate.seed,
        })
    }

    /// dV/dt at a time; of a drive that is known at samples alone by differences over an integration step.
    fn drive_slope(&self, time_s: f64) -> f64 {
        let step = 1.0 / self.integration_rate_hz;
        let differences = (self.drive.at(time_s + step) - self.drive.at(time_s - step)) / (2.0 * step);
        self.drive.slope(time_s).unwrap_or(differences)
    }

    /// The states at whole samples from `back` before the first on, the first sample's the last of them.
    fn until_start(&self, back: usize) -> VecDeque<[f64; 2]> {
        let mut states = VecDeque::with_capacity(back + 1);
        let Some((drive, steps)) = &self.before else {
            // A mirror that swung freely until then.
            let freely = self.hardware.mirror.resonator.exact(-1.0 / self.sampling_rate_hz, 0.0).transition;
            let mut state = self.start;
            states.push_front(state);
            for _ in 0..back {
                state = freely.times_vector(&state);
                states.push_front(state);
            }
            return states;
        };
        let mut simulator =
            Simulator::new(self.hardware.mirror, drive.clone(), self.integration_rate_hz, self.start);
        states.resize(back, self.start);
        for step in 0..=*steps {
            if step > 0 {
                simulator.step();
            }
            let left = steps - step;
            if left.is_multiple_of(self.steps_per_sample) && left / self.steps_per_sample <= back as u64 {
                states.push_back(*simulator.state());
                if states.len() > back + 1 {
                    states.pop_front();
                }
            }
        }
        states
    }
}

/// The drive until the recording begins with the steps that it takes, and from there on.
fn captured(capture: &CaptureDrive, rate_hz: f64) -> ((Drive, u64), Drive) {
    let half = 0.5 * capture.voltage.si();
    let (from_hz, to_hz, sweep_s) = (capture.from.si(), capture.to.si(), capture.sweep.si());
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // not negative, and saturating
    let steps = ((sweep_s + capture.hold.si()) * rate_hz).round() as u64;
    let sweep = Drive::Sweep { offset: half, amplitude: half, from_hz, to_hz, duration_s: sweep_s };
    let cycles = from_hz.midpoint(to_hz) * sweep_s + to_hz * (steps as f64 / rate_hz - sweep_s);
    let phase_rad = TAU * (cycles - cycles.floor());
    let held = Drive::Sine { offset: half, amplitude: half, frequency_hz: to_hz, phase_rad };
    let Some(cut_off) = &capture.cut_off else { return ((sweep, steps), held) };
    let off = Interruptions::from(cut_off);
    ((sweep, steps), Drive::Interrupted { drive: Box::new(held), off })
}

impl Simulation for ThresholdSimulation {
    fn recorded(&self) -> &[SimulatedColumn] {
        if self.detector.is_some() { &[DRIVE, SIGNAL, POSITION] } else { &[DRIVE, SIGNAL] }
    }

    fn truth(&self) -> &[SimulatedColumn] {
        &SimulatedColumn::ANGLE_AND_RATE
    }

    fn samples(&self) -> u64 {
        self.samples
    }

    fn sources(&self) -> &[RecordingSource] {
        &self.sources
    }

    fn run(&self, each: &mut dyn FnMut(&SimulatedSample) -> ControlFlow<()>) -> Result<(), SimulateError> {
        let late = self.detector.map_or(0.0, |detector| detector.late);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // not more than there are samples
        let whole = |samples: f64| samples.max(0.0).ceil() as usize + 1;
        let (back, ahead) = (whole(late), whole(-late));
        // The states around the sample that is recorded, at whole samples: `back` before it and `ahead` after it.
        let mut states = self.until_start(back);
        let first = states.back().copied().unwrap_or(self.start);
        let rate_hz = self.integration_rate_hz;
        let mut simulator = Simulator::new(self.hardware.mirror, self.drive.clone(), rate_hz, first);
        let mut noises = [SIGNAL_NOISE, POSITION_NOISE].map(|stream| WhiteNoise::new(self.seed, stream));
        for k in 0..self.samples {
            while states.len() < back + ahead + 1 {
                for _ in 0..self.steps_per_sample {
                    simulator.step();
                }
                states.push_back(*simulator.state());
            }
            let time_s = k as f64 / self.sampling_rate_hz;
            let state = states[back];
            if !state.iter().all(|x| x.is_finite()) {
                return Err(SimulateError::NotFinite { time_s });
            }
            let readout = Feedthrough {
                readout: &self.hardware.readout,
                current_gain: self.hardware.feedback_resistance * self.drive_slope(time_s),
                capacitance: self.hardware.feedthrough,
                state: None,
            };
            let [clean] = readout.predict(&state);
            let analogue = clean + self.signal_noise * noises[0].sample();
            let signal = self.converter.map_or(analogue, |converter| converter.round(analogue));
            let mut recorded = [self.drive.at(time_s), signal, f64::NAN];
            let channels = match self.detector {
                Some(detector) => {
                    let angle = angle_at(&states, back as f64 - late, 1.0 / self.sampling_rate_hz);
                    recorded[2] = detector.beam.volts(angle) + detector.noise * noises[1].sample();
                    3
                }
                None => 2,
            };
            if each(&SimulatedSample { time_s, recorded: &recorded[..channels], truth: &state }).is_break() {
                return Err(SimulateError::Interrupted);
            }
            states.pop_front();
        }
        Ok(())
    }
}

/// The angle between two samples, by the cubic through both angles and rates.
fn angle_at(states: &VecDeque<[f64; 2]>, place: f64, interval_s: f64) -> f64 {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // within the window
    let before = (place.max(0.0) as usize).min(states.len().saturating_sub(2));
    let [start, end] = [states[before], states[before + 1]];
    hermite((start[0], start[1]), (end[0], end[1]), interval_s, place - before as f64)
}

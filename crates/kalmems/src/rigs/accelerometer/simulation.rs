//! A recording of the accelerometer that is computed: open, in its loop, or with an observer in the loop.

use super::dither;
use super::filters::entries;
use super::instrument::Instrument;
use super::settings::{Hardware, Settings};
use crate::config::{
    AccelerationDrive, ConfigError, Device, DriveSource, Experiment, Fault, Key, Quantity, Sign,
};
use crate::recording::Source;
use crate::simulate::{Channel, Drive, Sample, SimulateError, Simulation, WhiteNoise};
use kalmems_core::{FixedGain, LinearProcess, Mat, Measurement, NoiseDensity, Process, Scalar};
use kalmems_models::control::{PiController, RebalanceLoop, SampledRebalance};
use std::f64::consts::TAU;
use std::ops::ControlFlow;

/// The accelerometer, its loop and what it is to measure.
pub struct AccelerometerSimulation {
    hardware: Hardware,
    closed: RebalanceLoop<f64>,
    through_observer: bool,
    acceleration: Acceleration,
    records_acceleration: bool,
    samples: u64,
    interval_s: f64,
    steps: u32,
    noise: bool,
    seed: u64,
    /// What is added to the feedback.
    dither: Option<Drive>,
}

/// What is to be measured.
#[derive(Clone, Copy, Debug)]
enum Acceleration {
    /// In m/s² and Hz.
    Sine { amplitude: f64, frequency_hz: f64 },
    /// As the device's prior says.
    Chance,
}

/// The streams of the three noises.
const SIGNAL_NOISE: u64 = 0;
const FORCE_NOISE: u64 = 1;
const ACCELERATION: u64 = 2;

const RECORDED: [Channel; 3] = [
    Channel { meaning: "feedback", column: "feedback_V" },
    Channel { meaning: "signal", column: "output_V" },
    Channel { meaning: "acceleration", column: "known_acceleration_m_per_s2" },
];

/// The loop that an experiment describes, sampled at this interval in s.
pub fn closed_loop(experiment: &Experiment, interval_s: f64) -> Result<RebalanceLoop<f64>, ConfigError> {
    let hardware = Hardware::of(experiment)?;
    let feedback = match &experiment.device {
        Device::Accelerometer(device) => device.feedback.as_ref(),
        _ => None,
    };
    let is_late = feedback.is_some_and(|feedback| feedback.one_sample_late);
    Ok(RebalanceLoop {
        device: hardware.sensed.device,
        readout: hardware.readout,
        controller: PiController {
            proportional: feedback.map_or(0.0, |feedback| feedback.proportional_gain.si()),
            integral: feedback.map_or(0.0, |feedback| feedback.integral_gain.si()),
        },
        // What is held is half an interval late on average.
        delay: if is_late { 1.5 * interval_s } else { 0.5 * interval_s },
    })
}

impl AccelerometerSimulation {
    /// Reads and checks what the file says. A loop that is not stable is refused.
    pub fn of(experiment: &Experiment) -> Result<Self, SimulateError> {
        let hardware = Hardware::of(experiment)?;
        let Some(simulate) = &experiment.simulate else {
            let remedy = "add the table `[simulate]` with `duration`, `sampling_rate`, `integration_rate`, `start` and \
                          `[simulate.drive.acceleration]`";
            return Err(experiment.error("simulate", Fault::MissingKey { remedy: remedy.to_owned() }).into());
        };
        if simulate.adc.is_some() {
            let why = "no converter is built for the accelerometer; leave it out".to_owned();
            return Err(experiment.error("simulate.adc", Fault::Value { why }).into());
        }
        let start = experiment.values("simulate.start", &simulate.start, entries::<2>(Sign::Any))?;
        if start != [0.0; 2] {
            let why =
                "an accelerometer starts at rest: write `{ displacement = \"0 m\", velocity = \"0 m/s\" }`";
            return Err(experiment.error("simulate.start", Fault::Value { why: why.to_owned() }).into());
        }
        let interval_s = 1.0 / simulate.sampling_rate.si();
        let closed = closed_loop(experiment, interval_s)?;
        if !closed.is_stable(interval_s) {
            return Err(unstable(experiment, &closed, interval_s).into());
        }
        let knows = |settings: Settings| settings.filters.iter().any(|filter| filter.known_acceleration);
        let records_acceleration = experiment.estimate.is_some() && knows(Settings::of(experiment)?);
        let feedback = match &experiment.device {
            Device::Accelerometer(device) => device.feedback.as_ref(),
            _ => None,
        };
        Ok(Self {
            hardware,
            closed,
            through_observer: feedback.is_some_and(|feedback| feedback.through_observer),
            acceleration: acceleration(experiment, &simulate.drive)?,
            records_acceleration,
            samples: simulate.samples(),
            interval_s,
            steps: u32::try_from(simulate.steps_per_sample()).unwrap_or(u32::MAX),
            noise: simulate.noise,
            seed: simulate.seed,
            dither: simulate.dither.as_ref().map(|settings| dither::tones(settings, simulate.seed)),
        })
    }

    /// The acceleration at all samples in m/s².
    fn accelerations(&self) -> Vec<f64> {
        let prior = self.hardware.sensed.prior;
        match self.acceleration {
            Acceleration::Sine { amplitude, frequency_hz } => (0..self.samples)
                .map(|k| amplitude * Scalar::sin(TAU * frequency_hz * k as f64 * self.interval_s))
                .collect(),
            Acceleration::Chance => {
                let mut noise = WhiteNoise::new(self.seed, ACCELERATION);
                let rate = prior.rate;
                let system = Mat([[0.0, 1.0], [-rate * rate, -2.0 * prior.damping_ratio * rate]]);
                let density = NoiseDensity::none().on::<1>(prior.density());
                let process =
                    LinearProcess::<f64, 2, 0>::exact(&system, &Mat::zero(), &density, self.interval_s);
                let root = process.noise.root();
                let mut state = [prior.rms * noise.sample(), prior.rms * rate * noise.sample()];
                let mut values = Vec::new();
                for _ in 0..self.samples {
                    values.push(state[0]);
                    let white = [noise.sample(), noise.sample()];
                    let pushed: [f64; 2] = root.times_vector(&white);
                    let moved = process.step(&state, &[]);
                    state = [moved[0] + pushed[0], moved[1] + pushed[1]];
                }
                values
            }
        }
    }
}

/// What is to be measured, from the file.
fn acceleration(experiment: &Experiment, drive: &DriveSource) -> Result<Acceleration, ConfigError> {
    let key = || Key::from("simulate").child("drive");
    let DriveSource::Acceleration(AccelerationDrive { amplitude, frequency }) = drive else {
        let why =
            "an accelerometer measures an acceleration; write `[simulate.drive.acceleration]`".to_owned();
        return Err(experiment.error(key(), Fault::Value { why }));
    };
    let missing = |name: &str, remedy: &str| {
        let remedy = format!("a sine has both: write `{name} = \"{remedy}\"`");
        Err(experiment.error(key().child("acceleration").child(name), Fault::MissingKey { remedy }))
    };
    match (amplitude.as_ref().map(Quantity::si), frequency.as_ref().map(Quantity::si)) {
        (Some(amplitude), Some(frequency_hz)) => Ok(Acceleration::Sine { amplitude, frequency_hz }),
        (None, None) => Ok(Acceleration::Chance),
        (Some(_), None) => missing("frequency", "10 Hz"),
        (None, Some(_)) => missing("amplitude", "1 gn"),
    }
}

/// Why a loop does not hold.
fn unstable(experiment: &Experiment, closed: &RebalanceLoop<f64>, interval_s: f64) -> ConfigError {
    let key = ["accelerometer", "feedback", "proportional_gain"];
    let key = key.into_iter().fold(Key::from("device"), Key::child);
    let why = if closed.controller.proportional < 0.0 {
        "the loop is unstable: its gain is negative, which pushes the mass away from rest; change its sign"
            .to_owned()
    } else if closed.device.softened_spring(0.0) <= 0.0 && closed.controller.proportional == 0.0 {
        "the plates pull more than the spring holds; lower the carrier or the bias".to_owned()
    } else {
        let nyquist = std::f64::consts::PI / interval_s;
        let margin = closed.margins(1.0, nyquist).phase.map_or(f64::NAN, f64::to_degrees);
        format!(
            "the loop is unstable at this sampling rate (phase margin {margin:.0}°); lower the gain, or sample faster"
        )
    };
    experiment.error(key, Fault::Value { why })
}

impl Simulation for AccelerometerSimulation {
    fn recorded(&self) -> &'static [Channel] {
        const WITHOUT: &[Channel] = &[RECORDED[0], RECORDED[1]];
        if self.records_acceleration { &RECORDED } else { WITHOUT }
    }

    fn truth(&self) -> &'static [Channel] {
        &[
            Channel { meaning: "acceleration", column: "acceleration_m_per_s2" },
            Channel { meaning: "displacement", column: "displacement_m" },
            Channel { meaning: "velocity", column: "velocity_m_per_s" },
        ]
    }

    fn samples(&self) -> u64 {
        self.samples
    }

    fn sources(&self) -> &[Source] {
        &[]
    }

    fn outlook(&self) -> Option<String> {
        None
    }

    fn run(&self, each: &mut dyn FnMut(&Sample) -> ControlFlow<()>) -> Result<(), SimulateError> {
        let accelerations = self.accelerations();
        let mut run = SampledRebalance::new(&self.closed, self.interval_s, self.steps);
        let mut observer = if self.through_observer { self.observer() } else { None };
        let (noise_sd, force_sd) = if self.noise {
            (self.hardware.noise_variance.sqrt(), run.force_sd(self.hardware.force_density))
        } else {
            (0.0, 0.0)
        };
        let mut signal_noise = WhiteNoise::new(self.seed, SIGNAL_NOISE);
        let mut force_noise = WhiteNoise::new(self.seed, FORCE_NOISE);
        let mut forces = vec![0.0; self.steps as usize];
        for (k, acceleration) in accelerations.iter().enumerate() {
            let output = run.read(noise_sd * signal_noise.sample());
            let seen = observer.as_mut().map_or(output, |observer| observer.see(output));
            let time_s = k as f64 * self.interval_s;
            let feedback = run.answer(seen) + self.dither.as_ref().map_or(0.0, |dither| dither.at(time_s));
            let [displacement, velocity] = *run.state();
            let recorded = [feedback, output, *acceleration];
            let sample = Sample {
                time_s,
                recorded: &recorded[..self.recorded().len()],
                truth: &[*acceleration, displacement, velocity],
            };
            if each(&sample).is_break() {
                return Err(SimulateError::Interrupted);
            }
            if let Some(observer) = &mut observer {
                observer.expect(feedback);
            }
            let Some(next) = accelerations.get(k + 1) else { break };
            for force in &mut forces {
                *force = force_sd * force_noise.sample();
            }
            run.advance(feedback, [*acceleration, *next], &forces)
                .map_err(|stopped| SimulateError::PulledIn { why: stopped.to_string() })?;
        }
        Ok(())
    }
}

/// A settled Kalman filter in the loop; it knows what is recorded and nothing else.
struct Observer {
    instrument: Instrument<kalmems_models::dynamics::SensedAcceleration<f64>, 4>,
    process: super::instrument::Exact<kalmems_models::dynamics::SensedAcceleration<f64>, 4>,
    filter: FixedGain<f64, 4, 1>,
}

impl AccelerometerSimulation {
    fn observer(&self) -> Option<Observer> {
        let instrument = Instrument::sensed(&self.hardware).ok()?;
        let filter = FixedGain::steady_state([0.0; 4], &instrument.at_rest(self.interval_s)).ok()?;
        Some(Observer { process: instrument.over(self.interval_s), instrument, filter })
    }
}

impl Observer {
    /// What it makes of an output, in V. An output that is no number leaves it as it was.
    fn see(&mut self, output: f64) -> f64 {
        let _ = self.filter.update(&self.instrument.readout, &[output]);
        let [volts]: [f64; 1] = self.instrument.readout.predict(self.filter.mean());
        volts
    }

    /// To the next sample under a feedback in V.
    fn expect(&mut self, feedback: f64) {
        let _ = self.filter.predict(&self.process, &feedback);
    }
}

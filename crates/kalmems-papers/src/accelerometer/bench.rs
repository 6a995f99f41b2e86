//! The thesis's instrument on the bench: runs of it, and the filters at work on them.

use super::{failed, published::noise};
use crate::config::{ConfigError, Experiment};
use crate::estimate::{EstimateError, Trajectory};
use crate::program::ReproduceError;
use crate::progress::Silent;
use crate::recording::RecordingFromRows;
use kalmems_models::constants::{BOLTZMANN, STANDARD_GRAVITY, VACUUM_PERMITTIVITY};
use kalmems_models::control::{PiController, RebalanceLoop};
use kalmems_rigs::accelerometer::{
    Acceleration, AccelerometerHardware, AccelerometerRun, ControllerInput, ControllerTiming, Moment,
    closed_loop,
};
use kalmems_rigs::equations::EquationsTable;
use kalmems_rigs::published;
use std::ops::ControlFlow;
use std::path::Path;

/// Between samples, in s: one per period of the carrier. The thesis states none; it asks for less than 5 µs.
pub const INTERVAL_S: f64 = 1e-6;
/// What no run is judged by, in s.
pub const SKIP_S: f64 = 0.02;
/// Of every sine here, in Hz (Table II).
pub const SIGNAL_HZ: f64 = 10.0;

/// The experiment, and what messages call it.
const DEVICE: &str = include_str!("device.toml");
const PLACE: &str = "accelerometer/device.toml";

/// The instrument, in its loop.
#[derive(Clone)]
pub struct AccelerometerBench {
    /// What the filters are told, the truth unless a caller changes it.
    pub hardware: AccelerometerHardware,
    /// The loop.
    pub closed: RebalanceLoop<f64>,
}

/// A filter, by its name in `device.toml`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BenchFilter {
    /// The thesis's hybrid filter, which has the acceleration as an input.
    Told,
    /// The settled filter that has it as a state.
    Honest,
}

impl AccelerometerBench {
    /// Tables I and II at this permittivity, biased for 10 g by equation 2-18.
    pub fn new(relative_permittivity: f64) -> Result<Self, ReproduceError> {
        let wrong = |e: ConfigError| failed("the published instrument")(e.into());
        let experiment = published().parse(DEVICE, Path::new(PLACE)).map_err(wrong)?;
        let mut hardware = AccelerometerHardware::of(&experiment).map_err(wrong)?;
        let mut closed = closed_loop(&experiment, INTERVAL_S).map_err(wrong)?;
        let device = &mut hardware.sensed.device;
        device.plates.permittivity = relative_permittivity * VACUUM_PERMITTIVITY;
        device.bias = device.bias_for(10.0 * STANDARD_GRAVITY);
        hardware.readout.plates = device.plates;
        (closed.device, closed.readout) = (*device, hardware.readout);
        Ok(Self { hardware, closed })
    }

    /// The linear instrument of the thesis's section 5.3, whose equation 5-1 knows nothing of what the plates take from
    /// the spring: that much is added to the spring.
    pub fn linear() -> Result<Self, ReproduceError> {
        let mut bench = Self::new(4.0)?;
        let device = &mut bench.hardware.sensed.device;
        device.mass.spring += device.electrostatic_spring(0.0);
        bench.closed.device = *device;
        Ok(bench)
    }

    /// Without a loop: no bias, and nothing fed back.
    pub fn open(&self) -> Self {
        let mut bench = self.clone();
        bench.hardware.sensed.device.bias = 0.0;
        bench.hardware.has_feedback = false;
        bench.closed.device.bias = 0.0;
        bench.closed.controller = PiController { proportional: 0.0, integral: 0.0 };
        bench
    }

    /// The hardware.
    pub fn hardware(&self) -> &AccelerometerHardware {
        &self.hardware
    }

    /// A run of `duration_s` under 10 Hz of this amplitude in g, with the noise of the hardware.
    pub fn sine(&self, amplitude_g: f64, duration_s: f64, seed: u64) -> AccelerometerRun {
        let amplitude = amplitude_g * STANDARD_GRAVITY;
        self.run(Acceleration::Sine { amplitude, frequency_hz: SIGNAL_HZ }, duration_s, seed)
    }

    /// A run of `duration_s`.
    pub fn run(&self, acceleration: Acceleration, duration_s: f64, seed: u64) -> AccelerometerRun {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // some 10⁵
        let samples = (duration_s / INTERVAL_S).round() as u64;
        AccelerometerRun {
            hardware: *self.hardware(),
            closed: self.closed,
            acting: ControllerTiming::Sampled,
            observer: ControllerInput::Output,
            acceleration,
            samples,
            interval_s: INTERVAL_S,
            steps: 1,
            noise: true,
            carrier_hz: None,
            dither: None,
            seed,
        }
    }

    /// Told the density Q of a force and the variance R, both off by these factors.
    pub fn tuned(&self, [q, r]: [f64; 2]) -> Self {
        let mut bench = self.clone();
        bench.hardware.force_density = q * noise::Q;
        bench.hardware.noise_variance = r * noise::R;
        bench
    }

    /// What a filter makes of a recording. `None` where it refuses, or was stopped.
    pub fn estimate(&self, filter: BenchFilter, record: &BenchRecord) -> Option<Trajectory> {
        let experiment = self.told(filter).ok()?;
        follow(&experiment, record).ok()?
    }

    /// The experiment with one filter that is told this hardware, on its equations alone: a mass that was pulled in is followed to its plate.
    fn told(&self, filter: BenchFilter) -> Result<Experiment, ConfigError> {
        let (hardware, device) = (&self.hardware, &self.hardware.sensed.device);
        let temperature = hardware.force_density / (2.0 * BOLTZMANN * device.mass.damping);
        // What has been parsed as an experiment is a table.
        let mut file: toml::Table = DEVICE.parse().unwrap_or_default();
        let mut set = |table: &str, key: &str, text: String| {
            let of_device = file.get_mut("device").and_then(|device| device.get_mut("accelerometer"));
            if let Some(toml::Value::Table(table)) = of_device.and_then(|device| device.get_mut(table)) {
                table.insert(key.to_owned(), text.into());
            }
        };
        set("proof_mass", "spring", format!("{:?} N/m", device.mass.spring));
        set("proof_mass", "temperature", format!("{temperature:?} K"));
        set(
            "plates",
            "relative_permittivity",
            format!("{:?}", device.plates.permittivity / VACUUM_PERMITTIVITY),
        );
        set("readout", "noise_variance", format!("{:?} V^2", hardware.noise_variance));
        set("acceleration", "rms", format!("{:?} m/s^2", hardware.sensed.prior.rms));
        // Without a loop there is no bias.
        set("feedback", "bias", format!("{:?} V", device.bias.max(f64::MIN_POSITIVE)));
        let mut experiment =
            published().parse(&toml::to_string(&file).unwrap_or_default(), Path::new(PLACE))?;
        if let Some(estimate) = &mut experiment.estimate {
            estimate.filters.retain(|own| own.known_acceleration == (filter == BenchFilter::Told));
        }
        let mut equations = (*experiment.device_in_terms_of::<EquationsTable>()?).clone();
        equations.check = None;
        experiment.set_device(equations);
        Ok(experiment)
    }
}

/// What the experiment's filter makes of a record.
fn follow(experiment: &Experiment, record: &BenchRecord) -> Result<Option<Trajectory>, EstimateError> {
    let rig = published().rig(experiment)?;
    let header = ["time_s", "feedback_V", "output_V", "acceleration_m_per_s2"];
    let mut rows = RecordingFromRows::new("recording.csv", &header, &rig.layout(experiment, 0)?)?;
    let signals = record.feedback.iter().zip(&record.output).zip(&record.acceleration);
    for (time_s, ((feedback, output), acceleration)) in record.time_s.iter().zip(signals) {
        rows.push(&[*time_s, *feedback, *output, *acceleration]);
    }
    let found = rig.estimate(experiment, 0, &rows.finish()?, &Silent)?;
    Ok(found.into_iter().next().and_then(|estimate| estimate.trajectories.into_iter().next()))
}

/// A run, column by column.
#[derive(Clone, Debug, Default)]
pub struct BenchRecord {
    /// Between two samples, in s.
    pub interval_s: f64,
    /// In s.
    pub time_s: Vec<f64>,
    /// In m/s².
    pub acceleration: Vec<f64>,
    /// In m.
    pub displacement: Vec<f64>,
    /// In V.
    pub output: Vec<f64>,
    /// What the controller acted on, in V.
    pub seen: Vec<f64>,
    /// In V.
    pub feedback: Vec<f64>,
    /// Why it ended before its time: the mass was pulled in.
    pub stopped: Option<String>,
}

impl BenchRecord {
    /// Of a whole run, or of one up to its pull-in.
    pub fn of(run: &AccelerometerRun) -> Self {
        let mut record = Self { interval_s: run.interval_s, ..Self::default() };
        let ended = run.follow(&mut |moment: &Moment| {
            record.time_s.push(moment.time_s);
            record.acceleration.push(moment.acceleration);
            record.displacement.push(moment.displacement);
            record.output.push(moment.output);
            record.seen.push(moment.seen);
            record.feedback.push(moment.feedback);
            ControlFlow::Continue(())
        });
        record.stopped = ended.err().map(|why| why.to_string());
        record
    }

    /// The first sample that is judged.
    pub fn from(&self) -> usize {
        self.time_s.partition_point(|time_s| *time_s < SKIP_S)
    }

    /// Every `count`-th sample, or the mean of as many around it. The feedback is in either case its mean up to the next.
    pub fn decimated(&self, count: usize, averaged: bool) -> Self {
        let mut fewer = Self { interval_s: self.interval_s * count as f64, ..Self::default() };
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        let half = count / 2;
        let mut at = half;
        while at + count <= self.time_s.len() {
            // A sample and as many on either side: an odd number.
            let around = if averaged { at - half..at + half + 1 } else { at..at + 1 };
            fewer.time_s.push(self.time_s[at]);
            fewer.acceleration.push(self.acceleration[at]);
            fewer.displacement.push(self.displacement[at]);
            fewer.output.push(mean(&self.output[around.clone()]));
            fewer.seen.push(mean(&self.seen[around]));
            fewer.feedback.push(mean(&self.feedback[at..at + count]));
            at += count;
        }
        fewer
    }
}

/// Root mean square.
pub fn rms(values: impl IntoIterator<Item = f64>) -> f64 {
    let (sum, count) =
        values.into_iter().fold((0.0, 0_u32), |(sum, count), value| (sum + value * value, count + 1));
    (sum / f64::from(count)).sqrt()
}

/// 20·log₁₀ of a ratio.
pub fn decibels(ratio: f64) -> f64 {
    20.0 * ratio.log10()
}

/// The difference of two columns from this sample on.
pub fn differences<'a>(a: &'a [f64], b: &'a [f64], from: usize) -> impl Iterator<Item = f64> + 'a {
    a.iter().zip(b).skip(from).map(|(a, b)| a - b)
}

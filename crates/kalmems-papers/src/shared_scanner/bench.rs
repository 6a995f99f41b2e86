//! The published device on the bench: its motion, recordings of it, and the estimators at work on them.

use super::failed;
use super::misprinted_ukf::{Misprint, MisprintedUkf};
use crate::config::{ConfigError, Experiment};
use crate::estimate::driven::SegmentDrive;
use crate::estimate::{EstimateError, SegmentEstimate, Trajectory};
use crate::evaluate::{Accuracy, ComparisonExtent, MotionErrors, ReferenceMotion, evaluate_motion};
use crate::program::ReproduceError;
use crate::progress::{Interruption, Progress};
use crate::recording::RecordingFromRows;
use crate::signal::extremes_of_rate;
use crate::simulate::{Drive, Simulator, WhiteNoise};
use kalmems_core::Measurement;
use kalmems_models::dynamics::ParametricScanner;
use kalmems_rigs::equations::estimate_with;
use kalmems_rigs::published;
use kalmems_rigs::shared_scanner::ScannerHardware;
use std::path::Path;

/// Samples per second of every recording here.
pub const SAMPLING_HZ: f64 = 1e6;
/// Samples of a recording.
pub const SAMPLES: u32 = 40_000;
/// Integration steps between samples.
const STEPS: u32 = 4;
/// Offset and amplitude of the drive that moves the published device, in V.
pub const DRIVE_V: f64 = 90.0;

/// The published device with the filters that are compared.
pub struct ScannerBench {
    hardware: ScannerHardware,
    skip_s: f64,
    /// The experiment, as its file has it.
    file: toml::Table,
    /// The keys of its filters, in its order.
    filters: Vec<String>,
}

/// How what the estimators are told differs from the device.
#[derive(Clone, Copy, Debug)]
pub struct ScannerMismatch {
    /// In a few words.
    pub words: &'static str,
    /// The stiffness of the filters' models, over the true one.
    pub stiffness: f64,
    /// The damping of the filters' models, over the true one.
    pub damping: f64,
    /// The drive voltage of the filters' models, over the true one.
    pub drive: f64,
    /// The density of the angular acceleration's noise, in rad²/s³.
    pub density: f64,
}

/// The steady motion at one frequency of the drive, sampled.
pub struct SampledSteadyMotion {
    /// The drive's frequency.
    pub drive_hz: f64,
    /// When, in s.
    pub time_s: Vec<f64>,
    /// The drive in V.
    pub volts: Vec<f64>,
    /// The signal without noise, in V.
    clean: Vec<f64>,
    /// The motion.
    pub truth: ReferenceMotion,
}

/// What an estimator made of a recording.
pub struct EstimatorResult {
    /// What it says.
    pub trajectory: Trajectory,
    /// How far that is from the truth; `None` where there is nothing left to compare.
    pub errors: Option<MotionErrors>,
}

impl ScannerBench {
    /// Reads the experiment that stands beside this file.
    pub fn new() -> Result<Self, ReproduceError> {
        let wrong = |e: ConfigError| failed("the published device")(e.into());
        let (text, path) = (include_str!("device.toml"), Path::new("shared_scanner/device.toml"));
        let experiment = published().parse(text, path).map_err(wrong)?;
        let filters = experiment.estimate.iter().flat_map(|estimate| &estimate.filters);
        Ok(Self {
            hardware: ScannerHardware::of(&experiment).map_err(wrong)?,
            skip_s: experiment.estimate.as_ref().map_or(f64::NAN, |estimate| estimate.skip.si()),
            filters: filters.map(|filter| filter.name.key()).collect(),
            // What has been parsed as an experiment is a table.
            file: text.parse().unwrap_or_default(),
        })
    }

    /// The device.
    pub fn scanner(&self) -> ParametricScanner<f64> {
        self.hardware.scanner
    }

    /// The device with its readout and noise.
    pub fn hardware(&self) -> ScannerHardware {
        self.hardware
    }

    /// How long the estimators have to settle, in s.
    pub fn skip_s(&self) -> f64 {
        self.skip_s
    }

    /// The steady motions at these frequencies of the drive, each reached from the one before.
    pub fn steady(&self, frequencies_hz: &[f64], settle_periods: u32) -> Vec<SampledSteadyMotion> {
        const STEPS_PER_PERIOD: u32 = 48;
        let mut state = [1e-2, 0.0];
        let drive =
            |frequency_hz| Drive::Sine { offset: DRIVE_V, amplitude: DRIVE_V, frequency_hz, phase_rad: 0.0 };
        let mut motions = Vec::new();
        for drive_hz in frequencies_hz {
            let rate_hz = drive_hz * f64::from(STEPS_PER_PERIOD);
            let mut settling = Simulator::new(self.scanner(), drive(*drive_hz), rate_hz, state);
            for _ in 0..settle_periods * STEPS_PER_PERIOD {
                settling.step();
            }
            state = *settling.state();
            motions.push(self.record(*drive_hz, drive(*drive_hz), state));
        }
        motions
    }

    fn record(&self, drive_hz: f64, drive: Drive, start: [f64; 2]) -> SampledSteadyMotion {
        let rate_hz = SAMPLING_HZ * f64::from(STEPS);
        let mut simulator = Simulator::new(self.scanner(), drive, rate_hz, start);
        let (mut time_s, mut volts, mut clean) = (Vec::new(), Vec::new(), Vec::new());
        let (mut angle, mut rate) = (Vec::new(), Vec::new());
        for k in 0..SAMPLES {
            time_s.push(f64::from(k) / SAMPLING_HZ);
            volts.push(simulator.drive());
            let [signal] = self.hardware.readout.predict(simulator.state());
            clean.push(signal);
            let [at, by] = *simulator.state();
            angle.push(at);
            rate.push(by);
            for _ in 0..STEPS {
                simulator.step();
            }
        }
        let truth = ReferenceMotion {
            states: ["angle", "rate"],
            time_s: time_s.clone(),
            angle,
            rate: Some(rate),
            accuracy: Accuracy::default(),
        };
        SampledSteadyMotion { drive_hz, time_s, volts, clean, truth }
    }

    /// The signal as it is recorded, in V.
    pub fn signal(&self, motion: &SampledSteadyMotion, (seed, stream): (u64, u64)) -> Vec<f64> {
        let mut noise = WhiteNoise::new(seed, stream);
        let deviation = self.hardware.noise_variance.sqrt();
        motion.clean.iter().map(|clean| clean + deviation * noise.sample()).collect()
    }

    /// What each estimator makes of a recording of this motion.
    pub fn estimate(
        &self,
        motion: &SampledSteadyMotion,
        belief: &ScannerMismatch,
        (seed, stream): (u64, u64),
        progress: &dyn Progress,
    ) -> Result<Vec<EstimatorResult>, ReproduceError> {
        let signal = self.signal(motion, (seed, stream));
        let volts: Vec<f64> = motion.volts.iter().map(|volts| belief.drive * volts).collect();
        let wrong = |why: EstimateError| ReproduceError::of_estimate("the estimators")(why);
        let mut judged = Vec::new();
        for place in 0..self.filters.len() {
            let experiment = self.told(belief, motion, (place, &volts)).map_err(|why| wrong(why.into()))?;
            let estimate =
                self.follow(&experiment, (place, motion), (&volts, &signal), progress).map_err(wrong)?;
            let extent = ComparisonExtent {
                from_s: self.skip_s,
                motion_hz: 0.5 * motion.drive_hz,
                drive: estimate.drive.as_ref(),
            };
            judged.extend(estimate.trajectories.into_iter().map(|trajectory| {
                let errors = evaluate_motion(&trajectory, &motion.truth, extent, &Interruption::never());
                EstimatorResult { trajectory, errors }
            }));
        }
        Ok(judged)
    }

    /// The experiment with one filter, with what the estimators believe, and the sign of this motion, which no signal shows.
    fn told(
        &self,
        belief: &ScannerMismatch,
        motion: &SampledSteadyMotion,
        (place, volts): (usize, &[f64]),
    ) -> Result<Experiment, ConfigError> {
        let mut file = self.file.clone();
        let resonator = &self.hardware.scanner.resonator;
        let (stiffness, damping) =
            (resonator.stiffness * belief.stiffness, resonator.damping * belief.damping);
        let set = |file: &mut toml::Table, [first, way @ ..]: [&str; 4], text: String| {
            let table = way[..2].iter().fold(file.get_mut(first), |table, key| table?.get_mut(key));
            if let Some(table) = table.and_then(toml::Value::as_table_mut) {
                table.insert(way[2].to_owned(), text.into());
            }
        };
        set(&mut file, ["device", "shared_scanner", "resonator", "stiffness"], format!("{stiffness:?} N m"));
        set(&mut file, ["device", "shared_scanner", "resonator", "damping"], format!("{damping:?} N m s"));
        if let Some(estimate) = file.get_mut("estimate").and_then(toml::Value::as_table_mut) {
            let density = toml::Value::from(format!("{:?} rad^2/s^3", belief.density));
            estimate.insert(
                "process_noise".to_owned(),
                toml::Table::from_iter([("angular_acceleration".to_owned(), density)]).into(),
            );
            let peak = self.first_peak(motion, volts);
            estimate.insert("first_peak".to_owned(), if peak { "positive" } else { "negative" }.into());
            let filters = estimate.get_mut("filter").and_then(toml::Value::as_array_mut);
            if let Some(filters) = filters {
                let kept = filters.get(place).cloned();
                *filters = kept.into_iter().collect();
                // The model alone has nothing to find the motion with: it starts from it.
                let alone = filters.iter_mut().filter_map(toml::Value::as_table_mut);
                for filter in
                    alone.filter(|filter| filter.get("method").and_then(toml::Value::as_str) == Some("model"))
                {
                    let first = |of: Option<&f64>| of.copied().unwrap_or(f64::NAN);
                    let rate = motion.truth.rate.as_ref().and_then(|rate| rate.first());
                    let start = [
                        ("angle", format!("{:?} rad", first(motion.truth.angle.first()))),
                        ("rate", format!("{:?} rad/s", first(rate))),
                    ];
                    let start = start.map(|(name, text)| (name.to_owned(), toml::Value::from(text)));
                    filter.insert("start".to_owned(), toml::Table::from_iter(start).into());
                }
            }
        }
        let text = toml::to_string(&file).unwrap_or_default();
        published().parse(&text, Path::new("shared_scanner/device.toml"))
    }

    /// Whether the first turning point of the true motion after the drive's first peak after the settling time is a maximum.
    fn first_peak(&self, motion: &SampledSteadyMotion, volts: &[f64]) -> bool {
        let drive = SegmentDrive::new(&motion.time_s, volts, 1.0 / SAMPLING_HZ);
        let peak = drive.first_sine().map_or(self.skip_s, |sine| sine.peak_after(self.skip_s));
        let from = motion.time_s.partition_point(|t| *t < peak);
        let rate = motion.truth.rate.as_deref().unwrap_or_default();
        let extremes = extremes_of_rate(&motion.time_s[from..], rate.get(from..).unwrap_or_default());
        extremes.first().is_some_and(|extreme| extreme.maximum)
    }

    /// What the experiment's one filter makes of a recording: it, or one with a misprint instead of the UKF.
    fn follow(
        &self,
        experiment: &Experiment,
        (place, motion): (usize, &SampledSteadyMotion),
        (volts, signal): (&[f64], &[f64]),
        progress: &dyn Progress,
    ) -> Result<SegmentEstimate, EstimateError> {
        let rig = published().rig(experiment)?;
        let header = ["time_s", "drive_V", "cap_V"];
        let mut rows = RecordingFromRows::new("recording.csv", &header, &rig.layout(experiment, 0)?)?;
        for ((time_s, volts), signal) in motion.time_s.iter().zip(volts).zip(signal) {
            rows.push(&[*time_s, *volts, *signal]);
        }
        let recording = rows.finish()?;
        let found = match misprint_of(&self.filters[place]) {
            None => rig.estimate(experiment, 0, &recording, progress)?,
            Some(misprint) => {
                let make = move |mean: [f64; 2], covariance, points| {
                    MisprintedUkf::new(mean, covariance, points, misprint)
                };
                estimate_with(experiment, 0, &recording, make, progress)?
            }
        };
        found.into_iter().next().ok_or(EstimateError::Interrupted)
    }
}

/// Which misprint the filter of this key in `device.toml` has, if it has one.
fn misprint_of(key: &str) -> Option<Misprint> {
    match key {
        "ukf_weights_as_printed" => Some(Misprint::Weights),
        "ukf_cross_covariance_as_printed" => Some(Misprint::CrossCovariance),
        "ukf_covariance_as_printed" => Some(Misprint::Covariance),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Names in the file choose the misprints; one that is misspelt would be a UKF without any.
    #[test]
    fn each_misprint_has_its_filter() {
        let bench = ScannerBench::new().unwrap();
        let found: Vec<Misprint> = bench.filters.iter().filter_map(|key| misprint_of(key)).collect();
        assert_eq!(found, [Misprint::Weights, Misprint::CrossCovariance, Misprint::Covariance]);
    }
}

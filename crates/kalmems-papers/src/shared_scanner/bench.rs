//! The published device on the bench: its motion, recordings of it, and the estimators at work on them.

use super::failed;
use super::misprinted_ukf::{Misprint, MisprintedUkf};
use crate::config::Method;
use crate::estimate::driven::DrivenSegment;
use crate::estimate::{EstimateError, FilterPast, Past, SideOutputs, Trajectory};
use crate::evaluate::{Accuracy, ComparisonExtent, MotionErrors, ReferenceMotion, evaluate_motion};
use crate::program::ReproduceError;
use crate::progress::{Interruption, Progress};
use crate::signal::extremes_of_rate;
use crate::simulate::{Drive, Simulator, WhiteNoise};
use kalmems_core::Measurement;
use kalmems_models::dynamics::ParametricScanner;
use kalmems_rigs::published;
use kalmems_rigs::shared_scanner::{
    ScannerFilterSettings, ScannerHardware, ScannerSettings, estimate_segment, estimate_segment_with,
};
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
    settings: ScannerSettings,
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
        let wrong = |e: crate::config::ConfigError| failed("the published device")(e.into());
        let path = Path::new("shared_scanner/device.toml");
        let experiment = published().parse(include_str!("device.toml"), path).map_err(wrong)?;
        Ok(Self {
            hardware: ScannerHardware::of(&experiment).map_err(wrong)?,
            settings: ScannerSettings::of(&experiment).map_err(wrong)?,
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
        self.settings.skip_s
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

    /// What each estimator makes of a recording of this motion. `None` where the work was stopped.
    pub fn estimate(
        &self,
        motion: &SampledSteadyMotion,
        belief: &ScannerMismatch,
        (seed, stream): (u64, u64),
        progress: &dyn Progress,
    ) -> Option<Vec<EstimatorResult>> {
        let signal = self.signal(motion, (seed, stream));
        let volts: Vec<f64> = motion.volts.iter().map(|volts| belief.drive * volts).collect();
        let interval_s = 1.0 / SAMPLING_HZ;
        let data = DrivenSegment::new(&motion.time_s, &volts, &signal, interval_s);
        let settings = self.told(belief, motion, &data);
        let extent = ComparisonExtent {
            from_s: settings.skip_s,
            motion_hz: 0.5 * motion.drive_hz,
            drive: data.drive.sine(),
        };
        let mut judged = Vec::new();
        for filter in &settings.filters {
            let trajectories = follow(&settings, filter, &data, progress).ok()?;
            judged.extend(trajectories.into_iter().map(|trajectory| {
                let errors = evaluate_motion(&trajectory, &motion.truth, extent, &Interruption::never());
                EstimatorResult { trajectory, errors }
            }));
        }
        Some(judged)
    }

    /// The settings with what the estimators believe, and the sign of this motion, which no signal shows.
    fn told(
        &self,
        belief: &ScannerMismatch,
        motion: &SampledSteadyMotion,
        data: &DrivenSegment,
    ) -> ScannerSettings {
        let mut settings = self.settings.clone();
        settings.hardware.scanner.resonator.stiffness *= belief.stiffness;
        settings.hardware.scanner.resonator.damping *= belief.damping;
        // The model alone has nothing to find the motion with: it starts from it.
        let rate = motion.truth.rate.as_ref().and_then(|rate| rate.first());
        let first = [motion.truth.angle.first(), rate].map(|first| first.copied().unwrap_or(f64::NAN));
        for filter in &mut settings.filters {
            filter.acceleration_density = belief.density;
            if filter.basics.method == Method::Model {
                filter.start = Some(first);
            }
        }
        let peak = data.first_drive_peak(settings.skip_s);
        let from = motion.time_s.partition_point(|t| *t < peak);
        let rate = motion.truth.rate.as_deref().unwrap_or_default();
        let first = extremes_of_rate(&motion.time_s[from..], rate.get(from..).unwrap_or_default());
        settings.first_peak_positive = first.first().map(|extreme| extreme.maximum);
        settings
    }
}

/// What one filter makes of a recording: one of the rig's, or one with a misprint in the place of the UKF.
fn follow(
    settings: &ScannerSettings,
    filter: &ScannerFilterSettings,
    data: &DrivenSegment,
    progress: &dyn Progress,
) -> Result<Vec<Trajectory>, EstimateError> {
    let place = "the simulated recording";
    if let Some(misprint) = misprint_of(&filter.basics.key) {
        let points = filter.basics.points;
        let own = |mean, covariance| MisprintedUkf::new(mean, covariance, points, misprint);
        let past = &mut FilterPast::default();
        return estimate_segment_with(settings, filter, data, past, place, progress, own);
    }
    let alone = ScannerSettings { filters: vec![filter.clone()], ..settings.clone() };
    estimate_segment(&alone, &SideOutputs::default(), data, &mut Past::default(), place, progress)
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
        let found: Vec<Misprint> =
            bench.settings.filters.iter().filter_map(|filter| misprint_of(&filter.basics.key)).collect();
        assert_eq!(found, [Misprint::Weights, Misprint::CrossCovariance, Misprint::Covariance]);
    }
}

//! The published device on the bench: free decays of it, recordings of them, and the filters at work.

use super::failed;
use crate::config::{ConfigError, CrossingTiming};
use crate::estimate::driven::DrivenSegment;
use crate::estimate::{MotionRate, Past, Trajectory};
use crate::program::ReproduceError;
use crate::progress::Progress;
use crate::signal::hermite;
use crate::simulate::WhiteNoise;
use kalmems_core::{Measurement, Process};
use kalmems_rigs::crossings::{LevelCrossing, SearchedSignal, SignalRows, find as find_crossings};
use kalmems_rigs::published;
use kalmems_rigs::threshold_scanner::{
    ThresholdFilterSettings, ThresholdHardware, ThresholdSamples, ThresholdScannerSettings, estimate_segment,
};
use std::f64::consts::TAU;
use std::path::Path;

/// s between two samples of every recording here, but for the sweeps of the rate.
pub const INTERVAL_S: f64 = 2e-6;
/// Samples of a recording: 80 ms.
pub const SAMPLES: usize = 40_000;
/// Where a decay starts, in rad.
pub const AMPLITUDE: f64 = 0.15;
/// Within so much of a pass, in s, a detection is that of the pass.
const NEAR_S: f64 = 0.2e-3;
/// At each end of a recording so much, in s, is not scored.
const ENDS_S: f64 = 0.4e-3;
/// The streams of the signal's noise, and of what the filters start from.
const SIGNAL_NOISE: u64 = 0;
const START: u64 = 2;

/// The published device, and the filters that are compared.
pub struct ThresholdBench {
    /// The device.
    pub device: ThresholdHardware,
    settings: ThresholdScannerSettings,
}

/// What the filters are told, where it is not the device.
#[derive(Clone, Copy, Debug)]
pub struct ThresholdMismatch {
    /// The gain of the filters' models, over the true one.
    pub gain: f64,
    /// The steepness of the filters' models, over the true one.
    pub steepness: f64,
    /// The resonance of the filters' models, over the true one.
    pub natural: f64,
    /// Where they believe the centre of the comb's curve, in rad.
    pub centre: f64,
    /// The density of the angular acceleration's noise that the printed filters reckon with, in rad²/s³.
    pub density: f64,
    /// The standard deviation of a crossing's angle that they reckon with, in rad.
    pub angle_sd: f64,
}

impl ThresholdBench {
    /// Reads the experiment that stands beside this file.
    pub fn new() -> Result<Self, ReproduceError> {
        let wrong = |e: ConfigError| failed("the published device")(e.into());
        let path = Path::new("threshold_scanner/device.toml");
        let experiment = published().parse(include_str!("device.toml"), path).map_err(wrong)?;
        let settings = ThresholdScannerSettings::of(&experiment).map_err(wrong)?;
        Ok(Self { device: settings.hardware, settings })
    }

    /// The filters of these names, told of this device.
    pub fn settings_for(&self, device: ThresholdHardware, names: &[&str]) -> ThresholdScannerSettings {
        let mut settings = self.settings.clone();
        settings.hardware = device;
        settings.filters.retain(|filter| names.contains(&filter.basics.name.as_str()));
        settings
    }

    /// The filters of these names that believe this.
    pub fn mismatched_settings(
        &self,
        belief: &ThresholdMismatch,
        names: &[&str],
    ) -> ThresholdScannerSettings {
        let mut device = self.device;
        device.readout.comb.gain *= belief.gain;
        device.readout.comb.steepness *= belief.steepness;
        device.readout.comb.centre = belief.centre;
        device.mirror.comb = device.readout.comb;
        device.mirror.resonator.natural_rate *= belief.natural;
        let mut settings = self.settings_for(device, names);
        for filter in &mut settings.filters {
            filter.acceleration_density = belief.density;
            if let Some(threshold) = &mut filter.threshold {
                threshold.angle_sd = Some(belief.angle_sd);
            }
        }
        settings
    }
}

/// A free decay, in closed form.
pub struct ClosedFormDecay {
    /// When, in s.
    pub time_s: Vec<f64>,
    /// Angle in rad and rate in rad/s.
    pub states: Vec<[f64; 2]>,
    /// The signal without noise, in V.
    pub clean: Vec<f64>,
    /// When the threshold is passed, in s, but for the ends of the recording.
    pub passes_s: Vec<f64>,
}

/// How far detections are from the passes that they belong to.
#[derive(Clone, Copy, Debug)]
pub struct DetectionError {
    /// The quarter of the recording.
    pub quarter: usize,
    /// The angle at the detection minus that of the threshold, in rad.
    pub angle: f64,
}

impl ClosedFormDecay {
    /// Of this device, from `AMPLITUDE` and this phase of its motion, in cycles.
    pub fn of(device: &ThresholdHardware, phase: f64) -> Self {
        let resonator = device.mirror.resonator;
        let step = resonator.exact(INTERVAL_S, 0.0);
        let (sine, cosine) = (TAU * phase).sin_cos();
        let mut x = [AMPLITUDE * sine, AMPLITUDE * resonator.natural_rate * cosine];
        let mut decay = Self { time_s: vec![], states: vec![], clean: vec![], passes_s: vec![] };
        let threshold = device.readout.comb.centre;
        for k in 0..SAMPLES {
            let time_s = k as f64 * INTERVAL_S;
            decay.time_s.push(time_s);
            decay.states.push(x);
            let [volts] = device.readout.predict(&x);
            decay.clean.push(volts);
            let next = step.step(&x, &[0.0]);
            if (x[0] < threshold) != (next[0] < threshold) {
                let after_s = pass_after(x, threshold, |x| resonator.acceleration(x[0], x[1], 0.0));
                decay.passes_s.push(time_s + after_s);
            }
            x = next;
        }
        decay.passes_s.retain(|time_s| is_scored(*time_s));
        decay
    }

    /// The phases of decays that differ from each other as much as they can.
    pub fn phase(index: usize) -> f64 {
        const GOLDEN: f64 = 0.618_033_988_749_895;
        (index as f64 * GOLDEN).fract()
    }

    /// The signal as it is recorded, in V, with noise of this standard deviation.
    pub fn recorded(&self, noise: f64, seed: u64) -> Vec<f64> {
        let mut white = WhiteNoise::new(seed, SIGNAL_NOISE);
        self.clean.iter().map(|volts| volts + noise * white.sample()).collect()
    }

    /// The angle at a time, by the cubic through both neighbours.
    pub fn angle_at(&self, time_s: f64) -> f64 {
        let place = time_s / INTERVAL_S;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // clamped
        let before = (place.max(0.0) as usize).min(SAMPLES - 2);
        let [start, end] = [self.states[before], self.states[before + 1]];
        hermite((start[0], start[1]), (end[0], end[1]), INTERVAL_S, place - before as f64)
    }

    /// How far the detections at these times are off; those that belong to no pass, and those at the ends, are left out.
    pub fn misses(
        &self,
        device: &ThresholdHardware,
        times_s: impl IntoIterator<Item = f64>,
    ) -> Vec<DetectionError> {
        let miss = |time_s: f64| {
            let apart = |pass_s: &f64| (pass_s - time_s).abs();
            let nearest = self.passes_s.iter().min_by(|a, b| apart(a).total_cmp(&apart(b)))?;
            (apart(nearest) < NEAR_S).then(|| DetectionError {
                quarter: quarter(*nearest),
                angle: self.angle_at(time_s) - device.readout.comb.centre,
            })
        };
        times_s.into_iter().filter_map(miss).collect()
    }
}

/// When after a state the threshold is passed, in s: within a sample the angle is a parabola.
fn pass_after(x: [f64; 2], threshold: f64, acceleration: impl Fn([f64; 2]) -> f64) -> f64 {
    let acceleration = acceleration(x);
    let mut t = 0.0;
    for _ in 0..5 {
        t -= (x[0] - threshold + t * (x[1] + 0.5 * acceleration * t)) / (x[1] + acceleration * t);
    }
    t
}

fn is_scored(time_s: f64) -> bool {
    (ENDS_S..SAMPLES as f64 * INTERVAL_S - ENDS_S).contains(&time_s)
}

/// The quarter of a recording that a time is in.
pub fn quarter(time_s: f64) -> usize {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturating
    let quarter = (4.0 * time_s / (SAMPLES as f64 * INTERVAL_S)) as usize;
    quarter.min(3)
}

/// The crossings of a recorded signal, and what the filters make of it. `None` where the work was stopped, or the
/// detector cannot be made.
pub fn estimate(
    settings: &ThresholdScannerSettings,
    decay: &ClosedFormDecay,
    signal: &[f64],
    seed: u64,
    progress: &dyn Progress,
) -> Option<(Vec<LevelCrossing>, Vec<Trajectory>)> {
    let crossings = crossings(settings, decay, signal)?;
    let trajectories = follow(settings, decay, (signal, &crossings), seed, progress)?;
    Some((crossings, trajectories))
}

/// The crossings of a recorded signal; `None` where the detector cannot be made.
pub fn crossings(
    settings: &ThresholdScannerSettings,
    decay: &ClosedFormDecay,
    signal: &[f64],
) -> Option<Vec<LevelCrossing>> {
    let device = &settings.hardware;
    let rows = SignalRows { time_s: &decay.time_s, volts: signal, first: 0 };
    let samples = (INTERVAL_S, device.noise_variance, device.readout.offset);
    let sought = SearchedSignal::of_comb(samples, device.readout.comb, device.mirror.resonator);
    find_crossings(rows, sought, settings.crossings.as_ref()?).ok()
}

/// What the filters make of a recorded signal and these crossings; `None` where the work was stopped.
pub fn follow(
    settings: &ThresholdScannerSettings,
    decay: &ClosedFormDecay,
    (signal, crossings): (&[f64], &[LevelCrossing]),
    seed: u64,
    progress: &dyn Progress,
) -> Option<Vec<Trajectory>> {
    let off = vec![0.0; signal.len()];
    let data = DrivenSegment::new(&decay.time_s, &off, signal, INTERVAL_S);
    let mut settings = settings.clone();
    start_near(&mut settings.filters, decay.states[0], seed);
    let motion = MotionRate { frequency_hz: settings.hardware.natural_hz(), is_driven: false };
    let samples = ThresholdSamples { data: &data, drive_slope: &off, crossings, first: 0, motion };
    estimate_segment(&settings, samples, &mut Past::default(), "the bench", progress).ok()
}

/// All filters start from the same state, as far from the true one as they believe to be.
fn start_near(filters: &mut [ThresholdFilterSettings], truth: [f64; 2], seed: u64) {
    let mut noise = WhiteNoise::new(seed, START);
    let off = [noise.sample(), noise.sample()];
    for filter in filters {
        filter.start = std::array::from_fn(|i| truth[i] + off[i] * filter.start_sd[i]);
    }
}

/// The angles that a trajectory has.
pub fn angles(trajectory: &Trajectory) -> &[f64] {
    trajectory.state("angle").map_or(&[], |state| &state.mean)
}

/// Samples after a detection over which the papers take an error of their own.
const AFTER: usize = 50;

/// Root mean square errors of the angle in rad, in the four quarters and as a whole.
pub fn errors(trajectory: &Trajectory, decay: &ClosedFormDecay) -> [f64; 5] {
    rms_of(trajectory, decay, |_| true)
}

/// The same over the 50 samples after each detection.
pub fn errors_after(
    trajectory: &Trajectory,
    decay: &ClosedFormDecay,
    crossings: &[LevelCrossing],
) -> [f64; 5] {
    let mut is_after = vec![false; SAMPLES];
    for crossing in crossings {
        let Some(instant) = crossing.at(CrossingTiming::Sample) else { continue };
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a sample of the recording
        let first = (instant.time_s / INTERVAL_S).round() as usize;
        for place in is_after.iter_mut().skip(first).take(AFTER) {
            *place = true;
        }
    }
    rms_of(trajectory, decay, |k| is_after[k])
}

fn rms_of(trajectory: &Trajectory, decay: &ClosedFormDecay, counts: impl Fn(usize) -> bool) -> [f64; 5] {
    let mut sums = [(0.0, 0.0); 5];
    for (k, (angle, state)) in angles(trajectory).iter().zip(&decay.states).enumerate() {
        if counts(k) {
            for place in [quarter(decay.time_s[k]), 4] {
                sums[place].0 += (angle - state[0]).powi(2);
                sums[place].1 += 1.0;
            }
        }
    }
    sums.map(|(sum, count)| f64::sqrt(sum / count))
}

/// Mean and standard deviation.
pub fn moments(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let square = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (mean, square.sqrt())
}

//! The published device on the bench: free decays of it, recordings of them, and the filters at work.

use super::failed;
use crate::config::{ConfigError, CrossingTiming, Experiment};
use crate::estimate::{EstimateError, Trajectory};
use crate::program::ReproduceError;
use crate::progress::Progress;
use crate::signal::hermite;
use crate::simulate::WhiteNoise;
use kalmems_core::{Measurement, Process};
use kalmems_engines::recording::RecordingFromRows;
use kalmems_rigs::crossings::{
    Acceptance, DetectorSettings, LevelCrossing, SearchedSignal, SignalRows, find as find_crossings,
};
use kalmems_rigs::published;
use kalmems_rigs::threshold_scanner::ThresholdHardware;
use std::f64::consts::TAU;
use std::path::Path;
use toml::{Table, Value};

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

/// How far from the true state filters start: angle in rad and rate in rad/s, as the experiment states it.
const START_SD: [f64; 2] = [5e-3, 20.0];

/// The published device, and the filters that are compared.
pub struct ThresholdBench {
    /// The device.
    pub device: ThresholdHardware,
    detector: DetectorSettings,
    document: Table,
}

/// Filters, what they are told of the device, and how crossings are found.
#[derive(Clone)]
pub struct ThresholdSettings {
    /// The device as the filters know it.
    pub device: ThresholdHardware,
    /// How crossings are found.
    pub detector: DetectorSettings,
    /// The tables of the filters.
    pub filters: Vec<Table>,
    document: Table,
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
        let (text, path) = (include_str!("device.toml"), Path::new("threshold_scanner/device.toml"));
        let experiment = published().parse(text, path).map_err(wrong)?;
        let device = ThresholdHardware::of(&experiment).map_err(wrong)?;
        let stated = experiment.estimate.as_ref().and_then(|estimate| estimate.crossings.as_ref());
        let detector = stated.map(DetectorSettings::from);
        let detector =
            detector.ok_or_else(|| failed("the published device")("it finds no crossings".into()))?;
        let document = text.parse().map_err(|e: toml::de::Error| failed("the published device")(e.into()))?;
        Ok(Self { device, detector, document })
    }

    /// The filters of these names, told of this device.
    pub fn settings_for(&self, device: ThresholdHardware, names: &[&str]) -> ThresholdSettings {
        let filters = self.document.get("estimate").and_then(|estimate| estimate.get("filter")?.as_array());
        let filters = filters.into_iter().flatten().filter_map(Value::as_table);
        let filters = filters.filter(|filter| names.contains(&name_of(filter))).cloned().collect();
        ThresholdSettings { device, detector: self.detector, filters, document: self.document.clone() }
    }

    /// The filters of these names that believe this.
    pub fn mismatched_settings(&self, belief: &ThresholdMismatch, names: &[&str]) -> ThresholdSettings {
        let mut device = self.device;
        device.readout.comb.gain *= belief.gain;
        device.readout.comb.steepness *= belief.steepness;
        device.readout.comb.centre = belief.centre;
        device.mirror.comb = device.readout.comb;
        device.mirror.resonator.natural_rate *= belief.natural;
        let mut settings = self.settings_for(device, names);
        for filter in &mut settings.filters {
            set_density(filter, belief.density);
            if let Some(threshold) = filter.get_mut("threshold").and_then(Value::as_table_mut) {
                threshold.insert("angle_sd".to_owned(), format!("{:?} rad", belief.angle_sd).into());
            }
        }
        settings
    }
}

/// The name of a filter.
pub fn name_of(filter: &Table) -> &str {
    filter.get("name").and_then(Value::as_str).unwrap_or_default()
}

/// Gives a filter this density of the angular acceleration's noise in rad²/s³.
pub fn set_density(filter: &mut Table, density: f64) {
    let noise =
        Table::from_iter([("angular_acceleration".to_owned(), format!("{density:?} rad^2/s^3").into())]);
    filter.insert("process_noise".to_owned(), noise.into());
}

impl ThresholdSettings {
    /// The experiment of filters that start at a state.
    pub fn experiment(&self, start: [f64; 2]) -> Result<Experiment, ConfigError> {
        let mut document = self.document.clone();
        document.remove("simulate");
        let ThresholdHardware { mirror, readout, noise_variance, .. } = &self.device;
        let numbers = [
            ("resonator", "natural_frequency", format!("{:?} Hz", self.device.natural_hz())),
            ("resonator", "damping_ratio", format!("{:?}", mirror.resonator.damping_ratio)),
            ("comb", "threshold_angle", format!("{:?} rad", readout.comb.centre)),
            ("comb", "gain", format!("{:?} V s/rad", readout.comb.gain)),
            ("comb", "steepness", format!("{:?} 1/rad", readout.comb.steepness)),
            ("readout", "offset", format!("{:?} V", readout.offset)),
            ("readout", "noise_variance", format!("{noise_variance:?} V^2")),
        ];
        for (table, key, number) in numbers {
            set(&mut document, &["device", "threshold_scanner", table, key], number.into());
        }
        let detector = &self.detector;
        let found = [("width", detector.width_s), ("separation", detector.separation_s)];
        for (key, seconds) in found {
            set(&mut document, &["estimate", "crossings", key], format!("{seconds:?} s").into());
        }
        if let Acceptance::Deviations(deviations) = detector.acceptance {
            set(&mut document, &["estimate", "crossings", "threshold"], deviations.into());
        }
        let start = Table::from_iter([
            ("angle".to_owned(), format!("{:?} rad", start[0]).into()),
            ("rate".to_owned(), format!("{:?} rad/s", start[1]).into()),
        ]);
        let started = self.filters.iter().enumerate().map(|(place, filter)| {
            let mut filter = filter.clone();
            // Several may be one filter with other numbers.
            filter.insert("name".to_owned(), format!("{place}").into());
            filter.insert("start".to_owned(), start.clone().into());
            Value::Table(filter)
        });
        set(&mut document, &["estimate", "filter"], Value::Array(started.collect()));
        let recording = "role = \"test\"\nfile = \"recording.csv\"\nclock = { column = \"time_s\" }\nchannels = { drive = \
                         \"drive_V\", signal = \"cap_V\" }";
        let recording: Table = recording.parse().unwrap_or_default();
        document.insert("recording".to_owned(), Value::Array(vec![recording.into()]));
        let text = toml::to_string(&document).unwrap_or_default();
        published().parse(&text, Path::new("threshold_scanner/device.toml"))
    }
}

/// Sets a value below tables.
fn set(document: &mut Table, keys: &[&str], value: Value) {
    let Some((last, tables)) = keys.split_last() else { return };
    let mut at = document;
    for key in tables {
        let below = at.entry((*key).to_owned()).or_insert_with(|| Table::new().into());
        let Some(below) = below.as_table_mut() else { return };
        at = below;
    }
    at.insert((*last).to_owned(), value);
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

/// The crossings of a recorded signal, and what the filters make of it.
pub fn estimate(
    settings: &ThresholdSettings,
    decay: &ClosedFormDecay,
    signal: &[f64],
    seed: u64,
    progress: &dyn Progress,
) -> Result<(Vec<LevelCrossing>, Vec<Trajectory>), ReproduceError> {
    let crossings = crossings(settings, decay, signal)?;
    let trajectories = follow(settings, decay, signal, seed, progress)?;
    Ok((crossings, trajectories))
}

/// The crossings of a recorded signal.
pub fn crossings(
    settings: &ThresholdSettings,
    decay: &ClosedFormDecay,
    signal: &[f64],
) -> Result<Vec<LevelCrossing>, ReproduceError> {
    let device = &settings.device;
    let rows = SignalRows { time_s: &decay.time_s, volts: signal, first: 0 };
    let samples = (INTERVAL_S, device.noise_variance, device.readout.offset);
    let sought = SearchedSignal::of_comb(samples, device.readout.comb, device.mirror.resonator);
    find_crossings(rows, sought, &settings.detector)
        .map_err(|why| failed("the detector of a decay")(why.into()))
}

/// What the filters make of a recorded signal, all from the same state, which is as far from the true one as they believe it to be.
fn follow(
    settings: &ThresholdSettings,
    decay: &ClosedFormDecay,
    signal: &[f64],
    seed: u64,
    progress: &dyn Progress,
) -> Result<Vec<Trajectory>, ReproduceError> {
    if settings.filters.is_empty() {
        return Ok(Vec::new());
    }
    let mut noise = WhiteNoise::new(seed, START);
    let off = [noise.sample(), noise.sample()];
    let start = std::array::from_fn(|i| decay.states[0][i] + off[i] * START_SD[i]);
    let wrong = |why: EstimateError| ReproduceError::of_estimate("the filters of a decay")(why);
    let experiment = settings.experiment(start).map_err(|why| wrong(why.into()))?;
    let rig = published().rig(&experiment).map_err(|why| wrong(why.into()))?;
    let layout = rig.layout(&experiment, 0).map_err(|why| wrong(why.into()))?;
    let columns = ["time_s", "drive_V", "cap_V"];
    let mut rows =
        RecordingFromRows::new("recording.csv", &columns, &layout).map_err(|why| wrong(why.into()))?;
    for (time_s, volts) in decay.time_s.iter().zip(signal) {
        rows.push(&[*time_s, 0.0, *volts]);
    }
    let recording = rows.finish().map_err(|why| wrong(why.into()))?;
    let estimates = rig.estimate(&experiment, 0, &recording, progress).map_err(wrong)?;
    let mut trajectories = estimates.into_iter().next().map_or_else(Vec::new, |one| one.trajectories);
    for (trajectory, filter) in trajectories.iter_mut().zip(&settings.filters) {
        name_of(filter).clone_into(&mut trajectory.name);
    }
    Ok(trajectories)
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

//! Faults of a device, of its readout and of what was recorded of it.

use crate::devices::{Device, Setting};
use kalmems::config::Experiment;
use kalmems::diagnose::{Diagnosis, diagnose_recording};
use kalmems::estimate::SegmentEstimate;
use kalmems::evaluate::{SegmentJudge, TestPlace, TestResult};
use kalmems::progress::{Interruption, Silent};
use kalmems::recording::SampledRecording;
use kalmems::results::Metrics;
use kalmems::rigs::published;
use kalmems::simulate::{ComputedRecording, WhiteNoise};
use kalmems::workflow::estimate_computed;

#[path = "../../parts/signal_faults.rs"]
mod signal_faults;

use signal_faults::{add_line, noise};
pub use signal_faults::{hum, late, scaled, spikes};

/// What a fault of a size does.
#[derive(Clone, Copy)]
pub enum Does {
    /// The filters are told a number that is larger by this part: key, true value, unit.
    Told(&'static str, f64, &'static str),
    /// They are told a number that is so many times too small.
    ToldTooSmall(&'static str, f64, &'static str),
    /// The device has a number that they are not told, in its unit.
    Has(&'static str, &'static str),
    /// The numbers of a channel are others.
    Records(&'static str, fn(&mut [f64], &[f64], f64, u64)),
}

/// A fault of a device.
pub struct Fault {
    pub device: &'static str,
    pub does: Does,
    /// What a diagnosis has to name.
    pub is_named: &'static str,
    /// The first size that is tried, and the largest.
    pub sizes: [f64; 2],
}

/// Both sides of a fault: a recording that shows it, and filters that do not know of it.
pub struct Faulty {
    pub told: Experiment,
    pub simulated: ComputedRecording,
    pub recording: SampledRecording,
}

impl Fault {
    /// Keys of the true device and of what the filters are told.
    fn settings(&self, size: f64) -> [Vec<Setting<'static>>; 2] {
        let written = |number: f64, unit: &str| {
            if unit.is_empty() { format!("{number:e}") } else { format!("\"{number:e} {unit}\"") }
        };
        // As many samples as a diagnosis looks at: a number that is fitted is then known better than what follows from it.
        let both = if self.device == "shared scanner" {
            vec![("simulate.duration", "\"58 ms\"".to_owned())]
        } else {
            Vec::new()
        };
        let own = match self.does {
            Does::Told(key, value, unit) => [vec![], vec![(key, written(value * (1.0 + size), unit))]],
            Does::ToldTooSmall(key, value, unit) => {
                [vec![], vec![(key, written(value / (1.0 + size), unit))]]
            }
            Does::Has(key, unit) => [vec![(key, written(size, unit))], vec![]],
            Does::Records(..) => [vec![], vec![]],
        };
        own.map(|settings| [both.clone(), settings].concat())
    }

    /// A recording with the fault.
    pub fn of_size(&self, size: f64, seed: u64) -> Faulty {
        let [real, told] = self.settings(size);
        let (told, simulated) = Device::named(self.device).recorded(&real, &told, seed);
        let rig = published().rig(&told).unwrap();
        let index = rig.wanted(&told).unwrap()[0];
        let mut recording = simulated.recorded(&rig.layout(&told, index).unwrap()).unwrap();
        if let Does::Records(meaning, change) = self.does {
            let described = told.recording(index).unwrap();
            let (_, column) = described.channels.iter().find(|(own, _)| *own == meaning).unwrap();
            recording = recording.what_if(column, |times, values| change(values, times, size, seed));
        }
        Faulty { told, simulated, recording }
    }

    /// The error of the first filter if it is told all: what a diagnosis is to reach.
    pub fn right_error(&self, size: f64, seed: u64) -> Option<f64> {
        let [real, _] = self.settings(size);
        let (told, simulated) = Device::named(self.device).recorded(&real, &real, seed);
        error(&told, &simulated)
    }

    /// The first size, of a factor of 2 between them, at which the innovations of three recordings that judge nothing show it, and half
    /// of that more; `None` where they do not up to the largest.
    pub fn visible_size(&self) -> Option<f64> {
        let [from, to] = self.sizes;
        let mut size = from;
        while size <= to {
            if (1..=3).all(|seed| self.of_size(size, seed).is_seen()) {
                return Some(1.5 * size);
            }
            size *= 2.0;
        }
        None
    }
}

impl Faulty {
    pub fn diagnosis(&self) -> Diagnosis {
        diagnose_recording(published(), &self.told, None, self.recording.clone(), &Silent).unwrap()
    }

    /// For each segment whether the first filter holds the lock, and the tests of its innovations; `None` where it refuses the recording.
    fn tests(&self) -> Option<Vec<(bool, Vec<TestResult>)>> {
        let rig = published().rig(&self.told).unwrap();
        let estimates = rig.estimate(&self.told, self.place(), &self.recording, &Silent).ok()?;
        let of = |estimate: &SegmentEstimate| {
            let mut judge = SegmentJudge::default();
            judge.take(estimate, &Interruption::never());
            let first = &estimate.trajectories[0];
            (first.lock.held(), judge.of(&first.key).map_or_else(Vec::new, |judgement| judgement.tests))
        };
        Some(estimates.iter().map(of).collect())
    }

    /// Whether the innovations of the first filter show anything. A filter that refuses the recording sees that something is wrong.
    fn is_seen(&self) -> bool {
        self.tests().is_none_or(|segments| {
            segments.iter().any(|(held, tests)| !held || tests.iter().any(TestResult::fails))
        })
    }

    /// The frequency of the motion, as the tests of the innovations have it.
    pub fn motion_hz(&self) -> f64 {
        let tests = self.tests().unwrap().remove(0).1;
        let of = |test: &TestResult| match test.place {
            Some(TestPlace::Harmonic { of_hz, .. }) => Some(of_hz),
            _ => None,
        };
        tests.iter().find_map(of).unwrap()
    }

    /// The place of the recording in the experiment.
    fn place(&self) -> usize {
        published().rig(&self.told).unwrap().wanted(&self.told).unwrap()[0]
    }

    /// A line of so many standard deviations of the noise in the signal.
    pub fn put_line(&mut self, hz: f64, size: f64) {
        let described = self.told.recording(self.place()).unwrap();
        let (_, column) = described.channels.iter().find(|(own, _)| *own == "signal").unwrap();
        self.recording =
            self.recording.what_if(column, |times, values| add_line(values, times, hz, size, 1.0));
    }

    /// The error of the first filter if it is told what a cause says.
    pub fn error_with(&self, diagnosis: &Diagnosis, name: &str) -> Option<f64> {
        let cause = diagnosis.causes.iter().find(|cause| cause.name == name)?;
        let mut document: toml::Value = self.told.to_toml().unwrap().parse::<toml::Table>().unwrap().into();
        for edit in &cause.edits {
            let value: toml::Table = format!("x = {}", edit.to).parse().unwrap();
            let key = edit.key.replace('[', ".").replace(']', "");
            crate::devices::put(&mut document, &key, Some(&value["x"].to_string()));
        }
        let text = toml::to_string(&document).unwrap();
        error(&published().parse(&text, self.told.path()).unwrap(), &self.simulated)
    }
}

/// The error of the first filter's answer, in whatever unit it has.
fn error(told: &Experiment, simulated: &ComputedRecording) -> Option<f64> {
    let outcome = estimate_computed(published(), told, simulated, &Silent).ok()?;
    let metrics = Metrics::of(&outcome);
    let estimator = metrics.estimators().next()?;
    let angle = estimator.errors.as_ref().map(|errors| errors.angle.rmse_deg);
    angle.or_else(|| metrics.values.iter().find_map(|value| Some(estimator.values.get(value.name)?.rmse)))
}

/// An amplifier whose gain grows by this part from the beginning to the end.
pub fn drifting(values: &mut [f64], _: &[f64], size: f64, _: u64) {
    let (mean, count) = (values.iter().sum::<f64>() / values.len() as f64, values.len() as f64);
    for (k, value) in values.iter_mut().enumerate() {
        *value += size * (k as f64 / count) * (*value - mean);
    }
}

/// A random walk of so many standard deviations of the noise over the recording.
pub fn wandering(values: &mut [f64], _: &[f64], size: f64, seed: u64) {
    let step = size * noise(values) / (values.len() as f64).sqrt();
    let (mut walk, mut source) = (0.0, WhiteNoise::new(seed, 9));
    for value in values {
        walk += step * source.sample();
        *value += walk;
    }
}

/// A step of so many standard deviations of the noise in the middle.
pub fn stepping(values: &mut [f64], _: &[f64], size: f64, _: u64) {
    let (height, half) = (size * noise(values), values.len() / 2);
    for value in &mut values[half..] {
        *value += height;
    }
}

/// Noise that is so many times as large in the second half.
pub fn noisier(values: &mut [f64], _: &[f64], size: f64, seed: u64) {
    let (sd, half) = (size * noise(values), values.len() / 2);
    let mut source = WhiteNoise::new(seed, 10);
    for value in &mut values[half..] {
        *value += sd * source.sample();
    }
}

/// An amplifier that compresses what is far from the mean, by this part at the largest.
pub fn compressed(values: &mut [f64], _: &[f64], size: f64, _: u64) {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let largest = values.iter().fold(0.0_f64, |largest, value| largest.max((value - mean).abs()));
    for value in values {
        let part = (*value - mean) / largest;
        *value -= size * largest * part.powi(3);
    }
}

/// A gap of so many samples in the middle, filled with the last one.
pub fn stuck(values: &mut [f64], _: &[f64], size: f64, _: u64) {
    let half = values.len() / 2;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let end = (half + size as usize).min(values.len());
    let held = values[half];
    values[half..end].fill(held);
}

/// The correlation time of coloured noise in samples.
pub const CORRELATED: f64 = 40.0;

/// Noise of first order, of so many standard deviations of the white noise.
pub fn coloured(values: &mut [f64], _: &[f64], size: f64, seed: u64) {
    let (sd, decay) = (size * noise(values), (-1.0 / CORRELATED).exp());
    let mut source = WhiteNoise::new(seed, 11);
    let mut now = sd * source.sample();
    for value in values {
        *value += now;
        now = decay * now + sd * (1.0 - decay * decay).sqrt() * source.sample();
    }
}

//! Simulated recordings with outliers, and what the first filter makes of them.

use crate::devices::{Device, Setting, put};
use kalmems::config::Experiment;
use kalmems::progress::Silent;
use kalmems::results::{EstimatorMetrics, Metrics};
use kalmems::rigs::published;
use kalmems::simulate::{ComputedRecording, WhiteNoise, described};
use kalmems::workflow::estimate_computed;
use std::path::Path;

/// What happens to a signal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Impairment {
    /// So large a part of the samples are off by 5 to 100 standard deviations of the noise, to either side.
    Share(f64),
    /// All samples of a millisecond are.
    Burst,
}

/// The cells of the matrix.
pub const IMPAIRMENTS: [Impairment; 4] =
    [Impairment::Share(1e-4), Impairment::Share(1e-3), Impairment::Share(1e-2), Impairment::Burst];

impl Impairment {
    pub fn words(self) -> String {
        match self {
            Self::Share(share) => format!("{} % outliers", 100.0 * share),
            Self::Burst => "a burst of 1 ms".to_owned(),
        }
    }

    /// Changes those of a signal of a recording, after its settling time in s.
    pub fn change(self, simulated: &mut ComputedRecording, signal: &str, by: (f64, u64)) {
        assert!(simulated.change_recorded(signal, |values, times| self.spoil(values, times, by)));
    }

    /// Changes the samples after the settling time.
    pub fn spoil(self, values: &mut [f64], times: &[f64], (skip_s, seed): (f64, u64)) {
        let mut chance = WhiteNoise::new(seed, 77);
        // Uniform enough: the last digits of a normal number.
        let mut uniform = move || (chance.sample() * 1e6).rem_euclid(1.0);
        let sd = noise(values);
        let from = times.partition_point(|time| *time < times[0] + skip_s);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a row
        let place = from + ((times.len() - from) as f64 * (0.2 + 0.5 * uniform())) as usize;
        let burst = place..times.partition_point(|time| *time < times[place] + 1e-3);
        for (k, value) in values.iter_mut().enumerate().skip(from) {
            let is_off = match self {
                Self::Share(share) => uniform() < share,
                Self::Burst => burst.contains(&k),
            };
            if is_off {
                let size = 5.0 * 20_f64.powf(uniform());
                *value += if uniform() < 0.5 { -size * sd } else { size * sd };
            }
        }
    }
}

/// The standard deviation of a channel's noise, from how its numbers differ from the line through their neighbours.
pub fn noise(values: &[f64]) -> f64 {
    let mut differences: Vec<f64> =
        values.windows(5).map(|w| (w[0] - 4.0 * w[1] + 6.0 * w[2] - 4.0 * w[3] + w[4]).abs()).collect();
    differences.sort_by(f64::total_cmp);
    // The median of the absolute value of a normal number is 0.6745.
    differences[differences.len() / 2] / 0.6745 / 70_f64.sqrt()
}

/// A device of the matrix: one of the published ones, or an experiment file with a device of equations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Of {
    Published(&'static str),
    Equations(&'static str),
}

pub const DEVICES: [Of; 6] = [
    Of::Published("shared scanner"),
    Of::Published("threshold scanner"),
    Of::Published("accelerometer"),
    Of::Published("micro-stage"),
    Of::Published("piston mirror"),
    Of::Equations("comb_resonator/simulation.toml"),
];

impl Of {
    pub fn name(self) -> &'static str {
        match self {
            Self::Published(name) => name,
            Self::Equations(_) => "comb resonator (equations)",
        }
    }

    /// A recording, and the experiment of its filters.
    pub fn recorded(self, settings: &[Setting], seed: u64) -> (Experiment, ComputedRecording) {
        match self {
            Self::Published(name) => Device::named(name).recorded(settings, settings, seed),
            Self::Equations(file) => {
                let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples").join(file);
                let mut document: toml::Value =
                    std::fs::read_to_string(&path).unwrap().parse::<toml::Table>().unwrap().into();
                put(&mut document, "simulate.seed", Some(&seed.to_string()));
                for (key, value) in settings {
                    put(&mut document, key, Some(value));
                }
                let experiment = published().parse(&toml::to_string(&document).unwrap(), &path).unwrap();
                let simulation = published().rig(&experiment).unwrap().simulate(&experiment).unwrap();
                let simulated = ComputedRecording::of(&*simulation, &Silent).unwrap();
                (described(&experiment, &*simulation), simulated)
            }
        }
    }
}

/// What came of a recording.
#[derive(Clone)]
pub struct Outcome {
    pub metrics: Option<Metrics>,
    /// Why it was refused.
    pub refused: String,
}

impl Outcome {
    pub fn of(experiment: &Experiment, simulated: &ComputedRecording) -> Self {
        match estimate_computed(published(), experiment, simulated, &Silent) {
            Ok(outcome) => Self { metrics: Some(Metrics::of(&outcome)), refused: String::new() },
            Err(why) => Self { metrics: None, refused: why.to_string() },
        }
    }

    /// The same of a device with these settings and what happens to its first signal.
    pub fn of_first(of: Of, settings: &[Setting], impairment: Option<Impairment>, seed: u64) -> Self {
        let (experiment, mut simulated) = of.recorded(settings, seed);
        let skip_s = experiment.estimate.as_ref().unwrap().skip.si();
        if let Some(impairment) = impairment {
            impairment.change(&mut simulated, &signals(&experiment)[0], (skip_s, seed));
        }
        Self::of(&experiment, &simulated)
    }

    /// The first filter.
    pub fn first(&self) -> Option<&EstimatorMetrics> {
        self.metrics.as_ref()?.estimators().next()
    }

    /// The error of its answer, in whatever unit it has; infinite where it has none.
    pub fn error(&self) -> f64 {
        let Some(first) = self.first().filter(|first| first.verdict.is_of_an_estimate()) else {
            return f64::INFINITY;
        };
        let angle = first.errors.as_ref().map(|errors| errors.angle.rmse_deg);
        let value = || {
            self.metrics.as_ref()?.values.iter().find_map(|value| Some(first.values.get(value.name)?.rmse))
        };
        angle.or_else(value).unwrap_or(f64::INFINITY)
    }

    /// Why there is no answer: a refusal, or when the signal was lost that was not found again.
    pub fn why_none(&self) -> Option<String> {
        if !self.refused.is_empty() {
            return Some(self.refused.clone());
        }
        let lost = self.first().filter(|first| !first.verdict.is_of_an_estimate())?;
        lost.lock.events.first().map(ToString::to_string)
    }

    pub fn passes(&self) -> bool {
        self.first().is_some_and(EstimatorMetrics::passes)
    }
}

/// The signals of a recording, by what they mean.
pub fn signals(experiment: &Experiment) -> Vec<String> {
    published().rig(experiment).unwrap().channels(experiment).signals
}

/// The recording of a seed without and with an impairment of its first signal.
pub fn both(of: Of, settings: &[Setting], impairment: Impairment, seed: u64) -> [Outcome; 2] {
    let (experiment, mut simulated) = of.recorded(settings, seed);
    let clean = Outcome::of(&experiment, &simulated);
    let skip_s = experiment.estimate.as_ref().unwrap().skip.si();
    let signal = &signals(&experiment)[0];
    impairment.change(&mut simulated, signal, (skip_s, seed));
    [clean, Outcome::of(&experiment, &simulated)]
}

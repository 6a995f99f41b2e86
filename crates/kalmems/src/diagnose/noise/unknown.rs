//! Which noises an experiment leaves to its recording, and how each is written.

use crate::config::{ConfigError, ConfigFault, Experiment, FROM_RECORDING, Key, KeyStep};
use crate::diagnose::DiagnoseError;
use crate::diagnose::bench::TrialBench;
use crate::diagnose::paste::changed;
use crate::diagnose::report::{Edit, digits, rounded};
use crate::diagnose::search::MOST_SIZES;
use crate::diagnose::suspect::{NumberRole, Suspect, WrittenNumber};
use crate::rigs::{StateDensity, Workbench};
use crate::signal::white_noise_variance;
use crate::units::Unit;
use toml::{Table, Value};

/// The logarithm of a factor by which a first guess of a readout's noise may be off, a third of how far a search may go.
const FARTHEST: f64 = 3.0;

/// The same of a process noise, of which no more is known than its power of ten.
const FARTHEST_WALK: f64 = 7.0;

/// Twice the first step of a search for the logarithm of a readout's noise. The standard error is that of a difference quotient over a step: over 0.01 it
/// is 0.5 % too small.
const FINEST: f64 = 0.02;

/// Digits of a standard deviation: more than any recording tells of it.
const DIGITS: usize = 5;

/// A noise that is to be found.
#[derive(Clone)]
pub(super) struct UnknownNoise {
    /// Where it stands in the experiment.
    pub(super) key: Key,
    pub(super) form: NoiseForm,
    /// The place of the filter whose own it is.
    pub(super) owner: Option<usize>,
}

/// How a noise is written.
#[derive(Clone)]
pub(super) enum NoiseForm {
    /// The variance of a sample, in this unit.
    Variance(&'static str),
    /// The root of a density, one-sided, in this unit.
    Density(&'static str),
    /// The variance of a sample of a measurement of equations, in the square of this unit.
    Measurement(String),
    /// The density of the process noise of a state.
    Walk(StateDensity),
}

/// The noises of readouts that an experiment leaves to its recording.
pub(super) fn of_readout(raw: &Experiment) -> Result<Vec<UnknownNoise>, ConfigError> {
    let unread = |why: String| raw.error(Key::default(), ConfigFault::Value { why });
    let document: Table = raw.text().parse().map_err(|e: toml::de::Error| unread(e.to_string()))?;
    let name = raw.device_name();
    let Some(device) = document.get("device").and_then(|devices| devices.get(name)) else {
        return Ok(Vec::new());
    };
    let mut keys = Vec::new();
    places(device, &Key::from("device").child(name), &mut keys);
    let form = |key: &Key| {
        let names: Vec<&str> = key.steps().iter().filter_map(step_name).collect();
        match *names.as_slice() {
            [.., "noise_variance"] => Some(NoiseForm::Variance("V^2")),
            [.., "noise_density"] => Some(NoiseForm::Density("F/sqrt(Hz)")),
            [_, "equations", "noise", measured] => {
                let law = device.get("measure")?.get(measured)?.as_str()?;
                Some(NoiseForm::Measurement(law.rsplit_once(" in ")?.1.trim().to_owned()))
            }
            _ => None,
        }
    };
    let one = |key: Key| {
        if let Some(form) = form(&key) {
            return Ok(UnknownNoise { key, form, owner: None });
        }
        let why = format!(
            "`{FROM_RECORDING}` is for the noise of a measurement: `noise_variance` or `noise_density` of a readout, or `noise` of \
             what equations measure"
        );
        Err(raw.error(key, ConfigFault::Value { why }))
    };
    keys.into_iter().map(one).collect()
}

/// The text with the word in the place of each density of a table that is left to the recording as a whole.
pub(super) fn spelled_out(raw: &Experiment, known: &[StateDensity]) -> String {
    let words =
        known.iter().map(|density| (density.entry.name.to_owned(), Value::String(FROM_RECORDING.to_owned())));
    let words = Value::Table(words.collect());
    let open = tables(raw).filter(|(_, table, _)| table.is_left_open() && !known.is_empty());
    open.fold(raw.text().to_owned(), |text, (key, ..)| with(&text, &key, &words).unwrap_or(text))
}

/// Whether a density of process noise is left to the recording.
pub(super) fn leaves_walks_open(raw: &Experiment) -> bool {
    tables(raw).any(|(_, table, _)| table.leaves_open())
}

/// The densities of process noise that an experiment leaves to its recording, of those that its rig knows.
pub(super) fn of_process(raw: &Experiment, known: &[StateDensity]) -> Vec<UnknownNoise> {
    let open = tables(raw).flat_map(|(key, table, owner)| {
        let left = known.iter().filter(|density| {
            table.is_left_open()
                || (table.names(density.entry.name) && !table.stated().contains_key(density.entry.name))
        });
        let of = move |density: &StateDensity| {
            let key = key.clone().child(density.entry.name);
            UnknownNoise { key, form: NoiseForm::Walk(*density), owner }
        };
        left.map(of).collect::<Vec<_>>()
    });
    open.collect()
}

/// The tables of process noise, each with its key and the place of the filter whose own it is.
fn tables(raw: &Experiment) -> impl Iterator<Item = (Key, &crate::config::ProcessNoiseTable, Option<usize>)> {
    raw.estimate.iter().flat_map(|estimate| {
        let own = estimate.filters.iter().enumerate().map(|(place, filter)| {
            let key = Key::from("estimate").child("filter").index(place).child("process_noise");
            (key, &filter.process_noise, Some(place))
        });
        let shared = Key::from("estimate").child("process_noise");
        std::iter::once((shared, &estimate.process_noise, None)).chain(own)
    })
}

/// Refuses more noises than are sought together.
pub(super) fn not_too_many(raw: &Experiment, sought: &[UnknownNoise]) -> Result<(), ConfigError> {
    match sought.get(MOST_SIZES) {
        Some(one) => {
            let why = format!("these are {} noises; at most {MOST_SIZES} are found together", sought.len());
            Err(raw.error(one.key.clone(), ConfigFault::Value { why }))
        }
        None => Ok(()),
    }
}

pub(super) fn step_name(step: &KeyStep) -> Option<&str> {
    match step {
        KeyStep::Name(name) => Some(name),
        KeyStep::Index(_) => None,
    }
}

/// The keys at which a table leaves a value to the recording.
fn places(value: &Value, key: &Key, keys: &mut Vec<Key>) {
    match value {
        Value::Table(table) => {
            table.iter().for_each(|(name, value)| places(value, &key.clone().child(name), keys));
        }
        Value::String(text) if text == FROM_RECORDING => keys.push(key.clone()),
        _ => {}
    }
}

/// The text with another value at a key.
pub(super) fn with(text: &str, key: &Key, value: &Value) -> Option<String> {
    changed(text, &Edit { key: key.to_string(), to: value.to_string(), ..Edit::default() })
}

impl UnknownNoise {
    /// The density that it is, where it is one of a process.
    pub(super) const fn walk(&self) -> Option<&StateDensity> {
        match &self.form {
            NoiseForm::Walk(density) => Some(density),
            _ => None,
        }
    }

    /// Where it stands in the document of a bench, which has one filter.
    pub(super) fn key_in_bench(&self) -> Key {
        match self.owner {
            Some(_) => {
                let own = Key::from("estimate").child("filter").index(0).child("process_noise");
                own.child(self.key.last())
            }
            None => self.key.clone(),
        }
    }

    /// What stands in the file for a number: a variance, the root of a density, or a density.
    pub(super) fn written(&self, number: f64) -> Value {
        match &self.form {
            NoiseForm::Variance(unit) | NoiseForm::Density(unit) => {
                Value::String(format!("{number:e} {unit}"))
            }
            NoiseForm::Measurement(unit) => Value::String(square(number, unit)),
            NoiseForm::Walk(density) => Value::String(format!("{number:e} {}", density.unit_of_density())),
        }
    }

    /// The same with the digits that a relative standard error leaves.
    pub(super) fn rounded(&self, number: f64, sd: f64) -> Value {
        match &self.form {
            NoiseForm::Measurement(unit) => {
                Value::String(format!("({} [{unit}])^2", digits(number.sqrt(), DIGITS)))
            }
            _ => rounded(&self.written(number), Some(sd)),
        }
    }

    /// A first guess of the number of a readout, by the differences of neighbouring samples; no number of a process noise.
    pub(super) fn guess(&self, workbench: &Workbench, bench: &TrialBench) -> Result<f64, DiagnoseError> {
        let signals = workbench.rig(&bench.experiment)?.channels(&bench.experiment).signals;
        let names: Vec<&str> = self.key.steps().iter().filter_map(step_name).collect();
        let of = |signal: &&String| {
            names.iter().any(|name| *signal == name || signal.strip_prefix("signal_") == Some(name))
        };
        let signal = signals.iter().find(of).or_else(|| signals.first());
        let samples = signal.and_then(|signal| bench.samples(signal));
        let (values, interval_s) = samples.unwrap_or((&[], f64::NAN));
        let variance = white_noise_variance(values).filter(|variance| *variance > 0.0);
        let variance = variance.ok_or_else(|| {
            let why = "the recording's signal is constant or too short: there is no noise to find; state it"
                .to_owned();
            bench.experiment.error(self.key.clone(), ConfigFault::Value { why })
        })?;
        Ok(match &self.form {
            NoiseForm::Variance(_) => variance,
            NoiseForm::Density(_) => (2.0 * interval_s * variance).sqrt(),
            // In the unit that the measurement is written in.
            NoiseForm::Measurement(unit) => {
                let factor = Unit::parse(unit).map_or(1.0, |unit| unit.factor());
                variance / (factor * factor)
            }
            NoiseForm::Walk(_) => f64::NAN,
        })
    }

    /// What a search changes.
    pub(super) fn suspect(&self, guess: f64) -> Suspect {
        let factor = |unit: &str| {
            let key = self.key_in_bench();
            NumberRole::Factor(vec![WrittenNumber { key, written: guess, unit: unit.to_owned() }])
        };
        match &self.form {
            NoiseForm::Variance(unit) | NoiseForm::Density(unit) => {
                Suspect { what: factor(unit), sizes: vec![FINEST, FARTHEST, -FARTHEST] }
            }
            NoiseForm::Measurement(unit) => {
                let (key, unit) = (self.key.clone(), unit.clone());
                let what = NumberRole::Noise { key, variance: guess, unit };
                Suspect { what, sizes: vec![FINEST, FARTHEST, -FARTHEST] }
            }
            NoiseForm::Walk(density) => {
                let sizes = vec![0.7, FARTHEST_WALK, -FARTHEST_WALK];
                Suspect { what: factor(density.unit_of_density()), sizes }
            }
        }
    }
}

/// A variance in the square of a unit, as equations write it.
pub(in crate::diagnose) fn square(variance: f64, unit: &str) -> String {
    format!("({:e} [{unit}])^2", variance.sqrt())
}

//! Noises of a readout that an experiment leaves to its recording.

use super::DiagnoseError;
use super::bench::{TestedRows, TrialBench, is_judged};
use super::cause::Cause;
use super::paste::changed;
use super::report::{Edit, digits, rounded};
use super::search::{CauseSearch, MOST_SIZES, MostLikelySizes};
use super::suspect::{NumberRole, Suspect, WrittenNumber};
use super::trial::{DiagnosisTrial, TrialBlocks};
use crate::config::{ConfigError, ConfigFault, Experiment, FROM_RECORDING, Key, KeyStep, put};
use crate::identify::TWO_SIDED;
use crate::progress::Progress;
use crate::recording::SampledRecording;
use crate::rigs::Workbench;
use crate::signal::white_noise_variance;
use crate::units::Unit;
use kalmems_core::Scalar;
use serde::Serialize;
use std::path::Path;
use toml::{Table, Value};

/// Rows after the settling times that are looked at, in all.
const ROWS: TestedRows = TestedRows(200_000);

/// Powers of ten by which a first guess is changed where the filter cannot be run with it.
const OTHER_GUESSES: [f64; 7] = [1.0, 10.0, 0.1, 100.0, 0.01, 1e3, 1e4];

/// The logarithm of a factor by which a first guess may be off, a third of how far a search may go.
const FARTHEST: f64 = 3.0;

/// A noise that is known no better than to this, relative to itself, is not determined by the recording.
const DETERMINED: f64 = 0.3;

/// Digits of a standard deviation: more than any recording tells of it.
const DIGITS: usize = 5;

/// Searches of a dozen iterations each, and a gain of ln p below which there is no further one.
const SEARCHES: usize = 8;
const NO_GAIN: f64 = 0.01;

/// A noise that was found from the recording.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FoundNoise {
    /// Its key in the experiment file.
    pub key: String,
    /// What the experiment has in its place.
    pub written: String,
    /// Its 95 % interval as factors of it.
    pub interval: [f64; 2],
    /// How many times as large it is as what the differences of neighbouring samples say, in the unit in which it is written: about 1 where
    /// the filter follows the signal, less where the motion is fast, and more where the filter's model misses something.
    pub of_neighbours: f64,
    /// The filter whose innovations are the likeliest.
    pub filter: String,
    /// The rows that told it.
    pub rows: usize,
}

/// Reads an experiment file, and finds each noise of its readout that it leaves to the recording (`noise_variance = "from_recording"`).
///
/// A noise is what makes the innovations of a filter the likeliest, of the first four that have white innovations when they are right that
/// under which they are the likeliest: ln p is maximised over the logarithm of its factor by Fisher's scoring ([`fit::most_likely`](crate::fit::most_likely)), from a first guess by
/// the differences of neighbouring samples. Where the motion is foreseen well the variance of n samples is then known to √(2/n). What
/// a filter's model misses counts as noise with it, and its process noise is taken as it is stated.
///
/// # Errors
/// An experiment file or a recording that cannot be read, a filter that cannot be run, and a noise that the recording does not determine.
pub fn load_with_noise(
    workbench: &Workbench,
    path: &Path,
    progress: &dyn Progress,
) -> Result<(Experiment, Vec<FoundNoise>), DiagnoseError> {
    // What is wrong with a file is said by who reads all of it.
    let Ok(raw) = Experiment::load(path) else { return Ok((workbench.load(path)?, Vec::new())) };
    with_noise(workbench, &raw, progress)
}

/// The same of an experiment whose device was not read yet, as [`Experiment::parse`] gives it.
///
/// # Errors
/// Those of [`load_with_noise`].
pub fn with_noise(
    workbench: &Workbench,
    raw: &Experiment,
    progress: &dyn Progress,
) -> Result<(Experiment, Vec<FoundNoise>), DiagnoseError> {
    found(workbench, raw, &|bench| bench.with_files(ROWS, progress), progress)
}

/// The same of an experiment whose device was not read yet, as [`Experiment::parse`] gives it, by a recording that is there already.
///
/// # Errors
/// Those of [`load_with_noise`].
pub fn noise_of_recording(
    workbench: &Workbench,
    raw: &Experiment,
    recording: &SampledRecording,
    progress: &dyn Progress,
) -> Result<(Experiment, Vec<FoundNoise>), DiagnoseError> {
    found(workbench, raw, &|bench| bench.with_recording(recording.clone()), progress)
}

/// Whether an experiment leaves a noise to its recording.
#[cfg(feature = "parquet-results")]
pub(crate) fn leaves_noise_open(raw: &Experiment) -> Result<bool, ConfigError> {
    sought(raw).map(|sought| !sought.is_empty())
}

/// Finds the noises with what this makes of a bench.
fn found(
    workbench: &Workbench,
    raw: &Experiment,
    with_recordings: &dyn Fn(TrialBench) -> Result<TrialBench, DiagnoseError>,
    progress: &dyn Progress,
) -> Result<(Experiment, Vec<FoundNoise>), DiagnoseError> {
    let path = raw.path();
    let sought = sought(raw)?;
    if sought.is_empty() {
        return Ok((workbench.parse(raw.text(), path)?, Vec::new()));
    }
    let stand_in =
        |text: String, one: &UnknownNoise| with(&text, &one.key, &one.written(1.0)).unwrap_or(text);
    let text = sought.iter().fold(raw.text().to_owned(), stand_in);
    let told = workbench.parse(&text, path)?;
    progress.begin("noise of the recording", 0);
    // Where the model of one filter misses something of the motion, that counts as noise with it; one whose states have it leaves less.
    let mut best: Option<FilterNoiseEvidence> = None;
    let filters: Vec<String> = told
        .estimate
        .iter()
        .flat_map(|estimate| &estimate.filters)
        .filter(|filter| is_judged(filter.method))
        .map(|filter| filter.name.to_string())
        .collect();
    let mut refused = None;
    for filter in filters.iter().take(FILTERS) {
        let bench = with_recordings(TrialBench::of(workbench, &told, Some(filter))?)?;
        match FilterNoiseEvidence::of(workbench, bench, &sought, progress) {
            Ok(found) => {
                let is_better = best.as_ref().is_none_or(|best| {
                    found.innovations == best.innovations
                        && found.likeliest.log_likelihood > best.likeliest.log_likelihood
                });
                best = if is_better { Some(found) } else { best };
            }
            Err(DiagnoseError::Stops { filter }) => {
                refused = refused.or(Some(DiagnoseError::NoNoise { filter }));
            }
            Err(error) => return Err(error),
        }
    }
    let Some(FilterNoiseEvidence { filter, guesses, base_guesses, likeliest, rows, .. }) = best else {
        // Which filters there are to be, where there is none that tells it.
        return Err(match refused {
            Some(refused) => refused,
            None => TrialBench::of(workbench, &told, None)
                .err()
                .unwrap_or(DiagnoseError::NoNoise { filter: String::new() }),
        });
    };
    let (mut text, mut noises) = (raw.text().to_owned(), Vec::new());
    for (place, one) in sought.iter().enumerate() {
        let (at, sd) = (likeliest.at[place], likeliest.sd[place]);
        if sd.is_nan() || sd >= DETERMINED {
            let why = "the recording does not determine it: the innovations are as likely with another; state it, or find it from a \
                       recording without motion";
            return Err(raw.error(one.key.clone(), ConfigFault::Value { why: why.to_owned() }).into());
        }
        let number = guesses[place] * Scalar::exp(at);
        let value = one.rounded(number, sd);
        text = with(&text, &one.key, &value).unwrap_or(text);
        noises.push(FoundNoise {
            key: one.key.to_string(),
            written: value.as_str().map_or_else(|| value.to_string(), str::to_owned),
            interval: [-1.0, 1.0].map(|side| Scalar::exp(side * TWO_SIDED * sd)),
            of_neighbours: number / base_guesses[place],
            filter: filter.clone(),
            rows,
        });
    }
    Ok((workbench.parse(&text, path)?, noises))
}

/// Filters that are tried, one after the other.
const FILTERS: usize = 4;

/// What the innovations of one filter say of the noises.
struct FilterNoiseEvidence {
    filter: String,
    /// How many innovations there are.
    innovations: usize,
    /// By the differences of neighbouring samples, and where the search began.
    base_guesses: Vec<f64>,
    guesses: Vec<f64>,
    likeliest: MostLikelySizes,
    rows: usize,
}

impl FilterNoiseEvidence {
    fn of(
        workbench: &Workbench,
        mut bench: TrialBench,
        sought: &[UnknownNoise],
        progress: &dyn Progress,
    ) -> Result<Self, DiagnoseError> {
        let stop = bench.stop.clone();
        let progress = stop.watching(progress);
        let base_guesses: Vec<f64> =
            sought.iter().map(|one| one.guess(workbench, &bench)).collect::<Result<_, _>>()?;
        let stops = |bench: &TrialBench| DiagnoseError::Stops { filter: bench.filter_name.clone() };
        let (guesses, base) = run(&mut bench, sought, &base_guesses).ok_or_else(|| stops(&bench))?;
        let suspects: Vec<Suspect> =
            sought.iter().zip(&guesses).map(|(one, guess)| one.suspect(*guess)).collect();
        let likeliest = most_likely(&CauseSearch { bench: &bench, suspects: &suspects, base: &base });
        if progress.reached(0).is_break() {
            return Err(DiagnoseError::Interrupted);
        }
        Ok(Self {
            innovations: base.innovations.value.len(),
            base_guesses,
            guesses,
            likeliest: likeliest.ok_or_else(|| stops(&bench))?,
            rows: bench.extent().0,
            filter: bench.filter_name,
        })
    }
}

/// The text with another value at a key.
fn with(text: &str, key: &Key, value: &Value) -> Option<String> {
    changed(text, &Edit { key: key.to_string(), from: None, to: value.to_string(), sd: None })
}

/// A noise that is to be found.
struct UnknownNoise {
    key: Key,
    form: NoiseForm,
}

/// How a noise is written.
enum NoiseForm {
    /// The variance of a sample, in this unit.
    Variance(&'static str),
    /// The root of a density, one-sided, in this unit.
    Density(&'static str),
    /// The variance of a sample of a measurement of equations, in the square of this unit.
    Measurement(String),
}

/// The noises that an experiment leaves to its recording.
fn sought(raw: &Experiment) -> Result<Vec<UnknownNoise>, ConfigError> {
    let unread = |why: String| raw.error(Key::default(), ConfigFault::Value { why });
    let document: Table = raw.text().parse().map_err(|e: toml::de::Error| unread(e.to_string()))?;
    let name = raw.device_name();
    let Some(device) = document.get("device").and_then(|devices| devices.get(name)) else {
        return Ok(Vec::new());
    };
    let mut keys = Vec::new();
    places(device, &Key::from("device").child(name), &mut keys);
    if keys.len() > MOST_SIZES {
        let why = format!("these are {} noises; at most {MOST_SIZES} are found together", keys.len());
        return Err(raw.error(Key::from("device").child(name), ConfigFault::Value { why }));
    }
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
            return Ok(UnknownNoise { key, form });
        }
        let why = format!(
            "`{FROM_RECORDING}` is for the noise of a measurement: `noise_variance` or `noise_density` of a readout, or `noise` of \
             what equations measure"
        );
        Err(raw.error(key, ConfigFault::Value { why }))
    };
    keys.into_iter().map(one).collect()
}

fn step_name(step: &KeyStep) -> Option<&str> {
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

impl UnknownNoise {
    /// What stands in the file for a number: a variance, or the root of a density.
    fn written(&self, number: f64) -> Value {
        match &self.form {
            NoiseForm::Variance(unit) | NoiseForm::Density(unit) => {
                Value::String(format!("{number:e} {unit}"))
            }
            NoiseForm::Measurement(unit) => Value::String(square(number, unit)),
        }
    }

    /// The same with the digits that a relative standard error leaves.
    fn rounded(&self, number: f64, sd: f64) -> Value {
        match &self.form {
            NoiseForm::Variance(_) | NoiseForm::Density(_) => rounded(&self.written(number), Some(sd)),
            NoiseForm::Measurement(unit) => {
                Value::String(format!("({} [{unit}])^2", digits(number.sqrt(), DIGITS)))
            }
        }
    }

    /// A first guess of the number, by the differences of neighbouring samples.
    fn guess(&self, workbench: &Workbench, bench: &TrialBench) -> Result<f64, DiagnoseError> {
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
        })
    }

    /// What a search changes.
    fn suspect(&self, guess: f64) -> Suspect {
        let what = match &self.form {
            NoiseForm::Variance(unit) | NoiseForm::Density(unit) => NumberRole::Factor(vec![WrittenNumber {
                key: self.key.clone(),
                written: guess,
                unit: (*unit).to_owned(),
            }]),
            NoiseForm::Measurement(unit) => {
                NumberRole::Noise { key: self.key.clone(), variance: guess, unit: unit.clone() }
            }
        };
        Suspect { what, sizes: vec![0.1, FARTHEST, -FARTHEST] }
    }
}

/// A variance in the square of a unit, as equations write it.
pub(super) fn square(variance: f64, unit: &str) -> String {
    format!("({:e} [{unit}])^2", variance.sqrt())
}

/// Puts guesses into the bench, larger or smaller ones where the filter cannot be run with them, and runs it.
fn run(
    bench: &mut TrialBench,
    sought: &[UnknownNoise],
    guesses: &[f64],
) -> Option<(Vec<f64>, DiagnosisTrial)> {
    for factor in OTHER_GUESSES {
        let guesses: Vec<f64> = guesses.iter().map(|guess| guess * factor).collect();
        for (one, guess) in sought.iter().zip(&guesses) {
            put(&mut bench.document, &one.key, one.written(*guess)).ok()?;
        }
        if let Some(trial) = bench.run(&[]) {
            return Some((guesses, trial));
        }
    }
    None
}

fn most_likely(search: &CauseSearch) -> Option<MostLikelySizes> {
    let from = |sizes: &[f64]| {
        let cause = Cause::Numbers(sizes.iter().copied().enumerate().collect());
        search.most_likely(&cause, TrialBlocks::All)
    };
    let mut best = from(&vec![0.0; search.suspects.len()])?;
    for _ in 1..SEARCHES {
        let Some(next) = from(&best.at) else { break };
        let gained = next.log_likelihood - best.log_likelihood;
        best = next;
        if gained < NO_GAIN {
            break;
        }
    }
    Some(best)
}

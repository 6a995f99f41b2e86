//! Noises of a readout and of a process that an experiment leaves to its recording.

mod evidence;
mod meaning;
mod powers_of_ten;
mod unknown;
mod unstated;

pub(in crate::diagnose) use unknown::square;

use super::DiagnoseError;
use super::bench::{TestedRows, TrialBench, is_judged};
use crate::config::{ConfigFault, Experiment};
use crate::progress::Progress;
use crate::recording::SampledRecording;
use crate::rigs::Workbench;
use evidence::FilterNoiseEvidence;
use serde::Serialize;
use std::path::Path;
use unknown::{UnknownNoise, leaves_walks_open, not_too_many, of_process, of_readout, spelled_out, with};
use unstated::with_unstated_left_open;

/// Rows after the settling times that are looked at, in all.
const ROWS: TestedRows = TestedRows(200_000);

/// Filters that are tried, one after the other.
const FILTERS: usize = 4;

/// A noise that was found from the recording.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FoundNoise {
    /// Its key in the experiment file.
    pub key: String,
    /// What the experiment has in its place.
    pub written: String,
    /// Its 95 % interval as factors of it. From 0 to 1 of a density of process noise that the recording does not show: what is written is the
    /// upper limit.
    pub interval: [f64; 2],
    /// How many times as large it is as what the differences of neighbouring samples say, in the unit in which it is written: about 1 where
    /// the filter follows the signal, less where the motion is fast, and more where the filter's model misses something. Of a noise of the readout alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub of_neighbours: Option<f64>,
    /// The filter whose innovations are the likeliest.
    pub filter: String,
    /// The rows that told it.
    pub rows: usize,
    /// Of a density of process noise what it means: how far its state wanders.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub meaning: Option<String>,
}

/// Reads an experiment file, and finds each noise of its readout that it does not state or leaves to the recording (`noise_variance = "from_recording"`),
/// and each density of process noise that it leaves to the recording.
///
/// A noise is what makes the innovations of a filter the likeliest, of the first four that have white innovations when they are right that
/// under which they are the likeliest: ln p is maximised over the logarithm of its factor by Fisher's scoring ([`fit::most_likely`](crate::fit::most_likely)), from a first guess by
/// the differences of neighbouring samples. Where the motion is foreseen well the variance of n samples is then known to √(2/n). What
/// a filter's model misses counts as noise with it, and a process noise that is stated is taken as it is.
///
/// A density of process noise is sought together with the noises of the readout, from the likeliest power of ten on. Its interval is that
/// of the profile of the likelihood. One that the recording does not show gets the upper end of its interval.
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
pub(crate) fn leaves_noise_open(
    workbench: &Workbench,
    raw: &Experiment,
) -> Result<bool, crate::config::ConfigError> {
    let raw = with_unstated_left_open(workbench, raw)?;
    Ok(leaves_walks_open(&raw) || !of_readout(&raw)?.is_empty())
}

/// Finds the noises with what this makes of a bench.
fn found(
    workbench: &Workbench,
    raw: &Experiment,
    with_recordings: &dyn Fn(TrialBench) -> Result<TrialBench, DiagnoseError>,
    progress: &dyn Progress,
) -> Result<(Experiment, Vec<FoundNoise>), DiagnoseError> {
    let raw = &with_unstated_left_open(workbench, raw)?;
    let path = raw.path();
    let mut sought = of_readout(raw)?;
    let mut text = raw.text().to_owned();
    if leaves_walks_open(raw) {
        // Which densities there are is known once the device is.
        let device = workbench.parse(&with_stand_ins(&text, &sought), path)?;
        let known = workbench.rig(&device)?.densities(&device);
        text = spelled_out(raw, &known);
        sought.extend(of_process(raw, &known));
    }
    if sought.is_empty() {
        return Ok((workbench.parse(raw.text(), path)?, Vec::new()));
    }
    let told = workbench.parse(&with_stand_ins(&text, &sought), path)?;
    progress.begin("noise of the recording", 0);
    let mut evidence: Vec<(usize, FilterNoiseEvidence)> = Vec::new();
    let (mut refused, mut tried) = (None, 0);
    for (place, filter) in told.estimate.iter().flat_map(|estimate| &estimate.filters).enumerate() {
        let here: Vec<UnknownNoise> = sought
            .iter()
            .filter(|one| {
                one.owner.map_or_else(
                    || one.walk().is_none() || filter.process_noise.is_empty(),
                    |own| own == place,
                )
            })
            .cloned()
            .collect();
        let has_own = here.iter().any(|one| one.owner.is_some());
        if !is_judged(filter.method) || here.is_empty() || (tried >= FILTERS && !has_own) {
            continue;
        }
        tried += 1;
        not_too_many(raw, &here)?;
        let bench = with_recordings(TrialBench::of(workbench, &told, Some(filter.name.as_str()))?)?;
        match FilterNoiseEvidence::of(workbench, bench, here, progress) {
            Ok(found) => evidence.push((place, found)),
            Err(DiagnoseError::Stops { filter }) => {
                refused = refused.or(Some(DiagnoseError::NoNoise { filter }));
            }
            Err(error) => return Err(error),
        }
    }
    let mut noises = Vec::new();
    for one in &sought {
        let Some((found, place)) = telling(&evidence, &sought, one) else {
            // Which filters there are to be, where there is none that tells it.
            return Err(match refused {
                Some(refused) => refused,
                None => no_filter(workbench, raw, &told, one),
            });
        };
        let (value, noise) = found.noise(raw, place)?;
        text = with(&text, &one.key, &value).unwrap_or(text);
        noises.push(noise);
    }
    Ok((workbench.parse(&text, path)?, noises))
}

/// The text with a number at each key that is left to the recording.
fn with_stand_ins(text: &str, sought: &[UnknownNoise]) -> String {
    let stand_in =
        |text: String, one: &UnknownNoise| with(&text, &one.key, &one.written(1.0)).unwrap_or(text);
    sought.iter().fold(text.to_owned(), stand_in)
}

/// The filter that tells a noise, and the place of the noise in what it tells: the one whose own it is, or else that with the likeliest
/// innovations of those that tell all that filters share.
///
/// Where the model of one filter misses something of the motion, that counts as noise with it; one whose states have it leaves less.
fn telling<'a>(
    evidence: &'a [(usize, FilterNoiseEvidence)],
    sought: &[UnknownNoise],
    one: &UnknownNoise,
) -> Option<(&'a FilterNoiseEvidence, usize)> {
    let place_in = |found: &FilterNoiseEvidence, one: &UnknownNoise| {
        found.sought.iter().position(|other| other.key == one.key)
    };
    let tells_all = |found: &FilterNoiseEvidence| {
        sought.iter().filter(|one| one.owner.is_none()).all(|one| place_in(found, one).is_some())
    };
    let mut best: Option<&FilterNoiseEvidence> = None;
    for (filter, found) in evidence {
        let may = one.owner.map_or_else(|| tells_all(found), |owner| owner == *filter);
        let is_better =
            best.is_none_or(|best| found.innovations == best.innovations && found.density > best.density);
        if may && is_better {
            best = Some(found);
        }
    }
    best.and_then(|found| Some((found, place_in(found, one)?)))
}

/// Why no filter tells a noise.
fn no_filter(
    workbench: &Workbench,
    raw: &Experiment,
    told: &Experiment,
    one: &UnknownNoise,
) -> DiagnoseError {
    if let Err(error) = TrialBench::of(workbench, told, None) {
        return error;
    }
    let why = "no filter that uses it has innovations that are white when it is right, so that no likelihood tells it; state it, or leave \
               it to the recording in `[estimate.process_noise]` with a filter such as `ekf` that uses that";
    raw.error(one.key.clone(), ConfigFault::Value { why: why.to_owned() }).into()
}

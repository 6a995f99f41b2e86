//! The work on one recording.

use super::journal::BatchPiece;
use super::{BatchContent, BatchError, BatchRecording};
use crate::array_experiment::{ArrayExperiment, PreparedExperiment};
use crate::config::Experiment;
use crate::diagnose::{DiagnoseError, FoundNoise};
use crate::journal::digest_of;
use crate::progress::Progress;
use crate::results::{Metrics, PooledMetrics, TrajectoryFile, number_check};
use crate::rigs::Workbench;
use crate::rows::rows;
use crate::sealed_line::hex;
use crate::workflow::{self, PartOutcome, PartsError, WorkflowError};
use serde_json::Value;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// Why a recording is not finished.
pub(super) enum Broken {
    /// The work was stopped.
    Stopped,
    /// It cannot be estimated; in words, on one line.
    Recording(String),
    /// What came of it cannot be kept.
    Results(BatchError),
}

impl From<DiagnoseError> for Broken {
    fn from(error: DiagnoseError) -> Self {
        if error.is_interruption() { Self::Stopped } else { Self::Recording(on_one_line(&error)) }
    }
}

impl From<WorkflowError> for Broken {
    fn from(error: WorkflowError) -> Self {
        if error.is_interruption() { Self::Stopped } else { Self::Recording(on_one_line(&error)) }
    }
}

pub(super) fn on_one_line(error: &dyn std::fmt::Display) -> String {
    error.to_string().replace('\n', " ")
}

/// The name of a file that is not finished begins so.
pub(super) const BEGUN: &str = ".kalmems-";

/// The file of a recording's trajectories before all results are complete.
pub(super) fn unfinished_file(folder: &Path, key: &str) -> PathBuf {
    folder.join(format!("{key}.parquet"))
}

/// The experiment with a recording instead of that which it names.
pub(super) fn with_recording(
    mut given: ArrayExperiment,
    of: Option<&str>,
    recording: &BatchRecording,
    reference: Option<&Path>,
) -> Result<ArrayExperiment, DiagnoseError> {
    match &recording.content {
        BatchContent::File(file) => given.file(of, file, reference)?,
        BatchContent::Arrays(arrays) => {
            given.alone(of)?;
            given.recording(of, arrays)?;
        }
    }
    Ok(given)
}

/// Estimates a recording and keeps its trajectories in a folder.
pub(super) fn finish(
    (workbench, given): (&Workbench, ArrayExperiment),
    key: &str,
    folder: &Path,
    progress: &dyn Progress,
) -> Result<BatchPiece, Broken> {
    let PreparedExperiment { workbench, experiment, noise } = given.prepare(workbench, progress)?;
    let path = unfinished_file(folder, key);
    let failed = |source: io::Error| Broken::Results(BatchError::Io { path: path.clone(), source });
    // Beside its place first, so that there is never half of it.
    let staged = tempfile::Builder::new().prefix(BEGUN).suffix(".parquet").tempfile_in(folder);
    let mut staged = staged.map_err(failed)?;
    let file = BufWriter::new(staged.as_file_mut().try_clone().map_err(failed)?);
    let estimated = estimate(&workbench, (&experiment, noise), file, progress);
    let metrics = estimated.map_err(|error| match error {
        PartsError::Work(error) => error.into(),
        PartsError::Taken(source) => failed(source),
    })?;
    staged.as_file().sync_all().map_err(failed)?;
    staged.persist(&path).map_err(|error| failed(error.error))?;
    let trajectories = digest_of(&path, &|| progress.reached(0).is_break()).map_err(failed)?;
    let Some(trajectories) = trajectories else { return Err(Broken::Stopped) };
    let segments = || metrics.recordings.iter().flat_map(|recording| &recording.segments);
    let mut rows = rows(&metrics);
    let estimators = segments().flat_map(|segment| {
        let trusted = segment.best_key();
        segment.estimators.iter().map(move |one| Some(one.key.as_str()) == trusted)
    });
    let findings: usize = metrics.recordings.iter().map(|recording| recording.diagnosis.len()).sum();
    for (row, is_trusted) in rows.iter_mut().zip(estimators) {
        // It is that of the batch.
        row.shift_remove("recording");
        row.insert("trusted".to_owned(), Value::String(if is_trusted { "yes" } else { "" }.to_owned()));
        row.insert("findings".to_owned(), Value::String(findings.to_string()));
    }
    let doubtful = segments().any(|segment| {
        let trusted = segment.best_key();
        segment.estimators.iter().any(|one| Some(one.key.as_str()) == trusted && !one.passes())
    });
    Ok(BatchPiece { key: key.to_owned(), trajectories: hex(&trajectories), doubtful, rows })
}

/// Estimates the one recording of an experiment, of any length, and writes its trajectories; its figures.
fn estimate<W: Write + Send>(
    workbench: &Workbench,
    (experiment, noise): (&Experiment, Vec<FoundNoise>),
    to: W,
    progress: &dyn Progress,
) -> Result<Metrics, PartsError<io::Error>> {
    let mut to = Some(to);
    let mut file: Option<TrajectoryFile<W>> = None;
    if !workflow::is_long(workbench, experiment)? {
        let outcome = workflow::estimate(workbench, experiment, progress)?;
        for recording in &outcome.recordings {
            add(&mut file, &mut to, recording).map_err(PartsError::Taken)?;
        }
        finished(file).map_err(PartsError::Taken)?;
        let metrics = Metrics::of(&outcome);
        let numbers = number_check(workbench, experiment, &metrics.without_findings(), progress)?;
        return Ok(metrics.with_numbers(numbers).with_noise(noise));
    }
    let mut pooled = PooledMetrics::default();
    let whole = workflow::estimate_in_parts(workbench, experiment, progress, &mut |part: PartOutcome| {
        pooled.take(&part);
        add(&mut file, &mut to, &part.outcome)
    })?;
    finished(file).map_err(PartsError::Taken)?;
    let rig = workbench.rig(experiment)?;
    let numbers = number_check(workbench, experiment, &pooled.without_findings(), progress)?;
    Ok(pooled.finish((rig, experiment), &whole, (numbers, noise)))
}

/// Writes trajectories into a file, which the first of them begin.
fn add<W: Write + Send>(
    file: &mut Option<TrajectoryFile<W>>,
    to: &mut Option<W>,
    outcome: &workflow::RecordingOutcome,
) -> io::Result<()> {
    if let (None, Some(to)) = (&file, to.take()) {
        *file = Some(TrajectoryFile::begin(to, outcome)?);
    }
    file.as_mut().map_or(Ok(()), |file| file.add(outcome))
}

fn finished<W: Write + Send>(file: Option<TrajectoryFile<W>>) -> io::Result<()> {
    file.map_or(Ok(()), |file| file.finish()?.flush())
}

/// What tells a recording from others by its samples alone, or with those of its reference; `None` where the work was stopped.
pub(super) fn digest_of_content(
    content: &BatchContent,
    reference: Option<&Path>,
    stop: &dyn Fn() -> bool,
) -> Option<Result<(String, String), String>> {
    let of_file = |path: &Path| match digest_of(path, stop) {
        Ok(digest) => digest.map(|digest| Ok(hex(&digest))),
        Err(error) => Some(Err(format!("cannot read {}: {error}", path.display()))),
    };
    let (sha256, beside) = match content {
        BatchContent::File(file) => match of_file(file)? {
            Ok(sha256) => (sha256, String::new()),
            Err(why) => return Some(Err(why)),
        },
        BatchContent::Arrays(given) => {
            let beside = format!("{:?} {:?} {:?}", given.units, given.segments, given.clock);
            (given.arrays.digest().sha256.clone(), beside)
        }
    };
    let reference = match reference.map(of_file) {
        None => String::new(),
        Some(Some(Ok(sha256))) => sha256,
        // Who reads it says that it is not there.
        Some(Some(Err(_))) => "none".to_owned(),
        Some(None) => return None,
    };
    Some(Ok((sha256.clone(), [sha256, beside, reference].join("\n"))))
}

/// Removes the trajectories of recordings that are part of the results now, and what a run that was killed had begun; the folder, where nothing
/// else is in it.
pub(super) fn clear<'a>(folder: &Path, keys: impl Iterator<Item = &'a String>) -> io::Result<()> {
    for key in keys {
        match std::fs::remove_file(unfinished_file(folder, key)) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
            _ => {}
        }
    }
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        if path.file_name().is_some_and(|name| name.to_string_lossy().starts_with(BEGUN)) {
            std::fs::remove_file(path)?;
        }
    }
    // Somebody's own file keeps it.
    let _ = std::fs::remove_dir(folder);
    Ok(())
}

/// Whether a file is there with this SHA-256.
pub(super) fn is_there(path: &Path, sha256: &str) -> bool {
    File::open(path).is_ok()
        && digest_of(path, &|| false).is_ok_and(|found| found.is_some_and(|found| hex(&found) == sha256))
}

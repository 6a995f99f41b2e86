//! Studies: an experiment again and again, in parts that run anywhere.

use crate::errors::{Raise, failed};
use crate::watch::Watch;
use kalmems::results::Output;
use kalmems::rigs::published;
use kalmems::study::{Shard, StudyError, StudyOptions, StudyPlan};
use pyo3::exceptions::{PyKeyboardInterrupt, PyValueError};
use pyo3::prelude::*;
use std::num::NonZero;
use std::path::{Path, PathBuf};

/// A study's text and its experiment's, with where that stands.
type Texts = (String, String, PathBuf);

fn plan(py: Python<'_>, (study, experiment, path): &Texts) -> PyResult<StudyPlan> {
    StudyPlan::of_texts(published(), (study, Path::new("study.toml")), (experiment, path))
        .map_err(|error| raised(py, error, None))
}

fn raised(py: Python<'_>, error: StudyError, watch: Option<&Watch>) -> PyErr {
    if let Some(error) = watch.and_then(Watch::error) {
        return error;
    }
    match error {
        StudyError::Config(error) => error.raise(py),
        StudyError::Interrupted { .. } => PyKeyboardInterrupt::new_err(error.to_string()),
        error => failed(py, &error),
    }
}

/// Refuses a study that is wrong; its name, its points and its runs.
#[pyfunction]
pub fn study_check(py: Python<'_>, texts: Texts) -> PyResult<(String, u64, u64)> {
    let plan = plan(py, &texts)?;
    Ok((plan.name().to_owned(), plan.points(), plan.runs()))
}

/// Runs a part of a study that its journal does not have yet; the journal, which stands beside the folder of the results.
#[pyfunction]
#[pyo3(signature = (texts, folder, part, of, threads=None, progress=None))]
pub fn study_run(
    py: Python<'_>,
    texts: Texts,
    folder: PathBuf,
    part: u64,
    of: u64,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<PathBuf> {
    let plan = plan(py, &texts)?;
    let Some(shard) = Shard::new(part, of) else {
        return Err(PyValueError::new_err(format!("there is no part {part} of {of}")));
    };
    let watch = Watch::new(progress);
    let options = StudyOptions { shard, threads: threads.and_then(NonZero::new), force: false };
    let progressed = py.detach(|| plan.run_all(&folder, options, &watch));
    progressed.map(|progressed| progressed.journal).map_err(|error| raised(py, error, Some(&watch)))
}

/// Joins journals and writes the results into a folder: the summary as JSON, as text, and the folder.
#[pyfunction]
pub fn study_merge(
    py: Python<'_>,
    texts: Texts,
    journals: Vec<PathBuf>,
    folder: PathBuf,
    force: bool,
) -> PyResult<(String, String, PathBuf)> {
    let plan = plan(py, &texts)?;
    let merged = py.detach(|| {
        let output = Output::begin(&folder, &plan.work().forced(force))?;
        let summary = plan.write_results(&journals, &output)?;
        let target = output.target().to_owned();
        output.commit()?;
        Ok((summary, target))
    });
    let (summary, target) = merged.map_err(|error| raised(py, error, None))?;
    let json = serde_json::to_string(&summary).map_err(|error| failed(py, &error))?;
    Ok((json, summary.to_string(), target))
}

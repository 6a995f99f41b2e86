//! Studies: an experiment again and again, in parts that run anywhere.

use crate::errors::{Raise, failed};
use crate::figures::as_json;
use crate::watch::done;
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
        .map_err(|error| raised(py, error))
}

fn raised(py: Python<'_>, error: StudyError) -> PyErr {
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
#[pyo3(signature = (texts, folder, part, of, threads=None, progress: "_Progress" = None))]
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
    let options = StudyOptions { shard, threads: threads.and_then(NonZero::new), force: false };
    let progressed = done(py, progress, move |watch| plan.run_all(&folder, options, watch))?;
    progressed.map(|progressed| progressed.journal).map_err(|error| raised(py, error))
}

/// Joins journals and writes the results into a folder: the summary as JSON, as text, the pictures of the report as data, and the folder.
#[pyfunction]
pub fn study_merge(
    py: Python<'_>,
    texts: Texts,
    journals: Vec<PathBuf>,
    folder: PathBuf,
    force: bool,
) -> PyResult<(String, String, String, PathBuf)> {
    let plan = plan(py, &texts)?;
    let merged = done(py, None, move |watch| {
        let output = Output::begin(&folder, &plan.work().forced(force))?;
        let summary = plan.write_results(&journals, &output)?;
        let target = output.target().to_owned();
        if !watch.is_stopped() {
            output.commit()?;
        }
        Ok((summary, target))
    })?;
    let (summary, target) = merged.map_err(|error| raised(py, error))?;
    let json = serde_json::to_string(&summary).map_err(|error| failed(py, &error))?;
    Ok((json, summary.to_string(), as_json(&summary.figures), target))
}

//! Many recordings by one experiment.

use crate::document::without_lines;
use crate::errors::{Raise, failed};
use crate::recording::Columns;
use crate::watch::done;
use kalmems::batch::{Batch, BatchContent, BatchError, BatchOptions, BatchRecording};
use kalmems::rigs::published;
use pyo3::exceptions::{PyKeyboardInterrupt, PyValueError};
use pyo3::prelude::*;
use std::num::NonZero;
use std::path::PathBuf;

/// A recording: its name, and its file or its columns.
type Given = (String, Option<PathBuf>, Option<Py<Columns>>);

fn raised(py: Python<'_>, error: BatchError, has_lines: bool) -> PyErr {
    match error {
        BatchError::Config(error) => without_lines(error, has_lines).raise(py),
        BatchError::Interrupted { .. } => PyKeyboardInterrupt::new_err(error.to_string()),
        BatchError::NoFile { .. } | BatchError::Pattern { .. } | BatchError::Name { .. } => {
            PyValueError::new_err(error.to_string())
        }
        error => failed(py, &error),
    }
}

/// The files that paths and patterns name, each by the name that it has in a batch.
#[pyfunction]
pub fn batch_files(py: Python<'_>, patterns: Vec<String>) -> PyResult<Vec<(String, PathBuf)>> {
    let found = BatchRecording::of_files(patterns.iter().map(String::as_str));
    let found = found.map_err(|error| raised(py, error, true))?;
    let file = |one: BatchRecording| match one.content {
        BatchContent::File(file) => Some((one.name, file)),
        BatchContent::Arrays(_) => None,
    };
    Ok(found.into_iter().filter_map(file).collect())
}

/// Estimates recordings and writes the results into a folder: the summary as JSON and as text, how many were estimated now and how many
/// before, and whether a reference was left out.
#[pyfunction]
#[pyo3(signature = (text, path, has_lines, recordings, folder, of=None, reference=None, threads=None, force=false, progress: "_Progress" = None))]
#[allow(clippy::too_many_arguments)] // named in Python
pub fn estimate_many(
    py: Python<'_>,
    text: String,
    path: PathBuf,
    has_lines: bool,
    recordings: Vec<Given>,
    folder: PathBuf,
    of: Option<String>,
    reference: Option<String>,
    threads: Option<usize>,
    force: bool,
    progress: Option<Py<PyAny>>,
) -> PyResult<(String, String, usize, usize, bool)> {
    let batch = Batch::parse(published(), &text, &path, of.as_deref());
    let batch = batch.map_err(|error| raised(py, error, has_lines))?;
    let batch = match reference {
        Some(files) => batch.with_references(&files),
        None => batch,
    };
    let one = |(name, file, columns): Given| {
        let content = match (file, columns) {
            (Some(file), None) => Ok(BatchContent::File(file)),
            (None, Some(columns)) => Ok(BatchContent::Arrays(Box::new(columns.get().given().clone()))),
            _ => Err(PyValueError::new_err(format!("`{name}` is neither a file nor arrays"))),
        };
        content.map(|content| BatchRecording { name, content })
    };
    let recordings = recordings.into_iter().map(one).collect::<PyResult<Vec<BatchRecording>>>()?;
    let options = BatchOptions { threads: threads.and_then(NonZero::new), force };
    let without = batch.leaves_reference_out();
    let outcome = done(py, progress, move |watch| batch.run(&recordings, &folder, options, watch))?;
    let outcome = outcome.map_err(|error| raised(py, error, has_lines))?;
    let json = serde_json::to_string(&outcome.summary).map_err(|error| failed(py, &error))?;
    Ok((json, outcome.summary.to_string(), outcome.estimated, outcome.before, without))
}

//! What recordings tell of a device: its parameters, and what of an experiment is wrong.

use crate::errors::{Raise, failed};
use crate::estimate::{Recordings, ready};
use crate::watch::done;
use kalmems::diagnose::{
    CauseReport, DiagnoseError, DiagnosisEffort, diagnose_with, identify as identified, pasted,
};
use kalmems::results::IdentificationSummary;
use pyo3::prelude::*;
use std::path::PathBuf;

/// Identifies parameters: what was found as JSON, as text, and the experiment with it.
#[pyfunction]
#[pyo3(signature = (text, path, has_lines, recordings, references, progress: "_Progress" = None))]
pub fn identify(
    py: Python<'_>,
    text: String,
    path: PathBuf,
    has_lines: bool,
    recordings: Recordings,
    references: Recordings,
    progress: Option<Py<PyAny>>,
) -> PyResult<(String, String, String)> {
    let found = done(py, progress, move |watch| {
        let ready = ready(&text, &path, (&recordings, &references), has_lines, watch)
            .map_err(|error| Box::new(error) as Box<dyn Raise + Send>)?;
        identified(&ready.workbench, &ready.experiment, watch)
            .map_err(|error| Box::new(error) as Box<dyn Raise + Send>)
    })?;
    let found = found.map_err(|error| error.raise(py))?;
    let summary = IdentificationSummary::of(&found);
    let json = serde_json::to_string(&summary).map_err(|error| failed(py, &error))?;
    let experiment = found.experiment.to_toml().map_err(|error| failed(py, &error))?;
    Ok((json, summary.to_text(), experiment))
}

/// As JSON and as text, the corrected experiment where one cause is chosen, and that by each cause.
type FoundCauses = (String, String, Option<String>, Vec<Option<String>>);

/// Finds what of an experiment is wrong: what was found as JSON, as text, the experiment with the cause corrected where there is one to choose, and with
/// each of the causes that it can state.
#[pyfunction]
#[pyo3(signature = (text, path, has_lines, recordings, filter=None, thorough=false, progress: "_Progress" = None))]
#[allow(clippy::too_many_arguments)] // named in Python
pub fn diagnose(
    py: Python<'_>,
    text: String,
    path: PathBuf,
    has_lines: bool,
    recordings: Recordings,
    filter: Option<String>,
    thorough: bool,
    progress: Option<Py<PyAny>>,
) -> PyResult<FoundCauses> {
    let found = done(py, progress, move |watch| {
        let ready = ready(&text, &path, (&recordings, &Vec::new()), has_lines, watch)?;
        let effort = if thorough { DiagnosisEffort::Thorough } else { DiagnosisEffort::Usual };
        let found = diagnose_with(&ready.workbench, &ready.experiment, (filter.as_deref(), effort), watch)?;
        Ok::<_, DiagnoseError>((ready.experiment, found))
    })?;
    let (experiment, found) = found.map_err(|error| error.raise(py))?;
    let json = serde_json::to_string(&found).map_err(|error| failed(py, &error))?;
    let corrected = |cause: &CauseReport| pasted(&experiment, cause).filter(|_| !cause.edits.is_empty());
    let chosen = found.chosen(None).and_then(corrected);
    let each = found.causes.iter().map(corrected).collect();
    Ok((json, found.to_text(), chosen, each))
}

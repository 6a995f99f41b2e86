//! Recordings that are computed.

use crate::document::without_lines;
use crate::errors::{Raise, failed};
use crate::watch::done;
use kalmems::rigs::published;
use kalmems::simulate::{ComputedRecording, SimulateError, described};
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;

/// What would be recorded and what is true, as columns, and the experiment of it.
type Simulated<'py> = (Bound<'py, PyDict>, Bound<'py, PyDict>, String);

/// Simulates the recording that an experiment describes.
#[pyfunction]
#[pyo3(signature = (text, path, has_lines, progress: "_Progress" = None) -> "tuple[dict[str, _Numbers], dict[str, _Numbers], str]")]
pub fn simulate(
    py: Python<'_>,
    text: String,
    path: PathBuf,
    has_lines: bool,
    progress: Option<Py<PyAny>>,
) -> PyResult<Simulated<'_>> {
    let found = done(py, progress, move |watch| {
        let experiment = published()
            .parse(&text, &path)
            .map_err(|error| SimulateError::from(without_lines(error, has_lines)))?;
        let simulation = published().rig(&experiment)?.simulate(&experiment)?;
        let samples = ComputedRecording::of(simulation.as_ref(), watch)?;
        Ok::<_, SimulateError>((samples, described(&experiment, simulation.as_ref())))
    })?;
    let (samples, experiment) = found.map_err(|error| error.raise(py))?;
    let columns = |columns: Vec<(&'static str, Vec<f64>)>| {
        let all = PyDict::new(py);
        for (name, values) in columns {
            all.set_item(name, PyArray1::from_vec(py, values))?;
        }
        Ok::<_, PyErr>(all)
    };
    let toml = experiment.to_toml().map_err(|error| failed(py, &error))?;
    Ok((columns(samples.recorded_columns())?, columns(samples.true_columns())?, toml))
}

//! Errors as exceptions of the package, with what they are about as data.

use kalmems::config::ConfigError;
use kalmems::diagnose::DiagnoseError;
use kalmems::estimate::EstimateError;
use kalmems::evaluate::ReferenceError;
use kalmems::identify::IdentifyError;
use kalmems::recording::{Finding, ReadError};
use kalmems::simulate::SimulateError;
use kalmems::workflow::WorkflowError;
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use serde_json::Value;

/// The exception of this class of the package, of these arguments.
fn raised<'py>(
    py: Python<'py>,
    class: &str,
    arguments: impl IntoPyObject<'py, Target = PyTuple, Output = Bound<'py, PyTuple>, Error = PyErr>,
) -> PyErr {
    let made = py.import("kalmems._errors").and_then(|module| module.getattr(class)).and_then(|class| {
        let arguments = arguments.into_pyobject(py)?;
        class.call1(arguments)
    });
    made.map_or_else(|error| error, PyErr::from_value)
}

/// A thing that stopped long work, as an exception.
pub trait Raise {
    /// The exception.
    fn raise(&self, py: Python<'_>) -> PyErr;
}

impl Raise for ConfigError {
    fn raise(&self, py: Python<'_>) -> PyErr {
        let position = self.place.position.map(|position| (position.line, position.column));
        let (line, column) = position.unzip();
        let (file, key) = (self.place.file.display().to_string(), self.place.key.to_string());
        raised(py, "ExperimentError", (self.to_string(), file, key, line, column))
    }
}

impl Raise for ReadError {
    fn raise(&self, py: Python<'_>) -> PyErr {
        match self {
            Self::Interrupted { .. } => PyKeyboardInterrupt::new_err(()),
            Self::Unusable { file, findings } => match each(py, findings) {
                Ok(findings) => raised(py, "RecordingError", (self.to_string(), file, findings)),
                Err(error) => error,
            },
            Self::Io { file, .. }
            | Self::Format { file, .. }
            | Self::Clock { file, .. }
            | Self::NoColumn { file, .. }
            | Self::Kind { file, .. } => {
                raised(py, "RecordingError", (self.to_string(), file, Vec::<Py<PyAny>>::new()))
            }
        }
    }
}

impl Raise for EstimateError {
    fn raise(&self, py: Python<'_>) -> PyErr {
        match self {
            Self::Config(error) => error.raise(py),
            Self::Read(error) => error.raise(py),
            Self::Interrupted => PyKeyboardInterrupt::new_err(()),
            error => failed(py, error),
        }
    }
}

impl Raise for ReferenceError {
    fn raise(&self, py: Python<'_>) -> PyErr {
        match self {
            Self::Config(error) => error.raise(py),
            Self::Read(error) => error.raise(py),
        }
    }
}

impl Raise for WorkflowError {
    fn raise(&self, py: Python<'_>) -> PyErr {
        match self {
            Self::Config(error) => error.raise(py),
            Self::Read(error) => error.raise(py),
            Self::Estimate(error) => error.raise(py),
            Self::Reference(error) => error.raise(py),
        }
    }
}

impl Raise for DiagnoseError {
    fn raise(&self, py: Python<'_>) -> PyErr {
        match self {
            Self::Config(error) => error.raise(py),
            Self::Read(error) => error.raise(py),
            Self::Interrupted => PyKeyboardInterrupt::new_err(()),
            error @ (Self::Stops { .. } | Self::NoNoise { .. }) => failed(py, error),
        }
    }
}

impl Raise for IdentifyError {
    fn raise(&self, py: Python<'_>) -> PyErr {
        match self {
            Self::Config(error) => error.raise(py),
            Self::Read(error) => error.raise(py),
            Self::Reference(error) => error.raise(py),
            Self::Interrupted => PyKeyboardInterrupt::new_err(()),
            error => failed(py, error),
        }
    }
}

impl Raise for SimulateError {
    fn raise(&self, py: Python<'_>) -> PyErr {
        match self {
            Self::Config(error) => error.raise(py),
            Self::Read(error) => error.raise(py),
            Self::Interrupted => PyKeyboardInterrupt::new_err(()),
            error => failed(py, error),
        }
    }
}

/// Work that could not be done with an experiment and recordings that were read.
pub fn failed(py: Python<'_>, error: &dyn std::fmt::Display) -> PyErr {
    raised(py, "EstimationError", (error.to_string(),))
}

/// Findings as the package has them.
fn each(py: Python<'_>, findings: &[Finding]) -> PyResult<Vec<Py<PyAny>>> {
    let class = py.import("kalmems._errors")?.getattr("Finding")?;
    let of = |finding: &Finding| {
        let fields = PyDict::new(py);
        let words = |value: Result<Value, serde_json::Error>| {
            value.ok().and_then(|value| value.as_str().map(str::to_owned)).unwrap_or_default()
        };
        fields.set_item("kind", words(serde_json::to_value(finding.kind)))?;
        fields.set_item("severity", words(serde_json::to_value(finding.severity())))?;
        fields.set_item("message", finding.to_string())?;
        fields.set_item("column", finding.column.clone())?;
        fields.set_item("segment", finding.segment.clone())?;
        fields.set_item("first", finding.first_row)?;
        fields.set_item("count", finding.count)?;
        Ok(class.call((), Some(&fields))?.unbind())
    };
    findings.iter().map(of).collect()
}

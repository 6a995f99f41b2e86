//! Experiments as text, as dictionaries, and changed.

use crate::errors::Raise;
use kalmems::config::{ConfigError, ConfigFault, ConfigPlace, Experiment, FROM_RECORDING, Key, KeyStep, put};
use kalmems::rigs::published;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyList, PyString};
use std::path::{Path, PathBuf};
use toml::{Table, Value};

/// Refuses the text of an experiment that is wrong; without lines, where no file has them. Its name and its description.
#[pyfunction]
pub fn check(
    py: Python<'_>,
    text: &str,
    path: PathBuf,
    has_lines: bool,
) -> PyResult<(String, Option<String>, String)> {
    let read = py.detach(|| {
        // Noises that the recording is to tell are found with it.
        if text.contains(FROM_RECORDING) {
            Experiment::parse(text, &path)
        } else {
            published().parse(text, &path)
        }
    });
    let experiment = read.map_err(|error| without_lines(error, has_lines).raise(py))?;
    Ok((experiment.name.to_string(), experiment.description.clone(), experiment.device_name().to_owned()))
}

/// The same without a line where no file has it.
pub fn without_lines(mut error: ConfigError, has_lines: bool) -> ConfigError {
    if !has_lines {
        error.place.position = None;
    }
    error
}

/// The text of an experiment of a dictionary.
#[pyfunction]
#[pyo3(signature = (document: "dict[str, Any]"))]
pub fn to_toml(document: &Bound<'_, PyDict>) -> PyResult<String> {
    Ok(table(document, "", 0)?.to_string())
}

/// The text of an experiment as a dictionary.
#[pyfunction]
#[pyo3(signature = (text, path) -> "dict[str, Any]")]
pub fn to_dict<'py>(py: Python<'py>, text: &str, path: PathBuf) -> PyResult<Bound<'py, PyAny>> {
    object(py, &Value::Table(parsed(py, text, &path)?))
}

/// The text of an experiment with other values at some keys, such as `recording[0].clock.rate`; without those that become `None`.
#[pyfunction]
#[pyo3(signature = (text, path, changes: "dict[str, Any]"))]
pub fn replaced(py: Python<'_>, text: &str, path: PathBuf, changes: &Bound<'_, PyDict>) -> PyResult<String> {
    let mut document = parsed(py, text, &path)?;
    for (key, new) in changes {
        let name: String = key.extract()?;
        let Some(key) = Key::parse(&name) else {
            return Err(PyValueError::new_err(format!(
                "`{name}` is no way to a key; write one such as `simulate.seed` or `recording[0].clock.rate`"
            )));
        };
        if new.is_none() {
            remove(&mut document, &key);
            continue;
        }
        let new = value(&new, &name, 0)?;
        put(&mut document, &key, new).map_err(|fault| at(&path, key, fault).raise(py))?;
    }
    Ok(document.to_string())
}

/// Takes a key away, where it is there.
fn remove(document: &mut Table, key: &Key) {
    let Some((KeyStep::Name(last), way)) = key.steps().split_last() else { return };
    let mut steps = way.iter();
    let Some(KeyStep::Name(first)) = steps.next() else {
        document.remove(last);
        return;
    };
    let inside = steps.try_fold(document.get_mut(first), |here, step| {
        let here = here?;
        Some(match step {
            KeyStep::Name(name) => here.get_mut(name.as_str()),
            KeyStep::Index(index) => here.get_mut(*index),
        })
    });
    if let Some(Some(Value::Table(table))) = inside {
        table.remove(last);
    }
}

fn parsed(py: Python<'_>, text: &str, path: &Path) -> PyResult<Table> {
    text.parse::<Table>().map_err(|error| {
        at(path, Key::default(), ConfigFault::Value { why: error.message().to_owned() }).raise(py)
    })
}

fn at(path: &Path, key: Key, fault: ConfigFault) -> ConfigError {
    ConfigError { place: Box::new(ConfigPlace { file: path.to_owned(), position: None, key }), fault }
}

/// Dictionaries and lists within one another at most: far more than a file has, and far fewer than a thread has room for.
const DEEPEST: usize = 64;

fn table(document: &Bound<'_, PyDict>, place: &str, depth: usize) -> PyResult<Table> {
    let mut table = Table::new();
    for (key, entry) in document {
        let name: String = key.extract()?;
        let below = if place.is_empty() { name.clone() } else { format!("{place}.{name}") };
        // What is None is left out, as an option that is not there.
        if !entry.is_none() {
            table.insert(name, value(&entry, &below, depth)?);
        }
    }
    Ok(table)
}

/// A value of Python's own types, or one that is such a number (NumPy's), a quantity of pint, or a path.
fn value(entry: &Bound<'_, PyAny>, place: &str, above: usize) -> PyResult<Value> {
    let depth = above + 1;
    if depth > DEEPEST {
        let top = place.split(['.', '[']).next().unwrap_or_default();
        return Err(PyValueError::new_err(format!(
            "`{top}` has more than {DEEPEST} dictionaries and lists within one another; expected a document as a file has it: does one contain \
             itself?"
        )));
    }
    if entry.is_instance_of::<PyBool>() {
        return Ok(Value::Boolean(entry.extract()?));
    }
    if entry.is_instance_of::<PyString>() {
        return Ok(Value::String(entry.extract()?));
    }
    if entry.is_instance_of::<PyInt>() {
        return Ok(Value::Integer(entry.extract()?));
    }
    if entry.is_instance_of::<PyFloat>() {
        return Ok(Value::Float(entry.extract()?));
    }
    if let Ok(document) = entry.cast::<PyDict>() {
        return Ok(Value::Table(table(document, place, depth)?));
    }
    let units = entry.py().import("kalmems._units")?;
    if units.call_method1("is_quantity", (entry,))?.extract()? {
        return Ok(Value::String(units.call_method1("text", (entry,))?.extract()?));
    }
    if let Ok(path) = entry.getattr("__fspath__") {
        return Ok(Value::String(path.call0()?.extract()?));
    }
    if let Ok(item) = entry.getattr("item") {
        // A number of NumPy.
        if let Ok(own) = item.call0()
            && !own.is(entry)
        {
            return value(&own, place, depth);
        }
    }
    if let Ok(items) = entry.try_iter() {
        let each = items.enumerate().map(|(index, item)| value(&item?, &format!("{place}[{index}]"), depth));
        return Ok(Value::Array(each.collect::<PyResult<_>>()?));
    }
    let found = entry.get_type().name()?;
    Err(PyTypeError::new_err(format!(
        "`{place}` is of the type {found}; expected text, a number, True or False, a list or a dictionary"
    )))
}

fn object<'py>(py: Python<'py>, value: &Value) -> PyResult<Bound<'py, PyAny>> {
    Ok(match value {
        Value::String(text) => PyString::new(py, text).into_any(),
        Value::Integer(number) => number.into_pyobject(py)?.into_any(),
        Value::Float(number) => number.into_pyobject(py)?.into_any(),
        Value::Boolean(flag) => PyBool::new(py, *flag).to_owned().into_any(),
        Value::Datetime(time) => PyString::new(py, &time.to_string()).into_any(),
        Value::Array(items) => {
            let items = items.iter().map(|item| object(py, item)).collect::<PyResult<Vec<_>>>()?;
            PyList::new(py, items)?.into_any()
        }
        Value::Table(table) => {
            let document = PyDict::new(py);
            for (name, value) in table {
                document.set_item(name, object(py, value)?)?;
            }
            document.into_any()
        }
    })
}

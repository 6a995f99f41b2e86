//! Recordings that are handed over as arrays.

use crate::errors::failed;
use kalmems::array_experiment::{ArrayClock, ArrayRecording};
use kalmems::recording::{Array, ArrayType, Arrays};
use numpy::PyReadonlyArray1;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use std::collections::BTreeMap;

/// A column: its name, its kind and the bytes of an element, the power of ten of a unit of time, its bytes, and which elements are
/// missing.
type Column<'py> = (String, char, usize, i32, PyReadonlyArray1<'py, u8>, Option<PyReadonlyArray1<'py, bool>>);

/// The columns of a recording, which nobody can change any more.
#[pyclass(frozen, module = "kalmems._kalmems")]
pub struct Columns {
    given: ArrayRecording,
}

impl Columns {
    /// As what an experiment takes.
    pub const fn given(&self) -> &ArrayRecording {
        &self.given
    }
}

#[pymethods]
impl Columns {
    /// Columns with what is said of them: units by the column, the column of the segments' labels, the column of the times or the rate
    /// in Hz.
    #[new]
    #[pyo3(signature = (columns: "Sequence[_Column]", units, segments=None, clock=None, rate_hz=None))]
    fn new(
        py: Python<'_>,
        columns: Vec<Column<'_>>,
        units: BTreeMap<String, String>,
        segments: Option<String>,
        clock: Option<String>,
        rate_hz: Option<f64>,
    ) -> PyResult<Self> {
        let mut arrays = Vec::with_capacity(columns.len());
        for (name, kind, size, power, bytes, missing) in columns {
            let time = kalmems::recording::TimeUnit::decimal(power);
            let of = match kind {
                'f' => ArrayType::Float(size),
                'i' => ArrayType::Signed(size),
                'u' => ArrayType::Unsigned(size),
                'M' => ArrayType::Dates(time),
                'm' => ArrayType::Durations(time),
                'S' => ArrayType::Texts(size),
                other => {
                    return Err(PyTypeError::new_err(format!("`{name}`: no column of the kind {other}")));
                }
            };
            let array = Array::new(&name, of, bytes.as_slice()?.to_vec());
            arrays.push(match missing {
                Some(missing) => array.without(missing.as_slice()?.to_vec()),
                None => array,
            });
        }
        let arrays = Arrays::new(arrays).map_err(|error| failed(py, &error))?;
        let clock = clock.map(ArrayClock::Column).or(rate_hz.map(ArrayClock::Rate));
        Ok(Self { given: ArrayRecording { arrays, units, segments, clock } })
    }

    /// How many samples there are.
    fn __len__(&self) -> usize {
        self.given.arrays.rows()
    }

    /// SHA-256 of names, types and numbers.
    #[getter]
    fn sha256(&self) -> String {
        self.given.arrays.digest().sha256.clone()
    }
}

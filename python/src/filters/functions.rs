//! Functions of a model: of C, of Python, and those of matrices.

use numpy::{PyArray1, PyReadonlyArrayDyn};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use std::cell::RefCell;

/// The most states and measurements of a filter.
pub const MOST: (usize, usize) = (kalmems::estimate::MOST_STATES, 16);

/// A function of a state and the inputs of a sample, by its numbers.
pub trait Function {
    /// Puts its values at this sample into `out`, row after row; not a number where there are none.
    fn call(&self, sample: usize, x: &[f64], u: &[f64], out: &mut [f64]);
}

/// A function of C: `void f(const double *x, const double *u, double *out)`.
pub struct Compiled(extern "C" fn(*const f64, *const f64, *mut f64));

impl Compiled {
    /// At an address.
    ///
    /// # Safety
    ///
    /// A function of this signature must stand there for as long as this lives, and read and write no more numbers than the filter has
    /// states, inputs and measurements.
    pub unsafe fn at(address: usize) -> Option<Self> {
        // SAFETY: the caller's promise; an address of zero is none.
        (address != 0).then(|| {
            Self(unsafe {
                std::mem::transmute::<usize, extern "C" fn(*const f64, *const f64, *mut f64)>(address)
            })
        })
    }
}

impl Function for Compiled {
    #[inline]
    fn call(&self, _: usize, x: &[f64], u: &[f64], out: &mut [f64]) {
        (self.0)(x.as_ptr(), u.as_ptr(), out.as_mut_ptr());
    }
}

/// A function of Python. What it raises is kept, and the filter stops where a value is missing.
pub struct Called<'py> {
    function: Bound<'py, PyAny>,
    error: RefCell<Option<PyErr>>,
}

impl<'py> Called<'py> {
    pub fn new(function: Bound<'py, PyAny>) -> Self {
        Self { function, error: RefCell::new(None) }
    }

    pub fn has_failed(&self) -> bool {
        self.error.borrow().is_some()
    }

    pub fn take_error(&self) -> Option<PyErr> {
        self.error.borrow_mut().take()
    }
}

impl Function for Called<'_> {
    fn call(&self, _: usize, x: &[f64], u: &[f64], out: &mut [f64]) {
        let py = self.function.py();
        let found = (|| {
            let x = PyArray1::from_slice(py, x);
            let values = if u.is_empty() {
                self.function.call1((x,))
            } else {
                self.function.call1((x, PyArray1::from_slice(py, u)))
            }?;
            let values = py.import("numpy")?.call_method1("ascontiguousarray", (values, "float64"))?;
            let values: PyReadonlyArrayDyn<f64> = values.extract()?;
            let values = values.as_slice()?;
            if values.len() != out.len() {
                let why =
                    format!("a function of the model gave {} numbers; expected {}", values.len(), out.len());
                return Err(PyValueError::new_err(why));
            }
            out.copy_from_slice(values);
            Ok(())
        })();
        if let Err(error) = found {
            out.fill(f64::NAN);
            self.error.borrow_mut().get_or_insert(error);
        }
    }
}

/// Arrays of one shape: the same at each sample, or one for each.
#[derive(Clone, Debug, Default)]
pub struct Matrices {
    pub numbers: Vec<f64>,
    /// How many numbers one has.
    pub size: usize,
    pub varies: bool,
}

impl Matrices {
    /// That of a sample.
    #[inline]
    pub fn at(&self, sample: usize) -> &[f64] {
        let first = if self.varies { sample * self.size } else { 0 };
        self.numbers.get(first..first + self.size).unwrap_or_default()
    }
}

/// M·x + B·u.
pub struct Linear<'a> {
    pub matrix: &'a Matrices,
    pub input: Option<&'a Matrices>,
}

impl Function for Linear<'_> {
    #[inline]
    fn call(&self, sample: usize, x: &[f64], u: &[f64], out: &mut [f64]) {
        let rows = self.matrix.at(sample).chunks_exact(x.len().max(1));
        for (value, row) in out.iter_mut().zip(rows) {
            *value = row.iter().zip(x).map(|(a, x)| a * x).sum();
        }
        let Some(input) = self.input.filter(|_| !u.is_empty()) else { return };
        for (value, row) in out.iter_mut().zip(input.at(sample).chunks_exact(u.len())) {
            *value += row.iter().zip(u).map(|(b, u)| b * u).sum::<f64>();
        }
    }
}

/// M, the derivative of M·x.
pub struct Slopes<'a>(pub &'a Matrices);

impl Function for Slopes<'_> {
    #[inline]
    fn call(&self, sample: usize, _: &[f64], _: &[f64], out: &mut [f64]) {
        out.copy_from_slice(self.0.at(sample));
    }
}

/// A function with its derivative by the state, or differences in its place.
#[derive(Clone, Copy)]
pub struct Model<'a> {
    pub value: &'a dyn Function,
    pub derivative: Option<&'a dyn Function>,
    /// How large each state is at least, for the differences.
    pub scales: &'a [f64],
}

impl Model<'_> {
    /// The value at a sample.
    #[inline]
    pub fn value(&self, (sample, u): (usize, &[f64]), x: &[f64], out: &mut [f64]) {
        self.value.call(sample, x, u, out);
    }

    /// The value and ∂/∂x: by its own function, or by central differences over ∛ε of each state, or of its first standard deviation where
    /// that is larger.
    pub fn linearize(&self, at: (usize, &[f64]), x: &[f64], out: &mut [f64], slopes: &mut [f64]) {
        self.value(at, x, out);
        if let Some(derivative) = self.derivative {
            return derivative.call(at.0, x, at.1, slopes);
        }
        let (n, count) = (x.len(), out.len());
        let mut room = [[0.0; MOST.0]; 4];
        let [above, below, up, down] = &mut room;
        let (above, below) = (&mut above[..n], &mut below[..n]);
        let (up, down) = (&mut up[..count], &mut down[..count]);
        for j in 0..n {
            let step = f64::EPSILON.cbrt() * x[j].abs().max(self.scales.get(j).copied().unwrap_or(1.0));
            above.copy_from_slice(x);
            below.copy_from_slice(x);
            above[j] += step;
            below[j] -= step;
            self.value(at, above, up);
            self.value(at, below, down);
            for i in 0..count {
                slopes[i * n + j] = (up[i] - down[i]) / (above[j] - below[j]);
            }
        }
    }
}

//! Filters over arrays, for models of one's own.

mod equations;
mod factors;
mod functions;
mod run;
mod sample;
mod verdict;

pub use equations::Equations;
pub use verdict::innovation_tests;

use crate::watch::Signals;
use functions::{Called, Compiled, Function, Linear, MOST, Matrices, Model, Slopes};
use kalmems::config::Method;
use numpy::{PyArray1, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::exceptions::{PyArithmeticError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use run::{Job, Run};

type Numbers<'py> = PyReadonlyArrayDyn<'py, f64>;

/// How a filter is to go over the samples: the word of its method, the spread α, β, κ of sigma points, the largest NIS that is believed with the
/// degrees of freedom of the noise of samples, and how many later samples correct a state, which is 0 for none.
type Manner = (String, [f64; 3], [f64; 2], usize);

/// An array of a shape, or of one such for each of the samples.
fn shaped(name: &str, array: &Numbers, shape: &[usize], rows: Option<usize>) -> PyResult<Matrices> {
    let of_each = rows.map(|rows| [&[rows], shape].concat());
    let varies = of_each.as_deref() == Some(array.shape());
    if !varies && array.shape() != shape {
        let or = of_each.map_or_else(String::new, |each| format!(" or {each:?}"));
        let why = format!("`{name}` has the shape {:?}; expected {shape:?}{or}", array.shape());
        return Err(PyValueError::new_err(why));
    }
    Ok(Matrices { numbers: array.as_slice()?.to_vec(), size: shape.iter().product(), varies })
}

/// What is known and measured, of n states, m numbers in a sample and so many samples.
struct Given {
    z: Matrices,
    inputs: Matrices,
    q: Matrices,
    r: Matrices,
    x0: Vec<f64>,
    p0: Vec<f64>,
    scales: Vec<f64>,
    method: Method,
    manner: Manner,
    n: usize,
    m: usize,
    rows: usize,
}

/// Samples, inputs, covariances of process and samples, start and its covariance.
type Arrays<'a, 'py> =
    (&'a Numbers<'py>, Option<&'a Numbers<'py>>, [&'a Numbers<'py>; 2], [&'a Numbers<'py>; 2]);

impl Given {
    fn of((z, u, [q, r], [x0, p0]): Arrays, manner: Manner) -> PyResult<Self> {
        let n = x0.shape().first().copied().unwrap_or(0);
        let [rows, m] = *z.shape() else {
            return Err(PyValueError::new_err(
                "`z` has a row for each sample and a column for each measurement",
            ));
        };
        if !(1..=MOST.0).contains(&n) || !(1..=MOST.1).contains(&m) {
            let why = format!(
                "{n} states and {m} measurements; a filter has 1 to {} states and 1 to {} measurements",
                MOST.0, MOST.1
            );
            return Err(PyValueError::new_err(why));
        }
        let methods =
            [Method::Ekf, Method::IteratedEkf, Method::SquareRootEkf, Method::Ukf, Method::SquareRootUkf];
        let method = methods.into_iter().find(|method| method.word() == manner.0);
        let method = method.ok_or_else(|| PyValueError::new_err(format!("no method `{}`", manner.0)))?;
        let p0 = shaped("P0", p0, &[n, n], None)?.numbers;
        let sd = |j: usize| p0.get(j * n + j).copied().unwrap_or(0.0).sqrt();
        let scales = (0..n).map(|j| if sd(j) > 0.0 { sd(j) } else { 1.0 }).collect();
        let width = u.map_or(0, |u| u.shape().get(1).copied().unwrap_or(0));
        let of_rows = |array: &Numbers, size| -> PyResult<Matrices> {
            Ok(Matrices { numbers: array.as_slice()?.to_vec(), size, varies: true })
        };
        if let Some(u) = u.filter(|u| u.shape() != [rows, width]) {
            let why = format!("`u` has the shape {:?}; expected [{rows}, {width}]", u.shape());
            return Err(PyValueError::new_err(why));
        }
        Ok(Self {
            z: of_rows(z, m)?,
            inputs: u.map_or_else(|| Ok(Matrices::default()), |u| of_rows(u, width))?,
            q: shaped("Q", q, &[n, n], Some(rows))?,
            r: shaped("R", r, &[m, m], Some(rows))?,
            x0: shaped("x0", x0, &[n], None)?.numbers,
            p0,
            scales,
            method,
            manner,
            n,
            m,
            rows,
        })
    }

    fn run(&self, motion: Model, sensor: Model, stop: &dyn Fn() -> bool) -> Option<Run> {
        let Self { z, inputs, q, r, x0, p0, method, manner: (_, points, limits, lag), .. } = self;
        let (method, points, limits, lag) = (*method, *points, *limits, *lag);
        Job { method, points, motion, sensor, z, inputs, q, r, x0, p0, limits, lag, stop }.run()
    }

    /// The answer as arrays.
    fn answer<'py>(
        &self,
        py: Python<'py>,
        run: Option<Run>,
        signals: &Signals,
    ) -> PyResult<Bound<'py, PyDict>> {
        if let Some(error) = signals.error() {
            return Err(error);
        }
        let Self { n, m, rows, .. } = *self;
        let run = run.ok_or_else(|| {
            let most = kalmems::estimate::MOST_OF_EVERY_METHOD;
            let why = format!("{n} states; this filter has at most {most}, and `kalman`, `Ekf` and their square-root forms {}", MOST.0);
            PyValueError::new_err(why)
        })?;
        if let Some((sample, why)) = run.stopped {
            return Err(PyArithmeticError::new_err(format!("the filter stops at sample {sample}: {why}")));
        }
        let all = PyDict::new(py);
        all.set_item("x", PyArray1::from_vec(py, run.x).reshape([rows, n])?)?;
        all.set_item("P", PyArray1::from_vec(py, run.p).reshape([rows, n, n])?)?;
        all.set_item("innovation", PyArray1::from_vec(py, run.innovation).reshape([rows, m])?)?;
        all.set_item("S", PyArray1::from_vec(py, run.s).reshape([rows, m, m])?)?;
        all.set_item("nis", PyArray1::from_vec(py, run.nis))?;
        all.set_item("log_likelihood", PyArray1::from_vec(py, run.log_likelihood))?;
        all.set_item("taken", PyArray1::from_vec(py, run.taken))?;
        if let Some((x, p)) = run.smoothed {
            all.set_item("smoothed_x", PyArray1::from_vec(py, x).reshape([rows, n])?)?;
            all.set_item("smoothed_P", PyArray1::from_vec(py, p).reshape([rows, n, n])?)?;
        }
        Ok(all)
    }
}

/// The linear Kalman filter over arrays.
#[pyfunction]
#[pyo3(signature = (
    z: "_Numbers", f: "_Numbers", h: "_Numbers", q: "_Numbers", r: "_Numbers", x0: "_Numbers", p0: "_Numbers",
    b: "_Numbers | None", u: "_Numbers | None", manner: "tuple[str, tuple[float, float, float], tuple[float, float], int]"
) -> "dict[str, _Numbers]")]
#[allow(clippy::too_many_arguments)] // the letters of the equations
pub fn kalman<'py>(
    py: Python<'py>,
    z: Numbers<'py>,
    f: Numbers<'py>,
    h: Numbers<'py>,
    q: Numbers<'py>,
    r: Numbers<'py>,
    x0: Numbers<'py>,
    p0: Numbers<'py>,
    b: Option<Numbers<'py>>,
    u: Option<Numbers<'py>>,
    manner: Manner,
) -> PyResult<Bound<'py, PyDict>> {
    let given = Given::of((&z, u.as_ref(), [&q, &r], [&x0, &p0]), manner)?;
    let rows = Some(given.rows);
    let f = shaped("F", &f, &[given.n, given.n], rows)?;
    let h = shaped("H", &h, &[given.m, given.n], rows)?;
    let b = b.map(|b| shaped("B", &b, &[given.n, given.inputs.size], rows)).transpose()?;
    let signals = Signals::new();
    let run = py.detach(|| {
        let (motion, sensor) = (Linear { matrix: &f, input: b.as_ref() }, Linear { matrix: &h, input: None });
        let (slope, seen) = (Slopes(&f), Slopes(&h));
        let motion = Model { value: &motion, derivative: Some(&slope), scales: &given.scales };
        let sensor = Model { value: &sensor, derivative: Some(&seen), scales: &given.scales };
        given.run(motion, sensor, &|| signals.stop())
    });
    given.answer(py, run, &signals)
}

/// Functions of a model: f, ∂f/∂x, h, ∂h/∂x, each as the address of a function of C, a function of Python, or none.
type Functions<'py> = [Option<(Option<usize>, Option<Bound<'py, PyAny>>)>; 4];

/// The filter of a model of functions.
#[pyfunction]
#[pyo3(signature = (
    z: "_Numbers", functions: "Sequence[_Function]", q: "_Numbers", r: "_Numbers", x0: "_Numbers", p0: "_Numbers",
    u: "_Numbers | None", manner: "tuple[str, tuple[float, float, float], tuple[float, float], int]"
) -> "dict[str, _Numbers]")]
#[allow(clippy::too_many_arguments)] // the letters of the equations
pub fn nonlinear<'py>(
    py: Python<'py>,
    z: Numbers<'py>,
    functions: Functions<'py>,
    q: Numbers<'py>,
    r: Numbers<'py>,
    x0: Numbers<'py>,
    p0: Numbers<'py>,
    u: Option<Numbers<'py>>,
    manner: Manner,
) -> PyResult<Bound<'py, PyDict>> {
    let given = Given::of((&z, u.as_ref(), [&q, &r], [&x0, &p0]), manner)?;
    let signals = Signals::new();
    let is_compiled = functions.iter().flatten().all(|(address, _)| address.is_some());
    if is_compiled {
        // SAFETY: the package gives addresses of functions that Numba or ctypes holds, and asks for this signature in its documentation.
        let compiled = functions
            .map(|function| function.and_then(|(address, _)| unsafe { Compiled::at(address.unwrap_or(0)) }));
        let [Some(f), fx, Some(h), hx] = &compiled else {
            return Err(PyValueError::new_err("`f` and `h` are needed"));
        };
        let run = py.detach(|| {
            let [motion, sensor] = [(f, fx), (h, hx)].map(|(value, derivative)| Model {
                value,
                derivative: derivative.as_ref().map(|of| of as &dyn Function),
                scales: &given.scales,
            });
            given.run(motion, sensor, &|| signals.stop())
        });
        return given.answer(py, run, &signals);
    }
    let called = functions.map(|function| function.and_then(|(_, function)| function).map(Called::new));
    let [Some(f), fx, Some(h), hx] = &called else {
        return Err(PyValueError::new_err(
            "`f` and `h` are needed, both as functions of Python or both compiled",
        ));
    };
    let stop = || called.iter().flatten().any(Called::has_failed) || signals.stop();
    let [motion, sensor] = [(f, fx), (h, hx)].map(|(value, derivative)| Model {
        value,
        derivative: derivative.as_ref().map(|of| of as &dyn Function),
        scales: &given.scales,
    });
    let run = given.run(motion, sensor, &stop);
    if let Some(error) = called.iter().flatten().find_map(Called::take_error) {
        return Err(error);
    }
    given.answer(py, run, &signals)
}

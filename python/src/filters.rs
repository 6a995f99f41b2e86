//! Filters over arrays, for models of one's own.

use crate::watch::Signals;
use kalmems_core::smooth::{Backward, Smoothed};
use kalmems_core::{
    Covariance, Ekf, Filter, Gaussian, Mat, NumericMeasurement, NumericProcess, ProcessNoise, SigmaPoints,
    Ukf,
};
use numpy::{PyArray1, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::exceptions::{PyArithmeticError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::cell::RefCell;

/// States and measurements for which filters are compiled, at most.
const MOST: (usize, usize) = (6, 2);

/// A function of a state and the inputs of a sample, by its numbers.
trait Function {
    /// Puts its values into `out`, row after row; not a number where there are none.
    fn call(&self, x: &[f64], u: &[f64], out: &mut [f64]);
}

/// A function of C: `void f(const double *x, const double *u, double *out)`.
struct Compiled(extern "C" fn(*const f64, *const f64, *mut f64));

impl Compiled {
    /// At an address.
    ///
    /// # Safety
    ///
    /// A function of this signature must stand there for as long as this lives, and read and write no more numbers than the filter has
    /// states, inputs and measurements.
    unsafe fn at(address: usize) -> Option<Self> {
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
    fn call(&self, x: &[f64], u: &[f64], out: &mut [f64]) {
        (self.0)(x.as_ptr(), u.as_ptr(), out.as_mut_ptr());
    }
}

/// A function of Python. What it raises is kept, and the filter stops where a value is missing.
struct Called<'py> {
    function: Bound<'py, PyAny>,
    error: RefCell<Option<PyErr>>,
}

impl Function for Called<'_> {
    fn call(&self, x: &[f64], u: &[f64], out: &mut [f64]) {
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

/// M·x + b·u, and M alone as its derivative.
struct Linear<'a> {
    matrix: &'a [f64],
    input: &'a [f64],
}

impl Function for Linear<'_> {
    #[inline]
    fn call(&self, x: &[f64], u: &[f64], out: &mut [f64]) {
        for (i, value) in out.iter_mut().enumerate() {
            let row = self.matrix.get(i * x.len()..(i + 1) * x.len()).unwrap_or_default();
            let moved: f64 = row.iter().zip(x).map(|(a, x)| a * x).sum();
            let driven = self.input.get(i * u.len()..(i + 1) * u.len()).unwrap_or_default();
            *value = moved + driven.iter().zip(u).map(|(b, u)| b * u).sum::<f64>();
        }
    }
}

/// A matrix that depends on nothing.
struct Constant<'a>(&'a [f64]);

impl Function for Constant<'_> {
    #[inline]
    fn call(&self, _: &[f64], _: &[f64], out: &mut [f64]) {
        out.copy_from_slice(self.0);
    }
}

/// A function with its derivative by the state, or differences in its place.
#[derive(Clone, Copy)]
struct Model<'a> {
    value: &'a dyn Function,
    derivative: Option<&'a dyn Function>,
    /// How large each state is at least, for the differences.
    scales: &'a [f64],
}

impl Model<'_> {
    #[inline]
    fn at<const N: usize, const K: usize>(&self, x: &[f64; N], u: &[f64]) -> [f64; K] {
        let mut out = [f64::NAN; K];
        self.value.call(x, u, &mut out);
        out
    }

    /// The value and ∂/∂x: by its own function, or by central differences over ∛ε of each state, or of its first standard deviation where
    /// that is larger.
    #[inline]
    fn linearized<const N: usize, const K: usize>(
        &self,
        x: &[f64; N],
        u: &[f64],
    ) -> ([f64; K], Mat<f64, K, N>) {
        let (value, mut slope) = (self.at(x, u), Mat([[f64::NAN; N]; K]));
        if let Some(derivative) = self.derivative {
            derivative.call(x, u, slope.0.as_flattened_mut());
            return (value, slope);
        }
        for j in 0..N {
            let step = f64::EPSILON.cbrt() * x[j].abs().max(self.scales.get(j).copied().unwrap_or(1.0));
            let (mut above, mut below) = (*x, *x);
            above[j] += step;
            below[j] -= step;
            let (up, down): ([f64; K], [f64; K]) = (self.at(&above, u), self.at(&below, u));
            for i in 0..K {
                slope.0[i][j] = (up[i] - down[i]) / (above[j] - below[j]);
            }
        }
        (value, slope)
    }
}

/// How the state moves between samples, as a filter meets it; its input is the place of the inputs' first.
struct Motion<'a, const N: usize> {
    model: Model<'a>,
    noise: ProcessNoise<f64, N>,
    inputs: &'a [f64],
    width: usize,
}

/// The inputs of a row.
fn row(inputs: &[f64], width: usize, row: usize) -> &[f64] {
    inputs.get(row * width..(row + 1) * width).unwrap_or_default()
}

impl<const N: usize> NumericProcess<f64, N> for Motion<'_, N> {
    type Input = usize;

    #[inline]
    fn moved(&self, x: &[f64; N], k: &usize) -> [f64; N] {
        self.model.at(x, row(self.inputs, self.width, *k))
    }

    #[inline]
    fn linearized(&self, x: &[f64; N], k: &usize) -> ([f64; N], Mat<f64, N, N>) {
        self.model.linearized(x, row(self.inputs, self.width, *k))
    }

    #[inline]
    fn noise_added(&self) -> &ProcessNoise<f64, N> {
        &self.noise
    }
}

/// What is measured of the state at one sample.
struct Sensor<'a> {
    model: Model<'a>,
    input: &'a [f64],
}

impl<const N: usize, const M: usize> NumericMeasurement<f64, N, M> for Sensor<'_> {
    #[inline]
    fn expected(&self, x: &[f64; N]) -> [f64; M] {
        self.model.at(x, self.input)
    }

    #[inline]
    fn linearized(&self, x: &[f64; N]) -> ([f64; M], Mat<f64, M, N>) {
        self.model.linearized(x, self.input)
    }
}

/// What a filter is to do.
struct Job<'a> {
    motion: Model<'a>,
    sensor: Model<'a>,
    /// Samples, row after row, and the inputs likewise.
    z: &'a [f64],
    inputs: &'a [f64],
    width: usize,
    q: &'a [f64],
    r: &'a [f64],
    x0: &'a [f64],
    p0: &'a [f64],
    points: Option<[f64; 3]>,
    /// Whether what later samples say of earlier states is wanted as well.
    smooths: bool,
    /// Whether to stop before a sample.
    stop: &'a dyn Fn() -> bool,
}

/// What it says of each sample, row after row.
#[derive(Default)]
struct Run {
    x: Vec<f64>,
    p: Vec<f64>,
    innovation: Vec<f64>,
    s: Vec<f64>,
    nis: Vec<f64>,
    log_likelihood: Vec<f64>,
    /// Mean and covariance given all samples, where they are wanted.
    smoothed: Option<(Vec<f64>, Vec<f64>)>,
    /// Where and why it stopped, if it did.
    stopped: Option<(usize, String)>,
}

fn square<const K: usize>(numbers: &[f64]) -> Covariance<f64, K> {
    Covariance::from_lower(Mat(std::array::from_fn(|i| std::array::from_fn(|j| numbers[i * K + j]))))
}

/// The whole of a filter's way.
fn follow<F: Filter<f64, N>, const N: usize, const M: usize>(mut filter: F, job: &Job) -> Run {
    let rows = job.z.len() / M;
    let mut run = Run::default();
    for (numbers, wide) in
        [(&mut run.x, N), (&mut run.p, N * N), (&mut run.innovation, M), (&mut run.s, M * M)]
    {
        numbers.reserve(rows * wide);
    }
    let motion = Motion::<N> {
        model: job.motion,
        noise: square::<N>(job.q).into(),
        inputs: job.inputs,
        width: job.width,
    };
    let r = square::<M>(job.r);
    let mut steps: Vec<Backward<f64, N>> = Vec::new();
    for k in 0..rows {
        if k % 64 == 0 && (job.stop)() {
            run.stopped = Some((k, String::new()));
            return run;
        }
        if k > 0 {
            let before = job.smooths.then(|| now(&filter));
            let predicted = filter.predict_linked(&motion, &(k - 1)).and_then(|link| {
                let step = before.map(|before| Backward::new(&before, &link, filter.mean()));
                step.transpose()
            });
            match predicted {
                Ok(step) => steps.extend(step),
                Err(why) => {
                    run.stopped = Some((k, why.to_string()));
                    return run;
                }
            }
        }
        let y: [f64; M] = std::array::from_fn(|i| job.z[k * M + i]);
        // What is missing is not made up: a prediction stands there.
        let seen = if y.iter().any(|y| y.is_nan()) {
            None
        } else {
            let sensor = Sensor { model: job.sensor, input: row(job.inputs, job.width, k) };
            match filter.update(&sensor, &y, &r) {
                Ok(innovation) => Some(innovation),
                Err(why) => {
                    run.stopped = Some((k, why.to_string()));
                    return run;
                }
            }
        };
        run.x.extend(filter.mean());
        run.p.extend(filter.covariance().to_full().0.as_flattened());
        if let Some(seen) = seen {
            run.innovation.extend(seen.residual);
            run.s.extend(seen.covariance.to_full().0.as_flattened());
            run.nis.push(seen.nis);
            run.log_likelihood.push(seen.log_likelihood());
        } else {
            run.innovation.extend([f64::NAN; M]);
            run.s.extend([f64::NAN; M].iter().cycle().take(M * M));
            run.nis.push(f64::NAN);
            run.log_likelihood.push(f64::NAN);
        }
    }
    if job.smooths && rows > 0 {
        match smoothed(&now(&filter), &steps, job.stop) {
            Ok(all) => run.smoothed = Some(all),
            Err(why) => run.stopped = Some((rows - 1, why)),
        }
    }
    run
}

/// What a filter says at present.
fn now<F: Filter<f64, N>, const N: usize>(filter: &F) -> Gaussian<f64, N> {
    Gaussian { mean: *filter.mean(), covariance: filter.covariance() }
}

/// Means and covariances given all samples, row after row, from the last one back.
fn smoothed<const N: usize>(
    last: &Gaussian<f64, N>,
    steps: &[Backward<f64, N>],
    stop: &dyn Fn() -> bool,
) -> Result<(Vec<f64>, Vec<f64>), String> {
    let mut state = Smoothed::newest(last).map_err(|why| why.to_string())?;
    let mut rows = vec![state];
    for (k, step) in steps.iter().rev().enumerate() {
        if k % 64 == 0 && stop() {
            return Err(String::new());
        }
        state = step.apply(&state);
        rows.push(state);
    }
    let means = rows.iter().rev().flat_map(|row| row.mean).collect();
    let covariances = rows.iter().rev().flat_map(|row| row.covariance().to_full().0.into_iter().flatten());
    Ok((means, covariances.collect()))
}

fn of_size<const N: usize, const M: usize>(job: &Job) -> Run {
    let (x0, p0) = (std::array::from_fn(|i| job.x0[i]), square::<N>(job.p0));
    match job.points {
        None => follow::<_, N, M>(Ekf::new(x0, p0), job),
        Some([alpha, beta, kappa]) => {
            follow::<_, N, M>(Ukf::new(x0, p0, SigmaPoints { alpha, beta, kappa }), job)
        }
    }
}

/// The filter of the size of the job; `None` where none is compiled.
fn sized(job: &Job, n: usize, m: usize) -> Option<Run> {
    macro_rules! sizes {
        ($(($n:literal, $m:literal)),*) => {
            match (n, m) {
                $(($n, $m) => Some(of_size::<$n, $m>(job)),)*
                _ => None,
            }
        };
    }
    sizes!((1, 1), (1, 2), (2, 1), (2, 2), (3, 1), (3, 2), (4, 1), (4, 2), (5, 1), (5, 2), (6, 1), (6, 2))
}

/// Arrays of numbers, by their names, with the shapes that they must have.
struct Given {
    z: Vec<f64>,
    inputs: Vec<f64>,
    q: Vec<f64>,
    r: Vec<f64>,
    x0: Vec<f64>,
    p0: Vec<f64>,
    n: usize,
    m: usize,
    width: usize,
    rows: usize,
    scales: Vec<f64>,
}

type Numbers<'py> = PyReadonlyArrayDyn<'py, f64>;

/// An array of a shape.
fn shaped(name: &str, array: &Numbers, shape: &[usize]) -> PyResult<Vec<f64>> {
    if array.shape() != shape {
        let why = format!("`{name}` has the shape {:?}; expected {shape:?}", array.shape());
        return Err(PyValueError::new_err(why));
    }
    Ok(array.as_slice()?.to_vec())
}

impl Given {
    fn of(
        z: &Numbers,
        u: Option<&Numbers>,
        q: &Numbers,
        r: &Numbers,
        x0: &Numbers,
        p0: &Numbers,
    ) -> PyResult<Self> {
        let n = x0.shape().first().copied().unwrap_or(0);
        let [rows, m] = *z.shape() else {
            return Err(PyValueError::new_err(
                "`z` has a row for each sample and a column for each measurement",
            ));
        };
        if !(1..=MOST.0).contains(&n) || !(1..=MOST.1).contains(&m) {
            let why = format!(
                "{n} states and {m} measurements; filters are compiled for 1 to {} states and 1 to {} measurements",
                MOST.0, MOST.1
            );
            return Err(PyValueError::new_err(why));
        }
        let p0_of = shaped("P0", p0, &[n, n])?;
        let sd = |j: usize| p0_of.get(j * n + j).copied().unwrap_or(0.0).sqrt();
        let scales = (0..n).map(|j| if sd(j) > 0.0 { sd(j) } else { 1.0 }).collect();
        let width = u.map_or(0, |u| u.shape().get(1).copied().unwrap_or(0));
        Ok(Self {
            z: z.as_slice()?.to_vec(),
            inputs: u.map_or(Ok(Vec::new()), |u| shaped("u", u, &[rows, width]))?,
            q: shaped("Q", q, &[n, n])?,
            r: shaped("R", r, &[m, m])?,
            x0: shaped("x0", x0, &[n])?,
            p0: p0_of,
            n,
            m,
            width,
            rows,
            scales,
        })
    }

    fn job<'a>(
        &'a self,
        motion: Model<'a>,
        sensor: Model<'a>,
        (points, smooths): (Option<[f64; 3]>, bool),
        stop: &'a dyn Fn() -> bool,
    ) -> Job<'a> {
        let Self { z, inputs, q, r, x0, p0, width, .. } = self;
        Job { motion, sensor, z, inputs, width: *width, q, r, x0, p0, points, smooths, stop }
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
        let run = run.ok_or_else(|| PyValueError::new_err("no filter is compiled for this size"))?;
        if let Some((sample, why)) = run.stopped {
            return Err(PyArithmeticError::new_err(format!("the filter stops at sample {sample}: {why}")));
        }
        let Self { n, m, rows, .. } = *self;
        let all = PyDict::new(py);
        all.set_item("x", PyArray1::from_vec(py, run.x).reshape([rows, n])?)?;
        all.set_item("P", PyArray1::from_vec(py, run.p).reshape([rows, n, n])?)?;
        all.set_item("innovation", PyArray1::from_vec(py, run.innovation).reshape([rows, m])?)?;
        all.set_item("S", PyArray1::from_vec(py, run.s).reshape([rows, m, m])?)?;
        all.set_item("nis", PyArray1::from_vec(py, run.nis))?;
        all.set_item("log_likelihood", PyArray1::from_vec(py, run.log_likelihood))?;
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
    b: "_Numbers | None" = None, u: "_Numbers | None" = None, smooth=false
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
    smooth: bool,
) -> PyResult<Bound<'py, PyDict>> {
    let given = Given::of(&z, u.as_ref(), &q, &r, &x0, &p0)?;
    let (f, h) = (shaped("F", &f, &[given.n, given.n])?, shaped("H", &h, &[given.m, given.n])?);
    let b = b.map_or(Ok(Vec::new()), |b| shaped("B", &b, &[given.n, given.width]))?;
    let signals = Signals::new();
    let run = py.detach(|| {
        let (motion, sensor) = (Linear { matrix: &f, input: &b }, Linear { matrix: &h, input: &[] });
        let (slope, seen) = (Constant(&f), Constant(&h));
        let stop = || signals.stop();
        let motion = Model { value: &motion, derivative: Some(&slope), scales: &given.scales };
        let sensor = Model { value: &sensor, derivative: Some(&seen), scales: &given.scales };
        sized(&given.job(motion, sensor, (None, smooth), &stop), given.n, given.m)
    });
    given.answer(py, run, &signals)
}

/// Functions of a model: f, ∂f/∂x, h, ∂h/∂x, each as the address of a function of C, a function of Python, or none.
type Functions<'py> = [Option<(Option<usize>, Option<Bound<'py, PyAny>>)>; 4];

/// The extended Kalman filter of a model of functions, or with the spread (α, β, κ) of its points the unscented one.
#[pyfunction]
#[pyo3(signature = (
    z: "_Numbers", functions: "Sequence[_Function]", q: "_Numbers", r: "_Numbers", x0: "_Numbers", p0: "_Numbers",
    u: "_Numbers | None" = None, points: "tuple[float, float, float] | None" = None, smooth=false
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
    points: Option<[f64; 3]>,
    smooth: bool,
) -> PyResult<Bound<'py, PyDict>> {
    let given = Given::of(&z, u.as_ref(), &q, &r, &x0, &p0)?;
    let signals = Signals::new();
    let is_compiled = functions.iter().flatten().all(|(address, _)| address.is_some());
    if is_compiled {
        let address =
            |place: usize| functions.get(place).and_then(Option::as_ref).and_then(|(address, _)| *address);
        // SAFETY: the package gives addresses of functions that Numba or ctypes holds, and asks for this signature in its documentation.
        let [f, fx, h, hx] =
            [0, 1, 2, 3].map(|place| address(place).and_then(|at| unsafe { Compiled::at(at) }));
        let (Some(f), Some(h)) = (f, h) else {
            return Err(PyValueError::new_err("`f` and `h` are needed"));
        };
        let run = py.detach(|| {
            let stop = || signals.stop();
            let motion = Model {
                value: &f,
                derivative: fx.as_ref().map(|of| of as &dyn Function),
                scales: &given.scales,
            };
            let sensor = Model {
                value: &h,
                derivative: hx.as_ref().map(|of| of as &dyn Function),
                scales: &given.scales,
            };
            sized(&given.job(motion, sensor, (points, smooth), &stop), given.n, given.m)
        });
        return given.answer(py, run, &signals);
    }
    let called = functions.map(|function| {
        let function = function.and_then(|(_, function)| function);
        function.map(|function| Called { function, error: RefCell::new(None) })
    });
    let [Some(f), fx, Some(h), hx] = &called else {
        return Err(PyValueError::new_err(
            "`f` and `h` are needed, both as functions of Python or both compiled",
        ));
    };
    let stop = || {
        let failed = called.iter().flatten().any(|function| function.error.borrow().is_some());
        failed || signals.stop()
    };
    let motion =
        Model { value: f, derivative: fx.as_ref().map(|of| of as &dyn Function), scales: &given.scales };
    let sensor =
        Model { value: h, derivative: hx.as_ref().map(|of| of as &dyn Function), scales: &given.scales };
    let run = sized(&given.job(motion, sensor, (points, smooth), &stop), given.n, given.m);
    if let Some(error) = called.iter().flatten().find_map(|function| function.error.borrow_mut().take()) {
        return Err(error);
    }
    given.answer(py, run, &signals)
}

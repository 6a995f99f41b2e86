//! A model that is described by equations in text.

use kalmems_core::Nodes;
use kalmems_equations::{
    Description, Device, EquationError, Motion, Named, NoiseKind, Parameter, ProgramNumbers, ReadoutProgram,
    StepTables,
};
use numpy::{PyArray1, PyReadonlyArrayDyn};
use pyo3::exceptions::{PyKeyError, PyValueError};
use pyo3::prelude::*;

type Array<'py> = Bound<'py, PyArray1<f64>>;

/// Names with their units.
type Names = Vec<(String, String)>;

/// Equations with values of their parameters, and what leads them over an interval.
#[pyclass(frozen, module = "kalmems._kalmems")]
pub struct Equations {
    device: Device,
    values: Vec<f64>,
    motion: Motion,
    tables: StepTables,
    work: ProgramNumbers,
    readouts: Vec<(ReadoutProgram, ProgramNumbers)>,
    /// Steps from a sample to the next.
    steps: usize,
}

fn wrong(error: &EquationError) -> PyErr {
    PyValueError::new_err(error.to_string())
}

#[pymethods]
impl Equations {
    /// Reads equations, with other values in SI of some parameters, for steps of this interval in s.
    #[new]
    #[pyo3(signature = (text, values: "Sequence[tuple[str, float]]", interval_s: "float", steps: "int"))]
    fn new(text: &str, values: Vec<(String, f64)>, interval_s: f64, steps: usize) -> PyResult<Self> {
        let device = Description::read(text).and_then(|text| Device::of(&text)).map_err(|e| wrong(&e))?;
        let unsuited = if device.has_resets() {
            Some("`when` sets states at once")
        } else if device.own_inputs() < device.inputs().len() {
            Some("`ddt` of an input needs its rate")
        } else {
            None
        };
        if let Some(why) = unsuited {
            return Err(PyValueError::new_err(format!(
                "{why}, which these filters do not follow; estimate it as a device, by an experiment"
            )));
        }
        let mut all = device.values();
        for (name, value) in values {
            let place = device.parameter(&name).ok_or_else(|| {
                let known: Vec<_> = device.parameters().iter().map(|p| p.named.name.to_string()).collect();
                PyKeyError::new_err(format!(
                    "no parameter is called `{name}`; there are {}",
                    known.join(", ")
                ))
            })?;
            all[place] = value;
        }
        let motion = device.motion(&[]).map_err(|e| wrong(&e))?;
        let mut work = motion.work(&all);
        let (states, inputs) = (motion.states(), vec![0.0; device.inputs().len()]);
        let (mut rates, mut slopes) = (vec![0.0; states], vec![0.0; states * states]);
        // A linear part that is not finite at the origin is left to the steps.
        if !motion.linearize(&mut work, &vec![0.0; states], &inputs, &mut rates, &mut slopes) {
            slopes.fill(0.0);
        }
        let mut tables = motion.tables();
        motion.set_tables(&mut tables, &slopes, interval_s / steps as f64);
        let readout = |measure| {
            let program = device.readout(measure, &[])?;
            let work = program.work(&all);
            Ok((program, work))
        };
        let readouts = (0..device.measures().len()).map(readout).collect::<Result<_, _>>();
        let readouts = readouts.map_err(|e| wrong(&e))?;
        Ok(Self { values: all, motion, tables, work, readouts, steps, device })
    }

    /// The states, inputs and measurements with their units, and the parameters with theirs.
    fn names(&self) -> (Names, Names, Names, Names) {
        let each = |names: &[Named]| names.iter().map(named).collect();
        let Self { device, .. } = self;
        let parameters = device.parameters().iter().map(|Parameter { named: one, .. }| named(one)).collect();
        (each(device.states()), each(device.inputs()), each(device.measures()), parameters)
    }

    /// The values of the parameters in SI.
    #[pyo3(signature = () -> "_Numbers")]
    fn values<'py>(&self, py: Python<'py>) -> Array<'py> {
        PyArray1::from_slice(py, &self.values)
    }

    /// The state after the interval, and its derivatives by the state row after row; not numbers where the equations have none.
    #[pyo3(signature = (x: "_Numbers", u: "_Numbers") -> "tuple[_Numbers, _Numbers]")]
    fn step<'py>(
        &self,
        py: Python<'py>,
        x: PyReadonlyArrayDyn<'py, f64>,
        u: PyReadonlyArrayDyn<'py, f64>,
    ) -> PyResult<(Array<'py>, Array<'py>)> {
        let (u, n) = (self.inputs(&u)?, self.motion.states());
        let mut at = self.state(&x)?.to_vec();
        let (mut work, mut next, mut slopes) = (self.work.clone(), vec![0.0; n], vec![0.0; n * n]);
        let mut all: Vec<f64> = (0..n * n).map(|k| f64::from(u8::from(k % (n + 1) == 0))).collect();
        for _ in 0..self.steps {
            let nodes = Nodes::held(u);
            if !self.motion.linearized_step(&mut work, &at, &nodes, &self.tables, &mut next, &mut slopes) {
                next.fill(f64::NAN);
            }
            let entry = |k: usize| (0..n).map(|j| slopes[k / n * n + j] * all[j * n + k % n]).sum();
            all = (0..n * n).map(entry).collect();
            at.copy_from_slice(&next);
        }
        Ok((PyArray1::from_vec(py, at), PyArray1::from_vec(py, all)))
    }

    /// What is measured at a state under inputs, and its derivatives by the state row after row.
    #[pyo3(signature = (x: "_Numbers", u: "_Numbers") -> "tuple[_Numbers, _Numbers]")]
    fn measure<'py>(
        &self,
        py: Python<'py>,
        x: PyReadonlyArrayDyn<'py, f64>,
        u: PyReadonlyArrayDyn<'py, f64>,
    ) -> PyResult<(Array<'py>, Array<'py>)> {
        let (x, u, n) = (self.state(&x)?, self.inputs(&u)?, self.motion.states());
        let mut slopes = vec![0.0; n * self.readouts.len()];
        let rows = self.readouts.iter().zip(slopes.chunks_exact_mut(n));
        let values =
            rows.map(|((program, work), row)| program.linearize(&mut work.clone(), x, u, row)).collect();
        Ok((PyArray1::from_vec(py, values), PyArray1::from_vec(py, slopes)))
    }

    /// The power densities of the rates of the states, and the variances of a sample of the measurements at an interval in s, at a state.
    #[pyo3(signature = (x: "_Numbers", interval_s: "float") -> "tuple[_Numbers, _Numbers]")]
    fn noise<'py>(
        &self,
        py: Python<'py>,
        x: PyReadonlyArrayDyn<'py, f64>,
        interval_s: f64,
    ) -> PyResult<(Array<'py>, Array<'py>)> {
        let (mut rates, mut samples) = (vec![0.0; self.motion.states()], vec![0.0; self.readouts.len()]);
        let all = self.device.noise(&self.values, self.state(&x)?).map_err(|e| wrong(&e))?;
        for (kind, size) in all {
            match kind {
                NoiseKind::Rate { state } => rates[state] = size,
                NoiseKind::Variance { measure } => samples[measure] = size,
                NoiseKind::Density { measure } => samples[measure] = 0.5 * size / interval_s,
                NoiseKind::EventTime { .. } | NoiseKind::Event { .. } => {}
            }
        }
        Ok((PyArray1::from_vec(py, rates), PyArray1::from_vec(py, samples)))
    }
}

fn named(one: &Named) -> (String, String) {
    (one.name.to_string(), one.unit_text.to_string())
}

impl Equations {
    fn state<'a>(&self, x: &'a PyReadonlyArrayDyn<'_, f64>) -> PyResult<&'a [f64]> {
        of_length("x", x, self.motion.states())
    }

    fn inputs<'a>(&self, u: &'a PyReadonlyArrayDyn<'_, f64>) -> PyResult<&'a [f64]> {
        of_length("u", u, self.device.inputs().len())
    }
}

fn of_length<'a>(name: &str, array: &'a PyReadonlyArrayDyn<'_, f64>, count: usize) -> PyResult<&'a [f64]> {
    let numbers = array.as_slice()?;
    if numbers.len() == count {
        return Ok(numbers);
    }
    Err(PyValueError::new_err(format!("`{name}` has {} numbers; the equations have {count}", numbers.len())))
}

//! What is read of a device: measurements, quantities, events, and what follows from its parameters.

use crate::device::{Device, NoiseKind};
use crate::error::{EquationError, EquationFault};
use crate::graph::{Graph, NodeId, Variable};
use crate::motion::{MOST_STATES, padded, variables, whole};
use crate::program::{Program, ProgramNumbers};

/// A readout with the numbers that it works on.
#[derive(Clone, Debug)]
pub struct Reading {
    readout: ReadoutProgram,
    work: ProgramNumbers,
}

impl Reading {
    /// With these values of all parameters, in SI and in the device's order.
    pub fn new(readout: ReadoutProgram, parameters: &[f64]) -> Self {
        Self { work: readout.work(parameters), readout }
    }

    /// See [`ReadoutProgram::read`].
    pub fn read(&mut self, x: &[f64], inputs: &[f64]) -> f64 {
        self.readout.read(&mut self.work, x, inputs)
    }

    /// See [`ReadoutProgram::linearize`].
    pub fn linearize(&mut self, x: &[f64], inputs: &[f64], slopes: &mut [f64]) -> f64 {
        self.readout.linearize(&mut self.work, x, inputs, slopes)
    }

    /// Whether it depends on a state, or on a parameter that is one.
    pub fn is_estimated(&self) -> bool {
        self.readout.sparsity().next().is_some()
    }
}

/// One measurement, one quantity, or the expression of one event, with its derivatives by the states.
///
/// Vectors are as those of [`Motion`](crate::Motion).
#[derive(Clone, Debug)]
pub struct ReadoutProgram {
    program: Program,
    states: usize,
    free: Vec<usize>,
    value: u16,
    /// Columns, and the registers of their derivatives.
    slopes: Vec<(usize, u16)>,
}

impl Device {
    /// A measurement, by its place, with these parameters as states.
    ///
    /// # Errors
    ///
    /// Where there is none, and where its derivatives are too large.
    pub fn readout(&self, measure: usize, free: &[usize]) -> Result<ReadoutProgram, EquationError> {
        let missing =
            || whole("measure", EquationFault::Missing(format!("there is no measurement {}", measure + 1)));
        self.readout_of(*self.readings.get(measure).ok_or_else(missing)?, free, "measure")
    }

    /// The expression of an event, by its place, with these parameters as states.
    ///
    /// # Errors
    ///
    /// Where there is none, and where its derivatives are too large.
    pub fn event(&self, event: usize, free: &[usize]) -> Result<ReadoutProgram, EquationError> {
        let missing = || whole("events", EquationFault::Missing(format!("there is no event {}", event + 1)));
        self.readout_of(*self.crossings.get(event).ok_or_else(missing)?, free, "events")
    }

    /// A quantity, by its place, with these parameters as states.
    ///
    /// # Errors
    ///
    /// Where there is none, and where its derivatives are too large.
    pub fn quantity(&self, quantity: usize, free: &[usize]) -> Result<ReadoutProgram, EquationError> {
        let why = || format!("there is no quantity {}", quantity + 1);
        let missing = || whole("quantities", EquationFault::Missing(why()));
        self.readout_of(*self.followed.get(quantity).ok_or_else(missing)?, free, "quantities")
    }

    /// Whether a quantity depends on an input.
    pub fn quantities_need_inputs(&self) -> bool {
        let by_input = |variable| matches!(variable, Variable::Input(_));
        self.followed.iter().any(|node| self.graph.depends(*node, by_input))
    }

    pub(crate) fn readout_of(
        &self,
        node: NodeId,
        free: &[usize],
        key: &str,
    ) -> Result<ReadoutProgram, EquationError> {
        self.readout_in(self.graph.clone(), node, free, key)
    }

    /// The same of a node of another graph.
    pub(crate) fn readout_in(
        &self,
        mut graph: Graph,
        node: NodeId,
        free: &[usize],
        key: &str,
    ) -> Result<ReadoutProgram, EquationError> {
        let (mut roots, mut columns) = (vec![node], Vec::new());
        for (column, variable) in variables(self.states.len(), free).enumerate() {
            let slope = graph.derivative(node, variable);
            if slope != Graph::ZERO {
                columns.push(column);
                roots.push(slope);
            }
        }
        let program = self.program(&mut graph, &roots, free, key)?.with_first_results(1);
        let outputs = program.outputs();
        let value = outputs.first().copied().unwrap_or_default();
        let slopes = columns.into_iter().zip(outputs.iter().skip(1).copied()).collect();
        Ok(ReadoutProgram { states: self.states.len(), free: free.to_vec(), value, slopes, program })
    }

    /// Every noise that is stated, with these values of all parameters; one that depends on the states or the inputs as it is at these states
    /// under no input.
    ///
    /// # Errors
    ///
    /// Where the expressions are too large.
    pub fn noise(&self, parameters: &[f64], at: &[f64]) -> Result<Vec<(NoiseKind, f64)>, EquationError> {
        let nodes: Vec<NodeId> =
            self.noise.iter().map(|noise| if noise.varies { Graph::ZERO } else { noise.node }).collect();
        let values = self.constants(&nodes, parameters, "noise")?;
        let mut all: Vec<_> = self.noise.iter().map(|noise| noise.kind).zip(values).collect();
        let inputs = vec![0.0; self.inputs.len()];
        for (kind, readout) in self.varying_noise(&[])? {
            if let Some((_, size)) = all.iter_mut().find(|(other, _)| *other == kind) {
                *size = Reading::new(readout, parameters).read(at, &inputs);
            }
        }
        Ok(all)
    }

    /// Every noise whose size depends on states or inputs, with these parameters as states.
    ///
    /// # Errors
    ///
    /// Where the expressions are too large.
    pub fn varying_noise(&self, free: &[usize]) -> Result<Vec<(NoiseKind, ReadoutProgram)>, EquationError> {
        let varying = self.noise.iter().filter(|noise| noise.varies);
        varying.map(|noise| Ok((noise.kind, self.readout_of(noise.node, free, "noise")?))).collect()
    }

    /// The cyclic states with their periods, with these values of all parameters.
    ///
    /// A state's period is the motion of whole turns, which whoever runs a filter takes off the state, the same for
    /// whatever is predicted together.
    ///
    /// # Errors
    ///
    /// A period that is not a positive finite number.
    pub fn periods(&self, parameters: &[f64]) -> Result<Vec<(usize, f64)>, EquationError> {
        let nodes: Vec<NodeId> = self.periods.iter().map(|(_, node)| *node).collect();
        let values = self.constants(&nodes, parameters, "cyclic")?;
        if let Some(value) = values.iter().find(|value| !(value.is_finite() && **value > 0.0)) {
            let why = format!("a period is {value}; expected a positive finite number");
            return Err(whole("cyclic", EquationFault::Value(why)));
        }
        Ok(self.periods.iter().map(|(state, _)| *state).zip(values).collect())
    }

    fn constants(&self, nodes: &[NodeId], parameters: &[f64], key: &str) -> Result<Vec<f64>, EquationError> {
        let program = self.program(&mut self.graph.clone(), nodes, &[], key)?;
        let work = program.work(parameters);
        Ok(program.outputs().iter().map(|register| work.get(*register)).collect())
    }
}

impl ReadoutProgram {
    /// What it works on, with these values of all parameters, in SI and in the device's order.
    pub fn work(&self, parameters: &[f64]) -> ProgramNumbers {
        self.program.work(parameters)
    }

    /// The value at a state under inputs; not a finite number outside of the domain.
    pub fn read(&self, work: &mut ProgramNumbers, x: &[f64], inputs: &[f64]) -> f64 {
        self.at::<false>(work, x, inputs)
    }

    /// The value, and its derivatives by the states.
    pub fn linearize(&self, work: &mut ProgramNumbers, x: &[f64], inputs: &[f64], slopes: &mut [f64]) -> f64 {
        let value = self.at::<true>(work, x, inputs);
        slopes.fill(0.0);
        for (column, register) in &self.slopes {
            if let Some(slope) = slopes.get_mut(*column) {
                *slope = work.get(*register);
            }
        }
        value
    }

    /// The value, with the derivatives computed or not.
    fn at<const LINEAR: bool>(&self, work: &mut ProgramNumbers, x: &[f64], inputs: &[f64]) -> f64 {
        if !self.free.is_empty() {
            for (k, parameter) in self.free.iter().enumerate() {
                if let Some(value) = x.get(self.states + k) {
                    self.program.set_parameter(work, *parameter, *value);
                }
            }
            self.program.begin_step(work);
        }
        Program::set_inputs(work, inputs);
        match self.states {
            0..=2 => self.stage::<2, LINEAR>(work, x),
            3..=5 => self.stage::<5, LINEAR>(work, x),
            6..=16 => self.stage::<16, LINEAR>(work, x),
            _ => self.stage::<MOST_STATES, LINEAR>(work, x),
        }
        work.get(self.value)
    }

    fn stage<const N: usize, const LINEAR: bool>(&self, work: &mut ProgramNumbers, x: &[f64]) {
        let x = padded::<N>(x, self.states);
        if LINEAR { self.program.stage(work, &x, true) } else { self.program.first_stage(work, &x, true) }
    }

    /// The states that it depends on at some point.
    pub fn sparsity(&self) -> impl Iterator<Item = usize> + '_ {
        self.slopes.iter().map(|(column, _)| *column)
    }
}

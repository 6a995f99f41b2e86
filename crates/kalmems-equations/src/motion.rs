//! How a device moves: rates, their derivatives, and steps by Runge and Kutta's method.

use crate::description::Place;
use crate::device::Device;
use crate::error::{EquationError, Fault};
use crate::graph::{Graph, NodeId, Variable};
use crate::program::{Counts, Program, REGISTERS, Work};
use kalmems_core::Nodes;

/// The most states with the parameters that are states.
pub const MOST_STATES: usize = 16;

/// The motion of a device, with some of its parameters as states behind its own.
///
/// Vectors are x = [states, those parameters]; the Jacobian of a step is [∂x′/∂x, ∂x′/∂p; 0, 1], row by row. Nothing is
/// allocated while it runs. A result that is not finite is told by the `false` that a function returns: a state is outside
/// the domain of the equations or of a table.
#[derive(Clone, Debug)]
pub struct Motion {
    program: Program,
    states: usize,
    free: Vec<usize>,
    rates: Vec<u16>,
    slopes: Vec<Slope>,
}

/// One entry of the Jacobian of the rates that is not always zero.
#[derive(Clone, Copy, Debug)]
struct Slope {
    row: usize,
    column: usize,
    register: u16,
}

impl Device {
    /// Its motion, with these parameters, by their places, as states.
    ///
    /// # Errors
    ///
    /// Too many states, and equations that are too large once they are differentiated.
    pub fn motion(&self, free: &[usize]) -> Result<Motion, EquationError> {
        let states = self.states.len();
        if states + free.len() > MOST_STATES {
            let why = format!(
                "the device has {states} states and {} parameters as states; at most {MOST_STATES} together",
                free.len()
            );
            return Err(whole("states", Fault::Value(why)));
        }
        let mut graph = self.graph.clone();
        let mut roots = self.rates.clone();
        let mut places = Vec::new();
        for (row, rate) in self.rates.iter().enumerate() {
            for (column, variable) in variables(states, free).enumerate() {
                let slope = graph.derivative(*rate, variable);
                if slope != Graph::ZERO {
                    places.push((row, column));
                    roots.push(slope);
                }
            }
        }
        let program = self.program(&mut graph, &roots, free, "derivative")?;
        let (rates, registers) = program.outputs().split_at(states);
        let slopes = places
            .into_iter()
            .zip(registers)
            .map(|((row, column), register)| Slope { row, column, register: *register })
            .collect();
        Ok(Motion { states, free: free.to_vec(), rates: rates.to_vec(), slopes, program })
    }

    /// A program for these nodes of the device's graph or of a copy of it.
    pub(crate) fn program(
        &self,
        graph: &mut Graph,
        roots: &[NodeId],
        free: &[usize],
        key: &str,
    ) -> Result<Program, EquationError> {
        if let Some(stop) = graph.take_stop() {
            return Err(whole(key, crate::device::fault_of(stop)));
        }
        let counts = Counts {
            states: self.states.len(),
            inputs: self.inputs.len(),
            parameters: self.parameters.len(),
        };
        Program::of(graph, roots, counts, free, &self.curves)
            .ok_or_else(|| whole(key, Fault::TooLarge { what: "numbers to keep", limit: REGISTERS }))
    }
}

pub(crate) fn whole(key: &str, fault: Fault) -> EquationError {
    EquationError::whole(&Place { key: key.to_owned(), offset: None }, "", fault)
}

/// The states, and behind them the parameters that are states.
pub(crate) fn variables(states: usize, free: &[usize]) -> impl Iterator<Item = Variable> + '_ {
    (0..states).map(Variable::State).chain(free.iter().map(|index| Variable::Parameter(*index)))
}

impl Motion {
    /// How many states it has, the parameters that are states included.
    pub fn states(&self) -> usize {
        self.states + self.free.len()
    }

    /// How many of them move by equations of their own, from the first one on; those behind are held over a step.
    pub fn moving(&self) -> usize {
        self.states
    }

    /// The entries of the rates' Jacobian that are not zero at every point, as rows and columns.
    pub fn sparsity(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        self.slopes.iter().map(|slope| (slope.row, slope.column))
    }

    /// How many instructions the rates and their Jacobian take at one point.
    pub fn instructions(&self) -> usize {
        self.program.stage_length()
    }

    /// What it works on, with these values of all parameters, in SI and in the device's order.
    pub fn work(&self, parameters: &[f64]) -> Work {
        self.program.work(parameters)
    }

    /// ẋ at a state under inputs; the rate of a parameter is 0. False where it is not finite.
    pub fn rates(&self, work: &mut Work, x: &[f64], inputs: &[f64], to: &mut [f64]) -> bool {
        self.begin(work, x);
        self.program.set_inputs(work, inputs);
        self.stage(work, x);
        for (index, rate) in to.iter_mut().enumerate() {
            *rate = self.rates.get(index).map_or(0.0, |register| work.get(*register));
        }
        are_finite(to)
    }

    /// ẋ, and ∂ẋ/∂x row by row. False where one of them is not finite.
    pub fn linearize(
        &self,
        work: &mut Work,
        x: &[f64],
        inputs: &[f64],
        to: &mut [f64],
        jacobian: &mut [f64],
    ) -> bool {
        let finite = self.rates(work, x, inputs, to);
        jacobian.fill(0.0);
        let columns = self.states();
        for slope in &self.slopes {
            if let Some(entry) = jacobian.get_mut(slope.row * columns + slope.column) {
                *entry = work.get(slope.register);
            }
        }
        finite && are_finite(jacobian)
    }

    /// x after one step of Runge and Kutta's method of fourth order over `interval` seconds, with the inputs at its start,
    /// middle and end. False where it is not finite.
    pub fn step(
        &self,
        work: &mut Work,
        x: &[f64],
        inputs: &Nodes<&[f64]>,
        interval: f64,
        to: &mut [f64],
    ) -> bool {
        self.begin(work, x);
        let n = self.states.min(MOST_STATES);
        let mut start = [0.0; MOST_STATES];
        start.iter_mut().zip(x).take(n).for_each(|(to, x)| *to = *x);
        let (mut at, mut total) = (start, [0.0; MOST_STATES]);
        for stage in STAGES {
            if let Some(inputs) = stage.new_inputs(inputs) {
                self.program.set_inputs(work, inputs);
            }
            self.stage(work, at.get(..n).unwrap_or_default());
            for (i, register) in self.rates.iter().enumerate().take(n) {
                let rate = work.get(*register);
                total[i] += stage.weight * rate;
                at[i] = start[i] + rate * (stage.onwards * interval);
            }
        }
        let sixth = interval * (1.0 / 6.0);
        for (i, next) in to.iter_mut().enumerate() {
            *next = if i < n { start[i] + total[i] * sixth } else { x.get(i).copied().unwrap_or_default() };
        }
        are_finite(to)
    }

    /// As [`step`](Self::step), and ∂x′/∂x row by row.
    pub fn linearized_step(
        &self,
        work: &mut Work,
        x: &[f64],
        inputs: &Nodes<&[f64]>,
        interval: f64,
        to: &mut [f64],
        jacobian: &mut [f64],
    ) -> bool {
        let over = (inputs, interval);
        match self.states() {
            0..=1 => self.chain::<1>(work, x, over, to, jacobian),
            2 => self.chain::<2>(work, x, over, to, jacobian),
            3 => self.chain::<3>(work, x, over, to, jacobian),
            4 => self.chain::<4>(work, x, over, to, jacobian),
            5 => self.chain::<5>(work, x, over, to, jacobian),
            6 => self.chain::<6>(work, x, over, to, jacobian),
            7..=8 => self.chain::<8>(work, x, over, to, jacobian),
            9..=12 => self.chain::<12>(work, x, over, to, jacobian),
            _ => self.chain::<MOST_STATES>(work, x, over, to, jacobian),
        }
    }

    /// The step and its Jacobian in rows of W numbers, at least as many as there are states: S = ∂x/∂x₀ goes with x
    /// through the stages, Ṡ = ∂f/∂x·S + ∂f/∂p.
    #[inline(never)]
    fn chain<const W: usize>(
        &self,
        work: &mut Work,
        x: &[f64],
        (inputs, interval): (&Nodes<&[f64]>, f64),
        to: &mut [f64],
        jacobian: &mut [f64],
    ) -> bool {
        self.begin(work, x);
        let n = self.states.min(W);
        let mut start = [0.0; W];
        start.iter_mut().zip(x).take(n).for_each(|(to, x)| *to = *x);
        let mut unit = [[0.0; W]; W];
        for (i, row) in unit.iter_mut().enumerate() {
            row[i] = 1.0;
        }
        let (mut at, mut total) = (start, [0.0; W]);
        let (mut s, mut s_total) = (unit, [[0.0; W]; W]);
        for stage in STAGES {
            if let Some(inputs) = stage.new_inputs(inputs) {
                self.program.set_inputs(work, inputs);
            }
            self.stage(work, at.get(..n).unwrap_or_default());
            let mut s_rate = [[0.0; W]; W];
            for slope in &self.slopes {
                let (value, row, column) =
                    (work.get(slope.register), slope.row.min(W - 1), slope.column.min(W - 1));
                if column < n {
                    for k in 0..W {
                        s_rate[row][k] += value * s[column][k];
                    }
                } else {
                    s_rate[row][column] += value;
                }
            }
            let onwards = stage.onwards * interval;
            for (i, register) in self.rates.iter().enumerate().take(n) {
                let rate = work.get(*register);
                total[i] += stage.weight * rate;
                at[i] = start[i] + rate * onwards;
                for k in 0..W {
                    s_total[i][k] += stage.weight * s_rate[i][k];
                    s[i][k] = unit[i][k] + s_rate[i][k] * onwards;
                }
            }
        }
        let sixth = interval * (1.0 / 6.0);
        for (i, next) in to.iter_mut().enumerate() {
            *next = if i < n { start[i] + total[i] * sixth } else { x.get(i).copied().unwrap_or_default() };
        }
        let columns = self.states();
        for (i, row) in jacobian.chunks_mut(columns.max(1)).enumerate().take(W) {
            for (k, entry) in row.iter_mut().enumerate().take(W) {
                *entry = if i < n { unit[i][k] + s_total[i][k] * sixth } else { unit[i][k] };
            }
        }
        are_finite(to) & are_finite(jacobian)
    }

    /// Takes the parameters that are states.
    #[inline]
    fn begin(&self, work: &mut Work, x: &[f64]) {
        if !self.free.is_empty() {
            for (parameter, value) in self.free.iter().zip(x.iter().skip(self.states)) {
                self.program.set_parameter(work, *parameter, *value);
            }
            self.program.begin_step(work);
        }
    }

    #[inline]
    fn stage(&self, work: &mut Work, x: &[f64]) {
        self.program.set_states(work, x.get(..self.states).unwrap_or(x));
    }
}

/// A stage of the method: which inputs it takes, its weight, and how far it leads the next one in intervals.
struct Stage {
    inputs: When,
    weight: f64,
    onwards: f64,
}

enum When {
    Start,
    Middle,
    /// Those of the stage before.
    Same,
    End,
}

const STAGES: [Stage; 4] = [
    Stage { inputs: When::Start, weight: 1.0, onwards: 0.5 },
    Stage { inputs: When::Middle, weight: 2.0, onwards: 0.5 },
    Stage { inputs: When::Same, weight: 2.0, onwards: 1.0 },
    Stage { inputs: When::End, weight: 1.0, onwards: 0.0 },
];

impl Stage {
    #[inline]
    fn new_inputs<'a>(&self, nodes: &Nodes<&'a [f64]>) -> Option<&'a [f64]> {
        match self.inputs {
            When::Start => Some(nodes.start),
            When::Middle => Some(nodes.middle),
            When::Same => None,
            When::End => Some(nodes.end),
        }
    }
}

/// Whether all are: 0·x is 0 or not a number.
#[inline]
pub(crate) fn are_finite(values: &[f64]) -> bool {
    values.iter().map(|value| value * 0.0).sum::<f64>() == 0.0
}

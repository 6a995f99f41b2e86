//! How a device moves: rates, their derivatives, and steps.

mod grid;
mod step;
mod tables;

pub use tables::StepTables;

use crate::description::TextPlace;
use crate::device::Device;
use crate::error::{EquationError, EquationFault};
use crate::graph::{Graph, NodeId, Variable};
use crate::program::{Program, ProgramNumbers, REGISTERS, RegisterCounts, STATES};
use kalmems_core::Nodes;

/// The most states with the parameters that are states.
pub const MOST_STATES: usize = STATES;

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
    /// The number of states, or one above it for which a step is compiled.
    size: usize,
    /// The columns of the Jacobian of those parameters that the rates depend on, and how many a step is compiled for.
    active: Vec<usize>,
    room: usize,
    sparsity: Vec<(usize, usize)>,
    /// The registers of f, of ∂f/∂x and of ∂f/∂p, row by row and of these sizes: that of the number 0 where one is always
    /// zero.
    rates: Vec<u16>,
    slopes: Vec<u16>,
    by_parameter: Vec<u16>,
    /// The rows of the rates that are not linear in the states with constant slopes, or that inputs enter.
    bent: Vec<usize>,
    is_linear: bool,
    /// The states that no equation moves and on which slopes of the rates by states depend.
    held: Vec<usize>,
    has_kinks: bool,
    /// Which inputs enter the rates.
    takes: Vec<bool>,
}

/// The numbers of states for which a step is compiled.
const SIZES: [usize; 10] = [1, 2, 3, 4, 5, 6, 8, 12, 16, MOST_STATES];
/// The numbers of parameters that the rates depend on for which a step is compiled.
const ROOMS: [usize; 3] = [0, 2, MOST_STATES];

impl Device {
    /// Its motion, with these parameters, by their places, as states.
    ///
    /// # Errors
    ///
    /// Too many states, and equations that are too large once they are differentiated.
    pub fn motion(&self, free: &[usize]) -> Result<Motion, EquationError> {
        self.motion_of((self.graph.clone(), &self.rates), free, 0)
    }

    /// The motion by these rates, which so many numbers enter behind the parameters that stay as they are over a step.
    pub(crate) fn motion_of(
        &self,
        (mut graph, own_rates): (Graph, &[NodeId]),
        free: &[usize],
        held_numbers: usize,
    ) -> Result<Motion, EquationError> {
        let states = self.states.len();
        if states + free.len() > MOST_STATES {
            let why = format!(
                "the device has {states} states and {} parameters as states; at most {MOST_STATES} together",
                free.len()
            );
            return Err(whole("states", EquationFault::Value(why)));
        }
        let mut roots = own_rates.to_vec();
        roots.push(Graph::ZERO);
        let mut places = Vec::new();
        for (row, rate) in own_rates.iter().enumerate() {
            for (column, variable) in variables(states, free).enumerate() {
                let slope = graph.derivative(*rate, variable);
                if slope != Graph::ZERO {
                    places.push((row, column));
                    roots.push(slope);
                }
            }
        }
        let is_free = |variable: Variable| match variable {
            Variable::State(_) | Variable::Input(_) => true,
            Variable::Parameter(index) => free.contains(&index) || index >= self.parameters.len(),
        };
        let varies = |row: usize| {
            let mut slopes = places.iter().zip(roots.iter().skip(states + 1));
            slopes.any(|((of, _), slope)| *of == row && graph.depends(*slope, is_free))
        };
        let varying: Vec<bool> = (0..states).map(varies).collect();
        let of_states =
            || places.iter().zip(roots.iter().skip(states + 1)).filter(|((_, column), _)| *column < states);
        let is_held = |state: &usize| {
            let shapes = |variable| variable == Variable::State(*state);
            own_rates.get(*state) == Some(&Graph::ZERO)
                && of_states().any(|(_, slope)| graph.depends(*slope, shapes))
        };
        let held = (0..states).filter(is_held).collect();
        let is_linear = !varying.contains(&true);
        let is_input = |variable| matches!(variable, Variable::Input(_));
        let rows = own_rates.iter().zip(varying).enumerate();
        let bent = rows.filter(|(_, (rate, varies))| *varies || graph.depends(**rate, is_input));
        let bent = bent.map(|(row, _)| row).collect();
        let takes = (0..self.inputs.len())
            .map(|input| {
                own_rates
                    .iter()
                    .any(|rate| graph.depends(*rate, |variable| variable == Variable::Input(input)))
            })
            .collect();
        let has_kinks = own_rates.iter().any(|rate| graph.has_kink(*rate));
        let program = self.program_with((&mut graph, &roots), (free, held_numbers), "derivative")?;
        let program = program.with_first_results(states);
        let (own, rest) = program.outputs().split_at(states);
        let (zero, registers) = rest.split_first().unwrap_or((&0, &[]));
        let size = SIZES.into_iter().find(|size| *size >= states).unwrap_or(MOST_STATES);
        let (mut rates, mut slopes) = (own.to_vec(), vec![*zero; size * size]);
        rates.resize(size, *zero);
        let mut active: Vec<usize> =
            places.iter().map(|(_, column)| *column).filter(|c| *c >= states).collect();
        active.sort_unstable();
        active.dedup();
        let room = ROOMS.into_iter().find(|room| *room >= active.len()).unwrap_or(MOST_STATES);
        let mut by_parameter = vec![*zero; size * room];
        for ((row, column), register) in places.iter().zip(registers) {
            let entry = match active.binary_search(column) {
                Err(_) => slopes.get_mut(row * size + column),
                Ok(parameter) => by_parameter.get_mut(row * room + parameter),
            };
            if let Some(entry) = entry {
                *entry = *register;
            }
        }
        let free = free.to_vec();
        Ok(Motion {
            program,
            states,
            free,
            size,
            active,
            room,
            sparsity: places,
            rates,
            slopes,
            by_parameter,
            bent,
            is_linear,
            held,
            has_kinks,
            takes,
        })
    }

    /// A program for these nodes of the device's graph or of a copy of it.
    pub(crate) fn program(
        &self,
        graph: &mut Graph,
        roots: &[NodeId],
        free: &[usize],
        key: &str,
    ) -> Result<Program, EquationError> {
        self.program_with((graph, roots), (free, 0), key)
    }

    /// The same with so many numbers behind the parameters that change from step to step.
    fn program_with(
        &self,
        (graph, roots): (&mut Graph, &[NodeId]),
        (free, held_numbers): (&[usize], usize),
        key: &str,
    ) -> Result<Program, EquationError> {
        if let Some(stop) = graph.take_stop() {
            return Err(whole(key, crate::device::fault_of(stop)));
        }
        if self.states.len() > MOST_STATES {
            let why =
                format!("the device has {} states; at most {MOST_STATES} can be run", self.states.len());
            return Err(whole("states", EquationFault::Value(why)));
        }
        let own = self.parameters.len();
        let counts = RegisterCounts { inputs: self.inputs.len(), parameters: own + held_numbers };
        let changing: Vec<usize> = free.iter().copied().chain(own..own + held_numbers).collect();
        Program::of(graph, roots, counts, &changing, &self.curves)
            .ok_or_else(|| whole(key, EquationFault::TooLarge { what: "numbers to keep", limit: REGISTERS }))
    }
}

pub(crate) fn whole(key: &str, fault: EquationFault) -> EquationError {
    EquationError::whole(&TextPlace { key: key.to_owned(), offset: None }, "", fault)
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
        self.sparsity.iter().copied()
    }

    /// How many instructions the rates and their Jacobian take at one point.
    pub fn instructions(&self) -> usize {
        self.program.stage_length()
    }

    /// What it works on, with these values of all parameters, in SI and in the device's order.
    pub fn work(&self, parameters: &[f64]) -> ProgramNumbers {
        self.program.work(parameters)
    }

    /// ẋ at a state under inputs; the rate of a parameter is 0. False where it is not finite.
    pub fn rates(&self, work: &mut ProgramNumbers, x: &[f64], inputs: &[f64], to: &mut [f64]) -> bool {
        self.begin(work, x);
        Program::set_inputs(work, inputs);
        self.program.first_stage(work, &padded::<MOST_STATES>(x, self.states), true);
        self.take_rates(work, to)
    }

    /// The rates that a stage has led to.
    fn take_rates(&self, work: &ProgramNumbers, to: &mut [f64]) -> bool {
        for (index, rate) in to.iter_mut().enumerate() {
            let register = self.rates.get(index).filter(|_| index < self.states);
            *rate = register.map_or(0.0, |register| work.get(*register));
        }
        are_finite(to)
    }

    /// ẋ, and ∂ẋ/∂x row by row. False where one of them is not finite.
    pub fn linearize(
        &self,
        work: &mut ProgramNumbers,
        x: &[f64],
        inputs: &[f64],
        to: &mut [f64],
        jacobian: &mut [f64],
    ) -> bool {
        self.begin(work, x);
        Program::set_inputs(work, inputs);
        self.program.stage(work, &padded::<MOST_STATES>(x, self.states), true);
        let finite = self.take_rates(work, to);
        jacobian.fill(0.0);
        let columns = self.states();
        for (row, column) in self.sparsity.iter().copied() {
            let register = match self.active.binary_search(&column) {
                Err(_) => self.slopes.get(row * self.size + column),
                Ok(parameter) => self.by_parameter.get(row * self.room + parameter),
            };
            if let Some((entry, register)) = jacobian.get_mut(row * columns + column).zip(register) {
                *entry = work.get(*register);
            }
        }
        finite && are_finite(jacobian)
    }

    /// Which of the inputs enter the rates.
    pub fn takes(&self) -> &[bool] {
        &self.takes
    }

    /// Whether a rate is not smooth everywhere: an `if`, `max`, `min` or `abs` of a state stands in it.
    pub fn has_kinks(&self) -> bool {
        self.has_kinks
    }

    /// Whether its rates are linear in the states with constant slopes, so that its steps are exact under inputs that are parabolas
    /// within them.
    pub fn is_linear(&self) -> bool {
        self.is_linear
    }

    /// x after one step over the interval of these tables, with the inputs at its start, middle and end. False where it is not finite.
    pub fn step(
        &self,
        work: &mut ProgramNumbers,
        x: &[f64],
        inputs: &Nodes<&[f64]>,
        tables: &StepTables,
        to: &mut [f64],
    ) -> bool {
        self.over(work, x, (inputs, tables), to, &mut [])
    }

    /// As [`step`](Self::step), and ∂x′/∂x row by row.
    pub fn linearized_step(
        &self,
        work: &mut ProgramNumbers,
        x: &[f64],
        inputs: &Nodes<&[f64]>,
        tables: &StepTables,
        to: &mut [f64],
        jacobian: &mut [f64],
    ) -> bool {
        self.over(work, x, (inputs, tables), to, jacobian)
    }

    /// Gives numbers that stay as they are over a step their values, from this place among the parameters on.
    pub(crate) fn hold(&self, work: &mut ProgramNumbers, first: usize, values: &[f64]) {
        for (k, value) in values.iter().enumerate() {
            self.program.set_parameter(work, first + k, *value);
        }
        self.program.begin_step(work);
    }

    /// Takes the parameters that are states.
    #[inline]
    fn begin(&self, work: &mut ProgramNumbers, x: &[f64]) {
        if !self.free.is_empty() {
            for (k, parameter) in self.free.iter().enumerate() {
                if let Some(value) = x.get(self.states + k) {
                    self.program.set_parameter(work, *parameter, *value);
                }
            }
            self.program.begin_step(work);
        }
    }
}

/// The first of these numbers, and zeros behind them.
#[inline(always)]
#[allow(clippy::inline_always)] // its size is known where it is called, and not to a function of its own
pub(crate) fn padded<const N: usize>(x: &[f64], count: usize) -> [f64; N] {
    // A copy of so many numbers as are known needs no call.
    if let Some(whole) = x.first_chunk().filter(|_| count >= N) {
        return *whole;
    }
    let mut padded = [0.0; N];
    let count = count.min(N).min(x.len());
    padded[..count].copy_from_slice(&x[..count]);
    padded
}

/// Whether all are: 0·x is 0 or not a number.
#[inline]
pub(crate) fn are_finite(values: &[f64]) -> bool {
    let mut sum = 0.0;
    for value in values {
        sum += value * 0.0;
    }
    sum == 0.0
}

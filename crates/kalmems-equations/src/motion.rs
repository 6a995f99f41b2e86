//! How a device moves: rates, their derivatives, and steps by Runge and Kutta's method.

use crate::description::Place;
use crate::device::Device;
use crate::error::{EquationError, Fault};
use crate::graph::{Graph, NodeId, Variable};
use crate::program::{Counts, Program, REGISTERS, STATES, Work};
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
    /// The number of parameters that are states, or one above it for which a step is compiled.
    room: usize,
    sparsity: Vec<(usize, usize)>,
    /// The registers of f, of ∂f/∂x and of ∂f/∂p, row by row and of these sizes: that of the number 0 where one is always
    /// zero.
    rates: Vec<u16>,
    slopes: Vec<u16>,
    by_parameter: Vec<u16>,
}

/// The numbers of states for which a step is compiled.
const SIZES: [usize; 9] = [1, 2, 3, 4, 5, 6, 8, 12, MOST_STATES];
/// The numbers of parameters as states for which a step is compiled.
const ROOMS: [usize; 3] = [0, 4, MOST_STATES];

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
        roots.push(Graph::ZERO);
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
        let (own, rest) = program.outputs().split_at(states);
        let (zero, registers) = rest.split_first().unwrap_or((&0, &[]));
        let size = SIZES.into_iter().find(|size| *size >= states).unwrap_or(MOST_STATES);
        let (mut rates, mut slopes) = (own.to_vec(), vec![*zero; size * size]);
        rates.resize(size, *zero);
        let room = ROOMS.into_iter().find(|room| *room >= free.len()).unwrap_or(MOST_STATES);
        let mut by_parameter = vec![*zero; size * room];
        for ((row, column), register) in places.iter().zip(registers) {
            let entry = match column.checked_sub(states) {
                None => slopes.get_mut(row * size + column),
                Some(parameter) => by_parameter.get_mut(row * room + parameter),
            };
            if let Some(entry) = entry {
                *entry = *register;
            }
        }
        let free = free.to_vec();
        Ok(Motion { program, states, free, size, room, sparsity: places, rates, slopes, by_parameter })
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
        if self.states.len() > MOST_STATES {
            let why =
                format!("the device has {} states; at most {MOST_STATES} can be run", self.states.len());
            return Err(whole("states", Fault::Value(why)));
        }
        let counts = Counts { inputs: self.inputs.len(), parameters: self.parameters.len() };
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
        self.sparsity.iter().copied()
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
        self.program.stage(work, &padded::<MOST_STATES>(x, self.states), true);
        for (index, rate) in to.iter_mut().enumerate() {
            let register = self.rates.get(index).filter(|_| index < self.states);
            *rate = register.map_or(0.0, |register| work.get(*register));
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
        for (row, column) in self.sparsity.iter().copied() {
            let register = match column.checked_sub(self.states) {
                None => self.slopes.get(row * self.size + column),
                Some(parameter) => self.by_parameter.get(row * self.room + parameter),
            };
            if let Some((entry, register)) = jacobian.get_mut(row * columns + column).zip(register) {
                *entry = work.get(*register);
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
        self.over(work, x, (inputs, interval), to, &mut [])
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
        self.over(work, x, (inputs, interval), to, jacobian)
    }

    /// The step, and its Jacobian where there is room for it, by the number of states.
    fn over(
        &self,
        work: &mut Work,
        x: &[f64],
        over: (&Nodes<&[f64]>, f64),
        to: &mut [f64],
        jacobian: &mut [f64],
    ) -> bool {
        macro_rules! by_size {
            ($($size:literal)+) => {
                match (self.size, self.room) {
                    $(
                        ($size, _) if jacobian.is_empty() => self.chain::<$size, 0, false>(work, x, over, to, jacobian),
                        ($size, 0) => self.chain::<$size, 0, true>(work, x, over, to, jacobian),
                        ($size, 4) => self.chain::<$size, 4, true>(work, x, over, to, jacobian),
                        ($size, _) => self.chain::<$size, MOST_STATES, true>(work, x, over, to, jacobian),
                    )+
                    _ => false,
                }
            };
        }
        by_size!(1 2 3 4 5 6 8 12 16)
    }

    /// The step and its Jacobian for N states, of which the last may not be there, and at most F parameters.
    ///
    /// Each column s = ∂x/∂x₀ or ∂x/∂p goes with x through the stages by ṡ = ∂f/∂x·s + ∂f/∂p, by itself.
    #[inline(never)]
    fn chain<const N: usize, const F: usize, const LINEAR: bool>(
        &self,
        work: &mut Work,
        x: &[f64],
        (inputs, interval): (&Nodes<&[f64]>, f64),
        to: &mut [f64],
        jacobian: &mut [f64],
    ) -> bool {
        self.begin(work, x);
        let at = padded::<N>(x, self.states);
        let half = 0.5 * interval;
        // What the columns need of each stage is kept, so that they go through all of them at one go.
        let mut linear = [Linear::<N, F>::NONE; 4];
        self.program.set_inputs(work, inputs.start);
        let k1 = self.stage::<N, F, LINEAR>(work, &at, true, &mut linear[0]);
        self.program.set_inputs(work, inputs.middle);
        let k2 = self.stage::<N, F, LINEAR>(work, &moved(&at, &k1, half), true, &mut linear[1]);
        let k3 = self.stage::<N, F, LINEAR>(work, &moved(&at, &k2, half), false, &mut linear[2]);
        self.program.set_inputs(work, inputs.end);
        let k4 = self.stage::<N, F, LINEAR>(work, &moved(&at, &k3, interval), true, &mut linear[3]);

        let sixth = interval * (1.0 / 6.0);
        let states = self.states.min(N);
        for (i, next) in to.iter_mut().enumerate() {
            *next = if i < states {
                at[i] + (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]) * sixth
            } else {
                x.get(i).copied().unwrap_or_default()
            };
        }
        if !LINEAR {
            return are_finite(to);
        }
        let of_states = through(&linear, linear.map(|stage| stage.slopes), interval);
        let of_parameters = through(&linear, linear.map(|stage| stage.by_parameter), interval);
        for (i, row) in jacobian.chunks_exact_mut(self.states().max(1)).enumerate() {
            for (k, entry) in row.iter_mut().enumerate() {
                let moved = match (i < states, k.checked_sub(states)) {
                    (false, _) => 0.0,
                    (true, None) => of_states[i][k] * sixth,
                    (true, Some(parameter)) => of_parameters[i].get(parameter).map_or(0.0, |sum| sum * sixth),
                };
                *entry = if i == k { 1.0 + moved } else { moved };
            }
        }
        are_finite(to) & are_finite(jacobian)
    }

    /// f, and ∂f/∂x and ∂f/∂p where they are wanted.
    #[inline(always)]
    fn stage<const N: usize, const F: usize, const LINEAR: bool>(
        &self,
        work: &mut Work,
        x: &[f64; N],
        new_inputs: bool,
        linear: &mut Linear<N, F>,
    ) -> [f64; N] {
        self.program.stage(work, x, new_inputs);
        if LINEAR {
            for (row, registers) in linear.slopes.iter_mut().zip(self.slopes.as_chunks::<N>().0) {
                *row = registers.map(|register| work.get(register));
            }
            let by_parameter = linear.by_parameter.as_flattened_mut();
            for (slope, register) in by_parameter.iter_mut().zip(&self.by_parameter) {
                *slope = work.get(*register);
            }
        }
        self.rates
            .first_chunk::<N>()
            .map_or([0.0; N], |registers| registers.map(|register| work.get(register)))
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
}

/// What one stage of a step is linearised to: ∂f/∂x and ∂f/∂p.
#[derive(Clone, Copy)]
struct Linear<const N: usize, const F: usize> {
    slopes: [[f64; N]; N],
    by_parameter: [[f64; F]; N],
}

impl<const N: usize, const F: usize> Linear<N, F> {
    const NONE: Self = Self { slopes: [[0.0; N]; N], by_parameter: [[0.0; F]; N] };
}

/// x + h·k.
#[inline(always)]
fn moved<const N: usize>(x: &[f64; N], k: &[f64; N], h: f64) -> [f64; N] {
    std::array::from_fn(|i| x[i] + k[i] * h)
}

/// K₁ + 2·K₂ + 2·K₃ + K₄ with Kᵢ = Bᵢ + cᵢ·h·Aᵢ·Kᵢ₋₁: the derivatives of the four rates.
///
/// Aᵢ is ∂f/∂x at the stage and Bᵢ what the rate hangs on directly: Aᵢ itself for derivatives by the state before the
/// step, since A·(1 + c·h·K) = A + c·h·A·K, and ∂f/∂p for those by parameters.
#[inline(always)]
fn through<const N: usize, const F: usize, const M: usize>(
    linear: &[Linear<N, F>; 4],
    b: [[[f64; M]; N]; 4],
    h: f64,
) -> [[f64; M]; N] {
    let half = 0.5 * h;
    let k1 = b[0];
    let k2 = plus_product(&b[1], &linear[1].slopes, &k1, half);
    let k3 = plus_product(&b[2], &linear[2].slopes, &k2, half);
    let k4 = plus_product(&b[3], &linear[3].slopes, &k3, h);
    let mut sum = k1;
    for i in 0..N {
        for k in 0..M {
            sum[i][k] = k1[i][k] + 2.0 * (k2[i][k] + k3[i][k]) + k4[i][k];
        }
    }
    sum
}

/// B + c·A·K.
#[inline(always)]
fn plus_product<const N: usize, const M: usize>(
    b: &[[f64; M]; N],
    a: &[[f64; N]; N],
    k: &[[f64; M]; N],
    c: f64,
) -> [[f64; M]; N] {
    let mut sum = *b;
    for i in 0..N {
        for column in 0..M {
            let mut product = a[i][0] * k[0][column];
            for j in 1..N {
                product += a[i][j] * k[j][column];
            }
            sum[i][column] += product * c;
        }
    }
    sum
}

/// The first of these numbers, and zeros behind them.
#[inline(always)]
pub(crate) fn padded<const N: usize>(x: &[f64], count: usize) -> [f64; N] {
    let mut padded = [0.0; N];
    for (padded, x) in padded.iter_mut().zip(x.iter().take(count)) {
        *padded = *x;
    }
    padded
}

/// Whether all are: 0·x is 0 or not a number.
#[inline]
pub(crate) fn are_finite(values: &[f64]) -> bool {
    values.iter().map(|value| value * 0.0).sum::<f64>() == 0.0
}

//! A step by exponential time differencing, with its Jacobian.

// Index loops over sizes that are known are the notation of the equations, and what unrolls; they must not become calls.
#![allow(clippy::inline_always, clippy::needless_range_loop)]

use super::tables::{StepMatrices, StepTables};
use super::{MOST_STATES, Motion, are_finite, padded};
use crate::program::{Program, ProgramNumbers};
use kalmems_core::Nodes;

impl Motion {
    /// The step, and its Jacobian where there is room for it, by the number of states.
    pub(super) fn over(
        &self,
        work: &mut ProgramNumbers,
        x: &[f64],
        over: (&Nodes<&[f64]>, &StepTables),
        to: &mut [f64],
        jacobian: &mut [f64],
    ) -> bool {
        // Where the linear part is all of the slopes, the Jacobian of the step is known with its matrices.
        let is_constant = self.is_linear && self.active.is_empty() && !over.1.is_runge_kutta();
        let is_known = jacobian.is_empty() || is_constant;
        macro_rules! by_size {
            ($($size:literal)+) => {
                match (self.size, self.room) {
                    $(
                        ($size, _) if is_known => self.chain::<$size, 0, false>(work, x, over, to, jacobian),
                        ($size, 0) => self.chain::<$size, 0, true>(work, x, over, to, jacobian),
                        ($size, 2) => self.chain::<$size, 2, true>(work, x, over, to, jacobian),
                        ($size, _) => self.chain::<$size, MOST_STATES, true>(work, x, over, to, jacobian),
                    )+
                    _ => false,
                }
            };
        }
        by_size!(1 2 3 4 5 6 8 12 16 24)
    }

    /// The step of [`Etdrk4`](kalmems_core::Etdrk4) and its Jacobian for N states, of which the last may not be there, and at most F
    /// parameters that the rates depend on.
    ///
    /// Rows of the rates that the linear part describes whole have no bend, so that all that is nonlinear costs by the rows that are. Without
    /// `LINEAR` nothing is differentiated, and the Jacobian that is written where there is room for it is that of the linear part.
    #[inline(never)]
    fn chain<const N: usize, const F: usize, const LINEAR: bool>(
        &self,
        work: &mut ProgramNumbers,
        x: &[f64],
        (inputs, tables): (&Nodes<&[f64]>, &StepTables),
        to: &mut [f64],
        jacobian: &mut [f64],
    ) -> bool {
        let Some(matrices) = tables.of::<N>() else { return false };
        let bent = tables.bent_rows::<N>();
        self.begin(work, x);
        let at = padded::<N>(x, self.states);
        let (mut of_states, mut of_parameters) = (Slopes::<N, N>::NONE, Slopes::<N, F>::NONE);

        Program::set_inputs(work, inputs.start);
        let (rate, linear) = self.stage::<N, F, LINEAR>(work, bent, &at, true);
        if LINEAR {
            of_states.begin(&matrices, bent, &linear.slopes, Some(matrices.straight_to_middle()));
            of_parameters.begin(&matrices, bent, &linear.by_parameter, None);
        }
        let first = times(matrices.to_middle(), &rate);

        Program::set_inputs(work, inputs.middle);
        let (there, linear) = self.stage::<N, F, LINEAR>(work, bent, &sum(&at, &first), true);
        let bend_a = bend(&matrices, bent, (&there, &rate), &first);
        let second = sum(&first, &times_bent(matrices.bend_to_middle(), bent, &bend_a));
        if LINEAR {
            of_states.middle(&matrices, bent, &linear.slopes, &linear.slopes);
            of_parameters.middle(&matrices, bent, &linear.slopes, &linear.by_parameter);
        }

        let (there, linear) = self.stage::<N, F, LINEAR>(work, bent, &sum(&at, &second), false);
        let bend_b = bend(&matrices, bent, (&there, &rate), &second);
        let straight = times(matrices.to_end(), &rate);
        let third = sum(&straight, &times_bent(matrices.bend_to_end(), bent, &bend_b));
        if LINEAR {
            of_states.second_middle(&matrices, bent, &linear.slopes, &linear.slopes);
            of_parameters.second_middle(&matrices, bent, &linear.slopes, &linear.by_parameter);
        }

        Program::set_inputs(work, inputs.end);
        let (there, linear) = self.stage::<N, F, LINEAR>(work, bent, &sum(&at, &third), true);
        let bend_c = bend(&matrices, bent, (&there, &rate), &third);
        let middles = times_bent(matrices.bend_of_middles(), bent, &sum(&bend_a, &bend_b));
        let end = times_bent(matrices.bend_of_end(), bent, &bend_c);
        if LINEAR {
            of_states.end(&matrices, bent, &linear.slopes, &linear.slopes);
            of_parameters.end(&matrices, bent, &linear.slopes, &linear.by_parameter);
        }

        let states = self.states.min(N).min(to.len());
        for i in 0..states {
            to[i] = at[i] + (straight[i] + (middles[i] + end[i]));
        }
        for i in states..to.len() {
            to[i] = x.get(i).copied().unwrap_or_default();
        }
        if jacobian.is_empty() {
            return are_finite(to);
        }
        let columns = self.states();
        jacobian.fill(0.0);
        let by_states = if LINEAR { &of_states.straight } else { matrices.straight_to_end() };
        for i in 0..columns.min(jacobian.len() / columns.max(1)) {
            let row = &mut jacobian[i * columns..(i + 1) * columns];
            // What is held depends on itself.
            row[i] = 1.0;
            if i < states {
                for j in 0..states {
                    row[j] += by_states[i][j];
                }
                for k in 0..self.active.len().min(F) {
                    row[self.active[k]] = of_parameters.straight[i][k];
                }
            }
        }
        are_finite(to)
            & are_finite(of_states.straight.as_flattened())
            & are_finite(of_parameters.straight.as_flattened())
    }

    /// f, and ∂f/∂x and ∂f/∂p where they are wanted.
    #[inline(always)]
    fn stage<const N: usize, const F: usize, const LINEAR: bool>(
        &self,
        work: &mut ProgramNumbers,
        bent: &[bool; N],
        x: &[f64; N],
        new_inputs: bool,
    ) -> ([f64; N], StageJacobians<N, F>) {
        let (mut rates, mut linear) = ([0.0; N], StageJacobians::NONE);
        if LINEAR {
            self.program.stage(work, x, new_inputs);
            take_rows(work, &self.slopes, bent, &mut linear.slopes);
            take_rows(work, &self.by_parameter, &[true; N], &mut linear.by_parameter);
        } else {
            self.program.first_stage(work, x, new_inputs);
        }
        take(work, &self.rates, &mut rates);
        (rates, linear)
    }
}

/// As many registers as there are numbers. A loop with an index is inlined, and an adapter of iterators is a call.
#[inline(always)]
fn take<const N: usize>(work: &ProgramNumbers, registers: &[u16], to: &mut [f64; N]) {
    let Some(registers) = registers.first_chunk::<N>() else { return };
    for k in 0..N {
        to[k] = work.get(registers[k]);
    }
}

/// Registers row by row, of the rows that are wanted.
#[inline(always)]
fn take_rows<const N: usize, const M: usize>(
    work: &ProgramNumbers,
    registers: &[u16],
    wanted: &[bool; N],
    to: &mut [[f64; M]; N],
) {
    if M == 0 {
        return;
    }
    for r in 0..N {
        if wanted[r] {
            take(work, registers.get(r * M..).unwrap_or_default(), &mut to[r]);
        }
    }
}

/// What one stage of a step is linearised to: ∂f/∂x and ∂f/∂p.
#[derive(Clone, Copy)]
struct StageJacobians<const N: usize, const F: usize> {
    slopes: [[f64; N]; N],
    by_parameter: [[f64; F]; N],
}

impl<const N: usize, const F: usize> StageJacobians<N, F> {
    const NONE: Self = Self { slopes: [[0.0; N]; N], by_parameter: [[0.0; F]; N] };
}

#[inline(always)]
fn sum<const N: usize>(a: &[f64; N], b: &[f64; N]) -> [f64; N] {
    let mut sum = [0.0; N];
    for i in 0..N {
        sum[i] = a[i] + b[i];
    }
    sum
}

#[inline(always)]
fn times<const N: usize>(matrix: &[[f64; N]; N], v: &[f64; N]) -> [f64; N] {
    let mut product = [0.0; N];
    for i in 0..N {
        let mut sum = matrix[i][0] * v[0];
        for j in 1..N {
            sum += matrix[i][j] * v[j];
        }
        product[i] = sum;
    }
    product
}

/// A matrix times a vector that is zero but in these rows.
#[inline(always)]
fn times_bent<const N: usize>(matrix: &[[f64; N]; N], bent: &[bool; N], v: &[f64; N]) -> [f64; N] {
    let mut product = [0.0; N];
    for r in 0..N {
        if !bent[r] {
            continue;
        }
        for i in 0..N {
            product[i] += matrix[i][r] * v[r];
        }
    }
    product
}

/// f(x + m) − f(x) − A·m in the rows that A does not describe whole.
#[inline(always)]
fn bend<const N: usize>(
    matrices: &StepMatrices<'_, N>,
    bent: &[bool; N],
    (there, here): (&[f64; N], &[f64; N]),
    by: &[f64; N],
) -> [f64; N] {
    let mut bend = [0.0; N];
    for r in 0..N {
        if !bent[r] {
            continue;
        }
        let row = &matrices.linear()[r];
        let mut described = row[0] * by[0];
        for j in 1..N {
            described += row[j] * by[j];
        }
        bend[r] = there[r] - here[r] - described;
    }
    bend
}

/// The derivatives of a step's stages by the states before it, or by parameters.
struct Slopes<const N: usize, const M: usize> {
    /// ∂f/∂ of the first stage, directly.
    direct: [[f64; M]; N],
    /// Those of the way to the stage that was taken last.
    way: [[f64; M]; N],
    /// Those of the straight way to the end, and in the end of all of the way.
    straight: [[f64; M]; N],
    /// Those of the bends in the middles.
    bends: [[f64; M]; N],
}

impl<const N: usize, const M: usize> Slopes<N, M> {
    const NONE: Self =
        Self { direct: [[0.0; M]; N], way: [[0.0; M]; N], straight: [[0.0; M]; N], bends: [[0.0; M]; N] };

    /// The first stage: by states, what the linear part does is known before; by parameters there is no linear part.
    #[inline(always)]
    fn begin(
        &mut self,
        matrices: &StepMatrices<'_, N>,
        bent: &[bool; N],
        direct: &[[f64; M]; N],
        of_states: Option<&[[f64; N]; N]>,
    ) {
        self.direct = *direct;
        if of_states.is_some() {
            for i in 0..N {
                for j in 0..N.min(M) {
                    self.way[i][j] = matrices.straight_to_middle()[i][j];
                    self.straight[i][j] = matrices.straight_to_end()[i][j];
                }
            }
            for r in 0..N {
                if !bent[r] {
                    continue;
                }
                let mut more = [0.0; M];
                for j in 0..N.min(M) {
                    more[j] = direct[r][j] - matrices.linear()[r][j];
                }
                add(&mut self.way, matrices.to_middle(), r, &more);
                add(&mut self.straight, matrices.to_end(), r, &more);
            }
        } else {
            for r in 0..N {
                add(&mut self.way, matrices.to_middle(), r, &direct[r]);
                add(&mut self.straight, matrices.to_end(), r, &direct[r]);
            }
        }
    }

    /// ∂(f(x + m) − f(x) − A·m) of a bent row: what it changes directly, and by the way m to where it is taken.
    #[inline(always)]
    fn bend(
        &self,
        matrices: &StepMatrices<'_, N>,
        r: usize,
        slopes: &[[f64; N]; N],
        direct: &[[f64; M]; N],
    ) -> [f64; M] {
        let mut bend = [0.0; M];
        for column in 0..M {
            bend[column] = direct[r][column] - self.direct[r][column];
        }
        for j in 0..N {
            let beyond = slopes[r][j] - matrices.linear()[r][j];
            for column in 0..M {
                bend[column] += beyond * self.way[j][column];
            }
        }
        bend
    }

    #[inline(always)]
    fn middle(
        &mut self,
        matrices: &StepMatrices<'_, N>,
        bent: &[bool; N],
        slopes: &[[f64; N]; N],
        direct: &[[f64; M]; N],
    ) {
        let mut way = self.way;
        for r in 0..N {
            if !bent[r] {
                continue;
            }
            let bend = self.bend(matrices, r, slopes, direct);
            add(&mut way, matrices.bend_to_middle(), r, &bend);
            self.bends[r] = bend;
        }
        self.way = way;
    }

    #[inline(always)]
    fn second_middle(
        &mut self,
        matrices: &StepMatrices<'_, N>,
        bent: &[bool; N],
        slopes: &[[f64; N]; N],
        direct: &[[f64; M]; N],
    ) {
        let mut way = self.straight;
        for r in 0..N {
            if !bent[r] {
                continue;
            }
            let bend = self.bend(matrices, r, slopes, direct);
            add(&mut way, matrices.bend_to_end(), r, &bend);
            for column in 0..M {
                self.bends[r][column] += bend[column];
            }
        }
        self.way = way;
    }

    #[inline(always)]
    fn end(
        &mut self,
        matrices: &StepMatrices<'_, N>,
        bent: &[bool; N],
        slopes: &[[f64; N]; N],
        direct: &[[f64; M]; N],
    ) {
        for r in 0..N {
            if !bent[r] {
                continue;
            }
            let bend = self.bend(matrices, r, slopes, direct);
            add(&mut self.straight, matrices.bend_of_middles(), r, &self.bends[r]);
            add(&mut self.straight, matrices.bend_of_end(), r, &bend);
        }
    }
}

/// Adds to `to` a column of a matrix times a row.
#[inline(always)]
fn add<const N: usize, const M: usize>(
    to: &mut [[f64; M]; N],
    matrix: &[[f64; N]; N],
    column: usize,
    row: &[f64; M],
) {
    for i in 0..N {
        for j in 0..M {
            to[i][j] += matrix[i][column] * row[j];
        }
    }
}

//! A step by Runge and Kutta's method, with its Jacobian.

// Index loops over sizes that are known are the notation of the equations, and what unrolls; they must not become calls.
#![allow(clippy::inline_always, clippy::needless_range_loop)]

use super::{MOST_STATES, Motion, are_finite, padded};
use crate::program::{Program, ProgramNumbers};
use kalmems_core::Nodes;

impl Motion {
    /// The step, and its Jacobian where there is room for it, by the number of states.
    pub(super) fn over(
        &self,
        work: &mut ProgramNumbers,
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
                        ($size, 2) => self.chain::<$size, 2, true>(work, x, over, to, jacobian),
                        ($size, _) => self.chain::<$size, MOST_STATES, true>(work, x, over, to, jacobian),
                    )+
                    _ => false,
                }
            };
        }
        by_size!(1 2 3 4 5 6 8 12 16)
    }

    /// The step and its Jacobian for N states, of which the last may not be there, and at most F parameters that the
    /// rates depend on.
    ///
    /// Each column s = ∂x/∂x₀ or ∂x/∂p goes with x through the stages by ṡ = ∂f/∂x·s + ∂f/∂p, by itself.
    #[inline(never)]
    fn chain<const N: usize, const F: usize, const LINEAR: bool>(
        &self,
        work: &mut ProgramNumbers,
        x: &[f64],
        (inputs, interval): (&Nodes<&[f64]>, f64),
        to: &mut [f64],
        jacobian: &mut [f64],
    ) -> bool {
        self.begin(work, x);
        let at = padded::<N>(x, self.states);
        let half = 0.5 * interval;
        let (mut of_states, mut of_parameters) =
            (RateDerivatives::<N, N>::NONE, RateDerivatives::<N, F>::NONE);
        // The columns of a stage are computed while the next one waits for its exponentials.
        let mut take = |linear: StageJacobians<N, F>, onwards: f64, weight: f64| {
            if LINEAR {
                of_states.take(&linear.slopes, &linear.slopes, onwards, weight);
                of_parameters.take(&linear.slopes, &linear.by_parameter, onwards, weight);
            }
        };
        Program::set_inputs(work, inputs.start);
        let (k1, linear) = self.stage::<N, F, LINEAR>(work, &at, true);
        take(linear, 0.0, 1.0);
        Program::set_inputs(work, inputs.middle);
        let (k2, linear) = self.stage::<N, F, LINEAR>(work, &moved(&at, &k1, half), true);
        take(linear, half, 2.0);
        let (k3, linear) = self.stage::<N, F, LINEAR>(work, &moved(&at, &k2, half), false);
        take(linear, half, 2.0);
        Program::set_inputs(work, inputs.end);
        let (k4, linear) = self.stage::<N, F, LINEAR>(work, &moved(&at, &k3, interval), true);
        take(linear, interval, 1.0);

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
        let columns = self.states();
        jacobian.fill(0.0);
        for (i, row) in jacobian.chunks_exact_mut(columns.max(1)).enumerate() {
            // What is held depends on itself.
            if let Some(entry) = row.get_mut(i) {
                *entry = 1.0;
            }
            if i < states {
                for (entry, sum) in row.iter_mut().zip(&of_states.sum[i]).take(states) {
                    *entry += sum * sixth;
                }
                for (column, sum) in self.active.iter().zip(&of_parameters.sum[i]) {
                    if let Some(entry) = row.get_mut(*column) {
                        *entry = sum * sixth;
                    }
                }
            }
        }
        are_finite(to)
            & are_finite(of_states.sum.as_flattened())
            & are_finite(of_parameters.sum.as_flattened())
    }

    /// f, and ∂f/∂x and ∂f/∂p where they are wanted.
    #[inline(always)]
    fn stage<const N: usize, const F: usize, const LINEAR: bool>(
        &self,
        work: &mut ProgramNumbers,
        x: &[f64; N],
        new_inputs: bool,
    ) -> ([f64; N], StageJacobians<N, F>) {
        self.program.stage(work, x, new_inputs);
        let rates = self.rates.first_chunk::<N>();
        let rates = rates.map_or([0.0; N], |registers| registers.map(|register| work.get(register)));
        let mut linear = StageJacobians::NONE;
        if LINEAR {
            for (row, registers) in linear.slopes.iter_mut().zip(self.slopes.as_chunks::<N>().0) {
                *row = registers.map(|register| work.get(register));
            }
            let by_parameter = linear.by_parameter.as_flattened_mut();
            for (slope, register) in by_parameter.iter_mut().zip(&self.by_parameter) {
                *slope = work.get(*register);
            }
        }
        (rates, linear)
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

/// x + h·k.
#[inline(always)]
fn moved<const N: usize>(x: &[f64; N], k: &[f64; N], h: f64) -> [f64; N] {
    std::array::from_fn(|i| x[i] + k[i] * h)
}

/// K₁ + 2·K₂ + 2·K₃ + K₄ with Kᵢ = Bᵢ + cᵢ·h·Aᵢ·Kᵢ₋₁: the derivatives of the four rates.
///
/// Aᵢ is ∂f/∂x at the stage and Bᵢ what the rate depends on directly: Aᵢ itself for derivatives by the state before the
/// step, since A·(1 + c·h·K) = A + c·h·A·K, and ∂f/∂p for those by parameters.
struct RateDerivatives<const N: usize, const M: usize> {
    last: [[f64; M]; N],
    sum: [[f64; M]; N],
}

impl<const N: usize, const M: usize> RateDerivatives<N, M> {
    const NONE: Self = Self { last: [[0.0; M]; N], sum: [[0.0; M]; N] };

    /// The next stage: with A, B, c·h, which is 0 for the first one, and its weight.
    #[inline(always)]
    fn take(&mut self, a: &[[f64; N]; N], b: &[[f64; M]; N], onwards: f64, weight: f64) {
        let mut next = *b;
        if onwards != 0.0 {
            for i in 0..N {
                for column in 0..M {
                    let mut product = a[i][0] * self.last[0][column];
                    for j in 1..N {
                        product += a[i][j] * self.last[j][column];
                    }
                    next[i][column] += product * onwards;
                }
            }
        }
        for i in 0..N {
            for column in 0..M {
                self.sum[i][column] += weight * next[i][column];
            }
        }
        self.last = next;
    }
}

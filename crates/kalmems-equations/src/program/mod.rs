//! Expressions as instructions over registers, run without allocation.

mod lower;
mod needs;
mod op;
mod run;
mod sums;

pub(crate) use lower::RegisterCounts;
pub(crate) use op::{REGISTERS, STATES};

use crate::curve::Curve;
use crate::graph::{Graph, NodeId};
use lower::{Stratum, StratumCode, lower};
use op::Instruction;
use run::{Registers, Tables, run};
use std::sync::Arc;

/// The numbers that a program works on: those of its parameters, and what follows from them.
///
/// It belongs to the program that made it.
#[derive(Clone, Debug)]
pub struct ProgramNumbers {
    registers: Box<Registers>,
}

/// Instructions for some expressions of a device.
#[derive(Clone, Debug)]
pub(crate) struct Program {
    code: StratumCode,
    /// The instructions of the inputs, and behind them those of the states: first those that the first results need.
    stage: Vec<Instruction>,
    /// How many of these the first results need, where some are asked for alone.
    of_first: usize,
    counts: RegisterCounts,
    tables: Tables,
}

impl Program {
    /// For these nodes, with these parameters changing from step to step; `None` where they are too many.
    pub(crate) fn of(
        graph: &Graph,
        roots: &[NodeId],
        counts: RegisterCounts,
        free: &[usize],
        curves: &Arc<[Curve]>,
    ) -> Option<Self> {
        let code = lower(graph, roots, counts, free)?;
        let stage: Vec<_> =
            [Stratum::Input, Stratum::State].into_iter().flat_map(|of| code.of(of)).copied().collect();
        let tables = Tables { arguments: code.arguments.clone(), curves: curves.clone() };
        Some(Self { of_first: stage.len(), code, stage, counts, tables })
    }

    /// Registers with these values of the parameters, and all that follows from them alone.
    pub(crate) fn work(&self, parameters: &[f64]) -> ProgramNumbers {
        // On the heap from the start: an array would be on the stack first.
        let zeros = vec![0.0; REGISTERS].into_boxed_slice();
        #[allow(clippy::large_stack_arrays)] // not met: the slice has as many numbers
        let registers = zeros.try_into().unwrap_or_else(|_| Box::new([0.0; REGISTERS]));
        let mut work = ProgramNumbers { registers };
        for (register, value) in &self.code.literals {
            if let Some(slot) = work.registers.get_mut(usize::from(*register)) {
                *slot = *value;
            }
        }
        Self::put(&mut work, STATES + self.counts.inputs, parameters);
        self.run(Stratum::Literal, &mut work);
        self.run(Stratum::Parameter, &mut work);
        work
    }

    /// Gives a parameter that changes from step to step its value; [`Program::begin_step`] follows.
    pub(crate) fn set_parameter(&self, work: &mut ProgramNumbers, parameter: usize, value: f64) {
        Self::put(work, STATES + self.counts.inputs + parameter, &[value]);
    }

    /// Computes what follows from the parameters that change from step to step.
    #[inline]
    pub(crate) fn begin_step(&self, work: &mut ProgramNumbers) {
        self.run(Stratum::Step, work);
    }

    /// Gives the inputs their values; a stage follows.
    #[inline]
    pub(crate) fn set_inputs(work: &mut ProgramNumbers, inputs: &[f64]) {
        Self::put(work, STATES, inputs);
    }

    /// Gives the states their values, at most as many as a program has, and computes what follows from them; from the
    /// inputs too where these are new.
    #[inline]
    pub(crate) fn stage<const N: usize>(
        &self,
        work: &mut ProgramNumbers,
        states: &[f64; N],
        new_inputs: bool,
    ) {
        self.stage_of(work, states, new_inputs, self.stage.len());
    }

    /// The same for the first results alone.
    #[inline]
    pub(crate) fn first_stage<const N: usize>(
        &self,
        work: &mut ProgramNumbers,
        states: &[f64; N],
        new_inputs: bool,
    ) {
        self.stage_of(work, states, new_inputs, self.of_first);
    }

    #[inline]
    fn stage_of<const N: usize>(
        &self,
        work: &mut ProgramNumbers,
        states: &[f64; N],
        new_inputs: bool,
        end: usize,
    ) {
        const { assert!(N <= STATES, "behind the states are the inputs") };
        if let Some(registers) = work.registers.first_chunk_mut::<N>() {
            *registers = *states;
        }
        let skipped = if new_inputs { 0 } else { self.code.of(Stratum::Input).len() };
        run(self.stage.get(skipped..end).unwrap_or_default(), &mut work.registers, &self.tables);
    }

    #[inline]
    fn put(work: &mut ProgramNumbers, start: usize, values: &[f64]) {
        let Some(registers) = work.registers.get_mut(start..start + values.len()) else { return };
        match (registers, values) {
            // Most devices have one input, for which a copy of any length would be a call.
            ([register], [value]) => *register = *value,
            (registers, values) => registers.copy_from_slice(values),
        }
    }

    #[inline]
    fn run(&self, stratum: Stratum, work: &mut ProgramNumbers) {
        run(self.code.of(stratum), &mut work.registers, &self.tables);
    }

    /// The registers of the results, in the order of the nodes.
    pub(crate) fn outputs(&self) -> &[u16] {
        &self.code.outputs
    }

    /// How many instructions a stage runs, those of the inputs and of the states.
    pub(crate) fn stage_length(&self) -> usize {
        self.stage.len()
    }
}

impl ProgramNumbers {
    /// A register.
    #[inline]
    pub(crate) fn get(&self, register: u16) -> f64 {
        self.registers[usize::from(register) & (REGISTERS - 1)]
    }
}

//! Expressions as instructions over registers, run without allocation.

mod lower;
mod op;
mod run;

pub(crate) use lower::Counts;
pub(crate) use op::REGISTERS;

use crate::curve::Curve;
use crate::graph::{Graph, NodeId};
use lower::{Code, Stratum, lower};
use run::{Registers, run};
use std::sync::Arc;

/// The numbers that a program works on: those of its parameters, and what follows from them.
///
/// It belongs to the program that made it.
#[derive(Clone, Debug)]
pub struct Work {
    registers: Box<Registers>,
}

/// Instructions for some expressions of a device.
#[derive(Clone, Debug)]
pub(crate) struct Program {
    code: Code,
    counts: Counts,
    curves: Arc<[Curve]>,
}

impl Program {
    /// For these nodes, with these parameters changing from step to step; `None` where they are too many.
    pub(crate) fn of(
        graph: &Graph,
        roots: &[NodeId],
        counts: Counts,
        free: &[usize],
        curves: &Arc<[Curve]>,
    ) -> Option<Self> {
        let code = lower(graph, roots, counts, free)?;
        Some(Self { code, counts, curves: curves.clone() })
    }

    /// Registers with these values of the parameters, and all that follows from them alone.
    pub(crate) fn work(&self, parameters: &[f64]) -> Work {
        // On the heap from the start: a debug build would have it on the stack first.
        let registers = vec![0.0; REGISTERS].into_boxed_slice().try_into();
        let mut work = Work { registers: registers.unwrap_or_else(|_| Box::new([0.0; REGISTERS])) };
        for (register, value) in &self.code.literals {
            if let Some(slot) = work.registers.get_mut(usize::from(*register)) {
                *slot = *value;
            }
        }
        self.put(&mut work, self.counts.states + self.counts.inputs, parameters);
        self.run(Stratum::Literal, &mut work);
        self.run(Stratum::Parameter, &mut work);
        work
    }

    /// Gives a parameter that changes from step to step its value; [`Program::begin_step`] follows.
    pub(crate) fn set_parameter(&self, work: &mut Work, parameter: usize, value: f64) {
        self.put(work, self.counts.states + self.counts.inputs + parameter, &[value]);
    }

    /// Computes what follows from the parameters that change from step to step.
    #[inline]
    pub(crate) fn begin_step(&self, work: &mut Work) {
        self.run(Stratum::Step, work);
    }

    /// Gives the inputs their values and computes what follows from them.
    #[inline]
    pub(crate) fn set_inputs(&self, work: &mut Work, inputs: &[f64]) {
        self.put(work, self.counts.states, inputs);
        self.run(Stratum::Input, work);
    }

    /// Gives the states their values and computes the rest.
    #[inline]
    pub(crate) fn set_states(&self, work: &mut Work, states: &[f64]) {
        self.put(work, 0, states);
        self.run(Stratum::State, work);
    }

    #[inline]
    fn put(&self, work: &mut Work, start: usize, values: &[f64]) {
        for (slot, value) in work.registers.iter_mut().skip(start).zip(values) {
            *slot = *value;
        }
    }

    #[inline]
    fn run(&self, stratum: Stratum, work: &mut Work) {
        if let Some(code) = self.code.of.get(stratum as usize).filter(|code| !code.is_empty()) {
            run(code, &mut work.registers, &self.code.arguments, &self.curves);
        }
    }

    /// The registers of the results, in the order of the nodes.
    pub(crate) fn outputs(&self) -> &[u16] {
        &self.code.outputs
    }

    /// How many instructions a stage runs, those of the inputs and of the states.
    pub(crate) fn stage_length(&self) -> usize {
        self.code.of.iter().skip(Stratum::Input as usize).map(Vec::len).sum()
    }
}

impl Work {
    /// A register.
    #[inline]
    pub(crate) fn get(&self, register: u16) -> f64 {
        self.registers[usize::from(register) & (REGISTERS - 1)]
    }
}

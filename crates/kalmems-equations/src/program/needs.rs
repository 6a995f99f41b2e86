//! Which instructions some results need, and which the others need besides.

use super::Program;
use super::lower::{Stratum, StratumCode};
use super::op::{Instruction, OpKind, REGISTERS};
use crate::laws::MOST_ARGUMENTS;

impl Instruction {
    /// The registers that it reads; those of a law's arguments are on a list.
    fn reads<'a>(&'a self, arguments: &'a [u16]) -> impl Iterator<Item = u16> + 'a {
        let (own, list) = match self.kind {
            OpKind::Reciprocal | OpKind::Power | OpKind::Call(_) => (1, None),
            OpKind::Add | OpKind::Subtract | OpKind::Multiply | OpKind::Angle => (2, None),
            // A curve reads the first and the third. The second is its number and no register: taken for one, it costs an instruction at most.
            OpKind::MultiplyAdd | OpKind::Curve => (3, None),
            OpKind::Products2 | OpKind::Choice | OpKind::ShortLaw(_) => (4, None),
            OpKind::Products2Add => (5, None),
            OpKind::Products3 => (6, None),
            OpKind::Law(_) | OpKind::Partial(_) => {
                (0, arguments.chunks_exact(MOST_ARGUMENTS).nth(self.of[0].into()))
            }
        };
        self.of.iter().take(own).chain(list.into_iter().flatten()).copied()
    }

    /// The registers that it writes.
    fn writes(&self) -> impl Iterator<Item = u16> + '_ {
        let derivatives = match self.kind {
            OpKind::ShortLaw(_) | OpKind::Law(_) | OpKind::Curve => 2,
            OpKind::Add
            | OpKind::Subtract
            | OpKind::Multiply
            | OpKind::MultiplyAdd
            | OpKind::Products2
            | OpKind::Products2Add
            | OpKind::Products3
            | OpKind::Reciprocal
            | OpKind::Power
            | OpKind::Call(_)
            | OpKind::Angle
            | OpKind::Choice
            | OpKind::Partial(_) => 0,
        };
        self.of.iter().rev().take(derivatives).copied().chain([self.to])
    }
}

impl StratumCode {
    /// The instructions of a stratum that the first so many results need, and the others, each in their order.
    fn divided(&self, stratum: Stratum, first: usize) -> (Vec<Instruction>, Vec<Instruction>) {
        let mut needed = vec![false; REGISTERS];
        let mark = |needed: &mut [bool], register: u16| {
            if let Some(needed) = needed.get_mut(usize::from(register)) {
                *needed = true;
            }
        };
        self.outputs.iter().take(first).for_each(|register| mark(&mut needed, *register));
        let (mut own, mut others) = (Vec::new(), Vec::new());
        for instruction in self.of(stratum).iter().rev() {
            if instruction.writes().any(|register| needed.get(usize::from(register)) == Some(&true)) {
                instruction.reads(&self.arguments).for_each(|register| mark(&mut needed, register));
                own.push(*instruction);
            } else {
                others.push(*instruction);
            }
        }
        own.reverse();
        others.reverse();
        (own, others)
    }
}

impl Program {
    /// The same, of which the first so many results can be computed alone; the numbers are the same to the last bit.
    #[must_use]
    pub(crate) fn with_first_results(self, first: usize) -> Self {
        let (own, others) = self.code.divided(Stratum::State, first);
        let mut stage = self.code.of(Stratum::Input).to_vec();
        stage.extend(own);
        let of_first = stage.len();
        stage.extend(others);
        Self { stage, of_first, ..self }
    }
}

//! The interpreter.

use super::op::{Instruction, OpKind, REGISTERS};
use crate::curve::Curve;
use crate::graph::whole_power;
use crate::laws::{self, LawId, MOST_ARGUMENTS};
use kalmems_core::{Portable, Scalar};
use std::sync::Arc;

/// The numbers of a program.
pub(crate) type Registers = [f64; REGISTERS];

/// What instructions refer to beside registers.
#[derive(Clone, Debug)]
pub(crate) struct Tables {
    /// The registers of the arguments of laws.
    pub(crate) arguments: Vec<u16>,
    pub(crate) curves: Arc<[Curve]>,
}

/// Runs instructions, one after the other.
///
/// Not inlined: there is one, whatever runs it. An index is below the number of registers once it is masked, which the
/// compiler sees.
#[inline(never)]
pub(crate) fn run(code: &[Instruction], r: &mut Registers, tables: &Tables) {
    for op in code {
        // Read where it is needed, and not before the branch.
        macro_rules! r {
            ($operand:literal) => {
                r[at(op.of[$operand])]
            };
        }
        let value = match op.kind {
            OpKind::Add => r!(0) + r!(1),
            OpKind::Subtract => r!(0) - r!(1),
            OpKind::Multiply => r!(0) * r!(1),
            OpKind::MultiplyAdd => r!(0) * r!(1) + r!(2),
            OpKind::Products2 => r!(0) * r!(1) + r!(2) * r!(3),
            OpKind::Products2Add => r!(0) * r!(1) + r!(2) * r!(3) + r!(4),
            OpKind::Products3 => r!(0) * r!(1) + r!(2) * r!(3) + r!(4) * r!(5),
            OpKind::Reciprocal => 1.0 / r!(0),
            OpKind::Power => whole_power(r!(0), i32::from(op.of[1].cast_signed())),
            OpKind::Call(function) => function.apply(r!(0)),
            OpKind::Angle => r!(0).portable_atan2(r!(1)),
            OpKind::Choice => Scalar::select(r!(0) < r!(1), r!(2), r!(3)),
            // The law that most devices have is worth a branch of its own.
            OpKind::ShortLaw(LawId::GaussianComb) => {
                let [value, slope, bend] = laws::gaussian_along_first(r!(0), r!(1), r!(2), r!(3));
                r!(4) = slope;
                r!(5) = bend;
                value
            }
            OpKind::ShortLaw(law) => {
                let [value, slope, bend] = laws::along_first_of_four(law, r!(0), r!(1), r!(2), r!(3));
                r!(4) = slope;
                r!(5) = bend;
                value
            }
            OpKind::Law(law) => {
                let [value, slope, bend] = laws::along_first(law, &gathered(r, &tables.arguments, op.of[0]));
                r!(4) = slope;
                r!(5) = bend;
                value
            }
            OpKind::Partial(law) => {
                #[allow(clippy::cast_possible_truncation)] // of an argument, of which there are seven
                let by = [op.of[2], op.of[3], op.of[4]].map(|index| index as u8);
                let by = by.get(..usize::from(op.of[1])).unwrap_or_default();
                laws::partial(law, by, &gathered(r, &tables.arguments, op.of[0]))
            }
            OpKind::Curve => {
                let curve = tables.curves.get(usize::from(op.of[1]));
                let [value, slope, bend] = match curve {
                    Some(curve) => curve.at([r!(0), r!(2)], op.of[3].into()),
                    None => [f64::NAN; 3],
                };
                r!(4) = slope;
                r!(5) = bend;
                value
            }
        };
        r[at(op.to)] = value;
    }
}

/// The place of a register.
#[inline(always)]
#[allow(clippy::inline_always)] // a call would be paid for each number of each instruction
fn at(register: u16) -> usize {
    usize::from(register) & (REGISTERS - 1)
}

/// The arguments of a law that begin at this place of the list.
#[inline]
fn gathered(r: &Registers, arguments: &[u16], start: u16) -> [f64; MOST_ARGUMENTS] {
    let start = usize::from(start) * MOST_ARGUMENTS;
    let mut values = [0.0; MOST_ARGUMENTS];
    if let Some(places) = arguments.get(start..start + MOST_ARGUMENTS) {
        for (value, place) in values.iter_mut().zip(places) {
            *value = r[at(*place)];
        }
    }
    values
}

//! The interpreter.

use super::op::{Kind, Op, REGISTERS};
use crate::curve::Curve;
use crate::graph::whole_power;
use crate::laws::{self, MOST_ARGUMENTS};
use kalmems_core::Scalar;

/// The numbers of a program.
pub(crate) type Registers = [f64; REGISTERS];

/// Runs instructions, one after the other.
///
/// Not inlined: there is one, whatever runs it. An index is below the number of registers once it is masked, which the
/// compiler sees.
#[inline(never)]
pub(crate) fn run(code: &[Op], r: &mut Registers, arguments: &[u16], curves: &[Curve]) {
    for op in code {
        let at = |register: u16| usize::from(register) & (REGISTERS - 1);
        let [a, b, c, d, e, f] = op.of.map(at);
        let value = match op.kind {
            Kind::Add => r[a] + r[b],
            Kind::Subtract => r[a] - r[b],
            Kind::Multiply => r[a] * r[b],
            Kind::MultiplyAdd => r[a] * r[b] + r[c],
            Kind::Products2 => r[a] * r[b] + r[c] * r[d],
            Kind::Products2Add => r[a] * r[b] + r[c] * r[d] + r[e],
            Kind::Products3 => r[a] * r[b] + r[c] * r[d] + r[e] * r[f],
            Kind::Reciprocal => 1.0 / r[a],
            Kind::Power => whole_power(r[a], i32::from(op.of[1].cast_signed())),
            Kind::Call(function) => function.apply(r[a]),
            Kind::Choice => Scalar::select(r[a] < r[b], r[c], r[d]),
            Kind::Law(law) => {
                let [value, slope, bend] = laws::along_first(law, &gathered(r, arguments, op.of[0]));
                r[b] = slope;
                r[c] = bend;
                value
            }
            Kind::Partial(law) => {
                #[allow(clippy::cast_possible_truncation)] // of an argument, of which there are seven
                let by = [op.of[2], op.of[3], op.of[4]].map(|index| index as u8);
                let by = by.get(..usize::from(op.of[1])).unwrap_or_default();
                laws::partial(law, by, &gathered(r, arguments, op.of[0]))
            }
            Kind::Curve => {
                let curve = curves.get(usize::from(op.of[1]));
                let [value, slope, bend] = curve.map_or([f64::NAN; 3], |curve| curve.at(r[a]));
                r[c] = slope;
                r[d] = bend;
                value
            }
        };
        r[at(op.to)] = value;
    }
}

/// The arguments of a law that begin at this place of the list.
#[inline]
fn gathered(r: &Registers, arguments: &[u16], start: u16) -> [f64; MOST_ARGUMENTS] {
    let start = usize::from(start) * MOST_ARGUMENTS;
    let mut values = [0.0; MOST_ARGUMENTS];
    if let Some(places) = arguments.get(start..start + MOST_ARGUMENTS) {
        for (value, place) in values.iter_mut().zip(places) {
            *value = r[usize::from(*place) & (REGISTERS - 1)];
        }
    }
    values
}

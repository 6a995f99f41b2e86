//! One instruction of a program.

use crate::graph::Function;
use crate::laws::LawId;

/// Registers of a program. A power of two: an index is masked and needs no check.
pub(crate) const REGISTERS: usize = 4096;

/// The first registers: states, and behind them the inputs.
pub(crate) const STATES: usize = 24;

/// What is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum OpKind {
    /// a + b
    Add,
    /// a − b
    Subtract,
    /// a·b
    Multiply,
    /// a·b + c
    MultiplyAdd,
    /// a·b + c·d
    Products2,
    /// a·b + c·d + e
    Products2Add,
    /// a·b + c·d + e·f
    Products3,
    /// 1/a
    Reciprocal,
    /// a^n of the whole number whose bits are in b
    Power,
    /// An elementary function of a.
    Call(Function),
    /// The angle of the point (b, a).
    Angle,
    /// c where a < b, d elsewhere
    Choice,
    /// A law of the arguments a to d: its value, and its first and second derivative by its first argument into the
    /// registers e and f.
    ShortLaw(LawId),
    /// A law of the arguments from the place a on: its value, and its first and second derivative by its first argument
    /// into the registers e and f.
    Law(LawId),
    /// One derivative of a law of the arguments from the place a on, by the b arguments that stand in c, d and e.
    Partial(LawId),
    /// The curve b at a: its value, and its derivatives into the registers e and f. Of two arguments, a and c, the derivatives of the group with the
    /// number d.
    Curve,
}

/// One instruction: what, where to, and of which registers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Instruction {
    pub(crate) kind: OpKind,
    pub(crate) to: u16,
    pub(crate) of: [u16; 6],
}

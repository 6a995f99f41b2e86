//! An expression as it is written.

use kalmems_units::Unit;
use std::ops::Range;

/// The place of a term in [`SyntaxTree::terms`].
pub(crate) type TermId = usize;

/// A text that was read: its terms, each behind those that it is made of, so that whatever goes over them needs no
/// recursion. The last one is the whole.
#[derive(Clone, Debug)]
pub(crate) struct SyntaxTree {
    pub(crate) terms: Vec<Term>,
    /// The unit behind `in`, which the whole is to have.
    pub(crate) unit: Option<(Unit, Range<usize>)>,
}

/// A part of an expression.
#[derive(Clone, Debug)]
pub(crate) struct Term {
    pub(crate) form: TermForm,
    /// Where it stands in the text.
    pub(crate) span: Range<usize>,
}

/// What a part of an expression is.
#[derive(Clone, Debug)]
pub(crate) enum TermForm {
    /// A number in SI, with its unit where one is written.
    Number(f64, Option<Unit>),
    /// The name with this span.
    Name(Range<usize>),
    /// Terms, each with whether it is subtracted.
    Sum(Vec<(bool, TermId)>),
    /// Factors, each with whether it divides.
    Product(Vec<(bool, TermId)>),
    /// The opposite.
    Negative(TermId),
    /// A power.
    Power(TermId, TermId),
    /// A function, whose name has this span, of these arguments.
    Call(Range<usize>, Vec<TermId>),
    /// `if(a < b, then, otherwise)`.
    Choice { smaller: TermId, larger: TermId, then: TermId, otherwise: TermId },
    /// `d(of, by)`: the partial derivative by the variable whose name has this span.
    Partial { of: TermId, by: Range<usize> },
    /// `ddt(of)`: the total derivative along the motion.
    Rate { of: TermId },
}

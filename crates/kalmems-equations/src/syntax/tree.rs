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
    /// `a < b`: a condition, as are the three below.
    Comparison { smaller: TermId, larger: TermId },
    /// `a < b and c < d and …`.
    All(Vec<TermId>),
    /// `a < b or c < d or …`.
    Any(Vec<TermId>),
    /// `not a < b`.
    Not(TermId),
    /// `if(condition, then, otherwise)`.
    Choice { condition: TermId, then: TermId, otherwise: TermId },
    /// `d(of, by)`: the partial derivative by the variable whose name has this span.
    Partial { of: TermId, by: Range<usize> },
    /// `ddt(of)`: the total derivative along the motion.
    Rate { of: TermId },
}

impl TermForm {
    /// Whether it holds or does not, and is no value.
    pub(crate) fn is_condition(&self) -> bool {
        matches!(self, Self::Comparison { .. } | Self::All(_) | Self::Any(_) | Self::Not(_))
    }

    /// Its parts that must be values.
    pub(crate) fn values(&self) -> Vec<TermId> {
        match self {
            Self::Number(..) | Self::Name(_) | Self::All(_) | Self::Any(_) | Self::Not(_) => Vec::new(),
            Self::Sum(parts) | Self::Product(parts) => parts.iter().map(|(_, part)| *part).collect(),
            Self::Negative(of) | Self::Partial { of, .. } | Self::Rate { of } => vec![*of],
            Self::Power(a, b) | Self::Comparison { smaller: a, larger: b } => vec![*a, *b],
            Self::Call(_, arguments) => arguments.clone(),
            Self::Choice { then, otherwise, .. } => vec![*then, *otherwise],
        }
    }
}

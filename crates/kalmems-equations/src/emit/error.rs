//! Why no source can be written.

use crate::error::EquationError;
use std::fmt::Display;

/// Why a filter cannot be written as source.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EmitError {
    /// The equations become too large, or need a derivative that is not there.
    #[error(transparent)]
    Equation(#[from] EquationError),
    /// A part of the request is wrong.
    #[error("{field}: found {found}; expected {expected}")]
    Request {
        /// Which part of the request.
        field: &'static str,
        /// What is there.
        found: String,
        /// What could be there.
        expected: String,
    },
    /// A law has no form in source code of this derivative.
    #[error(
        "a derivative of order {order} of `{law}` by the arguments {by:?} is not written as source; write the law as a formula"
    )]
    Law {
        /// Its name.
        law: &'static str,
        /// The order of the derivative.
        order: usize,
        /// By which arguments, from 0 on.
        by: Vec<u8>,
    },
    /// A constant is too large or too small for a number of 32 bits, in the units that were chosen.
    #[error(
        "the constant {value:e} does not fit a number of 32 bits; give the states other typical magnitudes or origins"
    )]
    Range {
        /// The constant.
        value: f64,
    },
}

impl EmitError {
    /// A part of the request that is wrong.
    pub(super) fn request(field: &'static str, found: &dyn Display, expected: impl Into<String>) -> Self {
        Self::Request { field, found: format!("{found}"), expected: expected.into() }
    }
}

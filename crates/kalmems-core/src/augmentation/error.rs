//! What cannot be augmented.

use crate::parameters::ParameterName;
use core::fmt;

/// Why a model cannot be augmented; `state` counts the added states from 0.
#[derive(Clone, Copy, Debug)]
pub enum AugmentationError {
    /// The model has no parameter of the name given for this state.
    NoSuchParameter {
        /// The added state.
        state: usize,
    },
    /// Two states enter the same parameter.
    EnteredTwice {
        /// The parameter.
        parameter: ParameterName,
        /// The second of the states.
        state: usize,
    },
    /// The scale of this state is 0 or not finite.
    Scale {
        /// The added state.
        state: usize,
    },
    /// The density or deviation of this state is negative or not finite, or its correlation time not positive.
    Drift {
        /// The added state.
        state: usize,
    },
}

impl fmt::Display for AugmentationError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoSuchParameter { state } => {
                write!(f, "the model has no parameter of the name given for the added state {state}")
            }
            Self::EnteredTwice { parameter, state } => {
                write!(f, "the added state {state} enters `{parameter}`, which another state enters already")
            }
            Self::Scale { state } => {
                write!(f, "the scale of the added state {state} is zero or not a finite number")
            }
            Self::Drift { state } => write!(
                f,
                "the drift of the added state {state} is not one: a density and a deviation are at least 0, a \
                 correlation time is above it"
            ),
        }
    }
}

impl core::error::Error for AugmentationError {}

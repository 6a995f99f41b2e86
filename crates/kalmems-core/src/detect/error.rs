//! What a detector cannot be made of.

use core::fmt;

/// Why a kernel or a threshold was not made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DetectError {
    /// The width of a Gaussian must be a positive number of samples.
    Width {
        /// What was given.
        samples: f64,
    },
    /// The standard deviation of the noise must be a positive number.
    Noise {
        /// What was given, in the signal's unit.
        deviation: f64,
    },
    /// No threshold has this rate of false alarms: it must be positive, and noise alone has no more maxima than
    /// `largest`.
    Rate {
        /// What was asked for, per sample.
        per_sample: f64,
        /// The rate with a threshold of zero, per sample.
        largest: f64,
    },
}

impl fmt::Display for DetectError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Width { samples } => {
                write!(f, "a Gaussian of width {samples} samples: give a positive number")
            }
            Self::Noise { deviation } => {
                write!(f, "noise of standard deviation {deviation}: give a positive number")
            }
            Self::Rate { per_sample, largest } => write!(
                f,
                "{per_sample} false alarms per sample: give a positive number below {largest}, the rate of all maxima"
            ),
        }
    }
}

impl core::error::Error for DetectError {}

//! Why parameters cannot be identified.

use crate::config::ConfigError;
use crate::evaluate::ReferenceError;
use crate::fit::{FitError, ShootingError};
use crate::recording::ReadError;

/// What keeps parameters from being identified.
#[derive(Debug, thiserror::Error)]
pub enum IdentifyError {
    /// The experiment file is wrong.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// A recording is.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// A reference is.
    #[error(transparent)]
    Reference(#[from] ReferenceError),
    /// A fit did not come to an end.
    #[error("{recording}: {source}")]
    Fit {
        /// The recording.
        recording: String,
        /// Why.
        source: FitError,
    },
    /// A model does not have what is to be fitted.
    #[error(transparent)]
    Shooting(#[from] ShootingError),
    /// A recording does not hold what its role asks for.
    #[error("{recording}: {why}")]
    Unfit {
        /// The recording.
        recording: String,
        /// What was found, what was expected, and what to do.
        why: String,
    },
    /// Stopped from outside.
    #[error("interrupted; nothing was written")]
    Interrupted,
}

impl IdentifyError {
    /// Whether it was stopped from outside.
    pub fn is_interruption(&self) -> bool {
        matches!(
            self,
            Self::Interrupted
                | Self::Fit { source: FitError::Interrupted, .. }
                | Self::Read(ReadError::Interrupted { .. })
                | Self::Reference(ReferenceError::Read(ReadError::Interrupted { .. }))
        )
    }
}

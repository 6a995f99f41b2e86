//! Why there is no diagnosis.

use crate::config::ConfigError;
use crate::recording::ReadError;

/// What keeps a diagnosis from being made.
#[derive(Debug, thiserror::Error)]
pub enum DiagnoseError {
    /// The experiment file is wrong.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// A recording cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The filter cannot be run.
    #[error(
        "the filter `{filter}` stops, or refuses the recording, whatever number of its device is changed; `kalmems estimate` says why"
    )]
    Stops {
        /// Its name.
        filter: String,
    },
    /// With no noise that was tried can a filter be run.
    #[error(
        "the noise cannot be found from the recording: the filter `{filter}` stops, or refuses the recording, with every noise that was tried; \
         write a value in place of `from_recording`, and `kalmems estimate` says why it stops"
    )]
    NoNoise {
        /// Its name.
        filter: String,
    },
    /// The work was stopped from outside.
    #[error("interrupted")]
    Interrupted,
}

impl DiagnoseError {
    /// Whether it was stopped from outside.
    pub fn is_interruption(&self) -> bool {
        matches!(self, Self::Interrupted | Self::Read(ReadError::Interrupted { .. }))
    }
}

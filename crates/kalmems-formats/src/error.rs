//! What can go wrong with a file of some format.

use std::io;

/// Why a table cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum FormatError {
    /// The system refuses.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// Nothing that is known.
    #[error("{found}; expected {expected}")]
    NotRecognised {
        /// What the file begins with.
        found: String,
        /// What can be read.
        expected: String,
    },
    /// The file is damaged or does not keep to its format.
    #[error("damaged {format} at {place}: {found}; expected {expected}")]
    Damaged {
        /// The format.
        format: &'static str,
        /// The byte, line or object.
        place: String,
        /// What is there.
        found: String,
        /// What should be.
        expected: String,
    },
    /// It is sound, and holds something that is not read.
    #[error("{format}: {what} is not read; {remedy}")]
    Unsupported {
        /// The format.
        format: &'static str,
        /// What is not read.
        what: String,
        /// What to do.
        remedy: String,
    },
    /// It claims or unpacks to more than is sensible.
    #[error("{format}: {what} is {found}; at most {limit} is read, so as not to exhaust the memory")]
    TooLarge {
        /// The format.
        format: &'static str,
        /// Of what.
        what: String,
        /// How much.
        found: u64,
        /// The limit.
        limit: u64,
    },
}

/// What may go wrong with a file.
pub(crate) type Result<T, E = FormatError> = std::result::Result<T, E>;

impl FormatError {
    /// Nothing that is known.
    pub(crate) fn not_recognised(found: impl Into<String>, expected: impl Into<String>) -> Self {
        Self::NotRecognised { found: found.into(), expected: expected.into() }
    }

    /// What is wrong at a place of a file, and what should be there.
    pub(crate) fn damaged(
        format: &'static str,
        place: impl Into<String>,
        found: impl Into<String>,
        expected: impl Into<String>,
    ) -> Self {
        Self::Damaged { format, place: place.into(), found: found.into(), expected: expected.into() }
    }

    /// The same at a byte of the file.
    pub(crate) fn damaged_at(
        format: &'static str,
        byte: u64,
        found: impl Into<String>,
        expected: impl Into<String>,
    ) -> Self {
        Self::damaged(format, format!("byte {byte}"), found, expected)
    }

    /// What is not read, and what to do.
    pub(crate) fn unsupported(
        format: &'static str,
        what: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Self {
        Self::Unsupported { format, what: what.into(), remedy: remedy.into() }
    }
}

/// Refuses what is wrong with an error that says so.
pub(crate) fn refuse_if<E>(is_wrong: bool, error: impl FnOnce() -> E) -> Result<(), E> {
    if is_wrong { Err(error()) } else { Ok(()) }
}

//! Why there is no batch.

use crate::config::ConfigError;
use crate::journal::JournalError;
use crate::results::OutputError;
use kalmems_figures::ReportError;
use std::io;
use std::path::PathBuf;

/// What keeps a batch from being made. A recording that cannot be estimated is none: it becomes a row that says why.
#[derive(Debug, thiserror::Error)]
pub enum BatchError {
    /// The experiment file is wrong.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The journal cannot be read or written, or is that of another batch.
    #[error(transparent)]
    Journal(#[from] JournalError),
    /// The results cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// The report cannot be made.
    #[error(transparent)]
    Report(#[from] ReportError),
    /// A file beside the results cannot be read or written.
    #[error("cannot read or write {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// There is nothing to estimate.
    #[error("no file matches `{pattern}`; name files, or a pattern such as \"recordings/*.csv\" in quotes")]
    NoFile {
        /// As given.
        pattern: String,
    },
    /// A pattern is none.
    #[error("`{pattern}` is no pattern of files: {why}")]
    Pattern {
        /// As given.
        pattern: String,
        /// What is wrong with it.
        why: String,
    },
    /// Two recordings have one name.
    #[error("two recordings have the name `{name}`; give each a name of its own")]
    Name {
        /// The name.
        name: String,
    },
    /// Stopped from outside. What is finished stays in the journal.
    #[error(
        "interrupted; {done} of {total} recordings are finished by {}, and the same command goes on from there",
        journal.display()
    )]
    Interrupted {
        /// Recordings that are finished, those with the content of another left out.
        done: usize,
        /// Of how many.
        total: usize,
        /// The journal.
        journal: PathBuf,
    },
}

//! Why there is no study.

use crate::config::ConfigError;
use crate::journal::JournalError;
use crate::results::OutputError;
use crate::simulate::SimulateError;
use crate::workflow::WorkflowError;
use kalmems_figures::ReportError;
use std::io;
use std::path::PathBuf;

/// What keeps a study from being made. A point that fails is none: it becomes a row that says why.
#[derive(Debug, thiserror::Error)]
pub enum StudyError {
    /// The study file, or the experiment file, is wrong.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The experiment cannot be simulated as it stands.
    #[error("{file}: {source}")]
    Simulate {
        /// The experiment file.
        file: String,
        /// Why.
        source: Box<SimulateError>,
    },
    /// A file cannot be read or written.
    #[error("cannot read or write {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// A journal cannot be read or written, or is that of another study.
    #[error(transparent)]
    Journal(#[from] JournalError),
    /// The shards are not those of one study.
    #[error("{} and {} are not of the same study: {why}", first.display(), second.display())]
    Different {
        /// A journal.
        first: PathBuf,
        /// Another one.
        second: PathBuf,
        /// In what they differ.
        why: String,
    },
    /// Two journals hold the same point, and other figures of it.
    #[error(
        "run {index} has other figures in {} than in {}; name each shard once, made by the same program",
        first.display(), second.display()
    )]
    Overlap {
        /// The run.
        index: u64,
        /// A journal that has it.
        first: PathBuf,
        /// Another one.
        second: PathBuf,
    },
    /// The journals do not have all points.
    #[error("{missing} of {total} runs are in none of the journals, the first is run {first}; {remedy}")]
    Gap {
        /// How many.
        missing: u64,
        /// Of how many.
        total: u64,
        /// The first of them.
        first: u64,
        /// What to do.
        remedy: String,
    },
    /// A shard that there is not.
    #[error("`{found}` is no shard; expected one of several, such as `1/3`, `2/3` and `3/3`")]
    Shard {
        /// As found.
        found: String,
    },
    /// The results cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// A figure cannot be drawn.
    #[error(transparent)]
    Report(#[from] ReportError),
    /// Stopped from outside. What is finished stays in the journal.
    #[error(
        "interrupted; {done} of {total} runs are in {}, and the same command goes on from there",
        journal.display()
    )]
    Interrupted {
        /// Runs in the journal.
        done: u64,
        /// Of how many.
        total: u64,
        /// The journal.
        journal: PathBuf,
    },
}

/// Why one run of a study has no figures.
#[derive(Debug, thiserror::Error)]
pub(super) enum RunError {
    #[error(transparent)]
    Config(#[from] ConfigError),
    #[error(transparent)]
    Simulate(#[from] SimulateError),
    #[error(transparent)]
    Workflow(#[from] WorkflowError),
}

impl RunError {
    /// The fault of the configuration, where it is one.
    pub(super) fn config(&self) -> Option<&ConfigError> {
        use crate::estimate::EstimateError as Estimate;
        use crate::evaluate::ReferenceError as Reference;
        match self {
            Self::Config(e)
            | Self::Simulate(SimulateError::Config(e))
            | Self::Workflow(
                WorkflowError::Config(e)
                | WorkflowError::Estimate(Estimate::Config(e))
                | WorkflowError::Reference(Reference::Config(e)),
            ) => Some(e),
            _ => None,
        }
    }

    pub(super) fn is_interruption(&self) -> bool {
        match self {
            Self::Config(_) => false,
            Self::Simulate(e) => matches!(e, SimulateError::Interrupted),
            Self::Workflow(e) => e.is_interruption(),
        }
    }

    /// In words, on one line, without lines of a file that nobody has: its text was put together for this run.
    pub(super) fn text(&self) -> String {
        let text =
            self.config().map_or_else(|| self.to_string(), |e| format!("{}: {}", e.place.key, e.fault));
        text.replace('\n', " ")
    }
}

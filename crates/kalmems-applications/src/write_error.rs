//! Why the files of a result are not there.

use kalmems_figures::ReportError;
use kalmems_store::OutputError;

/// Why a result could not be written.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// A file of it cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// A picture or the report cannot be made.
    #[error(transparent)]
    Report(#[from] ReportError),
}

//! What can go wrong when a report is written.

/// The template of a page could not be filled in.
#[derive(Debug, thiserror::Error)]
#[error("cannot write the report page: {0}")]
pub struct ReportError(#[from] minijinja::Error);

//! Why there is no reproduction.

use crate::estimate::EstimateError;
use kalmems_figures::ReportError;
use kalmems_store::OutputError;

/// Why there is no reproduction.
#[derive(Debug, thiserror::Error)]
pub enum ReproduceError {
    /// No table or figure of this name is reproduced.
    #[error("`{asked}` is not among what is reproduced; there is: {}", known.join(", "))]
    NoSuchItem {
        /// What was asked for.
        asked: String,
        /// What there is.
        known: Vec<String>,
    },
    /// An item cannot be computed.
    #[error("{item}: {source}")]
    Item {
        /// Its title.
        item: &'static str,
        /// Why.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// The results cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// The report cannot be made.
    #[error(transparent)]
    Report(#[from] ReportError),
    /// Stopped from outside.
    #[error("interrupted; nothing was written")]
    Interrupted,
}

impl ReproduceError {
    /// Of an item that takes an estimate, or of work that was stopped in one.
    pub fn of_estimate(item: &'static str) -> impl Fn(EstimateError) -> Self {
        move |why| match why {
            EstimateError::Interrupted => Self::Interrupted,
            why => Self::Item { item, source: why.into() },
        }
    }
}

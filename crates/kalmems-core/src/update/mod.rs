//! Which corrections are taken, and those that come late.

mod history;
mod policy;

pub use history::{History, HistoryError, Replay};
pub use policy::{Always, Correction, Gate, OnNeed, Policy};

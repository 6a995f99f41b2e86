//! Which corrections are taken, in what pieces, and those that come late.

mod decimate;
mod history;
mod policy;
mod sequential;

pub use decimate::{Decimation, NotSteady, SteadyDecimation};
pub use history::{History, HistoryError, Replay};
pub use policy::{Always, Correction, Gate, OnNeed, Policy};
pub use sequential::{Sequence, Sequential};

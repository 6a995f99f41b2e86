//! When a recorded signal crosses a level: a detector that runs with the signal, and what of the signal around a crossing says when it
//! was. Every rig whose filters are told of such times uses it.

mod crossing;
mod fallback;
mod kept;
mod kernel;
mod line;
mod search;
mod settings;
mod telling;

pub use crossing::{CrossingReading, LevelCrossing, find};
pub(crate) use fallback::LOUD;
pub(crate) use kept::{RowsNeeded, SearchState};
pub use line::CrossingWaveform;
pub(crate) use search::SearchTally;
pub use search::{CrossingLevel, Rows, SearchedSignal};
pub use settings::{Acceptance, DetectorSettings};
pub(crate) use telling::CrossingDelivery;

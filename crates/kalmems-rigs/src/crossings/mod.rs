//! When a recorded signal crosses a level: a detector that runs with the signal, and what of the signal around a crossing says when it
//! was. Every rig whose filters are told of such times uses it.

mod crossing;
mod delivery;
mod fallback;
mod kernel;
mod line;
mod search;
mod search_state;
mod settings;
mod verdict;

pub(crate) use crossing::TOLD_SHARE;
pub use crossing::{CrossingReading, LevelCrossing, find};
pub(crate) use delivery::CrossingDelivery;
pub use line::{CombWaveform, CrossingWaveform};
pub use search::{CrossingLevel, SearchedSignal, SignalRows};
pub(crate) use search_state::{RowsNeeded, SearchState};
pub use settings::{Acceptance, DetectorSettings};
pub(crate) use verdict::judge_crossings;

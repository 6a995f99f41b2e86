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

pub use crossing::{Crossing, Instant, find};
pub(crate) use fallback::LOUD;
pub(crate) use kept::{Kept, Needed};
pub use line::Line;
pub(crate) use search::Tally;
pub use search::{Level, Rows, Sought};
pub use settings::{Acceptance, DetectorSettings};
pub(crate) use telling::Telling;

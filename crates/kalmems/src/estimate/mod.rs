//! Estimation: from samples to trajectories.
//!
//! Nothing here, and nothing that calls it, reads a reference: see [`crate::evaluate`].

mod engine;
mod error;
mod lock;
mod model_alone;
mod progress;
mod trajectory;

pub use engine::{Course, follow};
pub use error::EstimateError;
pub use lock::{Lock, LockEvent, Motion, judge_lock};
pub use model_alone::ModelAlone;
pub use progress::{Progress, Silent};
pub use trajectory::{Consistency, Counts, Failure, StateSeries, Trajectory};

//! Estimation: from samples to trajectories.
//!
//! Nothing here, and nothing that calls it, reads a reference: see [`crate::evaluate`].

mod any_filter;
mod constant_gain;
mod engine;
mod error;
mod literal_ukf;
mod lock;
mod model_alone;
mod progress;
mod smoothing;
mod trajectory;

pub use any_filter::{AnyFilter, ITERATIONS};
pub use constant_gain::ConstantGain;
pub use engine::{Compute, Course, Derived, StateName, follow};
pub use error::EstimateError;
pub use literal_ukf::{LiteralUkf, Misprint};
pub(crate) use lock::is_the_only_one;
pub use lock::{Lock, LockEvent, Motion, judge_lock};
pub use model_alone::ModelAlone;
pub use progress::{Progress, Silent};
pub use smoothing::{Lookahead, smooth};
pub use trajectory::{Consistency, Counts, Failure, StateSeries, Trajectory, TrajectoryKind};

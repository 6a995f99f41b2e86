//! Evaluation: trajectories against an independent reference.
//!
//! This is the only place that reads a reference. Nothing flows from here to an estimate.

mod angle;
mod beam;
mod channels;
mod edge;
mod lag;
mod parts;
mod pool;
mod reference;
mod reference_parts;
mod value;

pub use angle::{AngleErrors, ErrorSeries, Extent, MotionErrors, PhasePoint, evaluate_motion};
pub use beam::BeamPosition;
pub use channels::{Instruments, ReferenceChannels};
pub use edge::EdgeVelocity;
pub use lag::ReferenceLag;
pub use parts::PartErrors;
pub use reference::{ONE_ANGLE, Reference, ReferenceError, ReferenceRecording};
pub use reference_parts::ReferenceParts;
pub use value::{ErrorsByState, ValueErrors, ValueReference, ValueState, evaluate_values};

//! Evaluation: trajectories against an independent reference.
//!
//! This is the only place that reads a reference. Nothing flows from here to an estimate.

mod angle;
mod reference;

pub use angle::{AngleErrors, ErrorSeries, Extent, MotionErrors, PhasePoint, evaluate_motion};
pub use reference::{ONE_ANGLE, Reference, ReferenceError, ReferenceRecording};

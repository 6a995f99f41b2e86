//! Devices that a recorded voltage drives.

mod drive;
mod parameters;
mod turning_gain;

pub use drive::{BLOCK, DrivePast, InterpolationLag, SegmentDrive};
pub use parameters::{ParameterStep, combinations};
pub use turning_gain::TurningGain;

/// Steps from sample to sample in which a hybrid filter follows its differential equations: what the method of fourth order
/// leaves out is 8⁴ times smaller than in one step.
pub const HYBRID_STEPS: usize = 8;

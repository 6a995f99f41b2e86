//! Devices that a recorded voltage drives.

mod course;
mod drive;
mod models;
mod parameters;
mod plant;
mod segment;
mod turning_gain;

pub use course::{DrivenCourse, HYBRID_STEPS};
pub use drive::{BLOCK, DrivePast, InterpolationLag, SegmentDrive};
pub use models::{ParameterPlaces, combinations, shifted, side_by_side};
pub use parameters::{ParameterAugmentedStep, ParameterStep, ParametricReadout};
pub use plant::{ByEuler, PlainModel, Plant, WithParameters, step};
pub use segment::DrivenSegment;
pub use turning_gain::TurningGain;

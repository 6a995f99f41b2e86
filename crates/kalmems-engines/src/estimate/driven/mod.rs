//! Devices that a recorded voltage drives.

mod course;
mod drive;
mod parameters;
mod plant;
mod segment;

pub use course::{DrivenCourse, PHASE};
pub use drive::{BLOCK, Drive, DrivePast};
pub use parameters::{OfMotion, ParametricReadout};
pub use plant::{Plain, Plant, WithParameters, step};
pub use segment::DrivenSegment;

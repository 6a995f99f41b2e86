//! Devices that a recorded voltage drives.

mod course;
mod drive;
mod plant;
mod segment;

pub use course::{DrivenCourse, PHASE};
pub use drive::{BLOCK, Drive, DrivePast};
pub use plant::{Augmentation, Plain, Plant, WithParameters, step};
pub use segment::DrivenSegment;

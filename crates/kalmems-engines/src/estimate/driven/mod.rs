//! Devices that a recorded voltage drives.

mod course;
mod drive;
mod models;
mod parameters;
mod plant;
mod segment;
mod turning_gain;

pub use course::{DrivenCourse, HYBRID_STEPS, PHASE};
pub use drive::{BLOCK, Drive, DrivePast};
pub use models::{Enters, combinations, shifted, side_by_side};
pub use parameters::{Beside, Held, OfMotion, ParametricReadout};
pub use plant::{ByEuler, Plain, Plant, WithParameters, step};
pub use segment::DrivenSegment;
pub use turning_gain::{SteadySwing, TurningGain};

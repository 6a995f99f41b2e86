//! Capacitance as a function of motion.

mod curve;
mod differential;
mod disks;
mod distance_series;
mod fingers;
mod gauss_legendre;
mod gaussian;
mod parallel_plate;
mod sliding_plate;
mod stage_layout;
mod tilting_plate;

pub use curve::{CombCurve, CurveShape};
pub use differential::{DifferentialPlates, FixedPlate};
pub use disks::CoaxialDisks;
pub use distance_series::DistanceSeries;
pub use fingers::CombFingers;
pub use gaussian::GaussianComb;
pub use parallel_plate::{ParallelPlate, VACUUM_PERMITTIVITY};
pub use sliding_plate::SlidingPlate;
pub use stage_layout::StageLayout;
pub use tilting_plate::{Contact, TiltingPlate};

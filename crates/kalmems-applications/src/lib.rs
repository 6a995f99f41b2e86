//! What an estimated motion is for: images of scanners, spectra of piston mirrors, calibrations of gyroscopes; and measurement
//! uncertainty as metrology has it.
//!
//! Each room has the file that an operator writes, the computation, and what becomes of it in a result's folder. Nothing here
//! knows how a motion was estimated: it comes as recorded trajectories with their standard deviations.

// Without the feature `report` no result is written; what only that asks of the rest is unused then.
#![cfg_attr(not(feature = "report"), allow(dead_code, unused_imports))]

mod application_file;
pub mod calibration;
mod earlier_command;
pub mod image;
pub mod metrology;
mod named_files;
pub mod spectrum;
#[cfg(feature = "report")]
mod write_error;

pub use application_file::ApplicationFile;
#[cfg(feature = "report")]
pub use write_error::WriteError;

use kalmems_engines::{
    config, estimate, fit, identify, inspect, progress, recording, signal, simulate, units,
};

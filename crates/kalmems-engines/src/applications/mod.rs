//! What an estimated motion is for.

pub mod calibration;
mod files;
pub mod image;
pub mod spectrum;

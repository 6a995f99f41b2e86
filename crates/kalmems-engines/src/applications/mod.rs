//! What an estimated motion is for.

pub mod calibration;
pub mod image;
pub mod spectrum;

//! Signals with samples that are none: what it costs an estimate, of each device.

mod defects;
mod matrix;
pub mod signals;

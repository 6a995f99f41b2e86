//! Signals with samples that are none: what it costs an estimate, of each device.

mod defects;
use crate::devices;
mod matrix;
mod signals;

//! Signals with samples that are none: what it costs an estimate, of each device.

mod defects;
#[path = "../verdict/devices.rs"]
#[allow(dead_code)] // what is judged there is another question
mod devices;
mod matrix;
mod signals;

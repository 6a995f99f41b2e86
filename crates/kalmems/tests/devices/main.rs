//! The published devices, by themselves and in the workbench.

mod accelerometer;
mod circuit;
mod gyroscope;
mod image;
mod micro_stage;
#[path = "../parts/mod.rs"]
mod parts;
mod piston;
mod piston_mirror;
mod piston_spectrum;
mod piston_theory;
mod readout_delay;
mod scanner;
mod scanner_estimators;
mod scanner_identification;
mod scanner_studies;
mod scene;
mod shared_scanner;
mod silverbox;
mod spectrum;
mod stability;
mod stage;
mod steps;
mod threshold;
mod threshold_identification;
mod threshold_scanner;
mod two_axes;

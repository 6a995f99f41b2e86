//! What holds for all devices: files, studies, reports, recordings, calibrations.

mod arrays;
mod calibration;
mod draft;
mod experiment_files;
mod folders;
mod identification;
mod interruption;
mod nist_strd;
mod noise;
mod outlook;
#[path = "../parts/mod.rs"]
mod parts;
mod report;
mod report_demo;
mod simulation;
mod study;
mod times;

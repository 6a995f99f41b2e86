//! The workbench of kalmems: from a recording of a MEMS device's capacitive signal to its motion.
//!
//! Data flows one way: `Experiment → Recording → Trajectory → Evaluation → Report`.

pub mod config;
pub mod inspect;
pub mod recording;
pub mod report;
pub mod units;

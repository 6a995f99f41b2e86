//! The workbench of kalmems: from a recording of a MEMS device's capacitive signal to its motion.
//!
//! Without the feature `report` (on unless it is left out) there is what computes, in memory: no files of results, no studies, and nothing that draws is built.
//!
//! Data flows one way: `Experiment → Recording → Trajectory → Evaluation → Report`. [`workflow::estimate`] takes all
//! steps in order; each can be taken by itself:
//!
//! ```
//! use kalmems::{progress::{Interruption, Silent}, evaluate::{ReferenceRecording, evaluate_angles}, recording::SampledRecording, rigs};
//! use std::{ops::ControlFlow, path::Path};
//!
//! # let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
//! let experiment = rigs::published().load(&root.join("examples/shared_scanner/experiment.toml"))?;
//! let rig = rigs::published().rig(&experiment)?;
//! for index in rig.wanted(&experiment)? {
//!     let file = experiment.resolve(&experiment.recording(index)?.file);
//!     let recording = SampledRecording::read(&file, &rig.layout(&experiment, index)?)?;
//!     for estimate in rig.estimate(&experiment, index, &recording, &Silent)? {
//!         let ekf = estimate.trajectories.iter().find(|t| t.key == "ekf").ok_or("no EKF")?;
//!         println!("{} samples, mean NIS {:?}", ekf.time_s.len(), ekf.consistency(ekf.scored(8e-3)));
//!
//!         // Only now is the reference opened.
//!         let reference = ReferenceRecording::read(&experiment, (index, recording.origin()), &rig.reference(&experiment)?, &mut |_, _| ControlFlow::Continue(()))?;
//!         let reference = reference.ok_or("no reference")?.segment(&estimate.segment.label)?;
//!         for errors in evaluate_angles(&estimate, &reference, 1, &Interruption::never()) {
//!             println!("angle RMSE {:?} deg", errors.map(|e| e.angle.rmse_deg));
//!         }
//!     }
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

// Without the feature `report` nothing is drawn and no result written; what only that asks of the rest is unused then.
#![cfg_attr(not(feature = "report"), allow(dead_code))]

pub mod array_experiment;
#[cfg(feature = "parquet-results")]
pub mod batch;
pub mod diagnose;
pub mod draft;
pub mod expand;
#[cfg(feature = "report")]
mod journal;
#[cfg(feature = "parquet-results")]
mod parquet;
pub mod results;
#[cfg(feature = "report")]
mod rows;
mod sealed_line;
pub mod source;
mod stated_start;
pub mod stream;
#[cfg(feature = "report")]
pub mod study;
#[cfg(feature = "report")]
mod table;

pub use kalmems_applications as applications;
pub use kalmems_engines::{
    circuit, config, estimate, evaluate, export, fit, identify, inspect, outlook, progress, recording,
    signal, simulate, topics, units,
};
pub use kalmems_figures as figures;
pub use kalmems_rigs::{self as rigs, workflow};

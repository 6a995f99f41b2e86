//! Studies: an experiment run again and again, with what varies.
//!
//! A study file names an experiment, the keys of it that vary (over a grid, a list, or by chance), what differs between
//! the truth and what the filters are told, and how often each point is repeated with noise of its own. Each run is a
//! simulation and an estimate of it, or, where the experiment has no `[simulate]`, an estimate of its recordings.
//!
//! [`StudyPlan::calibration`] draws the truth of each run from what the filters hold as uncertain, and asks of all runs together whether
//! what they claim holds.
//!
//! A finished run is a line of a journal, so that an interruption loses nothing, and its figures follow from the study
//! and the run's index alone: neither threads, nor interruptions, nor shards change a byte of the results.
//!
//! ```
//! use kalmems::progress::Silent;
//! use kalmems::results::Output;
//! use kalmems::study::{StudyOptions, StudyPlan, Shard};
//! # let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
//! # let folder = tempfile::tempdir()?;
//! # let simulation = std::fs::read_to_string(root.join("examples/shared_scanner/simulation.toml"))?
//! #     .replace("duration = \"60 ms\"", "duration = \"2 ms\"").replace("skip = \"45 ms\"", "skip = \"0.5 ms\"")
//! #     .replace("10 MHz", "1 MHz");
//! # std::fs::write(folder.path().join("simulation.toml"), simulation)?;
//! # let file = folder.path().join("study.toml");
//! # let out = folder.path().join("results");
//! std::fs::write(&file, r#"
//!     name = "start"
//!     experiment = "simulation.toml"
//!     [[vary]]
//!     key = "simulate.start.angle"
//!     values = ["0.01 rad", "0.05 rad"]
//! "#)?;
//! let plan = StudyPlan::load(kalmems::rigs::published(), &file)?;
//! let all = StudyOptions { shard: Shard::WHOLE, threads: None, force: false };
//! let progressed = plan.run_all(&out, all, &Silent)?;
//! let output = Output::begin(&out, &plan.work())?;
//! let summary = plan.write_results(&[progressed.journal], &output)?;
//! output.commit()?;
//! assert_eq!((summary.runs, summary.failed()), (2, 0));
//! assert!(std::fs::read_to_string(out.join("results.csv"))?.starts_with("point,repeat,seed,angle_rad,error,"));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod axis;
mod calibration;
mod description;
mod error;
mod journal;
mod map;
mod pictures;
mod plan;
mod results;
mod run;
mod runs;
mod seed;
mod shard;
mod spread;
mod table;

pub use crate::journal::JournalError;
pub use calibration::{
    ClaimCalibration, ClaimFinding, CoverageLevel, FilterCalibration, GradeCount, Share,
    StudyCalibrationSummary, TestCount, Uniformity,
};
pub use description::schema;
pub use error::StudyError;
pub use plan::StudyPlan;
pub use results::{Failures, Summary};
pub use run::{StudyOptions, StudyProgress};
pub use shard::Shard;

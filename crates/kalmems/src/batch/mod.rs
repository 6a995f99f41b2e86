//! Batches: many recordings by one experiment, each estimated by itself.
//!
//! Of each recording there is one Parquet file with the trajectories of all filters, and of all together one table. What is finished is a line of a
//! journal beside the results, so that an interruption loses nothing and another call computes only what is new; recordings with the same content
//! are estimated once. A recording that cannot be estimated becomes a row that says why, and keeps no other from its results.
//!
//! ```
//! use kalmems::batch::{Batch, BatchOptions, BatchRecording};
//! use kalmems::progress::Silent;
//! # let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
//! # let folder = tempfile::tempdir()?;
//! # let lines = std::fs::read_to_string(root.join("examples/shared_scanner/recording.csv"))?;
//! # let scans = folder.path().join("scans");
//! # std::fs::create_dir(&scans)?;
//! # std::fs::write(scans.join("monday.csv"), lines.lines().take(12000).collect::<Vec<_>>().join("\n"))?;
//! # std::fs::write(scans.join("tuesday.csv"), lines.lines().take(11000).collect::<Vec<_>>().join("\n"))?;
//! # std::fs::write(scans.join("broken.csv"), "no recording")?;
//! # let experiment = root.join("examples/shared_scanner/experiment.toml");
//! # let (pattern, out) = (format!("{}/*.csv", scans.display()), folder.path().join("results"));
//! let batch = Batch::load(kalmems::rigs::published(), &experiment, None)?;
//! let recordings = BatchRecording::of_files([pattern.as_str()])?;
//! let outcome = batch.run(&recordings, &out, BatchOptions::default(), &Silent)?;
//! assert_eq!((outcome.summary.recordings, outcome.summary.failures.len()), (3, 1));
//! assert!(out.join("trajectories/monday.parquet").is_file());
//! assert!(std::fs::read_to_string(out.join("summary.csv"))?.starts_with("recording,same_as,"));
//! // All of it is there.
//! let again = batch.run(&recordings, &out, BatchOptions::default(), &Silent)?;
//! assert_eq!((again.before, again.estimated), (2, 0));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod error;
mod input;
mod journal;
mod results;
mod run;
mod signals;
mod work;

pub use error::BatchError;
pub use input::{BatchContent, BatchRecording};
pub use results::BatchSummary;
pub use run::{Batch, BatchOptions, BatchOutcome};
pub use signals::BatchSignal;

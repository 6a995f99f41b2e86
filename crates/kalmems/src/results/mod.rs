//! Results: what is computed from an outcome, and the files and pictures that it becomes.

mod answer;
mod arbitrary;
mod diagnosis;
mod in_memory;
mod marks;
mod metrics;
#[cfg(feature = "report")]
mod pooled;
#[cfg(feature = "report")]
mod report;
mod streamed;
mod summary;
mod tracks;
#[cfg(feature = "parquet-results")]
mod trajectories;
mod verdict;

pub use answer::{AnsweredMotion, QuantityAnswer, summary_text};
pub(crate) use answer::{shown_for_people, value_and_sd};
pub use arbitrary::ArbitraryBranches;
#[cfg(feature = "report")]
pub use diagnosis::diagnosis_page;
pub use in_memory::{Estimated, number_check, number_check_of};
pub use kalmems_store::{
    EarlierResult, MANIFEST, Output, OutputError, RUN_FILE, ResultFile, RunInfo, RunTiming, StoredResult,
    Subject, Work, create_file, way_from, write_page, write_picture,
};
pub use metrics::{
    DriveMetrics, EstimatorMetrics, FilterSelection, FindingText, Metrics, RecordingMetrics, SegmentMetrics,
};
#[cfg(feature = "parquet-results")]
pub(crate) use pooled::PooledMetrics;
#[cfg(feature = "report")]
pub use report::*;
pub(crate) use streamed::StreamTracks;
#[cfg(feature = "report")]
pub(crate) use summary::severity_of;
pub use summary::{
    Notice, budget_table, is_unexplained, notices, notices_in_short, parameters_table, summary_table,
};
#[cfg(feature = "parquet-results")]
pub(crate) use trajectories::TrajectoryFile;
pub(crate) use verdict::doubts;
pub use verdict::{Verdict, grade_of_innovations};

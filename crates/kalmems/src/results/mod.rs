//! Results: what is computed from an outcome, and the files and pictures that it becomes.

#[cfg(feature = "report")]
mod compare;
mod diagnosis;
#[cfg(feature = "report")]
mod evidence;
#[cfg(feature = "report")]
mod figure_files;
#[cfg(feature = "report")]
mod figures;
#[cfg(feature = "report")]
mod files;
#[cfg(feature = "report")]
mod identification;
mod in_memory;
#[cfg(feature = "report")]
mod inspection;
#[cfg(feature = "report")]
mod long_estimate;
mod marks;
mod metrics;
#[cfg(feature = "report")]
mod names;
#[cfg(feature = "report")]
mod outlook;
#[cfg(feature = "report")]
mod page;
#[cfg(feature = "report")]
mod passings;
#[cfg(feature = "report")]
mod pooled;
#[cfg(feature = "report")]
mod samples;
#[cfg(feature = "report")]
mod simulation;
mod streamed;
mod summary;
mod tracks;
#[cfg(feature = "parquet-results")]
mod trajectories;
mod verdict;

#[cfg(feature = "report")]
pub use compare::{CompareError, compare_page};
#[cfg(feature = "report")]
pub use diagnosis::diagnosis_page;
#[cfg(feature = "report")]
pub(crate) use figure_files::write_figure;
#[cfg(feature = "report")]
pub use figures::figures as estimate_figures;
#[cfg(feature = "report")]
pub use files::{ResultWriteError, WriteOptions, write_estimate};
#[cfg(feature = "report")]
pub use identification::{IdentificationSummary, identification_page, write_identification};
pub use in_memory::{Estimated, number_check, number_check_of};
#[cfg(feature = "report")]
pub use inspection::{DrawError, draw_inspection, inspection_figure, inspection_page};
pub use kalmems_store::{
    EarlierResult, MANIFEST, Output, OutputError, RUN_FILE, ResultFile, RunInfo, RunTiming, StoredResult,
    Subject, Work, create_file, way_from, write_file, write_page,
};
#[cfg(feature = "report")]
pub use long_estimate::LongEstimate;
pub use metrics::{
    DriveMetrics, EstimatorMetrics, FilterSelection, FindingText, Metrics, RecordingMetrics, SegmentMetrics,
};
#[cfg(feature = "report")]
pub use outlook::{draw_outlook, outlook_figures, outlook_page, write_outlook};
#[cfg(feature = "parquet-results")]
pub(crate) use pooled::PooledMetrics;
#[cfg(feature = "report")]
pub use simulation::{SimulationSummary, SimulationWriteError, write_simulation};
pub(crate) use streamed::StreamTracks;
pub use summary::{
    Notice, budget_table, is_unexplained, notices, notices_in_short, parameters_table, summary_table,
};
#[cfg(feature = "parquet-results")]
pub(crate) use trajectories::TrajectoryFile;
pub use verdict::Verdict;

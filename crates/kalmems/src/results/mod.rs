//! Results: what is computed from an outcome, and the files and pictures that it becomes.

mod compare;
mod diagnosis;
mod evidence;
mod figure_files;
mod figures;
mod files;
mod identification;
mod in_memory;
mod inspection;
mod long_estimate;
mod marks;
mod metrics;
mod names;
mod outlook;
mod page;
mod passings;
mod pooled;
mod simulation;
mod streamed;
mod summary;
mod tracks;
#[cfg(feature = "parquet-results")]
mod trajectories;
mod verdict;

pub use compare::{CompareError, compare_page};
pub use diagnosis::diagnosis_page;
pub(crate) use figure_files::write_figure;
pub use figures::figures as estimate_figures;
pub use files::{ResultWriteError, WriteOptions, write_estimate};
pub use identification::{IdentificationSummary, identification_page, write_identification};
pub use in_memory::{Estimated, number_check, number_check_of};
pub use inspection::{DrawError, draw_inspection, inspection_figure, inspection_page};
pub use kalmems_store::{
    EarlierResult, MANIFEST, Output, OutputError, RUN_FILE, ResultFile, RunInfo, RunTiming, Subject, Work,
    create_file, way_from, write_file, write_page,
};
pub use long_estimate::LongEstimate;
pub use metrics::{
    DriveMetrics, EstimatorMetrics, FilterSelection, FindingText, Metrics, RecordingMetrics, SegmentMetrics,
};
pub use outlook::{draw_outlook, outlook_figures, outlook_page, write_outlook};
#[cfg(feature = "parquet-results")]
pub(crate) use pooled::PooledMetrics;
pub use simulation::{SimulationSummary, SimulationWriteError, write_simulation};
pub(crate) use streamed::StreamTracks;
pub use summary::{
    Notice, budget_table, is_unexplained, notices, notices_in_short, parameters_table, summary_table,
};
#[cfg(feature = "parquet-results")]
pub(crate) use trajectories::TrajectoryFile;
pub use verdict::Verdict;

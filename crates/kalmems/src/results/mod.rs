//! Results: what is computed from an outcome, and the files and pictures that it becomes.

mod figures;
mod files;
mod grey_png;
mod identification;
mod image;
mod inspection;
mod metrics;
mod names;
mod outlook;
mod output;
mod page;
mod simulation;
mod summary;

pub use figures::figures as estimate_figures;
pub use files::{RunInfo, WriteError, write_estimate};
pub use grey_png::{PictureError, read_grey, write_grey};
pub use identification::{IdentificationSummary, write_identification};
pub use image::{AxisMetrics, Developed, ImageMetrics, ReferenceMetrics, write_image};
pub use inspection::{DrawError, draw_inspection, inspection_figure};
pub use metrics::{
    DriveMetrics, EstimatorMetrics, FindingText, Likeliest, Metrics, RecordingMetrics, SegmentMetrics,
    Verdict,
};
pub use outlook::{draw_outlook, outlook_figures, write_outlook};
pub use output::{Output, OutputError, RUN_FILE};
pub use simulation::{SimulationSummary, SimulationWriteError, write_simulation};
pub(crate) use summary::significant;
pub use summary::{Notice, notices, summary_table};

//! Pages, pictures and files of results.

mod compare;
mod compared_run;
mod evidence;
mod figure_files;
mod figures;
mod files;
mod identification;
mod inspection;
mod long_estimate;
mod names;
mod outlook;
mod page;
mod passings;
mod samples;
mod simulation;
mod twins;

pub use compare::{CompareError, Comparison, compare};
pub(crate) use figure_files::write_figure;
pub use figures::figures as estimate_figures;
pub use files::{ResultWriteError, WriteOptions, write_estimate};
#[cfg(feature = "parquet-results")]
pub(super) use files::{columns, signal_unit};
pub use identification::{IdentificationSummary, identification_page, write_identification};
pub use inspection::{draw_inspection, inspection_figure, inspection_page};
pub use long_estimate::LongEstimate;
pub use outlook::{AnsweredOutlook, draw_outlook, outlook_figures, outlook_page, write_outlook};
pub(super) use page::page;
pub use simulation::{SimulationSummary, SimulationWriteError, write_simulation};

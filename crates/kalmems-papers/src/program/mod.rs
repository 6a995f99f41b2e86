//! Reproduction: the tables and figures of a paper, its values beside ours.
//!
//! What the papers of a device show is described as a [`PaperProgram`]; [`reproduce`] computes it, or one item of it, and
//! [`write_reproduction`] makes report, pictures and tables of it. What a paper says is constant and cited; what
//! stands beside it is computed in that run. Each item ends in a [`ItemVerdict`], which follows from its [`Check`]s alone.
//! Nothing here knows a device.

mod check;
mod error;
mod item;
mod page;
mod reproduction;
pub(crate) mod significance;
mod text;
mod tolerance;
mod work;
mod write;

pub use check::{Check, ItemVerdict, SeedSpread};
pub use error::ReproduceError;
pub use item::{Item, ItemHead, ItemKind, PaperPlace, ValueOrigin};
pub use reproduction::{
    Effort, Paper, PaperProgram, ProgramPart, Reproduction, ReproductionSettings, reproduce,
};
pub use text::{checks_table, summary_table};
pub use tolerance::CheckTolerance;
pub use work::PartWork;
pub use write::write_reproduction;

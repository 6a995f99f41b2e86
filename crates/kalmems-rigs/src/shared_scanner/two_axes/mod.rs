//! Two axes on one shared electrode: one voltage drives both, one signal senses both.
//!
//! The future work that Chen et al. (shared electrodes, 2020) and Chen's thesis of 2018 name: their scanner in a
//! gimbal that the same electrode drives and senses. Each axis is driven at twice its resonance; V² has the products of
//! both drives, and all of it acts on both axes. Either angle mirrored is an exact symmetry, so that the sign of each
//! motion is calibrated by itself.

mod band_plan;
mod expanded;
mod filters;
pub(super) mod hardware;
mod lock_in;
mod outlook;
mod plant;
mod rig;
mod run;
mod segment;
mod settings;
mod simulation;
mod tones;

pub use band_plan::{BandPlan, CombinationLine, Conflict, LinePlace, PlannedDrive, ProtectedBand};
pub use filters::{STATES, TwoAxisFilterSettings, TwoAxisStart};
pub use hardware::TwoAxisHardware;
pub use lock_in::{LineError, line_share};
pub use rig::TwoAxesRig;
pub use segment::{estimate, first_tones};
pub use settings::TwoAxisSettings;
pub use tones::DriveTones;

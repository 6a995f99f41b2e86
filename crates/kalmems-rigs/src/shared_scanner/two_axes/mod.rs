//! Two axes on one shared electrode: one voltage drives both, one signal senses both.
//!
//! The future work that Chen et al. (shared electrodes, 2020) and Chen's thesis of 2018 name: their scanner in a
//! gimbal that the same electrode drives and senses. Each axis is driven at twice its resonance; V² has the products of
//! both drives, and all of it acts on both axes. Either angle mirrored is an exact symmetry, so that the sign of each
//! motion is calibrated by itself.

mod band_plan;
pub mod hardware;
pub(super) mod outlook;
pub(super) mod simulation;

use crate::{Template, TemplateChannel};
pub use band_plan::{BandPlan, CombinationLine, Conflict, LinePlace, PlannedDrive, ProtectedBand};
pub use hardware::TwoAxisHardware;

/// What an experiment with both axes begins from.
pub const TEMPLATE: Template = Template {
    text: include_str!("template.toml"),
    channels: &[TemplateChannel::DRIVE, TemplateChannel::SIGNAL],
    references: &[
        TemplateChannel::optional(
            "angle_x",
            ("the angle of x, measured otherwise", "rad"),
            &["angle_x", "theta_x", "x"],
        ),
        TemplateChannel::optional(
            "angle_y",
            ("the angle of y, measured otherwise", "rad"),
            &["angle_y", "theta_y", "y"],
        ),
    ],
};

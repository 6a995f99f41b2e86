//! What an experiment file says of a filter that is told when a threshold is passed.

use super::filter::above_zero;
use super::kinds::{Angle, Time};
use super::quantity::Quantity;
use super::sign::{NotNegative, Positive};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How a filter of a threshold-sensing scanner takes the signal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Variant {
    /// By the derivative of `h(angle) rate`.
    #[default]
    Full,
    /// By `[0, h(angle)]` in its place, as printed; without parameters as states.
    Literal,
    /// Not at all: of the signal it uses the crossings alone.
    TimingOnly,
}

/// How a filter uses the crossings of the threshold.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CrossingUse {
    /// Where in time a crossing lies; `zero_crossing` if left out.
    #[serde(default)]
    pub timing: CrossingTiming,
    /// When the filter is told of it; `late` if left out.
    #[serde(default)]
    pub applied: CrossingApplication,
    /// How long after a crossing a filter is told that is told late; as long as the detector takes if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"390 us")]
    pub lag: Option<Quantity<Time, NotNegative>>,
    /// The angle that is passed; the comb's `threshold_angle` if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"3.7 mrad")]
    pub angle: Option<Quantity<Angle>>,
    /// The standard deviation of the angle at the time of a crossing; if left out, what follows from that of its time
    /// and from how fast the signal rises there.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"2 mrad")]
    pub angle_sd: Option<Quantity<Angle, Positive>>,
    /// The largest innovation that is believed, in standard deviations; what the filter's own `gate` believes if left out.
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "above_zero")]
    #[schemars(extend("exclusiveMinimum" = 0), example = &4.0)]
    pub gate: Option<f64>,
}

/// What of a crossing's response says when it was.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum CrossingTiming {
    /// The sample of the steepest rise.
    Sample,
    /// The top of a parabola through it and its neighbours.
    Parabola,
    /// Where the signal passes its offset.
    #[default]
    ZeroCrossing,
}

/// When a filter is told of a crossing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum CrossingApplication {
    /// As soon as a detector that runs with the signal knows of it: the filter goes back to its time.
    #[default]
    Late,
    /// At its time, as if it had been known there: as published, and possible after a recording alone.
    InPlace,
}

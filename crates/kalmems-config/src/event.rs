//! What an experiment file says of a device's events: where their times come from, and how a filter is told of them.

use super::filter::above_zero;
use super::kinds::Time;
use super::quantity::Quantity;
use super::sign::{NotNegative, Positive};
use super::values::AnyValue;
use super::{ConfigFault, CrossingApplication, CrossingTiming, Crossings, Key};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Where the times of an event of the device come from: from a measurement that crosses a level then, or, without `signal`, from a
/// channel of the recording with the event's name, which says how long before its row the event was.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct EventSource {
    /// The measurement that crosses a level when the event happens.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"signal")]
    pub signal: Option<String>,
    /// The level that it crosses, in the measurement's unit; 0 if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"0 V")]
    pub level: Option<AnyValue>,
    /// Whether the level is, from the first crossing on, the mean of the signal since then, as that of a current which adds up to
    /// nothing; false if left out.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub follows_mean: bool,
    /// The direction in which it crosses the level; `rising` if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub edge: Option<Edge>,
    /// How crossings are found.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub detector: Option<Crossings>,
    /// Without `signal`: no event is recorded in a row that is later by more than this; four samples if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"20 us")]
    pub known_within: Option<Quantity<Time, Positive>>,
}

/// The direction in which a signal crosses a level.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Edge {
    /// From below to above.
    #[default]
    Rising,
    /// From above to below.
    Falling,
}

impl EventSource {
    /// What no single value can be blamed for: the key, and what is wrong. `at` is the key of this table.
    pub(super) fn check(&self, at: &Key) -> Result<(), (Key, ConfigFault)> {
        if let Some(detector) = &self.detector {
            detector.check(&at.clone().child("detector"))?;
        }
        let refuse =
            |name: &str, why: &str| Err((at.clone().child(name), ConfigFault::Value { why: why.to_owned() }));
        if self.signal.is_some() {
            if self.detector.is_none() {
                let remedy =
                    "write `detector = { width = \"30 us\", separation = \"300 us\", threshold = 4 }`";
                return Err((
                    at.clone().child("detector"),
                    ConfigFault::MissingKey { remedy: remedy.to_owned() },
                ));
            }
            if self.known_within.is_some() {
                let why = "its detector says how long after a crossing it knows of it; leave it out";
                return refuse("known_within", why);
            }
            return Ok(());
        }
        let of_signals = [
            ("level", self.level.is_some()),
            ("follows_mean", self.follows_mean),
            ("edge", self.edge.is_some()),
            ("detector", self.detector.is_some()),
        ];
        match of_signals.into_iter().find(|(_, given)| *given) {
            Some((name, _)) => {
                let why = "it is about the signal that crosses a level; name the measurement, such as `signal = \"signal\"`, or \
                           leave it out, and the times come from the channel with the event's name";
                refuse(name, why)
            }
            None => Ok(()),
        }
    }
}

/// How a filter uses an event of the device: as the measurement that the event's expression was zero then, or another value.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct EventUse {
    /// Of an event that a signal shows: where in time its crossing lies; `zero_crossing` if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub timing: Option<CrossingTiming>,
    /// Of an event that a signal shows: when the filter is told of it; `late` if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub applied: Option<CrossingApplication>,
    /// How long after the event a filter is told that is told late; as long as the detector takes if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"390 us")]
    pub lag: Option<Quantity<Time, NotNegative>>,
    /// What the event's expression is at its time, in its unit; 0 if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"1 mrad")]
    pub value: Option<AnyValue>,
    /// The standard deviation of the event's expression at its time, in its unit; if left out, what follows from the standard
    /// deviation of the time and the rate of the expression, and from the `noise` of the event.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"2 mrad")]
    pub sd: Option<AnyValue>,
    /// The largest innovation that is believed, in standard deviations; what the filter's own `gate` believes if left out.
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "above_zero")]
    #[schemars(extend("exclusiveMinimum" = 0), example = &4.0)]
    pub gate: Option<f64>,
}

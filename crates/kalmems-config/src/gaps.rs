//! How long samples may be missing before an estimate begins anew.

use super::kinds::Time;
use super::quantity::NUMBER_FIRST;
use super::sign::Positive;
use super::{ConfigError, ConfigFault, Experiment, Key, Quantity};
use crate::inline_schema;
use crate::layout::{RecordingLayout, Restarts};
use schemars::{JsonSchema, json_schema};
use serde::de::{Error, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;

/// What is done where samples are missing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Gaps {
    /// The longest time between two samples that an estimate predicts over: a time, or a number of the device's cycles such
    /// as `20 cycles`. Behind a longer one it begins anew, as a new stretch; so it does wherever the clock goes back.
    #[schemars(example = &"20 cycles")]
    pub longest: LongestGap,
}

/// A time, as such or in cycles of the device.
#[derive(Clone, Debug, PartialEq)]
pub enum LongestGap {
    /// As such.
    Time(Quantity<Time, Positive>),
    /// In cycles of the device, with the text as written.
    Cycles(f64, String),
}

/// Over how many cycles of the device a missing stretch is predicted, where the experiment does not say it: up to about as
/// many a prediction was found to be no worse than a new beginning; see the book's chapter on long recordings.
pub const CYCLES: f64 = 100.0;

/// Over how many cycles a missing stretch is predicted at most: what the phase of a motion is worth after as many, nothing
/// that a filter knows tells, and the work for one sample stays bounded.
pub const MOST_CYCLES: f64 = 1024.0;

impl LongestGap {
    /// In s, of a device with such a cycle.
    fn of_cycle(&self, cycle_s: f64) -> f64 {
        match self {
            Self::Time(time) => time.si(),
            Self::Cycles(number, _) => number * cycle_s,
        }
    }

    fn parse(text: &str) -> Result<Self, String> {
        let Some(number) = text.trim().strip_suffix("cycles").or_else(|| text.trim().strip_suffix("cycle"))
        else {
            return Quantity::parse(text)
                .map(Self::Time)
                .map_err(|why| format!("{why}, or a number of cycles, such as `20 cycles`"));
        };
        match number.trim().parse() {
            Ok(cycles) if cycles > 0.0 && f64::is_finite(cycles) => Ok(Self::Cycles(cycles, text.to_owned())),
            _ => Err(format!(
                "`{}` is no number above 0; expected a number of cycles, such as `20 cycles`, or a time, such as `1 ms`",
                super::error::shown(number.trim())
            )),
        }
    }
}

impl Serialize for LongestGap {
    fn serialize<W: Serializer>(&self, serializer: W) -> Result<W::Ok, W::Error> {
        match self {
            Self::Time(time) => time.serialize(serializer),
            Self::Cycles(_, text) => serializer.serialize_str(text),
        }
    }
}

impl<'de> Deserialize<'de> for LongestGap {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct GapsVisitor;
        impl Visitor<'_> for GapsVisitor {
            type Value = LongestGap;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a time or a number of cycles as text in quotes, such as `20 cycles`")
            }

            fn visit_str<E: Error>(self, text: &str) -> Result<LongestGap, E> {
                LongestGap::parse(text).map_err(E::custom)
            }
        }
        deserializer.deserialize_any(GapsVisitor)
    }
}

inline_schema!(LongestGap, "LongestGap", |_| json_schema!({
    "type": "string",
    "title": "a time above 0 (s), or a number of cycles of the device",
    "pattern": NUMBER_FIRST,
    "examples": ["20 cycles", "1 ms"],
}));

impl Experiment {
    /// How to read these columns of a recording that is estimated, of a device with this cycle in s: cut into stretches
    /// behind gaps that are too long, and where its clock goes back.
    pub fn layout_to_estimate(
        &self,
        index: usize,
        columns: &[&str],
        cycle_s: f64,
    ) -> Result<RecordingLayout, ConfigError> {
        let recording = self.recording(index)?;
        let most_s = MOST_CYCLES * cycle_s;
        let longest_s = match &recording.gaps {
            None => CYCLES * cycle_s,
            Some(Gaps { longest }) => longest.of_cycle(cycle_s),
        };
        if longest_s > most_s * (1.0 + 1e-9) {
            let why = format!(
                "{longest_s} s are {:.0} cycles of the device, which has {:.4} in a second; no motion is predicted over \
                 more than {MOST_CYCLES}: write `{MOST_CYCLES} cycles` or less",
                longest_s / cycle_s,
                1.0 / cycle_s
            );
            let key = Key::from("recording").index(index).child("gaps").child("longest");
            return Err(self.error(key, ConfigFault::Value { why }));
        }
        Ok(RecordingLayout { restarts: Some(Restarts::beyond(longest_s)), ..recording.layout(columns) })
    }
}

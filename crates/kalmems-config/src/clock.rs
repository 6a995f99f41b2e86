//! When the samples of a recording were taken.

use super::ColumnChoice;
use super::kinds::{Frequency, Time};
use super::quantity::Quantity;
use super::sign::Positive;
use super::values::AnyValue;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize};
use std::borrow::Cow;

/// When samples were taken: a time column, or a rate where there is none.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
#[allow(clippy::large_enum_variant)] // there are a few of them in a description, and none in a loop
pub enum Clock {
    /// The file has a column of times.
    Column(TimeColumn),
    /// The samples are equidistant.
    Rate {
        /// Samples per second.
        rate: Quantity<Frequency, Positive>,
        /// The time of the first sample, of each segment where there are several; 0 s if left out.
        #[serde(skip_serializing_if = "Option::is_none")]
        start: Option<Quantity<Time>>,
    },
}

/// A column of times.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TimeColumn {
    /// Which one, and what its numbers are.
    #[serde(flatten, serialize_with = "ColumnChoice::serialize_as_table")]
    pub column: ColumnChoice,
    /// The rate at which the instrument is set to sample: the intervals of the times are judged by it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rate: Option<Quantity<Frequency, Positive>>,
}

/// The keys of a clock with a column.
#[derive(JsonSchema)]
#[serde(deny_unknown_fields)]
#[allow(dead_code)] // It is there for its schema.
struct ColumnKeys {
    /// The name of the column of times.
    #[schemars(example = &"time_s")]
    column: String,
    /// The unit of its numbers, such as `"us"`; that which the file says if left out.
    unit: Option<String>,
    /// What each number is multiplied by, such as `25` of a counter in `"ns"`; 1 if left out.
    scale: Option<AnyValue>,
    /// The rate at which the instrument is set to sample: the intervals of the times are judged by it; by their median if left out.
    rate: Option<Quantity<Frequency, Positive>>,
}

/// The keys of a clock without a column.
#[derive(JsonSchema)]
#[serde(deny_unknown_fields)]
#[allow(dead_code)] // It is there for its schema.
struct RateKeys {
    /// Samples per second.
    rate: Quantity<Frequency, Positive>,
    /// The time of the first sample, of each segment where there are several; 0 s if left out.
    start: Option<Quantity<Time>>,
}

impl JsonSchema for Clock {
    fn schema_name() -> Cow<'static, str> {
        "Clock".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let (column, rate) = (ColumnKeys::json_schema(generator), RateKeys::json_schema(generator));
        json_schema!({
            "description": "When samples were taken: a time column, or a rate where there is none.",
            "anyOf": [column, rate],
            "examples": [{ "column": "time_s" }],
        })
    }
}

impl Clock {
    /// A column of times by its name.
    pub fn column(name: &str) -> Self {
        Self::Column(TimeColumn { column: ColumnChoice::from(name), rate: None })
    }
}

impl<'de> Deserialize<'de> for Clock {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct ClockKeys {
            column: Option<String>,
            rate: Option<Quantity<Frequency, Positive>>,
            start: Option<Quantity<Time>>,
            unit: Option<String>,
            scale: Option<AnyValue>,
        }
        const EXPECTED: &str = "expected either `column = \"time_s\"` or `rate = \"8 kHz\"`";
        match ClockKeys::deserialize(deserializer)? {
            ClockKeys { column: Some(column), rate, start: None, unit, scale } => {
                let column = ColumnChoice::of_keys(column, unit, scale).map_err(D::Error::custom)?;
                Ok(Self::Column(TimeColumn { column, rate }))
            }
            ClockKeys { column: None, rate: Some(rate), start, unit: None, scale: None } => {
                Ok(Self::Rate { rate, start })
            }
            ClockKeys { column: None, rate: Some(_), .. } => Err(D::Error::custom(
                "found `unit` or `scale` with `rate`; they are for a column of times, so remove them",
            )),
            ClockKeys { column: Some(_), start: Some(_), .. } => Err(D::Error::custom(
                "found `start` with `column`; a time column says itself when it starts, so remove `start`",
            )),
            ClockKeys { column: None, rate: None, .. } => {
                Err(D::Error::custom(format!("found neither `column` nor `rate`; {EXPECTED}")))
            }
        }
    }
}

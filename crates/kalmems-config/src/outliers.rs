//! What an experiment file says about samples that are no samples of the signal.

use crate::inline_schema;
use schemars::{JsonSchema, json_schema};
use serde::de::{Error, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;

/// Whether a filter rejects outliers, and how seldom a sample that is none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum OutlierGate {
    /// It takes every sample.
    Off,
    /// It rejects a sample whose innovation is less probable than this.
    FalseRejections(f64),
}

/// The largest probability of a false rejection: two in a hundred samples, at 2.3 standard deviations.
const MOST: f64 = 0.02;

impl OutlierGate {
    /// The probability that it rejects a sample of a filter that is right, where it rejects any.
    pub const fn false_rejections(self) -> Option<f64> {
        match self {
            Self::Off => None,
            Self::FalseRejections(probability) => Some(probability),
        }
    }
}

impl Serialize for OutlierGate {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Off => serializer.serialize_bool(false),
            Self::FalseRejections(probability) => serializer.serialize_f64(*probability),
        }
    }
}

impl<'de> Deserialize<'de> for OutlierGate {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct FalseOrNumber;
        impl Visitor<'_> for FalseOrNumber {
            type Value = OutlierGate;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "`false` or a probability, such as `1e-7`")
            }

            fn visit_bool<E: Error>(self, on: bool) -> Result<OutlierGate, E> {
                if on {
                    return Err(E::custom(
                        "`true` does not say how seldom; write a probability, such as `1e-7`, or leave it out",
                    ));
                }
                Ok(OutlierGate::Off)
            }

            fn visit_f64<E: Error>(self, number: f64) -> Result<OutlierGate, E> {
                if number > 0.0 && number <= MOST {
                    return Ok(OutlierGate::FalseRejections(number));
                }
                Err(E::custom(format!(
                    "`{number}` is not above 0 and up to {MOST}; write how probable it may be that a sample that is no outlier is \
                     rejected, such as `1e-7`, or `false`"
                )))
            }

            #[allow(clippy::cast_precision_loss)] // what is not exact is far above `MOST`, and refused
            fn visit_i64<E: Error>(self, number: i64) -> Result<OutlierGate, E> {
                self.visit_f64(number as f64)
            }
        }
        deserializer.deserialize_any(FalseOrNumber)
    }
}

inline_schema!(OutlierGate, "Gate", |_| json_schema!({
    "anyOf": [{ "type": "number", "exclusiveMinimum": 0, "maximum": MOST }, { "const": false }],
    "examples": [1e-7, false],
}));

/// How a filter weighs a sample whose innovation is large.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Update {
    /// As any other: the noise is normally distributed.
    #[default]
    Normal,
    /// In proportion to its distance and not to the square of it, beyond 1.345 standard deviations (Huber).
    Huber,
    /// By Student's t distribution with `degrees_of_freedom`.
    StudentT,
}

impl Update {
    /// Whether it is the one where nothing is said.
    #[allow(clippy::trivially_copy_pass_by_ref)] // as serde calls it
    pub(super) fn is_normal(&self) -> bool {
        *self == Self::Normal
    }

    /// The word in the file.
    pub const fn word(self) -> &'static str {
        match self {
            Self::Normal => "normal",
            Self::Huber => "huber",
            Self::StudentT => "student_t",
        }
    }
}

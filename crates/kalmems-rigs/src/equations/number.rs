//! The value of a parameter.

use super::ordered::OfElement;
use crate::config::{inline_schema, with_sd};
use crate::units::Value;
use kalmems_equations::VectorElement;
use schemars::json_schema;
use serde::de::{Error, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::borrow::Cow;
use std::fmt;

/// A number with its unit as text; a ratio may be a plain number.
#[derive(Clone, Debug, PartialEq)]
pub struct NumberText(String);

impl NumberText {
    /// As it is written, without an uncertainty; what is wrong with that comes back in words.
    pub fn nominal(&self) -> Result<Cow<'_, str>, String> {
        if !self.0.contains('±') && !self.0.contains("+/-") {
            return Ok(Cow::Borrowed(&self.0));
        }
        Value::parse(&self.0).map(|value| Cow::Owned(value.nominal())).map_err(|e| e.to_string())
    }
}

impl OfElement for NumberText {
    fn of_element(&self, _: &VectorElement) -> Result<Self, String> {
        Ok(self.clone())
    }
}

impl Serialize for NumberText {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&self.0)
    }
}

impl<'de> Deserialize<'de> for NumberText {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct NumberTextVisitor;
        impl<'de> Visitor<'de> for NumberTextVisitor {
            type Value = NumberText;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a number with its unit as text in quotes")
            }

            fn visit_str<E: Error>(self, text: &str) -> Result<NumberText, E> {
                Ok(NumberText(text.to_owned()))
            }

            fn visit_i64<E: Error>(self, number: i64) -> Result<NumberText, E> {
                Ok(NumberText(number.to_string()))
            }

            fn visit_u64<E: Error>(self, number: u64) -> Result<NumberText, E> {
                Ok(NumberText(number.to_string()))
            }

            fn visit_f64<E: Error>(self, number: f64) -> Result<NumberText, E> {
                Ok(NumberText(format!("{number:?}")))
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<NumberText, A::Error> {
                with_sd(map).map(NumberText)
            }
        }
        deserializer.deserialize_any(NumberTextVisitor)
    }
}

inline_schema!(NumberText, "NumberText", |_| json_schema!({
    "type": ["string", "number", "object"],
    "title": "a number with its unit, and with its standard uncertainty if that is known; a ratio may be a plain number",
    "examples": ["3 N/m", "3 N/m ± 1 %"],
    "properties": { "value": { "type": ["string", "number"] }, "sd": { "type": ["string", "number"] } },
    "required": ["value", "sd"],
    "additionalProperties": false,
}));

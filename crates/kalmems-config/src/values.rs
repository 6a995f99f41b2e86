//! Tables of values whose keys and kinds a rig knows, such as the states of its filter.

use super::quantity::{NUMBER_FIRST, parse};
use super::sign::Sign;
use super::{ConfigFault, Key};
use crate::inline_schema;
use crate::units::{Kind, Value};
use schemars::json_schema;
use serde::de::{Error, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::collections::BTreeMap;
use std::fmt;

/// A value with a unit whose kind the rig checks.
#[derive(Clone, Debug, PartialEq)]
pub struct AnyValue(Value);

/// Values by name, such as `{ angle = "0.05 rad", rate = "0 rad/s" }`.
pub type Values = BTreeMap<String, AnyValue>;

/// One entry that a rig expects in a table of values.
#[derive(Clone, Copy, Debug)]
pub struct ExpectedEntry {
    /// Its name.
    pub name: &'static str,
    /// What it must be.
    pub kind: &'static Kind,
    /// Which sign it must have.
    pub sign: Sign,
}

impl ExpectedEntry {
    /// An entry of this name, kind and sign.
    pub const fn new(name: &'static str, kind: &'static Kind, sign: Sign) -> Self {
        Self { name, kind, sign }
    }
}

impl AnyValue {
    /// Reads it; what is wrong comes back in words.
    pub(super) fn of(text: &str) -> Result<Self, String> {
        parse(text, "a value with a unit", "0.05 rad").map(Self)
    }

    /// The value as parsed.
    pub const fn value(&self) -> &Value {
        &self.0
    }
}

/// The SI values of `expected` in its order. All must be there, and no others.
pub(super) fn read(values: &Values, expected: &[ExpectedEntry]) -> Result<Vec<f64>, (Key, ConfigFault)> {
    if let Some(name) = values.keys().find(|name| expected.iter().all(|entry| entry.name != *name)) {
        let known = expected.iter().map(|entry| entry.name);
        return Err((Key::default().child(name), ConfigFault::unknown_key(name, known)));
    }
    let one = |entry: &ExpectedEntry| {
        let at = |fault| (Key::default().child(entry.name), fault);
        let Some(value) = values.get(entry.name) else {
            let remedy = format!("write `{} = \"{}\"`", entry.name, entry.kind.example);
            return Err(at(ConfigFault::MissingKey { remedy }));
        };
        entry.sign.check(&value.0, entry.kind).map_err(|why| at(ConfigFault::Value { why }))
    };
    expected.iter().map(one).collect()
}

impl Serialize for AnyValue {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.0.text())
    }
}

impl<'de> Deserialize<'de> for AnyValue {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct ValuesVisitor;
        impl Visitor<'_> for ValuesVisitor {
            type Value = AnyValue;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a value with a unit as text in quotes")
            }

            fn visit_str<E: Error>(self, text: &str) -> Result<AnyValue, E> {
                AnyValue::of(text).map_err(E::custom)
            }

            fn visit_i64<E: Error>(self, number: i64) -> Result<AnyValue, E> {
                self.visit_str(&number.to_string())
            }

            fn visit_f64<E: Error>(self, number: f64) -> Result<AnyValue, E> {
                self.visit_str(&format!("{number:?}"))
            }
        }
        deserializer.deserialize_any(ValuesVisitor)
    }
}

inline_schema!(AnyValue, "AnyValue", |_| json_schema!({
    "type": ["string", "number"],
    "title": "a value with its unit; a ratio may be a plain number",
    "pattern": NUMBER_FIRST,
    "examples": ["0.05 rad"],
}));

//! Values of a kind that the key demands.

use super::error::shown;
use super::kinds::KindOf;
use super::sign::{Any, Positive, Sign, SignOf};
use crate::units::{Kind, UnitError, Value};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{Error, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::borrow::Cow;
use std::fmt;
use std::marker::PhantomData;

/// A value of one kind, such as a stiffness, and with the sign that physics demands.
///
/// In the file it is text with a unit; a ratio may also be a plain number.
#[derive(Clone, Debug, PartialEq)]
pub struct Quantity<K, S = Any> {
    value: Value,
    marker: PhantomData<(K, S)>,
}

impl<K: KindOf, S: SignOf> Quantity<K, S> {
    /// The value in SI units.
    pub const fn si(&self) -> f64 {
        self.value.si()
    }

    /// The text as written.
    pub fn text(&self) -> &str {
        self.value.text()
    }

    /// A value in a unit, such as what was identified; what is wrong with it comes back in words.
    pub fn of(number: f64, unit: &str) -> Result<Self, String> {
        Self::parse(&format!("{number:e} {unit}"))
    }

    /// The same with a standard uncertainty in the same unit, where that is above 0: in three digits, or in all of them, for numbers of which only
    /// a combination is known well.
    pub fn of_uncertain(number: f64, sd: f64, unit: &str, is_exact: bool) -> Result<Self, String> {
        if sd == 0.0 {
            return Self::of(number, unit);
        }
        let sd = if is_exact { format!("{sd:e}") } else { format!("{sd:.2e}") };
        Self::parse(&format!("{number:e} {unit} ± {sd} {unit}"))
    }

    /// From text such as `2.5 kHz`; what is wrong comes back in words.
    pub fn parse(text: &str) -> Result<Self, String> {
        parse_of(text, K::kind(), S::SIGN).map(Self::from)
    }
}

impl<K, S> From<Value> for Quantity<K, S> {
    fn from(value: Value) -> Self {
        Self { value, marker: PhantomData }
    }
}

/// A number in a unit as an experiment file has it: text with the unit behind it, and a plain number where that is empty.
pub fn written(number: f64, unit: &str) -> toml::Value {
    if unit.is_empty() {
        toml::Value::Float(number)
    } else {
        toml::Value::String(format!("{number:e} {unit}"))
    }
}

// What follows is compiled once, and not for each kind and sign.

fn parse_of(text: &str, kind: &Kind, sign: Sign) -> Result<Value, String> {
    let value = parse(text, &expectation(kind, sign), kind.example)?;
    sign.check(&value, kind)?;
    Ok(value)
}

fn expectation(kind: &Kind, sign: Sign) -> String {
    format!("{}{} ({})", kind.name, sign.suffix(), kind.dimension)
}

fn schema(kind: &Kind, sign: Sign) -> Schema {
    let ratio = kind.dimension == crate::units::Dimension::NONE;
    let kinds = if ratio {
        serde_json::json!(["string", "number", "object"])
    } else {
        serde_json::json!(["string", "object"])
    };
    json_schema!({
        "type": kinds,
        "title": expectation(kind, sign),
        "pattern": NUMBER_FIRST,
        "examples": [kind.example, format!("{} ± 1 %", kind.example)],
        "properties": { "value": { "type": ["string", "number"] }, "sd": { "type": ["string", "number"] } },
        "required": ["value", "sd"],
        "additionalProperties": false,
    })
}

/// Reads a value of a kind from text or a number.
struct QuantityVisitor(&'static Kind, Sign);

impl<'de> Visitor<'de> for QuantityVisitor {
    type Value = Value;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} as text in quotes", expectation(self.0, self.1))
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<Value, E> {
        parse_of(text, self.0, self.1).map_err(E::custom)
    }

    fn visit_i64<E: Error>(self, number: i64) -> Result<Value, E> {
        self.visit_str(&number.to_string())
    }

    fn visit_f64<E: Error>(self, number: f64) -> Result<Value, E> {
        // The shortest text that reads back as the same number.
        self.visit_str(&format!("{number:?}"))
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Value, A::Error> {
        self.visit_str(&with_sd(map)?)
    }
}

/// The text of a value that stands in a table with its standard uncertainty: `{ value = "3 N/m", sd = "1 %" }` is `3 N/m ± 1 %`.
pub fn with_sd<'de, A: MapAccess<'de>>(mut map: A) -> Result<String, A::Error> {
    const KEYS: [&str; 2] = ["value", "sd"];
    let mut found: [Option<String>; 2] = [None, None];
    while let Some(key) = map.next_key::<String>()? {
        let Some(place) = KEYS.iter().position(|known| *known == key) else {
            return Err(A::Error::unknown_field(&key, &KEYS));
        };
        found[place] = Some(match map.next_value::<serde_json::Value>()? {
            serde_json::Value::String(text) => text,
            other => other.to_string(),
        });
    }
    match found {
        [Some(value), Some(sd)] => Ok(format!("{value} ± {sd}")),
        [None, _] => Err(A::Error::missing_field("value")),
        [_, None] => Err(A::Error::missing_field("sd")),
    }
}

impl<K, S> Serialize for Quantity<K, S> {
    fn serialize<W: Serializer>(&self, serializer: W) -> Result<W::Ok, W::Error> {
        serializer.serialize_str(self.value.text())
    }
}

impl<'de, K: KindOf, S: SignOf> Deserialize<'de> for Quantity<K, S> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(QuantityVisitor(K::kind(), S::SIGN)).map(Self::from)
    }
}

impl<K: KindOf, S: SignOf> JsonSchema for Quantity<K, S> {
    fn schema_name() -> Cow<'static, str> {
        expectation(K::kind(), S::SIGN).into()
    }

    fn inline_schema() -> bool {
        true
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        schema(K::kind(), S::SIGN)
    }
}

/// What every value starts with; the rest of the grammar is checked when it is read.
pub(super) const NUMBER_FIRST: &str = r"^\s*[+-]?(\d|\.\d)";

/// What stands in the place of a readout's noise that is to be found from the recording.
pub const FROM_RECORDING: &str = "from_recording";

/// The schema of a noise, which may be left to the recording.
pub fn noise_schema<K: KindOf>(generator: &mut SchemaGenerator) -> Schema {
    let stated = Quantity::<K, Positive>::json_schema(generator);
    json_schema!({ "anyOf": [stated, { "const": FROM_RECORDING }] })
}

/// Reads a value; what is wrong comes back in words, with `expected` and an example.
pub(super) fn parse(text: &str, expected: &str, example: &str) -> Result<Value, String> {
    // A value is a few words; anything else would make the messages unreadable.
    const LONGEST: usize = 100;
    let wrong = if text.chars().count() > LONGEST || text.chars().any(char::is_control) {
        format!("`{}` is not a number and a unit on one line", shown(text))
    } else if text == FROM_RECORDING {
        format!(
            "`{FROM_RECORDING}` is the noise of a readout that `kalmems estimate`, `diagnose` and `identify` find; it is not known here"
        )
    } else {
        match Value::parse(text) {
            Ok(value) => return Ok(value),
            // Its own example is of another kind.
            Err(UnitError::Number { found }) => format!("`{found}` does not start with a finite number"),
            Err(other) => other.to_string(),
        }
    };
    let joint = if wrong.ends_with('?') { " " } else { "; " };
    Err(format!("{wrong}{joint}expected {expected}, such as `{example}`"))
}

//! The table of process noise, whose densities may be left to the recording.

use super::ConfigFault;
use super::quantity::FROM_RECORDING;
use super::values::{AnyValue, Values};
use crate::inline_schema;
use schemars::json_schema;
use serde::de::{DeserializeSeed, Error, MapAccess, Visitor};
use serde::ser::SerializeMap;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::collections::BTreeSet;
use std::fmt;

/// Power densities of process noise by state, of which some or all may be left to the recording.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ProcessNoiseTable {
    stated: Values,
    /// The names that have [`FROM_RECORDING`] in the place of a density.
    open: BTreeSet<String>,
    /// Whether the word stands in the place of the whole table.
    is_open: bool,
}

impl ProcessNoiseTable {
    /// Whether the file says nothing of it.
    pub fn is_empty(&self) -> bool {
        self.stated.is_empty() && !self.leaves_open()
    }

    /// Those that the file states as numbers.
    pub const fn stated(&self) -> &Values {
        &self.stated
    }

    /// Whether it has an entry of this name, stated or left to the recording.
    pub fn names(&self, name: &str) -> bool {
        self.stated.contains_key(name) || self.open.contains(name)
    }

    /// Whether a density is left to the recording.
    pub fn leaves_open(&self) -> bool {
        self.is_open || !self.open.is_empty()
    }

    /// Whether all of it is left to the recording: `process_noise = "from_recording"`.
    pub const fn is_left_open(&self) -> bool {
        self.is_open
    }

    /// What is stated, where nothing is left to the recording; else the name that is, empty of the whole table, and why it cannot be read here.
    pub fn known(&self) -> Result<&Values, (&str, ConfigFault)> {
        if !self.leaves_open() {
            return Ok(&self.stated);
        }
        let name = self.open.first().map_or("", String::as_str);
        let why = format!(
            "`{FROM_RECORDING}` is a density that `kalmems estimate`, `diagnose` and `identify` find; it is not known here; expected a value \
             with its unit, such as `1e6 rad^2/s^3`"
        );
        Err((name, ConfigFault::Value { why }))
    }
}

impl Serialize for ProcessNoiseTable {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if self.is_open {
            return serializer.serialize_str(FROM_RECORDING);
        }
        let mut map = serializer.serialize_map(Some(self.stated.len() + self.open.len()))?;
        for (name, value) in &self.stated {
            map.serialize_entry(name, value)?;
        }
        for name in &self.open {
            map.serialize_entry(name, FROM_RECORDING)?;
        }
        map.end()
    }
}

/// A density, or `None` of one that is left to the recording.
struct DensitySeed;

impl<'de> DeserializeSeed<'de> for DensitySeed {
    type Value = Option<AnyValue>;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Self::Value, D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl Visitor<'_> for DensitySeed {
    type Value = Option<AnyValue>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "a value with a unit as text in quotes, or \"{FROM_RECORDING}\"")
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<Self::Value, E> {
        if text == FROM_RECORDING {
            return Ok(None);
        }
        AnyValue::of(text).map(Some).map_err(E::custom)
    }

    fn visit_i64<E: Error>(self, number: i64) -> Result<Self::Value, E> {
        self.visit_str(&number.to_string())
    }

    fn visit_f64<E: Error>(self, number: f64) -> Result<Self::Value, E> {
        self.visit_str(&format!("{number:?}"))
    }
}

impl<'de> Deserialize<'de> for ProcessNoiseTable {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct TableVisitor;
        impl<'de> Visitor<'de> for TableVisitor {
            type Value = ProcessNoiseTable;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "a table of densities by state, or \"{FROM_RECORDING}\"")
            }

            fn visit_str<E: Error>(self, text: &str) -> Result<Self::Value, E> {
                if text != FROM_RECORDING {
                    return Err(E::invalid_value(serde::de::Unexpected::Str(text), &self));
                }
                Ok(ProcessNoiseTable { is_open: true, ..ProcessNoiseTable::default() })
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
                let mut table = ProcessNoiseTable::default();
                while let Some(name) = map.next_key::<String>()? {
                    match map.next_value_seed(DensitySeed)? {
                        Some(value) => {
                            table.stated.insert(name, value);
                        }
                        None => {
                            table.open.insert(name);
                        }
                    }
                }
                Ok(table)
            }
        }
        deserializer.deserialize_any(TableVisitor)
    }
}

inline_schema!(ProcessNoiseTable, "ProcessNoiseTable", |generator| {
    let stated = AnyValue::json_schema(generator);
    json_schema!({
        "anyOf": [
            { "type": "object", "additionalProperties": { "anyOf": [stated, { "const": FROM_RECORDING }] } },
            { "const": FROM_RECORDING },
        ]
    })
});

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Serialize, Deserialize)]
    struct Holder {
        process_noise: ProcessNoiseTable,
    }

    fn read(text: &str) -> Result<ProcessNoiseTable, String> {
        toml::from_str::<Holder>(text).map(|holder| holder.process_noise).map_err(|e| e.to_string())
    }

    #[test]
    fn what_is_left_to_the_recording_is_written_as_it_was() {
        for (text, open) in [
            ("process_noise = \"from_recording\"\n", true),
            ("[process_noise]\na = \"1 Hz^2/s\"\nb = \"from_recording\"\n", true),
            ("[process_noise]\na = \"1 Hz^2/s\"\n", false),
        ] {
            let table = read(text).unwrap();
            assert_eq!(table.leaves_open(), open);
            assert_eq!(table.known().is_err(), open);
            assert_eq!(toml::to_string(&Holder { process_noise: table }).unwrap(), text);
        }
        let table = read("[process_noise]\nb = \"from_recording\"").unwrap();
        assert_eq!(table.known().unwrap_err().0, "b");
    }

    #[test]
    fn other_words_are_refused() {
        assert!(read("process_noise = \"from_signal\"").unwrap_err().contains("from_recording"));
        assert!(read("[process_noise]\na = \"much\"").unwrap_err().contains("a value with a unit"));
    }
}

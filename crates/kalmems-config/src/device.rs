//! The device of an experiment: one table, which stays as it is written until a rig claims it.

use super::reader::read_below;
use super::source::Source;
use super::uncertainty::{CORRELATION, Correlations};
use super::variation::Variations;
use super::{ConfigError, ConfigFault, Experiment, Key};
use crate::inline_schema;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{DeserializeOwned, EnumAccess, VariantAccess, Visitor};
use serde::ser::SerializeMap;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::any::Any;
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

/// What a rig reads from the table `[device.NAME]` that is for it.
pub trait DeviceDescription: Serialize + DeserializeOwned + JsonSchema + Send + Sync + 'static {
    /// The name of the table.
    const NAME: &'static str;

    /// The device in a sentence, for those who look into the schema.
    const SUMMARY: &'static str;

    /// What no single value can be blamed for: the key, and what is wrong.
    fn check(&self) -> Result<(), (Key, String)> {
        Ok(())
    }

    /// The same device in other terms, such as the differential equations that its numbers stand in, where it is worked on in those; see
    /// [`Experiment::device_in_terms_of`].
    fn in_other_terms(&self) -> Result<Option<OtherTerms>, (Key, String)> {
        Ok(None)
    }
}

/// A description of a device in terms of another table.
pub type OtherTerms = Arc<dyn Any + Send + Sync>;

/// A kind of device that can be described: the name of its table and the schema of what is in it.
#[derive(Clone, Copy, Debug)]
pub struct DeviceKind {
    /// The name of its table below `[device]`.
    pub name: &'static str,
    summary: &'static str,
    schema: fn(&mut SchemaGenerator) -> Schema,
}

impl DeviceKind {
    /// That which this type describes.
    pub fn of<T: DeviceDescription>() -> Self {
        Self { name: T::NAME, summary: T::SUMMARY, schema: SchemaGenerator::subschema_for::<T> }
    }

    /// The schema of a table `[device]` that holds exactly one of these tables.
    pub(super) fn schema_of_one(kinds: &[Self], generator: &mut SchemaGenerator) -> Schema {
        let one = |kind: &Self| {
            json_schema!({
                "description": kind.summary,
                "type": "object",
                "properties": { kind.name: (kind.schema)(generator), CORRELATION: generator.subschema_for::<Correlations>() },
                "required": [kind.name],
                "additionalProperties": false,
            })
        };
        let each: Vec<Schema> = kinds.iter().map(one).collect();
        json_schema!({
            "description": "The device: exactly one of these tables, and the correlations of its uncertain numbers.",
            "oneOf": each,
        })
    }
}

/// What the reader knows the choice of a device's table by.
pub(super) const DEVICE: &str = "Device";

/// The table `[device.NAME]`: as it stands in the file, and what a rig has read from it.
#[derive(Clone)]
pub(super) struct DeviceTable {
    name: String,
    /// As it was written.
    written: serde_json::Value,
    claimed: OnceLock<ParsedDevice>,
    /// The correlations that are stated beside it.
    pub(super) correlation: Correlations,
}

/// What a rig reads from the table.
#[derive(Clone)]
struct ParsedDevice {
    description: Arc<dyn Any + Send + Sync>,
    /// As it is written out, with every default that has a value.
    written: serde_json::Value,
    other_terms: Option<OtherTerms>,
}

impl ParsedDevice {
    fn of<T: DeviceDescription>(description: T, other_terms: Option<OtherTerms>) -> Self {
        // What is not a table of values, lists and tables could not have been read.
        let written = serde_json::to_value(&description).unwrap_or_default();
        Self { description: Arc::new(description), written, other_terms }
    }
}

/// Reads a device from the text of its table alone, `[device.NAME]`.
pub fn read_device<T: DeviceDescription>(text: &str) -> Result<T, ConfigError> {
    read_below(&Source::of(text, Path::new(T::NAME))?, &Key::from("device").child(T::NAME))
}

impl DeviceTable {
    pub(super) fn written(&self) -> &serde_json::Value {
        self.claimed.get().map_or(&self.written, |claimed| &claimed.written)
    }

    /// The same as it is written out, with every file that it names put elsewhere: what stands behind a key `file`.
    pub(super) fn move_files(&mut self, place: &dyn Fn(&Path) -> PathBuf) {
        move_files(&mut self.written, place);
        if let Some(mut claimed) = self.claimed.take() {
            move_files(&mut claimed.written, place);
            self.claimed = claimed.into();
        }
    }

    /// The description, read once and checked.
    fn description<T: DeviceDescription>(&self, source: &Source) -> Result<Arc<T>, ConfigError> {
        let key = || Key::from("device").child(T::NAME);
        let claimed = if let Some(claimed) = self.claimed.get() {
            claimed
        } else {
            let description: T = read_below(source, &key())?;
            let other_terms = description.check().and_then(|()| description.in_other_terms());
            let other_terms =
                other_terms.map_err(|(key, why)| source.error_at(key, ConfigFault::Value { why }))?;
            self.claimed.get_or_init(|| ParsedDevice::of(description, other_terms))
        };
        // Two rigs may read the same table, each in its own way.
        Arc::clone(&claimed.description).downcast::<T>().or_else(|_| {
            // By the one reader that there is: a second one for each device would be compiled for this alone.
            let whole = serde_json::json!({ "device": { T::NAME: claimed.written } });
            let text = toml::to_string(&whole)
                .map_err(|e| source.error_at(key(), ConfigFault::Value { why: e.to_string() }))?;
            read_below(&Source::of(&text, &source.path)?, &key()).map(Arc::new)
        })
    }
}

fn move_files(written: &mut serde_json::Value, place: &dyn Fn(&Path) -> PathBuf) {
    match written {
        serde_json::Value::Object(table) => {
            for (name, value) in table {
                match value {
                    serde_json::Value::String(text) if name == "file" => {
                        *text = place(Path::new(text)).to_string_lossy().into_owned();
                    }
                    value => move_files(value, place),
                }
            }
        }
        serde_json::Value::Array(list) => list.iter_mut().for_each(|value| move_files(value, place)),
        _ => {}
    }
}

impl Experiment {
    /// The name of the device's table: `shared_scanner` of `[device.shared_scanner]`.
    pub fn device_name(&self) -> &str {
        &self.device.name
    }

    /// What the device's table says, where it is of this kind.
    pub fn device<T: DeviceDescription>(&self) -> Result<Arc<T>, ConfigError> {
        if self.device.name == T::NAME {
            self.device.description(&self.source)
        } else {
            let why = format!("this rig is for a `[device.{}]`", T::NAME);
            Err(self.error("device", ConfigFault::Value { why }))
        }
    }

    /// The device in terms of this table: what its own table says, where it is this one, or what the rig that reads it takes it for.
    pub fn device_in_terms_of<T: DeviceDescription>(&self) -> Result<Arc<T>, ConfigError> {
        let claimed = self.device.claimed.get().filter(|_| self.device.name != T::NAME);
        match claimed.and_then(|claimed| claimed.other_terms.clone()?.downcast::<T>().ok()) {
            Some(description) => Ok(description),
            None => self.device(),
        }
    }

    /// Puts another device, or another description of the same, in the place of the one that there is. The correlations of the same
    /// device stay, but for those of numbers without an uncertainty.
    pub fn set_device<T: DeviceDescription>(&mut self, device: T) {
        let other_terms = device.in_other_terms().ok().flatten();
        let claimed = ParsedDevice::of(device, other_terms);
        let written = claimed.written.clone();
        let before = std::mem::take(&mut self.device.correlation);
        let correlation = if self.device.name == T::NAME { before } else { Correlations::default() };
        self.device = DeviceTable { name: T::NAME.to_owned(), written, claimed: claimed.into(), correlation };
        self.variations = Variations::default();
        let uncertain = self.uncertain().unwrap_or_default();
        self.device.correlation.keep(&|name| uncertain.iter().any(|number| number.name == name));
    }
}

impl PartialEq for DeviceTable {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name && self.written() == other.written() && self.correlation == other.correlation
    }
}

impl fmt::Debug for DeviceTable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct(&self.name).field("table", self.written()).finish_non_exhaustive()
    }
}

impl Serialize for DeviceTable {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        map.serialize_entry(&self.name, self.written())?;
        if !self.correlation.is_empty() {
            map.serialize_entry(CORRELATION, &self.correlation)?;
        }
        map.end()
    }
}

impl<'de> Deserialize<'de> for DeviceTable {
    /// A table with exactly one entry, which names the kind; the reader leaves out what stands beside it.
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct OneTable;
        impl<'de> Visitor<'de> for OneTable {
            type Value = DeviceTable;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("exactly one table, such as `[device.NAME]`")
            }

            fn visit_enum<A: EnumAccess<'de>>(self, choice: A) -> Result<DeviceTable, A::Error> {
                let (name, content) = choice.variant::<String>()?;
                let written = content.newtype_variant()?;
                let correlation = Correlations::default();
                Ok(DeviceTable { name, written, claimed: OnceLock::new(), correlation })
            }
        }
        deserializer.deserialize_enum(DEVICE, &[], OneTable)
    }
}

inline_schema!(
    DeviceTable,
    "Device",
    |_| json_schema!({ "type": "object", "minProperties": 1, "maxProperties": 2 })
);

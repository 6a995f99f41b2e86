//! The study file.

use crate::config::{Name, inline_schema, schema_of};
use schemars::{JsonSchema, json_schema};
use serde::de::Error;
use serde::{Deserialize, Deserializer};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// A study, as one TOML file describes it.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[allow(clippy::struct_field_names)] // the file's own words
pub(super) struct StudyDescription {
    /// A name; results go to a folder of this name unless another is given.
    pub(super) name: Name,
    /// What the study is about, in free text.
    #[serde(default)]
    pub(super) description: Option<String>,
    /// The experiment file, relative to the folder of the study file.
    #[schemars(example = &"experiment.toml")]
    pub(super) experiment: PathBuf,
    /// How many times each point of the grid is run, each time with noise and draws of its own; 1 if left out.
    #[serde(default = "once", deserialize_with = "at_least_one")]
    #[schemars(range(min = 1))]
    pub(super) repeats: u64,
    /// What all noise and all draws follow from, a whole number of 0 or more; 0 if left out.
    #[serde(default, deserialize_with = "whole")]
    #[schemars(range(min = 0))]
    pub(super) seed: u64,
    /// Keys of the experiment whose values differ in what is simulated.
    #[serde(default)]
    #[schemars(with = "BTreeMap<String, Value>")]
    pub(super) truth: BTreeMap<String, toml::Value>,
    /// The keys that vary: at least one, unless the study is run as a calibration, which draws what the filters hold as uncertain.
    #[serde(default)]
    pub(super) vary: Vec<Vary>,
    /// The pictures that are wanted.
    #[serde(default)]
    pub(super) figure: Vec<StudyPicture>,
}

/// One key that varies: over a grid, a list, or by chance.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("oneOf" = [
    { "required": ["grid"] }, { "required": ["values"] }, { "required": ["normal"] }, { "required": ["uniform"] },
]))]
pub(super) struct Vary {
    /// The key of the experiment file, such as `simulate.drive.sine.frequency` or `recording[0].clock.rate`.
    #[schemars(example = &"simulate.drive.sine.frequency")]
    pub(super) key: String,
    /// What it is called in the results; the last name of the key if left out.
    #[serde(default)]
    pub(super) name: Option<Name>,
    /// Whether it is varied in what is simulated, in what the filters are told, or in both.
    #[serde(default)]
    pub(super) applies_to: Option<AppliesTo>,
    /// Equidistant values.
    #[serde(default)]
    pub(super) grid: Option<GridValues>,
    /// A list of values.
    #[serde(default)]
    #[schemars(with = "Option<Vec<Value>>")]
    pub(super) values: Option<Vec<toml::Value>>,
    /// Drawn from a normal distribution in each repeat.
    #[serde(default)]
    pub(super) normal: Option<Normal>,
    /// Drawn with equal chance between two values in each repeat.
    #[serde(default)]
    pub(super) uniform: Option<Uniform>,
}

/// Where a varied key is varied.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(super) enum AppliesTo {
    /// In what is simulated.
    Truth,
    /// In what the filters are told.
    Told,
    /// In both.
    Both,
}

/// Values from one to another.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct GridValues {
    /// The first.
    #[schemars(with = "NumberOrText", example = &"31.1 kHz")]
    pub(super) from: toml::Value,
    /// The last.
    #[schemars(with = "NumberOrText", example = &"31.5 kHz")]
    pub(super) to: toml::Value,
    /// How many, 2 or more.
    #[serde(deserialize_with = "whole")]
    #[schemars(range(min = 2), example = 15)]
    pub(super) points: u64,
    /// Whether they are equally far from each other, or stand in equal ratios; `linear` if left out.
    #[serde(default)]
    pub(super) spacing: Spacing,
}

/// How the values of a grid lie.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(super) enum Spacing {
    /// In equal steps.
    #[default]
    Linear,
    /// In equal ratios.
    Log,
}

/// A value of an experiment that lies between others: a number, or text of a number with a unit.
struct NumberOrText;

inline_schema!(NumberOrText, "NumberOrText", |_| json_schema!({ "type": ["string", "number"] }));

/// The JSON schema of a study file: for editors, and for checking a file without this program.
pub fn schema() -> Value {
    schema_of::<StudyDescription>("A kalmems study")
}

/// A normal distribution.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct Normal {
    /// Its mean.
    #[schemars(with = "NumberOrText", example = &"1.10e-4 N m")]
    pub(super) mean: toml::Value,
    /// Its standard deviation.
    #[schemars(with = "NumberOrText", example = &"3e-7 N m")]
    pub(super) sd: toml::Value,
}

/// A uniform distribution.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct Uniform {
    /// The lowest value.
    #[schemars(with = "NumberOrText", example = &"31.1 kHz")]
    pub(super) from: toml::Value,
    /// What all values lie below.
    #[schemars(with = "NumberOrText", example = &"31.5 kHz")]
    pub(super) to: toml::Value,
}

/// A figure of the results against a parameter.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct StudyPicture {
    /// The column of the results, such as `errors.angle.rmse_deg`.
    #[schemars(example = &"errors.angle.rmse_deg")]
    pub(super) metric: String,
    /// The name of what varies; what varies first if left out.
    #[serde(default)]
    pub(super) against: Option<String>,
    /// The name of what varies upwards in a map: the column is then shown in colours. Both have a grid or values.
    #[serde(default)]
    pub(super) over: Option<String>,
    /// Where the colours of a map part and a line is drawn; the colours rise from the lowest value if left out.
    #[serde(default)]
    pub(super) level: Option<f64>,
    /// What the column is called; the end of its name if left out.
    #[serde(default)]
    pub(super) label: Option<String>,
    /// How the column's axis is divided, or its colours; `linear` if left out.
    #[serde(default)]
    pub(super) scale: Spacing,
}

fn once() -> u64 {
    1
}

fn whole<'de, D: Deserializer<'de>>(deserializer: D) -> Result<u64, D::Error> {
    let number = i64::deserialize(deserializer)?;
    u64::try_from(number).map_err(|_| D::Error::custom(format!("`{number}` is below 0; write `0` or more")))
}

fn at_least_one<'de, D: Deserializer<'de>>(deserializer: D) -> Result<u64, D::Error> {
    match whole(deserializer)? {
        0 => Err(D::Error::custom("`0` is below 1; write how many times, such as `10`")),
        number => Ok(number),
    }
}

//! Columns of files as settings name them: by name, or with what their numbers are.

use super::compensation::Compensation;
use super::error::shown;
use super::format::FileFormat;
use super::values::AnyValue;
use super::{Clock, Quantity, Segments, TimeColumn};
use crate::layout::{self, ColumnReading, DeclaredColumn, RecordingLayout};
use crate::units::{Unit, Value};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::value::MapAccessDeserializer;
use serde::de::{Error, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};

/// A column of a file, and what its numbers are where the file does not say it or says it wrongly:
/// the value is `scale · number`, in the product of both units, plus `offset`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct ColumnTable {
    /// Its name in the file; of a format that keeps the unit apart, without it.
    #[schemars(example = &"Vdrive")]
    column: String,
    /// The unit of its numbers, such as `"mV"`; that which the file says if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"V")]
    unit: Option<String>,
    /// What each number is multiplied by, such as `10` for a probe that divides by ten, or `"0.5 gn/V"`, which makes an
    /// acceleration of volts: the inverse of a sensitivity of `2 V/gn`; 1 if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    scale: Option<AnyValue>,
    /// Of numbers that are codes of a converter: how many make up the unit, such as `"131 LSB/(deg/s)"` or `"16384 LSB/gn"` in a data sheet. It
    /// stands instead of `scale` and `unit`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"131 LSB/(deg/s)")]
    sensitivity: Option<String>,
    /// What is added after that, in the unit of the result, such as `"0.1 V"`; 0 if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    offset: Option<AnyValue>,
    /// The full scale of the instrument, such as `"10 V"`, in the unit of the result: values of this size or larger are beyond it, and no
    /// measured values.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    full_scale: Option<AnyValue>,
    /// The range of the instrument where it is not the same to both sides, such as `["0 V", "5 V"]`: values at its ends or beyond are no
    /// measured values.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    range: Option<[AnyValue; 2]>,
    /// What its values are compensated for over the temperature, in the channels of a recording and of a calibration.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    compensation: Option<Compensation>,
}

/// A column of a file: its name, or a table such as `{ column = "Ucap", unit = "V", scale = 2.5, offset = "0.1 V" }`.
#[derive(Clone, Debug, PartialEq)]
pub struct ColumnChoice {
    table: Box<ColumnTable>,
    reading: Option<Box<ColumnReading>>,
}

/// Said of a column of another table.
const NOT_COMPENSATED: &str =
    "`compensation` is for the channels of a recording and of a calibration; leave it out here";

impl ColumnTable {
    /// A name, of whose numbers nothing is said.
    const fn named(column: String) -> Self {
        Self {
            column,
            unit: None,
            scale: None,
            sensitivity: None,
            offset: None,
            full_scale: None,
            range: None,
            compensation: None,
        }
    }
}

impl ColumnChoice {
    /// Its name.
    pub fn name(&self) -> &str {
        &self.table.column
    }

    /// What is said of its numbers, where that is more than the name.
    pub fn reading(&self) -> Option<&ColumnReading> {
        self.reading.as_deref()
    }

    /// Of codes of a converter: how many make up the unit, and that unit.
    pub fn sensitivity(&self) -> Option<(f64, &str)> {
        sensitivity_parts(self.table.sensitivity.as_deref()?)
    }

    fn of(table: ColumnTable) -> Result<Self, String> {
        let ColumnTable { column, unit, scale, sensitivity, offset, full_scale, range, compensation } =
            &table;
        if column.trim().is_empty() {
            return Err(
                "found no name; expected that of a column of the file, such as `column = \"Ucap\"`".into()
            );
        }
        let of_code = sensitivity.as_deref().map(value_of_code).transpose()?;
        if of_code.is_some() && (unit.is_some() || scale.is_some()) {
            return Err(
                "found `sensitivity` with `unit` or `scale`; expected it alone, as it says what both would"
                    .into(),
            );
        }
        let unit = unit.as_deref().or(of_code.is_some().then_some("1")).map(|text| {
            let unit = Unit::parse(text).map_err(|e| {
                let joint = if e.to_string().ends_with('?') { " " } else { "; " };
                format!(
                    "`unit`: {e}{joint}expected the unit of the column's numbers, such as `unit = \"mV\"`"
                )
            })?;
            Ok::<_, String>((text.trim().to_owned(), unit))
        });
        let unit = unit.transpose()?;
        let [scale, offset] =
            [scale, offset].map(|value: &Option<AnyValue>| value.as_ref().map(|v| v.value().clone()));
        let scale = of_code.or(scale);
        if scale.as_ref().is_some_and(|scale: &Value| scale.si() == 0.0) {
            return Err(
                "`scale` is 0, and every number would be; expected another, such as `scale = 10`".into()
            );
        }
        let range = match (full_scale, range) {
            (Some(_), Some(_)) => {
                return Err("found `full_scale` and `range`; expected one of them".into());
            }
            (Some(full), None) => {
                let full = full.value();
                let low = Value::parse(&format!("-{}", full.nominal().trim_start_matches('+')));
                Some([
                    low.map_err(|_| format!("`full_scale` is `{}`; expected a size above 0", full.text()))?,
                    full.clone(),
                ])
            }
            (None, range) => range.as_ref().map(|ends| ends.each_ref().map(|end| end.value().clone())),
        };
        if let Some([low, high]) = &range
            && low.si() >= high.si()
        {
            return Err(format!(
                "found a range from `{}` to `{}`; expected one that rises, such as `full_scale = \"10 V\"` or `range = \
                 [\"0 V\", \"5 V\"]`",
                low.text(),
                high.text()
            ));
        }
        let compensation = compensation.is_some().then(|| Err(NOT_COMPENSATED.to_owned()));
        let said = unit.is_some()
            || scale.is_some()
            || offset.is_some()
            || range.is_some()
            || compensation.is_some();
        let reading = said.then(|| Box::new(ColumnReading { unit, scale, offset, range, compensation }));
        Ok(Self { table: Box::new(table), reading })
    }

    /// Reads the curves that it is compensated with; `folder` is that of the file that names it.
    pub(super) fn load_compensation(&mut self, folder: &Path) {
        if let (Some(choice), Some(reading)) = (&self.table.compensation, &mut self.reading) {
            reading.compensation = Some(choice.load(folder));
        }
    }

    /// Puts the file with these curves elsewhere.
    pub(super) fn move_file(&mut self, place: &dyn Fn(&Path) -> PathBuf) {
        if let Some(choice) = &mut self.table.compensation {
            choice.file = place(&choice.file);
        }
    }

    /// As [`DeclaredColumn`] under this key, with a unit that would fit where it needs one.
    pub(super) fn declared(&self, key: &str, usual_unit: Option<&'static str>) -> DeclaredColumn {
        DeclaredColumn {
            column: self.name().to_owned(),
            key: key.to_owned(),
            usual_unit,
            reading: self.reading().cloned(),
        }
    }

    /// As a table, as a clock has it.
    pub(super) fn serialize_as_table<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.table.serialize(serializer)
    }

    /// From the keys of a table.
    pub(super) fn of_keys(
        column: String,
        unit: Option<String>,
        scale: Option<AnyValue>,
    ) -> Result<Self, String> {
        Self::of(ColumnTable { unit, scale, ..ColumnTable::named(column) })
    }
}

/// The number and the unit of a sensitivity such as `131 LSB/(deg/s)`.
fn sensitivity_parts(text: &str) -> Option<(f64, &str)> {
    let (number, unit) = text.split_once("LSB/")?;
    let unit = unit.trim();
    let unit = unit.strip_prefix('(').and_then(|unit| unit.strip_suffix(')')).unwrap_or(unit);
    let number: f64 = number.trim().parse().ok()?;
    (number.is_finite() && number != 0.0).then_some((number, unit))
}

/// What one code of a converter with this sensitivity is.
fn value_of_code(text: &str) -> Result<Value, String> {
    let value =
        sensitivity_parts(text).map(|(number, unit)| Value::parse(&format!("{:e} {unit}", number.recip())));
    match value {
        Some(Ok(value)) => Ok(value),
        Some(Err(error)) => Err(format!("`sensitivity` is `{text}`: {error}")),
        None => Err(format!(
            "`sensitivity` is `{text}`; expected codes by a unit, such as `\"131 LSB/(deg/s)\"` or `\"16384 LSB/gn\"`"
        )),
    }
}

/// A unit that a channel of this meaning could have, for a message.
pub(super) fn usual_unit(meaning: &str) -> &'static str {
    match meaning {
        "angle" | "angle_x" | "angle_y" => "rad",
        "rate" | "rate_x" | "rate_y" | "x" | "y" | "z" => "rad/s",
        "position" | "displacement" => "m",
        "velocity" => "m/s",
        "acceleration" => "m/s^2",
        _ => "V",
    }
}

impl From<&str> for ColumnChoice {
    fn from(name: &str) -> Self {
        Self { table: Box::new(ColumnTable::named(name.to_owned())), reading: None }
    }
}

impl fmt::Display for ColumnChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl Serialize for ColumnChoice {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match &self.reading {
            None => serializer.serialize_str(self.name()),
            Some(_) => self.table.serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for ColumnChoice {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct ColumnChoiceVisitor;
        impl<'de> Visitor<'de> for ColumnChoiceVisitor {
            type Value = ColumnChoice;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(
                    "the name of a column as text in quotes, or a table such as `{ column = \"Ucap\", unit = \"V\" }`",
                )
            }

            fn visit_str<E: Error>(self, name: &str) -> Result<ColumnChoice, E> {
                Ok(ColumnChoice::from(name))
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<ColumnChoice, A::Error> {
                let table = ColumnTable::deserialize(MapAccessDeserializer::new(map))?;
                ColumnChoice::of(table).map_err(A::Error::custom)
            }
        }
        deserializer.deserialize_any(ColumnChoiceVisitor)
    }
}

impl JsonSchema for ColumnChoice {
    fn schema_name() -> Cow<'static, str> {
        "Column".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let table = ColumnTable::json_schema(generator);
        json_schema!({
            "description": "A column of a file: its name, or a table that also says what its numbers are.",
            "anyOf": [{ "type": "string" }, table],
            "examples": ["cap_V", { "column": "Ucap", "unit": "V" }],
        })
    }
}

/// A file with columns, as some table of the settings describes it.
#[derive(Clone, Debug, Default)]
pub struct FileColumns<'a> {
    /// How the file is written, where that cannot be told from it.
    pub format: Option<&'a FileFormat>,
    /// Where there is none, samples count as one a second.
    pub clock: Option<&'a Clock>,
    /// What divides its rows into segments.
    pub segments: Option<&'a Segments>,
    /// The keys of the settings that name its columns, these, and where their numbers need a unit one that would fit.
    pub columns: Vec<(&'a str, &'a ColumnChoice, Option<&'static str>)>,
}

impl<'a> FileColumns<'a> {
    /// Columns of a file with this clock, which nothing divides.
    pub fn new(
        format: Option<&'a FileFormat>,
        clock: &'a Clock,
        columns: Vec<(&'a str, &'a ColumnChoice, Option<&'static str>)>,
    ) -> Self {
        Self { format, clock: Some(clock), segments: None, columns }
    }

    /// The same, of a file whose rows these divide.
    #[must_use]
    pub fn divided_by(self, segments: Option<&'a Segments>) -> Self {
        Self { segments, ..self }
    }

    fn declared(&self) -> Vec<DeclaredColumn> {
        let columns = self.columns.iter().map(|(key, column, usual_unit)| column.declared(key, *usual_unit));
        let clock = match self.clock {
            Some(Clock::Column(times)) => Some(times.column.declared(DeclaredColumn::CLOCK, Some("s"))),
            _ => None,
        };
        columns.chain(clock).collect()
    }

    /// How to read these columns of it, or all.
    pub fn layout(&self, columns: Option<&[&str]>) -> RecordingLayout {
        let all = || self.columns.iter().map(|(_, column, _)| column.name().to_owned()).collect();
        RecordingLayout {
            clock: match self.clock {
                Some(Clock::Column(times)) => layout::TimeSource::Column(times.column.name().to_owned()),
                Some(Clock::Rate { rate, start }) => layout::TimeSource::Rate {
                    rate_hz: rate.si(),
                    start_s: start.as_ref().map_or(0.0, Quantity::si),
                },
                None => layout::TimeSource::Rate { rate_hz: 1.0, start_s: 0.0 },
            },
            segment_column: self.segments.map(|segments| segments.column.clone()),
            columns: Some(columns.map_or_else(all, |some| some.iter().map(|&c| c.to_owned()).collect())),
            declared: self.declared(),
            hints: self.format.map(FileFormat::hints).unwrap_or_default(),
            nominal_rate_hz: match self.clock {
                Some(Clock::Column(TimeColumn { rate, .. })) => rate.as_ref().map(Quantity::si),
                _ => None,
            },
            origin: None,
            restarts: None,
        }
    }

    /// Refuses a column that two keys read differently: the second of them, and why.
    pub fn check(&self) -> Result<(), (String, String)> {
        let mut first: BTreeMap<String, DeclaredColumn> = BTreeMap::new();
        for declared in self.declared() {
            if let Some(other) = first.get(&declared.column) {
                if other.reading != declared.reading {
                    let why = format!(
                        "the column `{}` is that of `{}` as well, and there its numbers are read otherwise; say the same \
                         of them in both places",
                        shown(&declared.column),
                        other.key
                    );
                    return Err((declared.key, why));
                }
            } else {
                first.insert(declared.column.clone(), declared);
            }
        }
        Ok(())
    }
}

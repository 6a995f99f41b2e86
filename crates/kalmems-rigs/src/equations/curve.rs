//! Curves through points, written out or in a file.

use crate::config::{ConfigError, ConfigFault, Experiment, Key, inline_schema};
use crate::table_file::read_table;
use kalmems_equations::{CurveExtension, CurvePoints};
use schemars::{JsonSchema, json_schema};
use serde::de::{Error, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;
use std::path::PathBuf;

/// A curve through points: a twice differentiable spline.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CurveTable {
    /// The file that the points are in, relative to the folder of the experiment; `x` and `y` name columns of it then.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<PathBuf>,
    /// Where the points are, rising: numbers in `x_unit`, or a column of the file.
    pub x: Coordinates,
    /// The value at each: numbers in `y_unit`, or a column of the file.
    pub y: Coordinates,
    /// The unit of the argument; in a file the name of the column says it.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub x_unit: String,
    /// The unit of the value, in the language of equations.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub y_unit: String,
    /// What it does beyond the points; an estimate stops there if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub outside: Option<OutsideRule>,
}

/// What a curve does beyond its points.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum OutsideRule {
    /// It has no value.
    Error,
    /// It keeps the value of the end.
    Clamp,
    /// It goes on along the tangent of the end.
    Linear,
}

/// Numbers that are written out, or the column that has them.
#[derive(Clone, Debug, PartialEq)]
pub enum Coordinates {
    /// The numbers.
    Numbers(Vec<f64>),
    /// The column of the file, by its name.
    Column(String),
}

impl CurveTable {
    /// Points without a name yet, as they are written out; none of those in a file.
    pub fn points_here(&self) -> CurvePoints {
        let numbers = |of: &Coordinates| match of {
            Coordinates::Numbers(numbers) => numbers.clone(),
            Coordinates::Column(_) => Vec::new(),
        };
        CurvePoints {
            name: String::new(),
            place: kalmems_equations::TextPlace::default(),
            file: self.file.as_ref().map(|file| file.display().to_string()),
            x: numbers(&self.x),
            y: numbers(&self.y),
            x_unit: self.x_unit.clone(),
            y_unit: self.y_unit.clone(),
            outside: match self.outside {
                None | Some(OutsideRule::Error) => CurveExtension::Error,
                Some(OutsideRule::Clamp) => CurveExtension::Clamp,
                Some(OutsideRule::Linear) => CurveExtension::Linear,
            },
        }
    }

    /// The same with the points of the file, where there is one.
    pub fn points_of(&self, experiment: &Experiment) -> Result<CurvePoints, ConfigError> {
        let Some(file) = &self.file else { return Ok(self.points_here()) };
        let refuse =
            |why: String| experiment.error(Key::from("device.equations.tables"), ConfigFault::Value { why });
        let (Coordinates::Column(x), Coordinates::Column(y)) = (&self.x, &self.y) else {
            let why = format!(
                "the points of a curve are in the file `{}`; name its columns, such as `x = \"angle_rad\", y = \"C_pF\"`",
                file.display()
            );
            return Err(refuse(why));
        };
        let recording = read_table(experiment, file, &[x, y]).map_err(|why| refuse(why.to_string()))?;
        let read = |name: &str| -> Result<(Vec<f64>, String), ConfigError> {
            let column = recording.column(name).map_err(|why| refuse(why.to_string()))?;
            let unit = column.header.unit.unwrap_or(crate::units::Unit::ONE);
            let values = recording.segments().first().map(|segment| column.of(segment).to_vec());
            Ok((values.unwrap_or_default(), unit.dimension().to_string()))
        };
        let ((x, x_unit), (y, y_unit)) = (read(x)?, read(y)?);
        Ok(CurvePoints { file: None, x, y, x_unit, y_unit, ..self.points_here() })
    }
}

impl Serialize for Coordinates {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Numbers(numbers) => numbers.serialize(serializer),
            Self::Column(name) => serializer.serialize_str(name),
        }
    }
}

impl<'de> Deserialize<'de> for Coordinates {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct CoordinatesVisitor;
        impl<'de> Visitor<'de> for CoordinatesVisitor {
            type Value = Coordinates;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a list of numbers, or a column of a file as text in quotes")
            }

            fn visit_str<E: Error>(self, text: &str) -> Result<Coordinates, E> {
                Ok(Coordinates::Column(text.to_owned()))
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Coordinates, A::Error> {
                let mut numbers = Vec::new();
                while let Some(number) = list.next_element()? {
                    numbers.push(number);
                }
                Ok(Coordinates::Numbers(numbers))
            }
        }
        deserializer.deserialize_any(CoordinatesVisitor)
    }
}

inline_schema!(Coordinates, "Coordinates", |_| json_schema!({
    "oneOf": [{ "type": "array", "items": { "type": "number" } }, { "type": "string" }],
    "title": "numbers, or a column of the file",
}));

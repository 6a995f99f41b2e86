//! Curves through points, written out or in a file.

use super::ordered::OfElement;
use crate::config::{ConfigError, ConfigFault, Experiment, Key, inline_schema};
use crate::table_file::read_table;
use kalmems_equations::{CurveExtension, CurvePoints, VectorElement};
use schemars::{JsonSchema, json_schema};
use serde::de::{Error, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;
use std::path::PathBuf;

/// A curve through points, or a surface through points on a grid: twice differentiable splines.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CurveTable {
    /// The file that the points are in, relative to the folder of the experiment; `x` and `y` name columns of it then.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<PathBuf>,
    /// Where the points are, rising: numbers in `x_unit`, or a column of the file.
    pub x: Coordinates,
    /// The value at each: numbers in `y_unit`, or a column of the file. Of a surface where its points are along the second argument, rising.
    pub y: Coordinates,
    /// Of a surface its values in `z_unit`, a row for each `x` with one for each `y`; or a column of the file, whose rows are the points in any
    /// order.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub z: Option<SurfaceValues>,
    /// The unit of the argument; in a file the name of the column says it.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub x_unit: String,
    /// The unit of the value, in the language of equations; of a surface that of the second argument.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub y_unit: String,
    /// The unit of a surface's value.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub z_unit: String,
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

/// Values on a grid that are written out, or the column that has them.
#[derive(Clone, Debug, PartialEq)]
pub enum SurfaceValues {
    /// A row for each place along the first argument.
    Rows(Vec<Vec<f64>>),
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
            z: match &self.z {
                Some(SurfaceValues::Rows(rows)) => rows.concat(),
                Some(SurfaceValues::Column(_)) | None => Vec::new(),
            },
            x_unit: self.x_unit.clone(),
            y_unit: self.y_unit.clone(),
            z_unit: self.z_unit.clone(),
            outside: match self.outside {
                None | Some(OutsideRule::Error) => CurveExtension::Error,
                Some(OutsideRule::Clamp) => CurveExtension::Clamp,
                Some(OutsideRule::Linear) => CurveExtension::Linear,
            },
        }
    }

    /// Refuses rows of a surface that do not have one value for each place along the second argument.
    pub fn check_rows(&self) -> Result<(), String> {
        let (Some(SurfaceValues::Rows(rows)), Coordinates::Numbers(y)) = (&self.z, &self.y) else {
            return Ok(());
        };
        match rows.iter().position(|row| row.len() != y.len()) {
            Some(row) => Err(format!(
                "row {} has {} numbers; expected {}, one for each `y`",
                row + 1,
                rows[row].len(),
                y.len()
            )),
            None => Ok(()),
        }
    }

    /// The same with the points of the file, where there is one.
    pub fn points_of(&self, experiment: &Experiment) -> Result<CurvePoints, ConfigError> {
        let Some(file) = &self.file else { return Ok(self.points_here()) };
        let refuse =
            |why: String| experiment.error(Key::from("device.equations.tables"), ConfigFault::Value { why });
        let z = match &self.z {
            Some(SurfaceValues::Rows(_)) => {
                return Err(refuse(format!(
                    "the points of a surface are in the file `{}`; name the column of its values, such as `z = \"C_pF\"`",
                    file.display()
                )));
            }
            Some(SurfaceValues::Column(z)) => Some(z),
            None => None,
        };
        let (Coordinates::Column(x), Coordinates::Column(y)) = (&self.x, &self.y) else {
            let why = format!(
                "the points of a curve are in the file `{}`; name its columns, such as `x = \"angle_rad\", y = \"C_pF\"`",
                file.display()
            );
            return Err(refuse(why));
        };
        let columns: Vec<&str> = [x, y].into_iter().chain(z).map(String::as_str).collect();
        let recording = read_table(experiment, file, &columns).map_err(|why| refuse(why.to_string()))?;
        let read = |name: &str| -> Result<(Vec<f64>, String), ConfigError> {
            let column = recording.column(name).map_err(|why| refuse(why.to_string()))?;
            let unit = column.header.unit.unwrap_or(crate::units::Unit::ONE);
            let values = recording.segments().first().map(|segment| column.of(segment).to_vec());
            Ok((values.unwrap_or_default(), unit.dimension().to_string()))
        };
        let ((x, x_unit), (y, y_unit)) = (read(x)?, read(y)?);
        let found = CurvePoints { file: None, x, y, x_unit, y_unit, ..self.points_here() };
        let Some((values, z_unit)) = z.map(|z| read(z)).transpose()? else { return Ok(found) };
        let [x, y, z] = on_a_grid(&found.x, &found.y, &values).map_err(|why| {
            refuse(format!("the points of a surface in the file `{}` are no grid: {why}", file.display()))
        })?;
        Ok(CurvePoints { x, y, z, z_unit, ..found })
    }
}

/// Places along both arguments, rising, and the values row by row of equal first places, of points in any order; or what is missing.
fn on_a_grid(x: &[f64], y: &[f64], z: &[f64]) -> Result<[Vec<f64>; 3], String> {
    let rising = |all: &[f64]| {
        let mut all = all.to_vec();
        all.sort_by(f64::total_cmp);
        all.dedup();
        all
    };
    let (rows, columns) = (rising(x), rising(y));
    // Points that are strewn about have as many places along each argument as there are points.
    if rows.len().saturating_mul(columns.len()) > 2 * z.len() {
        return Err(format!(
            "there are {} values for the {} places of the first column and the {} of the second; each pair needs one",
            z.len(),
            rows.len(),
            columns.len()
        ));
    }
    let mut values: Vec<Option<f64>> = vec![None; rows.len() * columns.len()];
    for ((x, y), value) in x.iter().zip(y).zip(z) {
        let place =
            |all: &[f64], at: &f64| all.binary_search_by(|other| other.total_cmp(at)).unwrap_or_default();
        let slot = place(&rows, x) * columns.len() + place(&columns, y);
        if values[slot].replace(*value).is_some() {
            return Err(format!("{x} and {y} (SI) stand there twice"));
        }
    }
    let missing = |slot: usize| {
        let (x, y) = (rows[slot / columns.len()], columns[slot % columns.len()]);
        format!(
            "there is no value at {x} and {y} (SI); each of the {} places of the first column needs one at each of the {} of the second",
            rows.len(),
            columns.len()
        )
    };
    let values: Result<Vec<f64>, String> =
        values.iter().enumerate().map(|(slot, value)| value.ok_or_else(|| missing(slot))).collect();
    Ok([rows, columns, values?])
}

impl Serialize for SurfaceValues {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Rows(rows) => rows.serialize(serializer),
            Self::Column(name) => serializer.serialize_str(name),
        }
    }
}

impl<'de> Deserialize<'de> for SurfaceValues {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct RowsVisitor;
        impl<'de> Visitor<'de> for RowsVisitor {
            type Value = SurfaceValues;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a list of rows of numbers, or a column of a file as text in quotes")
            }

            fn visit_str<E: Error>(self, text: &str) -> Result<SurfaceValues, E> {
                Ok(SurfaceValues::Column(text.to_owned()))
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<SurfaceValues, A::Error> {
                let mut rows = Vec::new();
                while let Some(row) = list.next_element()? {
                    rows.push(row);
                }
                Ok(SurfaceValues::Rows(rows))
            }
        }
        deserializer.deserialize_any(RowsVisitor)
    }
}

inline_schema!(SurfaceValues, "SurfaceValues", |_| json_schema!({
    "oneOf": [{ "type": "array", "items": { "type": "array", "items": { "type": "number" } } }, { "type": "string" }],
    "title": "rows of numbers, or a column of the file",
}));

impl OfElement for CurveTable {
    fn of_element(&self, _: &VectorElement) -> Result<Self, String> {
        Ok(self.clone())
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Their grid would have 10^10 places.
    #[test]
    fn points_that_are_strewn_about_are_no_grid_and_take_no_memory() {
        let x: Vec<f64> = (0..100_000).map(f64::from).collect();
        let why = on_a_grid(&x, &x, &x).unwrap_err();
        assert!(why.contains("100000 values for the 100000 places of the first column"), "{why}");
    }
}

//! Numbers of a sensor over its temperature, and how a column is compensated with them.

use super::ColumnChoice;
use crate::layout::ColumnCompensation;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// A number of a sensor over the temperature, as the file `temperature.json` of a calibration has it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TemperatureCurve {
    /// The number, such as `gyroscope_bias_z`.
    pub name: String,
    /// The unit of the number in SI.
    pub unit: String,
    /// The temperatures in K of the record, lowest and highest; the curve keeps its values at them beyond.
    pub range_k: [f64; 2],
    /// Polynomials one after the other, each up to the temperature of the next: one, or those between the knots of a spline.
    pub pieces: Vec<CurvePiece>,
    /// The square of the expanded uncertainty (95 %) in the same form, in the square of the unit; none if it is not known.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub expanded_square: Vec<CurvePiece>,
}

/// A polynomial of the temperature.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CurvePiece {
    /// The temperature in K from which it counts.
    pub reference_k: f64,
    /// The coefficients from the constant on.
    pub coefficients: Vec<f64>,
}

impl TemperatureCurve {
    /// The value at a temperature in K, which is held within the range.
    pub fn at(&self, temperature_k: f64) -> f64 {
        self.of(&self.pieces, temperature_k)
    }

    /// The expanded uncertainty (95 %) of the value at a temperature in K; not a number if it is not known.
    pub fn expanded_at(&self, temperature_k: f64) -> f64 {
        match self.of(&self.expanded_square, temperature_k) {
            // By rounding.
            square if square < 0.0 => 0.0,
            square => square.sqrt(),
        }
    }

    fn of(&self, pieces: &[CurvePiece], temperature_k: f64) -> f64 {
        let [low, high] = self.range_k;
        // A temperature that is not a number stays one.
        let held = if temperature_k < low {
            low
        } else if temperature_k > high {
            high
        } else {
            temperature_k
        };
        let after = pieces.partition_point(|piece| piece.reference_k <= held);
        let Some(piece) = pieces.get(after.saturating_sub(1)) else { return f64::NAN };
        piece.coefficients.iter().rev().fold(0.0, |sum, own| sum * (held - piece.reference_k) + own)
    }

    fn is_valid(&self) -> bool {
        let all = self.pieces.iter().chain(&self.expanded_square);
        let numbers = all.flat_map(|piece| piece.coefficients.iter().chain([&piece.reference_k]));
        let rises = |pair: &[CurvePiece]| pair[0].reference_k < pair[1].reference_k;
        self.range_k[0] <= self.range_k[1]
            && numbers.chain(&self.range_k).all(|number| number.is_finite())
            && !self.pieces.is_empty()
            && [&self.pieces, &self.expanded_square].iter().all(|pieces| pieces.windows(2).all(rises))
    }
}

/// What the values of a column are compensated for: (value − bias − Σ cross-axis sensitivity · other column) / scale factor, with curves at the
/// temperature that another column of the same rows has.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Compensation {
    /// The file with the curves, as `kalmems calibrate` writes it.
    #[schemars(example = &"out/calibration/temperature.json")]
    pub(super) file: PathBuf,
    /// The column with the temperature of the sensor.
    #[schemars(example = &"unit_K")]
    temperature: ColumnChoice,
    /// The name of the curve of the bias; 0 if left out. One for rising and one for falling temperature end with `_up` and `_down`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"gyroscope_bias_z")]
    bias: Option<String>,
    /// The name of the curve of the scale factor; 1 if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"gyroscope_scale_factor_z")]
    scale_factor: Option<String>,
    /// Other columns of the file, each with the name of the curve of the sensitivity to it, such as `{ gx_dps = "gyroscope_cross_axis_sensitivity_zx" }`.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    cross_axis: BTreeMap<String, String>,
}

impl Compensation {
    /// The curves from its file, which stands in this folder or below; in words why there are none.
    pub(super) fn load(&self, folder: &Path) -> Result<Box<ColumnCompensation>, String> {
        let path = folder.join(&self.file);
        let text = std::fs::read_to_string(&path).map_err(|error| {
            format!("the file of its `compensation`, `{}`, cannot be read: {error}", path.display())
        })?;
        let expected = "expected `temperature.json` of a calibration";
        let curves: Vec<TemperatureCurve> = serde_json::from_str(&text).map_err(|error| {
            format!("`{}` holds no curves of its `compensation`: {error}; {expected}", path.display())
        })?;
        let curve = |name: &String| {
            let Some(curve) = curves.iter().find(|curve| curve.name == *name) else {
                let names: Vec<&str> = curves.iter().map(|curve| curve.name.as_str()).collect();
                return Err(format!(
                    "`{}` has no curve `{name}`; it has {}",
                    path.display(),
                    names.join(", ")
                ));
            };
            let why = || format!("the curve `{name}` of `{}` is not one; {expected}", path.display());
            if curve.is_valid() { Ok(curve.clone()) } else { Err(why()) }
        };
        let cross_axis = self.cross_axis.iter().map(|(column, name)| Ok((column.clone(), curve(name)?)));
        Ok(Box::new(ColumnCompensation {
            temperature: self.temperature.declared("temperature", Some("K")),
            bias: self.bias.as_ref().map(curve).transpose()?,
            scale_factor: self.scale_factor.as_ref().map(curve).transpose()?,
            cross_axis: cross_axis.collect::<Result<_, String>>()?,
        }))
    }
}

//! Tables of the source: curves and the series of two disks, in units of their own.

use super::error::EmitError;
use super::interface::part;
use super::routine::Syntax;
use super::tape::CalledFunction;
use crate::curve::{Curve, Grid, SplinePoints};
use crate::description::CurveExtension;
use crate::device::Device;
use crate::laws::disks;
use std::collections::BTreeSet;

/// Numbers in a list, each as a language writes it.
pub(super) fn listed(
    values: &[f64],
    number: impl Fn(f64) -> Result<String, EmitError>,
) -> Result<String, EmitError> {
    Ok(values.iter().map(|value| number(*value)).collect::<Result<Vec<_>, _>>()?.join(", "))
}

/// The functions of the texts by their names, and whether they are needed for those that are called.
fn needed(called: &BTreeSet<CalledFunction>) -> Vec<(&'static str, bool)> {
    let any = |of: &[CalledFunction]| of.iter().any(|one| called.contains(one));
    let atanhc = called.iter().any(|c| matches!(c, CalledFunction::Atanhc(_)));
    let disks_used = called.iter().any(|c| matches!(c, CalledFunction::Disks(_)));
    let atanh = atanhc || any(&[CalledFunction::Atanh]);
    let ln_cosh = any(&[CalledFunction::LnCosh]);
    let tanh = any(&[CalledFunction::Tanh]);
    let arcs = any(&[CalledFunction::Asin, CalledFunction::Acos]);
    vec![
        ("EXP", disks_used || any(&[CalledFunction::Exp])),
        ("FALLING_EXP", tanh || ln_cosh || any(&[CalledFunction::FallingExp])),
        ("LN", atanh || ln_cosh || disks_used || any(&[CalledFunction::Ln])),
        ("SIN_COS", any(&[CalledFunction::Sin, CalledFunction::Cos])),
        ("SIN", any(&[CalledFunction::Sin])),
        ("COS", any(&[CalledFunction::Cos])),
        ("TANH", tanh),
        ("ATANH", atanh),
        ("SQRT", arcs || any(&[CalledFunction::Sqrt])),
        ("ATAN", arcs || any(&[CalledFunction::Atan])),
        ("ASIN", any(&[CalledFunction::Asin])),
        ("ACOS", any(&[CalledFunction::Acos])),
        ("FLOOR", any(&[CalledFunction::Floor])),
        ("LN_COSH", ln_cosh),
        ("ATANHC", atanhc),
    ]
}

/// What a language writes for functions that it does not have, and for tables.
pub(super) trait FunctionSource: Syntax {
    /// The functions, each behind its marker.
    const TEXT: &'static str;
    /// What stands before and behind the name of a function in its marker.
    const MARKER: [&'static str; 2];
    /// The function of two disks, with names in braces where its numbers are.
    const DISKS: &'static str;
    /// What surfaces have in common.
    const AXIS: &'static str;

    /// A curve.
    fn curve(curve: usize, table: &EmittedCurve) -> Result<String, EmitError>;

    /// A surface.
    fn grid(curve: usize, table: &EmittedGrid) -> Result<String, EmitError>;

    /// What is called and not there: functions, and tables with theirs.
    fn functions(&self, device: &Device, called: &BTreeSet<CalledFunction>) -> Result<String, EmitError> {
        let [before, behind] = Self::MARKER;
        let mut text = String::new();
        let place = |one: &CalledFunction| match one {
            CalledFunction::Curve(place, _) => Some(*place),
            _ => None,
        };
        let curves: BTreeSet<usize> = called.iter().filter_map(place).collect();
        let curves: Vec<(usize, &Curve)> =
            curves.into_iter().filter_map(|place| Some((place, device.curves.get(place)?))).collect();
        for (name, is_needed) in needed(called) {
            if is_needed {
                text.push('\n');
                text += part(Self::TEXT, &format!("{before}{name}{behind}\n"), before);
            }
        }
        if called.iter().any(|one| matches!(one, CalledFunction::Disks(_))) {
            text += &self.disks()?;
        }
        if curves.iter().any(|(_, curve)| matches!(curve.points(), SplinePoints::Grid(_))) {
            text += Self::AXIS;
        }
        for (place, curve) in curves {
            text += &match curve.points() {
                SplinePoints::Line { .. } => Self::curve(place, &EmittedCurve::of(curve))?,
                SplinePoints::Grid(grid) => Self::grid(place, &EmittedGrid::of(curve, grid))?,
            };
        }
        Ok(text)
    }

    /// The function of two disks.
    fn disks(&self) -> Result<String, EmitError> {
        let (series, size, factor, offset) = disks_series();
        let float = |value| self.literal(value, false);
        let numbers = [
            ("{count}", series.len().to_string()),
            ("{table}", coefficient_rows(series, float)?),
            ("{size}", float(size)?),
            ("{factor}", float(factor)?),
            ("{offset}", float(offset)?),
        ];
        Ok(numbers.iter().fold(Self::DISKS.to_owned(), |text, (name, number)| text.replace(name, number)))
    }
}

/// Coefficients of 32 bits in rows of six.
pub(super) fn coefficient_rows(
    values: &[f64],
    float: impl Fn(f64) -> Result<String, EmitError>,
) -> Result<String, EmitError> {
    // A coefficient that 32 bits do not hold is nothing beside the others.
    let small = |value: f64| if value.abs() < f64::from(f32::MIN_POSITIVE) { 0.0 } else { value };
    let texts = values.iter().map(|value| float(small(*value))).collect::<Result<Vec<_>, _>>()?;
    Ok(texts.chunks(6).map(|row| row.join(", ")).collect::<Vec<_>>().join(",\n    "))
}

/// A curve over its own span from −1 to 1, in its largest value.
pub(super) struct EmittedCurve {
    pub(super) places: Vec<f64>,
    /// The coefficients of the powers 0 to 3 of the distance from the piece's first place.
    pub(super) pieces: Vec<[f64; 4]>,
    pub(super) outside: CurveExtension,
}

impl EmittedCurve {
    pub(super) fn of(curve: &Curve) -> Self {
        let ([[middle, half], _], size) = curve.extent();
        let places = curve.places().concat();
        Self {
            places: places.iter().map(|x| (x - middle) / half).collect(),
            pieces: (curve.points().pieces())
                .iter()
                .map(|c| [c[0], c[1] * half, c[2] * half * half, c[3] * half.powi(3)].map(|c| c / size))
                .collect(),
            outside: curve.outside(),
        }
    }
}

/// A surface over its own spans from −1 to 1, in its largest value.
pub(super) struct EmittedGrid {
    pub(super) places: [Vec<f64>; 2],
    /// Of each point the value and the derivatives that a spline needs, row by row of equal first places.
    pub(super) nodes: Vec<[f64; 4]>,
    /// What is outside: 0 nothing, 1 the end, 2 the tangent.
    pub(super) outside: u8,
}

impl EmittedGrid {
    fn of(curve: &Curve, grid: &Grid) -> Self {
        let (spans, size) = curve.extent();
        let mut places = [Vec::new(), Vec::new()];
        for ((own, along), [middle, half]) in places.iter_mut().zip(curve.places()).zip(spans) {
            own.extend(along.iter().map(|place| (place - middle) / half));
        }
        let [of_x, of_y] = spans.map(|[_, half]| half * half);
        let scaled = |node: &[f64; 4]| {
            let [value, by_x, by_y, by_both] = node.map(|number| number / size);
            [value, by_x * of_x, by_y * of_y, by_both * of_x * of_y]
        };
        let outside = match curve.outside() {
            CurveExtension::Error => 0,
            CurveExtension::Clamp => 1,
            CurveExtension::Linear => 2,
        };
        Self { places, nodes: grid.nodes().iter().map(scaled).collect(), outside }
    }
}

/// The series of ln(C/(ε₀·a)): its coefficients behind the first, e to the power of the first, and factor and offset from ln κ to its
/// argument.
///
/// The first coefficient is twice as large as the rest of the series: as a factor it costs no digits of the exponent.
fn disks_series() -> (&'static [f64], f64, f64, f64) {
    use kalmems_core::Scalar;
    let [low, high] = disks::RANGE.map(Scalar::ln);
    let (factor, offset) = (2.0 / (high - low), -(high + low) / (high - low));
    let [first, rest @ ..] = disks::coefficients();
    (rest, Scalar::exp(*first), factor, offset)
}

//! Functions and tables that Rust without `std` does not have.

use super::{Rust, float};
use crate::description::CurveExtension;
use crate::emit::error::EmitError;
use crate::emit::tables::{EmittedCurve, EmittedGrid, FunctionSource, coefficient_rows};

/// The function of two disks, with names in braces where its numbers are.
const DISKS: &str = r"
/// Chebyshev's coefficients from the first order on of ln(C/(epsilon_0 a)) of two disks, over ln(d/a).
static DISKS: [f32; {count}] = [
    {table}
];

/// C/(epsilon_0 a) of two disks over d/a, and its first two derivatives.
fn disks(share: f32, order: u32) -> f32 {
    let x = {factor} * ln(share) + {offset};
    if !(-1.0..=1.0).contains(&x) {
        return f32::NAN;
    }
    let (mut b1, mut b2, mut d1, mut d2, mut e1, mut e2) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    for c in DISKS.iter().rev() {
        let b = 2.0 * x * b1 - b2 + c;
        let d = 2.0 * (b1 + x * d1) - d2;
        let e = 2.0 * (2.0 * d1 + x * e1) - e2;
        (b2, b1, d2, d1, e2, e1) = (b1, b, d1, d, e1, e);
    }
    let value = {size} * exp(x * b1 - b2);
    let slope = b1 + x * d1 - d2;
    let bend = 2.0 * d1 + x * e1 - e2;
    let by_share = {factor} / share;
    match order {
        0 => value,
        1 => value * slope * by_share,
        _ => value * by_share * by_share * (slope * slope + bend - slope / {factor}),
    }
}
";

/// What surfaces have in common.
const AXIS: &str = r"
/// The piece of a spline that holds x, and the weights of the values and the second derivatives at its ends in the spline or in a derivative of
/// it; outside of the places there is nothing (0), the end (1) or the tangent (2).
fn axis(at: &[f32], outside: u32, x: f32, order: u32) -> (usize, [f32; 4]) {
    let (mut low, mut high) = (0, at.len() - 1);
    let end = if x < at[0] { at[0] } else if x > at[high] { at[high] } else { x };
    let beyond = x - end;
    while high - low > 1 {
        let middle = (low + high) / 2;
        if end < at[middle] {
            high = middle;
        } else {
            low = middle;
        }
    }
    let h = at[high] - at[low];
    let (a, b) = ((at[high] - end) / h, (end - at[low]) / h);
    let value = [a, b, (a * a - 1.0) * a * h * h / 6.0, (b * b - 1.0) * b * h * h / 6.0];
    let slope = [-1.0 / h, 1.0 / h, -(3.0 * a * a - 1.0) * h / 6.0, (3.0 * b * b - 1.0) * h / 6.0];
    let mut weights = match order {
        0 => value,
        1 => slope,
        _ => [0.0, 0.0, a, b],
    };
    if beyond != 0.0 {
        for (weight, slope) in weights.iter_mut().zip(slope) {
            *weight = match (outside, order) {
                (0, _) => f32::NAN,
                (1, 0) => *weight,
                (2, 0) => *weight + beyond * slope,
                (2, 1) => slope,
                _ => 0.0,
            };
        }
    }
    (low, weights)
}
";

impl FunctionSource for Rust {
    const TEXT: &'static str = include_str!("functions.rs");
    const MARKER: [&'static str; 2] = ["// --- ", ""];
    const DISKS: &'static str = DISKS;
    const AXIS: &'static str = AXIS;

    fn curve(curve: usize, table: &EmittedCurve) -> Result<String, EmitError> {
        let count = table.places.len();
        let rows: Result<Vec<String>, EmitError> =
            table.pieces.iter().map(|piece| Ok(format!("[{}]", coefficient_rows(piece, float)?))).collect();
        let outside = match table.outside {
            CurveExtension::Error => {
                "    if !(x >= CURVE_AT[0] && x <= CURVE_AT[LAST]) {\n        return f32::NAN;\n    }\n    let beyond = 0.0;\n"
            }
            CurveExtension::Clamp => {
                "    let end = x.clamp(CURVE_AT[0], CURVE_AT[LAST]);\n    if x != end && order > 0 {\n        \
             return if x == x { 0.0 } else { x };\n    }\n    let (x, beyond) = (end, 0.0);\n"
            }
            CurveExtension::Linear => {
                "    let end = x.clamp(CURVE_AT[0], CURVE_AT[LAST]);\n    let beyond = x - end;\n    \
             if beyond != 0.0 && order > 1 {\n        return 0.0 * beyond;\n    }\n    let x = end;\n"
            }
        };
        let text = format!(
            r"
/// The places of a curve over its own span, and the coefficients of its pieces in its largest value.
static CURVE_AT: [f32; {count}] = [
    {places}
];
static CURVE: [[f32; 4]; {pieces}] = [
    {coefficients}
];
/// A curve and its first two derivatives.
fn curve{curve}(x: f32, order: u32) -> f32 {{
{outside}    let (mut low, mut high) = (0, LAST);
    while high - low > 1 {{
        let middle = (low + high) / 2;
        if x < CURVE_AT[middle] {{
            high = middle;
        }} else {{
            low = middle;
        }}
    }}
    let c = CURVE[low];
    let u = x - CURVE_AT[low];
    let slope = (3.0 * c[3] * u + 2.0 * c[2]) * u + c[1];
    match order {{
        0 => ((c[3] * u + c[2]) * u + c[1]) * u + c[0] + beyond * slope,
        1 => slope,
        _ => 6.0 * c[3] * u + 2.0 * c[2],
    }}
}}
",
            places = coefficient_rows(&table.places, float)?,
            pieces = count - 1,
            coefficients = rows?.join(",\n    "),
        );
        Ok(text
            .replace("CURVE_AT", &format!("CURVE{curve}_AT"))
            .replace("CURVE:", &format!("CURVE{curve}:"))
            .replace("CURVE[", &format!("CURVE{curve}["))
            .replace("LAST", &(count - 1).to_string()))
    }

    fn grid(curve: usize, table: &EmittedGrid) -> Result<String, EmitError> {
        let [x, y] = &table.places;
        let nodes = table.nodes.iter().map(|node| Ok(format!("[{}]", coefficient_rows(node, float)?)));
        Ok(format!(
            r"
/// The places of a surface over its own spans, and at each point the value and the derivatives that a spline needs, in its largest value.
static CURVE{curve}_X: [f32; {rows}] = [
    {x}
];
static CURVE{curve}_Y: [f32; {columns}] = [
    {y}
];
static CURVE{curve}: [[f32; 4]; {count}] = [
    {nodes}
];
/// The surface, or a derivative of it of these orders by its arguments.
fn curve{curve}(x: f32, y: f32, along_x: u32, along_y: u32) -> f32 {{
    let (row, u) = axis(&CURVE{curve}_X, {outside}, x, along_x);
    let (column, v) = axis(&CURVE{curve}_Y, {outside}, y, along_y);
    let mut sum = 0.0;
    for (p, weight) in u.iter().enumerate() {{
        let (kind, at) = (p / 2, (row + p % 2) * {columns} + column);
        let (near, far) = (CURVE{curve}[at], CURVE{curve}[at + 1]);
        sum += weight * (v[0] * near[kind] + v[1] * far[kind] + v[2] * near[kind + 2] + v[3] * far[kind + 2]);
    }}
    sum
}}
",
            rows = x.len(),
            columns = y.len(),
            count = table.nodes.len(),
            outside = table.outside,
            x = coefficient_rows(x, float)?,
            y = coefficient_rows(y, float)?,
            nodes = nodes.collect::<Result<Vec<_>, EmitError>>()?.join(",\n    "),
        ))
    }
}

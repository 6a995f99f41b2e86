//! Functions and tables that Rust without `std` does not have.

use super::{Rust, float};
use crate::description::CurveExtension;
use crate::emit::error::EmitError;
use crate::emit::tables::{EmittedCurve, FunctionSource, coefficient_rows};
use crate::emit::tape::CalledFunction;
use std::collections::BTreeSet;

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

impl FunctionSource for Rust {
    const TEXT: &'static str = include_str!("functions.rs");
    const MARKER: [&'static str; 2] = ["// --- ", ""];
    const DISKS: &'static str = DISKS;

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
}

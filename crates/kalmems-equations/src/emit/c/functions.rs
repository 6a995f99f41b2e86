//! Functions that `math.h` does not have, and tables, in C99.

use super::{C, float};
use crate::description::CurveExtension;
use crate::emit::error::EmitError;
use crate::emit::tables::{EmittedCurve, FunctionSource, coefficient_rows};
use crate::emit::tape::CalledFunction;
use std::collections::BTreeSet;

/// The function of two disks, with names in braces where its numbers are.
const DISKS: &str = r"
/* Chebyshev's coefficients from the first order on of ln(C/(epsilon_0 a)) of two disks, over ln(d/a). */
static const float DISKS[{count}] = {
    {table}
};

/* C/(epsilon_0 a) of two disks over d/a, and its first two derivatives. */
static float disks(float share, unsigned order)
{
    const float x = {factor} * logf(share) + {offset};
    float b1 = 0.0F, b2 = 0.0F, d1 = 0.0F, d2 = 0.0F, e1 = 0.0F, e2 = 0.0F;
    float value, slope, bend, by_share;
    int k;
    if (!(fabsf(x) <= 1.0F)) {
        return NAN;
    }
    for (k = {count} - 1; k >= 0; k--) {
        const float b = 2.0F * x * b1 - b2 + DISKS[k];
        const float d = 2.0F * (b1 + x * d1) - d2;
        const float e = 2.0F * (2.0F * d1 + x * e1) - e2;
        b2 = b1; b1 = b; d2 = d1; d1 = d; e2 = e1; e1 = e;
    }
    value = {size} * expf(x * b1 - b2);
    slope = b1 + x * d1 - d2;
    bend = 2.0F * d1 + x * e1 - e2;
    by_share = {factor} / share;
    return order == 0U   ? value
           : order == 1U ? value * slope * by_share
                         : value * by_share * by_share * (slope * slope + bend - slope / {factor});
}
";

impl FunctionSource for C {
    const TEXT: &'static str = include_str!("functions.c");
    const MARKER: [&'static str; 2] = ["/* --- ", " */"];
    const DISKS: &'static str = DISKS;

    fn needed(called: &BTreeSet<CalledFunction>) -> Vec<(&'static str, bool)> {
        vec![
            ("FALLING_EXP", called.contains(&CalledFunction::FallingExp)),
            ("LN_COSH", called.contains(&CalledFunction::LnCosh)),
            ("ATANHC", called.iter().any(|c| matches!(c, CalledFunction::Atanhc(_)))),
        ]
    }

    fn curve(curve: usize, table: &EmittedCurve) -> Result<String, EmitError> {
        let count = table.places.len();
        let coefficients: Vec<f64> = table.pieces.iter().flatten().copied().collect();
        let (before, after) = match table.outside {
            CurveExtension::Error => {
                ("    if (!(x >= CURVE_AT[0] && x <= CURVE_AT[LAST])) {\n        return NAN;\n    }\n", "")
            }
            CurveExtension::Clamp => (
                "    const float end = x < CURVE_AT[0] ? CURVE_AT[0] : x > CURVE_AT[LAST] ? CURVE_AT[LAST] : x;\n    \
             if (end != x && order > 0U) {\n        return x == x ? 0.0F : NAN;\n    }\n    x = end;\n",
                "",
            ),
            CurveExtension::Linear => (
                "    const float end = x < CURVE_AT[0] ? CURVE_AT[0] : x > CURVE_AT[LAST] ? CURVE_AT[LAST] : x;\n    \
             const float beyond = x - end;\n    x = end;\n",
                "    if (beyond != 0.0F) {\n        return order == 0U   ? ((c[3] * u + c[2]) * u + c[1]) * u + c[0]\n                               \
             + beyond * ((3.0F * c[3] * u + 2.0F * c[2]) * u + c[1])\n               : order == 1U ? (3.0F * c[3] * u + 2.0F * c[2]) * u + c[1]\n                             : 0.0F;\n    }\n",
            ),
        };
        let text = format!(
            r"
/* A curve and its first two derivatives, over its own span and in its largest value. */
static const float CURVE_AT[{count}] = {{
    {places}
}};
static const float CURVE[{pieces}][4] = {{
    {coefficients}
}};
static float curve{curve}(float x, unsigned order)
{{
{before}    unsigned low = 0, high = LAST;
    const float *c;
    float u;
    while (high - low > 1U) {{
        const unsigned middle = (low + high) / 2U;
        if (x < CURVE_AT[middle]) {{
            high = middle;
        }} else {{
            low = middle;
        }}
    }}
    c = CURVE[low];
    u = x - CURVE_AT[low];
{after}    return order == 0U   ? ((c[3] * u + c[2]) * u + c[1]) * u + c[0]
           : order == 1U ? (3.0F * c[3] * u + 2.0F * c[2]) * u + c[1]
                         : 6.0F * c[3] * u + 2.0F * c[2];
}}
",
            places = coefficient_rows(&table.places, float)?,
            pieces = count - 1,
            coefficients = rows(&coefficients)?,
        );
        Ok(text
            .replace("CURVE_AT", &format!("CURVE{curve}_AT"))
            .replace("CURVE[", &format!("CURVE{curve}["))
            .replace("LAST", &format!("{}U", count - 1)))
    }
}

/// Rows of four numbers in brackets.
fn rows(values: &[f64]) -> Result<String, EmitError> {
    let rows = values.chunks(4).map(|row| Ok(format!("{{{}}}", coefficient_rows(row, float)?)));
    Ok(rows.collect::<Result<Vec<_>, EmitError>>()?.join(",\n    "))
}

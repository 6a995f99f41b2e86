//! Functions, in which a source needs no library, and tables, in C99.

use super::{C, float};
use crate::description::CurveExtension;
use crate::emit::error::EmitError;
use crate::emit::tables::{EmittedCurve, EmittedGrid, FunctionSource, coefficient_rows};

/// The function of two disks, with names in braces where its numbers are.
const DISKS: &str = r"
/* Chebyshev's coefficients from the first order on of ln(C/(epsilon_0 a)) of two disks, over ln(d/a). */
static const float DISKS[{count}] = {
    {table}
};

/* C/(epsilon_0 a) of two disks over d/a, and its first two derivatives. */
static float disks(float share, unsigned order)
{
    const float x = {factor} * ln_f32(share) + {offset};
    float b1 = 0.0F, b2 = 0.0F, d1 = 0.0F, d2 = 0.0F, e1 = 0.0F, e2 = 0.0F;
    float value, slope, bend, by_share;
    int k;
    if (!(x >= -1.0F && x <= 1.0F)) {
        return nothing();
    }
    for (k = {count} - 1; k >= 0; k--) {
        const float b = 2.0F * x * b1 - b2 + DISKS[k];
        const float d = 2.0F * (b1 + x * d1) - d2;
        const float e = 2.0F * (2.0F * d1 + x * e1) - e2;
        b2 = b1; b1 = b; d2 = d1; d1 = d; e2 = e1; e1 = e;
    }
    value = {size} * exp_f32(x * b1 - b2);
    slope = b1 + x * d1 - d2;
    bend = 2.0F * d1 + x * e1 - e2;
    by_share = {factor} / share;
    return order == 0U   ? value
           : order == 1U ? value * slope * by_share
                         : value * by_share * by_share * (slope * slope + bend - slope / {factor});
}
";

/// What surfaces have in common.
const AXIS: &str = r"
/* The piece of a spline that holds x, and the weights of the values and the second derivatives at its ends in the spline or in a derivative
   of it; outside of the places there is nothing (0), the end (1) or the tangent (2). */
static unsigned axis(const float *at, unsigned count, unsigned outside, float x, unsigned order, float *weights)
{
    const float end = x < at[0] ? at[0] : x > at[count - 1U] ? at[count - 1U] : x;
    const float beyond = x - end;
    unsigned low = 0U, high = count - 1U, k;
    float h, a, b, value[4], slope[4], bend[4];
    while (high - low > 1U) {
        const unsigned middle = (low + high) / 2U;
        if (end < at[middle]) {
            high = middle;
        } else {
            low = middle;
        }
    }
    h = at[high] - at[low];
    a = (at[high] - end) / h;
    b = (end - at[low]) / h;
    value[0] = a;
    value[1] = b;
    value[2] = (a * a - 1.0F) * a * h * h / 6.0F;
    value[3] = (b * b - 1.0F) * b * h * h / 6.0F;
    slope[0] = -1.0F / h;
    slope[1] = 1.0F / h;
    slope[2] = -(3.0F * a * a - 1.0F) * h / 6.0F;
    slope[3] = (3.0F * b * b - 1.0F) * h / 6.0F;
    bend[0] = bend[1] = 0.0F;
    bend[2] = a;
    bend[3] = b;
    for (k = 0U; k < 4U; k++) {
        const float *const own = order == 0U ? value : order == 1U ? slope : bend;
        weights[k] = own[k];
        if (beyond != 0.0F) {
            const float tangent = order == 0U ? value[k] + beyond * slope[k] : order == 1U ? slope[k] : 0.0F;
            const float stays = order == 0U ? value[k] : 0.0F;
            weights[k] = outside == 0U ? nothing() : outside == 1U ? stays : tangent;
        }
    }
    return low;
}
";

impl FunctionSource for C {
    const TEXT: &'static str = include_str!("functions.c");
    const MARKER: [&'static str; 2] = ["/* --- ", " */"];
    const DISKS: &'static str = DISKS;
    const AXIS: &'static str = AXIS;

    fn curve(curve: usize, table: &EmittedCurve) -> Result<String, EmitError> {
        let count = table.places.len();
        let coefficients: Vec<f64> = table.pieces.iter().flatten().copied().collect();
        let (before, after) = match table.outside {
            CurveExtension::Error => (
                "    if (!(x >= CURVE_AT[0] && x <= CURVE_AT[LAST])) {\n        return nothing();\n    }\n",
                "",
            ),
            CurveExtension::Clamp => (
                "    const float end = x < CURVE_AT[0] ? CURVE_AT[0] : x > CURVE_AT[LAST] ? CURVE_AT[LAST] : x;\n    \
             if (end != x && order > 0U) {\n        return x == x ? 0.0F : nothing();\n    }\n    x = end;\n",
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

    fn grid(curve: usize, table: &EmittedGrid) -> Result<String, EmitError> {
        let [x, y] = &table.places;
        let nodes: Vec<f64> = table.nodes.iter().flatten().copied().collect();
        Ok(format!(
            r"
/* A surface over its own spans and in its largest value: its places, and at each point the value and the derivatives that a spline needs. */
static const float CURVE{curve}_X[{rows}] = {{
    {x}
}};
static const float CURVE{curve}_Y[{columns}] = {{
    {y}
}};
static const float CURVE{curve}[{count}][4] = {{
    {nodes}
}};
/* The surface, or a derivative of it of these orders by its arguments. */
static float curve{curve}(float x, float y, unsigned along_x, unsigned along_y)
{{
    float u[4], v[4], sum = 0.0F;
    const unsigned row = axis(CURVE{curve}_X, {rows}U, {outside}U, x, along_x, u);
    const unsigned column = axis(CURVE{curve}_Y, {columns}U, {outside}U, y, along_y, v);
    unsigned p;
    for (p = 0U; p < 4U; p++) {{
        const unsigned kind = p / 2U, at = (row + p % 2U) * {columns}U + column;
        const float *near = CURVE{curve}[at], *far = CURVE{curve}[at + 1U];
        sum += u[p] * (v[0] * near[kind] + v[1] * far[kind] + v[2] * near[kind + 2U] + v[3] * far[kind + 2U]);
    }}
    return sum;
}}
",
            rows = x.len(),
            columns = y.len(),
            count = table.nodes.len(),
            outside = table.outside,
            x = coefficient_rows(x, float)?,
            y = coefficient_rows(y, float)?,
            nodes = rows(&nodes)?,
        ))
    }
}

/// Rows of four numbers in brackets.
fn rows(values: &[f64]) -> Result<String, EmitError> {
    let rows = values.chunks(4).map(|row| Ok(format!("{{{}}}", coefficient_rows(row, float)?)));
    Ok(rows.collect::<Result<Vec<_>, EmitError>>()?.join(",\n    "))
}

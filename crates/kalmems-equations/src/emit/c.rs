//! A filter in C99.

use super::error::EmitError;
use super::filter::Program;
use super::interface::Interface;
use super::request::{EmitGain, EmitRequest};
use super::routine::{Array, Routine, Syntax, Written};
use super::tables::{CurveTable, disks_series};
use super::tape::Called;
use crate::description::Outside;
use crate::device::Device;
use std::collections::BTreeSet;
use std::fmt::Write as _;

/// Functions that `math.h` does not have.
const FUNCTIONS: &str = include_str!("functions.c");

/// What a compiler is told: on a small processor calls and two roundings cost more than they are worth.
const MACROS: &str = "
#ifdef __FAST_MATH__
#error \"gaps and refusals are seen by what is not a number: compile without -ffast-math\"
#endif

/* a*b + c, rounded once on a processor of Arm that has an instruction for it. */
#ifdef __ARM_FEATURE_FMA
#if defined(__clang__)
#if __has_builtin(__builtin_elementwise_fma)
#define FUSED(a, b, c) __builtin_elementwise_fma((a), (b), (c))
#endif
#elif defined(__GNUC__)
#define FUSED(a, b, c) __builtin_fmaf((a), (b), (c))
#endif
#endif
#ifndef FUSED
#define FUSED(a, b, c) ((a) * (b) + (c))
#endif

/* Within a step nothing is called, so that the state stays in registers. */
#ifdef __GNUC__
#define WITHIN static inline __attribute__((always_inline))
#else
#define WITHIN static
#endif
";

/// Numbers of 32 or, where parameters are taken, of 64 bits.
struct C {
    wide: bool,
}

/// A number of 32 bits as C reads it.
pub(super) fn float(value: f64) -> Result<String, EmitError> {
    #[allow(clippy::cast_possible_truncation)] // rounding to f32 is what is wanted
    let rounded = value as f32;
    if !rounded.is_finite() || (value != 0.0 && rounded.abs() < f32::MIN_POSITIVE) {
        return Err(EmitError::Range { value });
    }
    Ok(format!("{rounded:?}F"))
}

impl Syntax for C {
    fn literal(&self, value: f64) -> Result<String, EmitError> {
        if self.wide { Ok(format!("{value:?}")) } else { float(value) }
    }

    fn declare(&self, name: &str, value: &str) -> String {
        format!("const {} {name} = {value};", if self.wide { "double" } else { "float" })
    }

    fn call(&self, called: Called, at: &str) -> String {
        let at = if self.wide { format!("(float)({at})") } else { at.to_owned() };
        let call = match called {
            Called::FallingExp => format!("falling_exp({at})"),
            Called::Exp => format!("expf({at})"),
            Called::Ln => format!("logf({at})"),
            Called::Sin => format!("sinf({at})"),
            Called::Cos => format!("cosf({at})"),
            Called::Tanh => format!("tanhf({at})"),
            Called::Atanh => format!("atanhf({at})"),
            Called::Sqrt => format!("sqrtf({at})"),
            Called::Atanhc(order) => format!("atanhc({at}, {order}U)"),
            Called::LnCosh => format!("ln_cosh({at})"),
            Called::Disks(order) => format!("disks({at}, {order}U)"),
            Called::Curve(curve, order) => format!("curve{curve}({at}, {order}U)"),
        };
        if self.wide { format!("(double){call}") } else { call }
    }

    fn choice(&self, [a, b, c, d]: [&str; 4]) -> String {
        format!("({a} < {b} ? {c} : {d})")
    }

    fn fused(&self, a: &str, b: &str, c: &str) -> Option<String> {
        (!self.wide).then(|| format!("FUSED({a}, {b}, {c})"))
    }

    fn stage(&self, output: &str, arguments: &[String]) -> String {
        format!("stage({}, {output});", arguments.join(", "))
    }
}

/// Header and source.
pub(super) fn files(
    device: &Device,
    request: &EmitRequest,
    program: &Program,
) -> Result<Vec<(String, String)>, EmitError> {
    let interface = Interface::of(device, request, program);
    let name = &request.name;
    Ok(vec![
        (format!("{name}.h"), header(device, request, program, &interface)?),
        (format!("{name}.c"), source(device, request, program, &interface)?),
    ])
}

/// The lines at the head of a file, in a comment.
pub(super) fn comment(lines: &[String]) -> String {
    let lines = lines.iter().flat_map(|line| line.lines());
    let lines: String =
        lines.map(|line| format!(" * {}\n", line.replace("*/", "* /").replace("/*", "/ *"))).collect();
    format!("/*\n{lines} */\n")
}

fn header(
    device: &Device,
    request: &EmitRequest,
    program: &Program,
    interface: &Interface,
) -> Result<String, EmitError> {
    let (name, upper) = (&request.name, request.name.to_uppercase());
    let size = request.size();
    let mut text = comment(&interface.heading);
    let _ = write!(
        text,
        "#ifndef {upper}_H\n#define {upper}_H\n\n#ifdef __cplusplus\nextern \"C\" {{\n#endif\n\n\
         /* How many states there are:\n{} */\n#define {upper}_STATES {size}\n\n\
         /* The sampling interval in s. */\n#define {upper}_INTERVAL_S {}\n\n",
        interface.states(" * "),
        float(request.interval_s)?
    );
    let _ = write!(
        text,
        "/* What is estimated, each state in its unit. */\ntypedef struct {{\n    float mean[{size}];\n"
    );
    if request.gain == EmitGain::Covariance {
        let entries = size * (size + 1) / 2;
        let _ = writeln!(text, "    float covariance[{entries}]; /* the lower triangle, row by row */");
    }
    let _ = write!(text, "}} {name}_state_t;\n\n");
    if program.configure.is_some() {
        let _ = writeln!(
            text,
            "/* Parameters that may change while the program runs, in SI. */\ntypedef struct {{"
        );
        for (field, unit, _) in interface.parameters(device, request, program) {
            let _ = writeln!(text, "    double {field}; /* {} */", unit.replace("*/", "* /"));
        }
        let _ = write!(text, "}} {name}_parameters_t;\n\n");
    }
    let _ = write!(text, "typedef struct {{\n    {name}_state_t state;\n");
    if let Some(configure) = &program.configure {
        let count = configure.outputs.len().max(1);
        let _ = writeln!(text, "    float constants[{count}]; /* what follows from the parameters */");
    }
    let _ = write!(text, "}} {name}_t;\n\n");
    if program.configure.is_some() {
        let _ = write!(
            text,
            "/* The parameters of the device. */\nvoid {name}_default_parameters({name}_parameters_t *parameters);\n\n\
             /* Takes parameters. 1 where they are taken; 0 where a number that follows is not finite. */\n\
             int {name}_configure({name}_t *filter, const {name}_parameters_t *parameters);\n\n"
        );
    }
    let _ = write!(
        text,
        "/* Before the first sample{}. */\nvoid {name}_start({name}_t *filter);\n\n",
        if program.configure.is_some() { ", with the parameters of the device" } else { "" }
    );
    let _ = write!(
        text,
        "/*\n * One interval on. 1 where it was taken; 0 where the result would not be finite, and nothing has changed.\n{} */\n\
         int {name}_predict({});\n\n",
        interface.inputs(" * "),
        interface.arguments(name, &interface.predict, &[])
    );
    for (place, update) in program.updates.iter().enumerate() {
        let is_event = place >= request.measures.len();
        let what = if is_event {
            "Corrects where the event happened: its expression was zero.".to_owned()
        } else {
            format!("Corrects by a measurement in {}.", interface.unit_of(place))
        };
        let measured = if is_event { vec![] } else { vec![program.names.measured(place)] };
        let _ = write!(
            text,
            "/* {what} 1 where it was taken; 0 where it is refused, and nothing has changed. */\n\
             int {name}_update_{}({});\n\n",
            program.names.measure(place),
            interface.arguments(name, &Interface::inputs_of(device, program, update), &measured)
        );
    }
    let _ = write!(
        text,
        "/*\n * The prediction and all corrections of one sample. 1 where all were taken. 0 where one is refused and left out;\n \
         * a sample that is not a number is a gap, and refused behind the prediction.\n */\nint {name}_step({});\n\n\
         /* The mean of a state in SI. */\nfloat {name}_value(const {name}_t *filter, unsigned state);\n\n",
        interface.arguments(name, &interface.step, &interface.measured)
    );
    if request.gain == EmitGain::Covariance {
        let _ = write!(
            text,
            "/* The variance of a state in SI. */\nfloat {name}_variance(const {name}_t *filter, unsigned state);\n\n"
        );
    }
    text += "#ifdef __cplusplus\n}\n#endif\n\n#endif\n";
    Ok(text)
}

fn source(
    device: &Device,
    request: &EmitRequest,
    program: &Program,
    interface: &Interface,
) -> Result<String, EmitError> {
    let name = &request.name;
    let routines = program.routines();
    let called: BTreeSet<Called> = routines.iter().flat_map(|routine| routine.called()).collect();
    let functions = functions(device, &called)?;
    let mut text = comment(&interface.heading);
    let _ = write!(text, "#include \"{name}.h\"\n\n");
    if functions.contains("uint32_t") {
        text += "#include <stdint.h>\n";
    }
    if called.iter().any(|called| *called != Called::FallingExp) {
        text += "#include <math.h>\n";
    }
    text += MACROS;
    text += &functions;
    text += &scales(request, program)?;
    if let Some(stage) = &program.stage {
        let written = stage.written(&C { wide: false })?;
        let parameters: Vec<String> = stage.parameters.iter().map(|p| format!("float {p}")).collect();
        let _ = write!(
            text,
            "\n/* What one stage needs: rates per sample and their derivatives. */\nstatic void stage({}, float to[{}])\n{{\n",
            parameters.join(", "),
            stage.outputs.len()
        );
        body(&mut text, &written, "to", "to", "to");
        text += "}\n";
    }
    let has_constants = |routine: &Routine| routine.reads_constants();
    let mut core =
        |routine: &Routine, of: &str, inputs: &[String], measured: &[String]| -> Result<(), EmitError> {
            let written = routine.written(&C { wide: false })?;
            let constants = if has_constants(routine) { ", const float *constants" } else { "" };
            let more: String =
                inputs.iter().chain(measured).map(|input| format!(", float {input}")).collect();
            let kind = if written.variance.is_some() { "int" } else { "void" };
            let _ = write!(text, "\nWITHIN {kind} {of}({name}_state_t *state{constants}{more})\n{{\n");
            for (local, array, place) in interface.loads(routine, program) {
                let _ = writeln!(
                    text,
                    "    const float {local} = {array}[{place}];",
                    array = match array {
                        Array::Mean => "state->mean",
                        Array::Covariance => "state->covariance",
                        Array::Constants | Array::Stage => "constants",
                    }
                );
            }
            if let Some(measured) = measured.first() {
                let _ = writeln!(text, "    const float seen = {measured};");
            }
            if let Some(stage) = &program.stage {
                for call in &routine.calls {
                    let _ = writeln!(text, "    float {}[{}];", call.output, stage.outputs.len());
                }
            }
            body(&mut text, &written, "state->mean", "state->covariance", "constants");
            if let Some(variance) = &written.variance {
                let _ = writeln!(text, "    return {variance} > 0.0F;");
            }
            text += "}\n";
            Ok(())
        };
    core(&program.predict, "predict", &interface.predict, &[])?;
    for (place, update) in program.updates.iter().enumerate() {
        let measured =
            if place < request.measures.len() { vec![program.names.measured(place)] } else { vec![] };
        let inputs = Interface::inputs_of(device, program, update);
        core(update, &format!("update_{}", program.names.measure(place)), &inputs, &measured)?;
    }
    finish(&mut text, device, request, program, interface)?;
    Ok(text)
}

/// The statements of a routine and where their results go.
fn body(text: &mut String, written: &Written, mean: &str, covariance: &str, other: &str) {
    for statement in &written.statements {
        let _ = writeln!(text, "    {statement}");
    }
    for (array, place, value) in &written.outputs {
        let array = match array {
            Array::Mean => mean,
            Array::Covariance => covariance,
            Array::Constants | Array::Stage => other,
        };
        let _ = writeln!(text, "    {array}[{place}] = {value};");
    }
}

/// Units and origins as tables.
fn scales(request: &EmitRequest, program: &Program) -> Result<String, EmitError> {
    let list = |values: &[f64]| -> Result<String, EmitError> {
        Ok(values.iter().map(|value| float(*value)).collect::<Result<Vec<_>, _>>()?.join(", "))
    };
    let size = request.size();
    Ok(format!(
        "\n/* The unit of each state and what it is counted from, in SI. */\nstatic const float UNIT[{size}] = {{{}}};\n\
         static const float ORIGIN[{size}] = {{{}}};\n",
        list(&program.units.scale)?,
        list(&program.units.origins)?
    ))
}

/// What is around the routines.
fn finish(
    text: &mut String,
    device: &Device,
    request: &EmitRequest,
    program: &Program,
    interface: &Interface,
) -> Result<(), EmitError> {
    let name = &request.name;
    let size = request.size();
    let (mean, covariance) = &program.start;
    let arrays: Vec<String> = (0..size)
        .map(|k| format!("state->mean[{k}]"))
        .chain((0..covariance.len()).map(|k| format!("state->covariance[{k}]")))
        .collect();
    let _ = write!(
        text,
        "\n/* Takes over a state where all its numbers are finite. */\nWITHIN int take({name}_t *filter, const {name}_state_t *state)\n{{\n    \
         const float sum = {};\n    if (!(sum - sum == 0.0F)) {{\n        return 0;\n    }}\n    filter->state = *state;\n    return 1;\n}}\n",
        arrays.join("\n                      + ")
    );
    if let Some(configure) = &program.configure {
        let written = configure.written(&C { wide: true })?;
        let _ = write!(text, "\nvoid {name}_default_parameters({name}_parameters_t *parameters)\n{{\n");
        for (field, _, value) in interface.parameters(device, request, program) {
            let _ = writeln!(text, "    parameters->{field} = {value:?};");
        }
        let _ = write!(
            text,
            "}}\n\nint {name}_configure({name}_t *filter, const {name}_parameters_t *parameters)\n{{\n"
        );
        let count = configure.outputs.len();
        let names = configure.names();
        for (field, _, _) in interface.parameters(device, request, program) {
            if names.contains(&field) {
                let _ = writeln!(text, "    const double {field} = parameters->{field};");
            }
        }
        if names.is_empty() {
            text.push_str("    (void)parameters;\n");
        }
        let _ = writeln!(text, "    float constants[{}], sum = 0.0F;\n    unsigned k;", count.max(1));
        for statement in &written.statements {
            let _ = writeln!(text, "    {statement}");
        }
        for (_, place, value) in &written.outputs {
            let _ = writeln!(text, "    constants[{place}] = (float)({value});");
        }
        let _ = write!(
            text,
            "    for (k = 0; k < {count}U; k++) {{\n        sum += constants[k];\n    }}\n    if (!(sum - sum == 0.0F)) {{\n        return 0;\n    }}\n    \
             for (k = 0; k < {count}U; k++) {{\n        filter->constants[k] = constants[k];\n    }}\n    return 1;\n}}\n"
        );
    }
    let _ = write!(text, "\nvoid {name}_start({name}_t *filter)\n{{\n");
    if program.configure.is_some() {
        let _ = writeln!(text, "    {name}_parameters_t parameters;");
    }
    for (array, values) in [("mean", mean), ("covariance", covariance)] {
        for (k, value) in values.iter().enumerate() {
            let _ = writeln!(text, "    filter->state.{array}[{k}] = {};", float(*value)?);
        }
    }
    if program.configure.is_some() {
        let _ = write!(
            text,
            "    {name}_default_parameters(&parameters);\n    (void){name}_configure(filter, &parameters);\n"
        );
    }
    text.push_str("}\n");
    steps(text, device, request, program, interface);
    let _ = write!(
        text,
        "\nfloat {name}_value(const {name}_t *filter, unsigned state)\n{{\n    \
         return state < {size}U ? ORIGIN[state] + UNIT[state] * filter->state.mean[state] : 0.0F;\n}}\n"
    );
    if !covariance.is_empty() {
        let _ = write!(
            text,
            "\nfloat {name}_variance(const {name}_t *filter, unsigned state)\n{{\n    return state < {size}U\n               \
             ? UNIT[state] * UNIT[state] * filter->state.covariance[state * (state + 3U) / 2U]\n               : 0.0F;\n}}\n"
        );
    }
    Ok(())
}

/// The functions that predict and correct, each whole or not at all.
fn steps(
    text: &mut String,
    device: &Device,
    request: &EmitRequest,
    program: &Program,
    interface: &Interface,
) {
    let name = &request.name;
    let call = |routine: &Routine, of: &str, arguments: &[String]| {
        let constants = if routine.reads_constants() { ", filter->constants" } else { "" };
        let arguments: String = arguments.iter().map(|argument| format!(", {argument}")).collect();
        format!("{of}(&next{constants}{arguments})")
    };
    let predict = call(&program.predict, "predict", &interface.predict);
    let _ = write!(
        text,
        "\nint {name}_predict({})\n{{\n    {name}_state_t next = filter->state;\n    {predict};\n    return take(filter, &next);\n}}\n",
        interface.arguments(name, &interface.predict, &[])
    );
    let (mut calls, mut apart) = (Vec::new(), Vec::new());
    for (place, update) in program.updates.iter().enumerate() {
        let inputs = Interface::inputs_of(device, program, update);
        let is_event = place >= request.measures.len();
        let measured = if is_event { vec![] } else { vec![program.names.measured(place)] };
        let of = format!("update_{}", program.names.measure(place));
        let arguments: Vec<String> = inputs.iter().chain(&measured).cloned().collect();
        let one = call(update, &of, &arguments);
        let taken = if update.variance.is_some() {
            format!("    return {one} && take(filter, &next);\n")
        } else {
            format!("    {one};\n    return take(filter, &next);\n")
        };
        let _ = write!(
            text,
            "\nint {name}_{of}({})\n{{\n    {name}_state_t next = filter->state;\n{taken}}}\n",
            interface.arguments(name, &inputs, &measured)
        );
        if !is_event {
            calls.push((one, update.variance.is_some()));
            let all: Vec<String> = ["filter".to_owned()].into_iter().chain(arguments).collect();
            apart.push(format!("{name}_{of}({})", all.join(", ")));
        }
    }
    let _ = write!(
        text,
        "\nint {name}_step({})\n{{\n    {name}_state_t next = filter->state;\n    int taken = 1;\n    {predict};\n",
        interface.arguments(name, &interface.step, &interface.measured)
    );
    for (one, says) in calls {
        let _ = writeln!(text, "    {}{one};", if says { "taken &= " } else { "" });
    }
    let arguments: Vec<String> =
        ["filter".to_owned()].into_iter().chain(interface.predict.iter().cloned()).collect();
    let _ = write!(
        text,
        "    if (taken && take(filter, &next)) {{\n        return 1;\n    }}\n    /* One is refused: each for itself. */\n    \
         taken = {name}_predict({});\n",
        arguments.join(", ")
    );
    text.push_str("    if (!taken) {\n        return 0;\n    }\n");
    for one in apart {
        let _ = writeln!(text, "    taken &= {one};");
    }
    text.push_str("    return taken;\n}\n");
}

/// The functions that are called and that `math.h` does not have.
fn functions(device: &Device, called: &BTreeSet<Called>) -> Result<String, EmitError> {
    let mut text = String::new();
    for (marker, is_used) in [
        ("FALLING_EXP", called.contains(&Called::FallingExp)),
        ("LN_COSH", called.contains(&Called::LnCosh)),
        ("ATANHC", called.iter().any(|c| matches!(c, Called::Atanhc(_)))),
    ] {
        if is_used {
            text.push('\n');
            text += super::interface::part(FUNCTIONS, &format!("/* --- {marker} */\n"), "/* --- ");
        }
    }
    if called.iter().any(|c| matches!(c, Called::Disks(_))) {
        text += &disks()?;
    }
    let curves: BTreeSet<usize> = called
        .iter()
        .filter_map(|c| if let Called::Curve(curve, _) = c { Some(*curve) } else { None })
        .collect();
    for curve in curves {
        if let Some(table) = device.curves.get(curve) {
            text += &curve_function(curve, &CurveTable::of(table))?;
        }
    }
    Ok(text)
}

fn numbers(values: &[f64]) -> Result<String, EmitError> {
    // A coefficient that 32 bits do not hold is nothing beside the others.
    let small = |value: f64| if value.abs() < f64::from(f32::MIN_POSITIVE) { 0.0 } else { value };
    let texts = values.iter().map(|value| float(small(*value))).collect::<Result<Vec<_>, _>>()?;
    Ok(texts.chunks(6).map(|row| row.join(", ")).collect::<Vec<_>>().join(",\n    "))
}

fn disks() -> Result<String, EmitError> {
    let (coefficients, factor, offset) = disks_series();
    Ok(format!(
        r"
/* Chebyshev's coefficients of ln(C/(epsilon_0 a)) of two disks, over ln(d/a). */
static const float DISKS[{count}] = {{
    {table}
}};

/* C/(epsilon_0 a) of two disks over d/a, and its first two derivatives. */
static float disks(float share, unsigned order)
{{
    const float x = {factor} * logf(share) + {offset};
    float b1 = 0.0F, b2 = 0.0F, d1 = 0.0F, d2 = 0.0F, e1 = 0.0F, e2 = 0.0F;
    float value, slope, bend, by_share;
    int k;
    if (!(fabsf(x) <= 1.0F)) {{
        return NAN;
    }}
    for (k = {count} - 1; k > 0; k--) {{
        const float b = 2.0F * x * b1 - b2 + DISKS[k];
        const float d = 2.0F * (b1 + x * d1) - d2;
        const float e = 2.0F * (2.0F * d1 + x * e1) - e2;
        b2 = b1; b1 = b; d2 = d1; d1 = d; e2 = e1; e1 = e;
    }}
    value = expf(x * b1 - b2 + DISKS[0]);
    slope = b1 + x * d1 - d2;
    bend = 2.0F * d1 + x * e1 - e2;
    by_share = {factor} / share;
    return order == 0U   ? value
           : order == 1U ? value * slope * by_share
                         : value * by_share * by_share * (slope * slope + bend - slope / {factor});
}}
",
        count = coefficients.len(),
        table = numbers(coefficients)?,
        factor = float(factor)?,
        offset = float(offset)?
    ))
}

fn curve_function(curve: usize, table: &CurveTable) -> Result<String, EmitError> {
    let count = table.places.len();
    let coefficients: Vec<f64> = table.pieces.iter().flatten().copied().collect();
    let (before, after) = match table.outside {
        Outside::Error => {
            ("    if (!(x >= CURVE_AT[0] && x <= CURVE_AT[LAST])) {\n        return NAN;\n    }\n", "")
        }
        Outside::Clamp => (
            "    const float end = x < CURVE_AT[0] ? CURVE_AT[0] : x > CURVE_AT[LAST] ? CURVE_AT[LAST] : x;\n    \
             if (end != x && order > 0U) {\n        return x == x ? 0.0F : NAN;\n    }\n    x = end;\n",
            "",
        ),
        Outside::Linear => (
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
        places = numbers(&table.places)?,
        pieces = count - 1,
        coefficients = rows(&coefficients)?,
    );
    Ok(text
        .replace("CURVE_AT", &format!("CURVE{curve}_AT"))
        .replace("CURVE[", &format!("CURVE{curve}["))
        .replace("LAST", &format!("{}U", count - 1)))
}

/// Rows of four numbers in brackets.
fn rows(values: &[f64]) -> Result<String, EmitError> {
    let rows = values.chunks(4).map(|row| Ok(format!("{{{}}}", numbers(row)?)));
    Ok(rows.collect::<Result<Vec<_>, EmitError>>()?.join(",\n    "))
}

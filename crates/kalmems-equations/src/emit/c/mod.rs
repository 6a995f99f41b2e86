//! A filter in C99.

mod accessors;
mod functions;
mod header;
mod loss;
mod parameters;
mod steps;

use super::error::EmitError;
use super::explanation;
use super::filter::FilterProgram;
use super::interface::{Interface, UpdateFunction, further};
use super::request::EmitRequest;
use super::routine::{ArrayNames, Routine, Syntax};
use super::tables::{FunctionSource as _, listed};
use super::tape::CalledFunction;
use crate::device::Device;
use header::header;
use std::collections::BTreeSet;
use std::fmt::Write as _;
use steps::finish;

/// What a compiler is told: on a small processor calls and two roundings cost more than they are worth.
const MACROS: &str = "
#if defined(__FAST_MATH__) || defined(__ASSOCIATIVE_MATH__) || (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__ > 0)
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

/* What is not a number. */
WITHIN float nothing(void)
{
    union { uint32_t bits; float value; } none;
    none.bits = 0x7FC00000U;
    return none.value;
}
";

/// The arrays of a filter.
const ARRAYS: ArrayNames =
    ArrayNames { mean: "state->mean", covariance: "state->covariance", other: "constants" };

/// Numbers of 32 or 64 bits.
struct C;

/// The type of a number.
fn kind(wide: bool) -> &'static str {
    if wide { "double" } else { "float" }
}

/// A number of this width as C reads it.
fn number(value: f64, wide: bool) -> Result<String, EmitError> {
    if wide { Ok(format!("{value:?}")) } else { float(value) }
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

/// What a function is called: apart from those of `math.h`, none of which is used.
fn name_of(called: CalledFunction) -> String {
    match called {
        CalledFunction::Exp
        | CalledFunction::Ln
        | CalledFunction::Sin
        | CalledFunction::Cos
        | CalledFunction::Tanh
        | CalledFunction::Atanh
        | CalledFunction::Atan
        | CalledFunction::Asin
        | CalledFunction::Acos
        | CalledFunction::Floor
        | CalledFunction::Sqrt => format!("{}_f32", called.name()),
        _ => called.name().into_owned(),
    }
}

impl Syntax for C {
    fn literal(&self, value: f64, wide: bool) -> Result<String, EmitError> {
        number(value, wide)
    }

    fn declare(&self, name: &str, value: &str, wide: bool) -> String {
        format!("const {} {name} = {value};", kind(wide))
    }

    fn call(&self, called: CalledFunction, at: &[String], wide: bool) -> String {
        let narrow = |at: &String| if wide { format!("(float)({at})") } else { at.clone() };
        let mut arguments: Vec<String> = at.iter().map(narrow).collect();
        let orders = called.order().into_iter().flatten().take(at.len());
        arguments.extend(orders.map(|order| format!("{order}U")));
        let call = format!("{}({})", name_of(called), arguments.join(", "));
        if wide { format!("(double){call}") } else { call }
    }

    fn choice(&self, [a, b, c, d]: [&str; 4]) -> String {
        format!("({a} < {b} ? {c} : {d})")
    }

    fn fused(&self, a: &str, b: &str, c: &str) -> Option<String> {
        Some(format!("FUSED({a}, {b}, {c})"))
    }

    fn converted(&self, _: &str, bracketed: &str, wide: bool) -> String {
        format!("({}){bracketed}", kind(wide))
    }

    fn stage(&self, output: &str, arguments: &[String]) -> String {
        format!("stage({}, {output});", arguments.join(", "))
    }
}

/// Header and source.
pub(super) fn files(
    device: &Device,
    request: &EmitRequest,
    program: &FilterProgram,
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
    let mut text = "/*\n".to_owned();
    for line in lines.iter().flat_map(|line| line.lines()) {
        let _ = writeln!(text, " * {}", line.replace("*/", "* /").replace("/*", "/ *"));
    }
    text + " */\n"
}

fn source(
    device: &Device,
    request: &EmitRequest,
    program: &FilterProgram,
    interface: &Interface,
) -> Result<String, EmitError> {
    let name = &request.name;
    let routines = program.routines();
    let called: BTreeSet<CalledFunction> = routines.iter().flat_map(|routine| routine.called()).collect();
    let functions = C.functions(device, &called)?;
    let mut text = comment(&interface.heading);
    text += &comment(&explanation::lines(device, request));
    let _ = write!(text, "#include \"{name}.h\"\n\n#include <stdint.h>\n");
    text += MACROS;
    text += &functions;
    text += &scales(request, program)?;
    if let Some(stage) = &program.stage {
        let written = stage.written(&C)?;
        let of_stage = kind(program.widths.stage);
        let parameters: Vec<String> = stage.parameters.iter().map(|p| format!("{of_stage} {p}")).collect();
        let _ = write!(
            text,
            "\n/* What one stage needs: rates per sample and their derivatives. */\nstatic void stage({}, {of_stage} to[{}])\n{{\n",
            parameters.join(", "),
            stage.outputs.len()
        );
        text += &written.body(ArrayNames::STAGE, "");
        text += "}\n";
    }
    text += &request.watch_functions()?;
    core(&mut text, request, program, interface, (&program.predict, "predict"), (&interface.part, &[]))?;
    for update in UpdateFunction::all(interface, (device, request), program) {
        let function = (update.routine, &*update.name);
        core(&mut text, request, program, interface, function, (&update.inputs, &update.measured))?;
    }
    finish(&mut text, device, request, program, interface)?;
    Ok(text)
}

/// A routine as a function over a state.
fn core(
    text: &mut String,
    request: &EmitRequest,
    program: &FilterProgram,
    interface: &Interface,
    (routine, of): (&Routine, &str),
    (inputs, measured): (&[String], &[String]),
) -> Result<(), EmitError> {
    let (written, name) = (routine.written(&C)?, &request.name);
    let constants = if routine.reads_constants() {
        format!(", const {} *constants", kind(program.widths.constants))
    } else {
        String::new()
    };
    let more: String = further(inputs.iter().chain(measured), "float ", "");
    let result = if written.variance.is_some() { "int" } else { "void" };
    let watch = if written.residual.is_some() { format!(", {name}_watch_t *watch") } else { String::new() };
    let _ = write!(text, "\nWITHIN {result} {of}({name}_state_t *state{watch}{constants}{more})\n{{\n");
    for (local, array, place) in interface.loads(routine, program) {
        let (kind, array) = (kind(program.widths.of(array)), ARRAYS.of(array));
        let _ = writeln!(text, "    const {kind} {local} = {array}[{place}];");
    }
    if let Some(measured) = measured.first() {
        let _ = writeln!(text, "    const float seen = {measured};");
    }
    if let Some(stage) = &program.stage {
        for call in &routine.calls {
            let (kind, outputs) = (kind(program.widths.stage), stage.outputs.len());
            let _ = writeln!(text, "    {kind} {}[{outputs}];", call.output);
        }
    }
    let refusal = match (&written.residual, &written.variance) {
        (Some(residual), Some(variance)) => {
            format!("    if (!believed(watch, {residual}, {variance})) {{\n        return 0;\n    }}\n")
        }
        _ => String::new(),
    };
    *text += &written.body(ARRAYS, &refusal);
    if let Some(variance) = &written.variance {
        let result = if written.residual.is_some() { "1".to_owned() } else { format!("{variance} > 0.0F") };
        let _ = writeln!(text, "    return {result};");
    }
    text.push_str("}\n");
    Ok(())
}

/// Units and origins as tables.
fn scales(request: &EmitRequest, program: &FilterProgram) -> Result<String, EmitError> {
    let (size, measures) = (request.size(), request.measures.len());
    Ok(format!(
        "\n/* The unit of each state and what it is counted from, in SI. */\nstatic const float UNIT[{size}] = {{{}}};\n\
         static const float ORIGIN[{size}] = {{{}}};\n\
         /* The standard deviation of the noise of each measurement in SI. */\nstatic const float DEVIATION[{measures}] = {{{}}};\n",
        listed(&program.units.scale, float)?,
        listed(&program.units.origins, float)?,
        listed(&request.measures.iter().map(|m| m.variance.sqrt()).collect::<Vec<_>>(), float)?
    ))
}

//! A filter in Rust, without `std` and without any crate.

mod accessors;
mod kept;
mod methods;
mod parameters;
mod tables;

use super::error::EmitError;
use super::explanation;
use super::filter::FilterProgram;
use super::interface::{Interface, UpdateFunction, further};
use super::request::{EmitGain, EmitRequest};
use super::routine::{ArrayNames, Routine, Syntax};
use super::tables::{FunctionSource as _, listed};
use super::tape::CalledFunction;
use super::watch::{IN_RUST, LOSS_IN_RUST, WatchRules};
use crate::device::Device;
use methods::methods;
use std::collections::BTreeSet;
use std::fmt::Write as _;

/// A choice between two values.
const CHOICE: &str = "
#[inline(always)]
fn choice<T: PartialOrd>(smaller: T, larger: T, then: T, otherwise: T) -> T {
    if smaller < larger { then } else { otherwise }
}
";

/// A number of 64 bits as one of 32.
const NARROW: &str = "
#[inline(always)]
fn narrow(value: f64) -> f32 {
    value as f32
}
";

/// The arrays of a filter.
const ARRAYS: ArrayNames =
    ArrayNames { mean: "state.mean", covariance: "state.covariance", other: "constants" };

/// Numbers of 32 or 64 bits.
struct Rust;

/// The type of a number.
fn kind(wide: bool) -> &'static str {
    if wide { "f64" } else { "f32" }
}

/// A number of this width as Rust reads it.
fn number(value: f64, wide: bool) -> Result<String, EmitError> {
    if wide { Ok(format!("{value:?}")) } else { float(value) }
}

/// A number of 32 bits as Rust reads it.
pub(super) fn float(value: f64) -> Result<String, EmitError> {
    let mut text = super::c::float(value)?;
    text.pop();
    Ok(text)
}

impl Syntax for Rust {
    fn literal(&self, value: f64, wide: bool) -> Result<String, EmitError> {
        number(value, wide)
    }

    fn declare(&self, name: &str, value: &str, _: bool) -> String {
        format!("let {name} = {value};")
    }

    fn call(&self, called: CalledFunction, at: &[String], wide: bool) -> String {
        let narrow = |at: &String| if wide { format!("narrow({at})") } else { at.clone() };
        let mut arguments: Vec<String> = at.iter().map(narrow).collect();
        let orders = called.order().into_iter().flatten().take(at.len());
        arguments.extend(orders.map(|order| order.to_string()));
        let call = format!("{}({})", called.name(), arguments.join(", "));
        if wide { format!("f64::from({call})") } else { call }
    }

    fn choice(&self, [a, b, c, d]: [&str; 4]) -> String {
        format!("choice({a}, {b}, {c}, {d})")
    }

    fn fused(&self, _: &str, _: &str, _: &str) -> Option<String> {
        None
    }

    fn converted(&self, plain: &str, _: &str, wide: bool) -> String {
        if wide { format!("f64::from({plain})") } else { format!("narrow({plain})") }
    }

    fn stage(&self, output: &str, arguments: &[String]) -> String {
        format!("let {output} = stage({});", arguments.join(", "))
    }
}

/// The module.
pub(super) fn files(
    device: &Device,
    request: &EmitRequest,
    program: &FilterProgram,
) -> Result<Vec<(String, String)>, EmitError> {
    let interface = Interface::of(device, request, program);
    let size = request.size();
    let entries = size * (size + 1) / 2;
    let mut text = comment(&interface.heading);
    let called: BTreeSet<CalledFunction> =
        program.routines().iter().flat_map(|routine| routine.called()).collect();
    let has_covariance = request.gain == EmitGain::Covariance;
    text += "//!\n";
    text += &comment(&explanation::lines(device, request));
    text += "\n#![allow(dead_code, non_snake_case, clippy::all, clippy::pedantic)]\n";
    let _ = write!(
        text,
        "\n/// How many states there are:\n///\n{}pub const STATES: usize = {size};\n\
         /// The sampling interval in s.\npub const INTERVAL_S: f32 = {};\n/// How many measurements correct it.\npub const MEASUREMENTS: usize = {};\n\
         /// A step corrects by one sample in so many.\npub const UPDATE_EVERY: u32 = {};\n\
         /// How many inputs a step is given.\nconst INPUTS: usize = {};\n",
        interface.states("/// "),
        float(request.sampling_interval_s())?,
        request.measures.len(),
        request.update_every,
        interface.step.len()
    );
    let _ = write!(
        text,
        "/// The unit of each state in SI.\nconst UNIT: [f32; {size}] = [{}];\n\
         /// What each state is counted from, in SI.\nconst ORIGIN: [f32; {size}] = [{}];\n\
         /// The standard deviation of the noise of each measurement in SI.\nconst DEVIATION: [f32; MEASUREMENTS] = [{}];\n",
        listed(&program.units.scale, float)?,
        listed(&program.units.origins, float)?,
        listed(&request.measures.iter().map(|m| m.variance.sqrt()).collect::<Vec<_>>(), float)?
    );
    let covariance = if has_covariance {
        format!(
            "    /// The lower triangle, row by row.\n    pub covariance: [{}; {entries}],\n",
            kind(program.widths.covariance)
        )
    } else {
        String::new()
    };
    let _ = write!(
        text,
        "\n/// What is estimated, each state in its unit.\n#[derive(Clone, Copy, Debug)]\npub struct State {{\n    \
         /// The means.\n    pub mean: [{}; {size}],\n{covariance}}}\n",
        kind(program.widths.mean)
    );
    let constants = program.configure.as_ref().map(|configure| configure.outputs.len());
    if constants.is_some() {
        text += &parameters::types(&Interface::parameters(device, request, program), request.experiment);
    }
    let of_constants = kind(program.widths.constants);
    let field =
        constants.map_or(String::new(), |count| format!("    constants: [{of_constants}; {count}],\n"));
    let _ = write!(
        text,
        "\n/// The filter.\n#[derive(Clone, Copy, Debug)]\npub struct Filter {{\n    /// What is estimated.\n    pub state: State,\n    \
         /// What the corrections by each measurement saw.\n    pub watch: [InnovationWatch; MEASUREMENTS],\n    \
         /// How often it has lost its signal or its numbers, and what it knew of the motion.\n    pub begun: u32,\n    \
         /// How many inputs were no numbers, in whose places are the last that were.\n    pub missing: u32,\n    inputs: [f32; INPUTS],\n    \
         /// Samples until the next correction.\n    left: u32,\n{field}{}{}}}\n\n",
        if request.has_range() {
            "    /// Samples in a row of each measurement at an end of its range.\n    pub saturated: [u32; MEASUREMENTS],\n"
        } else {
            ""
        },
        if request.begins_again() {
            "    /// Its state as its gate opened, predicted on.\n    kept: State,\n    /// What is known of that.\n    loss: KeptRecord,\n"
        } else {
            ""
        }
    );
    text += IN_RUST;
    if request.begins_again() {
        text.push('\n');
        text += LOSS_IN_RUST;
    }
    text += &rules(request)?;
    if program.routines().iter().any(|routine| routine.counts()[4] > 0) {
        text += CHOICE;
    }
    text += &Rust.functions(device, &called)?.replace("pub(super) fn", "fn");
    stage(&mut text, program)?;
    core(&mut text, program, &interface, (&program.predict, "predict"), (&interface.part, &[]))?;
    for update in UpdateFunction::all(&interface, (device, request), program) {
        let (function, handed) = ((update.routine, &*update.name), (&*update.inputs, &update.measured[..]));
        core(&mut text, program, &interface, function, handed)?;
    }
    methods(&mut text, device, request, program, &interface)?;
    if text.contains("narrow(") {
        text += NARROW;
    }
    Ok(vec![(format!("{}.rs", request.name), text)])
}

/// A stage of Runge and Kutta's method, if the program has one.
fn stage(text: &mut String, program: &FilterProgram) -> Result<(), EmitError> {
    if let Some(stage) = &program.stage {
        let written = stage.written(&Rust)?;
        let of_stage = kind(program.widths.stage);
        let parameters: Vec<String> = stage.parameters.iter().map(|p| format!("{p}: {of_stage}")).collect();
        let count = stage.outputs.len();
        let _ = write!(
            text,
            "\n/// What one stage needs: rates per sample and their derivatives.\nfn stage({}) -> [{of_stage}; {count}] {{\n    let mut to = [0.0; {count}];\n",
            parameters.join(", ")
        );
        *text += &written.body(ArrayNames::STAGE, "");
        *text += "    to\n}\n";
    }
    Ok(())
}

/// The rules by which its innovations are watched.
fn rules(request: &EmitRequest) -> Result<String, EmitError> {
    let WatchRules { largest_nis, rejects, settling, forgets, lost } = request.watch_rules();
    Ok(format!(
        "\nconst RULES: WatchRules =\n    WatchRules {{ largest_nis: {}, rejects: {rejects}, settling: {settling}, forgets: {}, lost: {lost} }};\n",
        float(largest_nis.into())?,
        float(forgets.into())?
    ))
}

/// The lines at the head of a file.
pub(super) fn comment(lines: &[String]) -> String {
    let mut text = String::new();
    for line in lines.iter().flat_map(|line| line.lines()) {
        let _ = writeln!(text, "//! {line}");
    }
    text
}

/// Arguments with their types.
fn typed(arguments: &[String]) -> String {
    further(arguments, "", ": f32")
}

/// A routine as a function over a state.
fn core(
    text: &mut String,
    program: &FilterProgram,
    interface: &Interface,
    (routine, of): (&Routine, &str),
    (inputs, measured): (&[String], &[String]),
) -> Result<(), EmitError> {
    let written = routine.written(&Rust)?;
    let constants = match &program.configure {
        Some(configure) if routine.reads_constants() => {
            format!(", constants: &[{}; {}]", kind(program.widths.constants), configure.outputs.len())
        }
        _ => String::new(),
    };
    let more = typed(inputs) + &typed(measured);
    let kind = if written.variance.is_some() { " -> bool" } else { "" };
    let watch = if written.residual.is_some() { ", watch: &mut InnovationWatch" } else { "" };
    let _ =
        write!(text, "\n#[inline(always)]\nfn {of}(state: &mut State{watch}{constants}{more}){kind} {{\n");
    for (local, array, place) in interface.loads(routine, program) {
        let _ = writeln!(text, "    let {local} = {}[{place}];", ARRAYS.of(array));
    }
    if let Some(measured) = measured.first() {
        let _ = writeln!(text, "    let seen = {measured};");
    }
    let refusal = match (&written.residual, &written.variance) {
        (Some(residual), Some(variance)) => {
            format!(
                "    if !watch.believes(&RULES, {residual}, {variance}) {{\n        return false;\n    }}\n"
            )
        }
        _ => String::new(),
    };
    *text += &written.body(ARRAYS, &refusal);
    if let Some(variance) = &written.variance {
        let result = if written.residual.is_some() { "true".to_owned() } else { format!("{variance} > 0.0") };
        let _ = writeln!(text, "    {result}");
    }
    text.push_str("}\n");
    Ok(())
}

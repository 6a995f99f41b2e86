//! A filter in Rust, without `std` and without any crate.

use super::error::EmitError;
use super::filter::Program;
use super::interface::{Interface, part};
use super::request::{EmitGain, EmitRequest};
use super::routine::{Array, Routine, Syntax, Written};
use super::tables::{CurveTable, disks_series};
use super::tape::Called;
use crate::description::Outside;
use crate::device::Device;
use std::collections::BTreeSet;
use std::fmt::Write as _;

/// Functions that Rust without `std` does not have.
const FUNCTIONS: &str = include_str!("functions.rs");

/// A choice between two values.
const CHOICE: &str = "
#[inline(always)]
fn choice(smaller: f32, larger: f32, then: f32, otherwise: f32) -> f32 {
    if smaller < larger { then } else { otherwise }
}
";

/// Numbers of 32 or, where parameters are taken, of 64 bits.
struct Rust {
    wide: bool,
}

/// A number of 32 bits as Rust reads it.
pub(super) fn float(value: f64) -> Result<String, EmitError> {
    let mut text = super::c::float(value)?;
    text.pop();
    Ok(text)
}

impl Syntax for Rust {
    fn literal(&self, value: f64) -> Result<String, EmitError> {
        if self.wide { Ok(format!("{value:?}")) } else { float(value) }
    }

    fn declare(&self, name: &str, value: &str) -> String {
        format!("let {name} = {value};")
    }

    fn call(&self, called: Called, at: &str) -> String {
        let at = if self.wide { format!("({at}) as f32") } else { at.to_owned() };
        let call = match called {
            Called::FallingExp => format!("falling_exp({at})"),
            Called::Exp => format!("exp({at})"),
            Called::Ln => format!("ln({at})"),
            Called::Sin => format!("sin({at})"),
            Called::Cos => format!("cos({at})"),
            Called::Tanh => format!("tanh({at})"),
            Called::Atanh => format!("atanh({at})"),
            Called::Sqrt => format!("sqrt({at})"),
            Called::Atanhc(order) => format!("atanhc({at}, {order})"),
            Called::LnCosh => format!("ln_cosh({at})"),
            Called::Disks(order) => format!("disks({at}, {order})"),
            Called::Curve(curve, order) => format!("curve{curve}({at}, {order})"),
        };
        if self.wide { format!("f64::from({call})") } else { call }
    }

    fn choice(&self, [a, b, c, d]: [&str; 4]) -> String {
        format!("choice({a}, {b}, {c}, {d})")
    }

    fn fused(&self, _: &str, _: &str, _: &str) -> Option<String> {
        None
    }

    fn stage(&self, output: &str, arguments: &[String]) -> String {
        format!("let {output} = stage({});", arguments.join(", "))
    }
}

/// The module.
pub(super) fn files(
    device: &Device,
    request: &EmitRequest,
    program: &Program,
) -> Result<Vec<(String, String)>, EmitError> {
    let interface = Interface::of(device, request, program);
    let size = request.size();
    let entries = size * (size + 1) / 2;
    let mut text = comment(&interface.heading);
    let called: BTreeSet<Called> = program.routines().iter().flat_map(|routine| routine.called()).collect();
    let has_covariance = request.gain == EmitGain::Covariance;
    text += "\n#![allow(non_snake_case, clippy::all, clippy::pedantic)]\n";
    let _ = write!(
        text,
        "\n/// How many states there are:\n///\n{}pub const STATES: usize = {size};\n\
         /// The sampling interval in s.\npub const INTERVAL_S: f32 = {};\n",
        interface.states("/// "),
        float(request.interval_s)?
    );
    let list = |values: &[f64]| -> Result<String, EmitError> {
        Ok(values.iter().map(|value| float(*value)).collect::<Result<Vec<_>, _>>()?.join(", "))
    };
    let _ = write!(
        text,
        "/// The unit of each state in SI.\nconst UNIT: [f32; {size}] = [{}];\n\
         /// What each state is counted from, in SI.\nconst ORIGIN: [f32; {size}] = [{}];\n",
        list(&program.units.scale)?,
        list(&program.units.origins)?
    );
    let covariance = if has_covariance {
        format!("    /// The lower triangle, row by row.\n    pub covariance: [f32; {entries}],\n")
    } else {
        String::new()
    };
    let _ = write!(
        text,
        "\n/// What is estimated, each state in its unit.\n#[derive(Clone, Copy, Debug)]\npub struct State {{\n    \
         /// The means.\n    pub mean: [f32; {size}],\n{covariance}}}\n"
    );
    let constants = program.configure.as_ref().map(|configure| configure.outputs.len());
    if constants.is_some() {
        text += "\n/// Parameters that may change while the program runs, in SI.\n#[derive(Clone, Copy, Debug)]\npub struct Parameters {\n";
        for (field, unit, _) in interface.parameters(device, request, program) {
            let _ = write!(text, "    /// {unit}\n    pub {field}: f64,\n");
        }
        text += "}\n\nimpl Default for Parameters {\n    fn default() -> Self {\n        Self {";
        for (field, _, value) in interface.parameters(device, request, program) {
            let _ = write!(text, " {field}: {value:?},");
        }
        text += " }\n    }\n}\n";
    }
    let field = constants.map_or(String::new(), |count| format!("    constants: [f32; {count}],\n"));
    let _ = write!(
        text,
        "\n/// The filter.\n#[derive(Clone, Copy, Debug)]\npub struct Filter {{\n    /// What is estimated.\n    pub state: State,\n{field}}}\n"
    );
    if program.routines().iter().any(|routine| routine.counts()[4] > 0) {
        text += CHOICE;
    }
    text += &functions(device, &called)?;
    if let Some(stage) = &program.stage {
        let written = stage.written(&Rust { wide: false })?;
        let parameters: Vec<String> = stage.parameters.iter().map(|p| format!("{p}: f32")).collect();
        let count = stage.outputs.len();
        let _ = write!(
            text,
            "\n/// What one stage needs: rates per sample and their derivatives.\nfn stage({}) -> [f32; {count}] {{\n    let mut to = [0.0; {count}];\n",
            parameters.join(", ")
        );
        body(&mut text, &written, "to", "to", "to");
        text += "    to\n}\n";
    }
    core(&mut text, program, &interface, (&program.predict, "predict"), (&interface.predict, &[]))?;
    for (place, update) in program.updates.iter().enumerate() {
        let is_event = place >= request.measures.len();
        let measured = if is_event { vec![] } else { vec![program.names.measured(place)] };
        let inputs = Interface::inputs_of(device, program, update);
        let of = format!("update_{}", program.names.measure(place));
        core(&mut text, program, &interface, (update, &of), (&inputs, &measured))?;
    }
    methods(&mut text, device, request, program, &interface)?;
    Ok(vec![(format!("{}.rs", request.name), text)])
}

/// The lines at the head of a file.
pub(super) fn comment(lines: &[String]) -> String {
    let lines = lines.iter().flat_map(|line| line.lines());
    lines.map(|line| format!("//! {line}\n")).collect()
}

/// Arguments with their types.
fn typed(arguments: &[String]) -> String {
    arguments.iter().map(|argument| format!(", {argument}: f32")).collect()
}

/// A routine as a function over a state.
fn core(
    text: &mut String,
    program: &Program,
    interface: &Interface,
    (routine, of): (&Routine, &str),
    (inputs, measured): (&[String], &[String]),
) -> Result<(), EmitError> {
    let written = routine.written(&Rust { wide: false })?;
    let constants = match &program.configure {
        Some(configure) if routine.reads_constants() => {
            format!(", constants: &[f32; {}]", configure.outputs.len())
        }
        _ => String::new(),
    };
    let more = typed(inputs) + &typed(measured);
    let kind = if written.variance.is_some() { " -> bool" } else { "" };
    let _ = write!(text, "\n#[inline(always)]\nfn {of}(state: &mut State{constants}{more}){kind} {{\n");
    for (local, array, place) in interface.loads(routine, program) {
        let array = match array {
            Array::Mean => "state.mean",
            Array::Covariance => "state.covariance",
            Array::Constants | Array::Stage => "constants",
        };
        let _ = writeln!(text, "    let {local} = {array}[{place}];");
    }
    if let Some(measured) = measured.first() {
        let _ = writeln!(text, "    let seen = {measured};");
    }
    body(text, &written, "state.mean", "state.covariance", "constants");
    if let Some(variance) = &written.variance {
        let _ = writeln!(text, "    {variance} > 0.0");
    }
    text.push_str("}\n");
    Ok(())
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

/// The functions that predict and correct, each whole or not at all, and what is around them.
fn methods(
    text: &mut String,
    device: &Device,
    request: &EmitRequest,
    program: &Program,
    interface: &Interface,
) -> Result<(), EmitError> {
    let list = |values: &[f64]| -> Result<String, EmitError> {
        Ok(values.iter().map(|value| float(*value)).collect::<Result<Vec<_>, _>>()?.join(", "))
    };
    let (mean, covariance) = &program.start;
    let size = request.size();
    let triangle =
        if covariance.is_empty() { String::new() } else { format!(", covariance: [{}]", list(covariance)?) };
    let state = format!("State {{ mean: [{}]{triangle} }}", list(mean)?);
    text.push_str("\nimpl Filter {\n    /// Before the first sample.\n    pub fn new() -> Self {\n");
    match &program.configure {
        None => {
            let _ = writeln!(text, "        Self {{ state: {state} }}\n    }}");
        }
        Some(configure) => {
            let count = configure.outputs.len();
            let _ = write!(
                text,
                "        let mut filter = Self {{ state: {state}, constants: [0.0; {count}] }};\n        \
                 let _ = filter.configure(&Parameters::default());\n        filter\n    }}\n"
            );
            configured(text, device, request, program, interface, configure)?;
        }
    }
    let mut sum: Vec<String> = (0..size).map(|k| format!("state.mean[{k}]")).collect();
    sum.extend((0..covariance.len()).map(|k| format!("state.covariance[{k}]")));
    let _ = write!(
        text,
        "\n    /// Takes over a state where all its numbers are finite.\n    fn take(&mut self, state: &State) -> bool {{\n        \
         let sum = {};\n        if sum - sum == 0.0 {{\n            self.state = *state;\n            return true;\n        }}\n        false\n    }}\n",
        sum.join("\n            + ")
    );
    steps(text, device, request, program, interface);
    let _ = write!(
        text,
        "\n    /// The means in SI.\n    pub fn values(&self) -> [f32; {size}] {{\n        \
         core::array::from_fn(|k| ORIGIN[k] + UNIT[k] * self.state.mean[k])\n    }}\n"
    );
    if !covariance.is_empty() {
        let _ = write!(
            text,
            "\n    /// The variances in SI.\n    pub fn variances(&self) -> [f32; {size}] {{\n        \
             core::array::from_fn(|k| UNIT[k] * UNIT[k] * self.state.covariance[k * (k + 3) / 2])\n    }}\n"
        );
    }
    text.push_str(
        "}\n\nimpl Default for Filter {\n    fn default() -> Self {\n        Self::new()\n    }\n}\n",
    );
    Ok(())
}

/// The function that takes parameters.
fn configured(
    text: &mut String,
    device: &Device,
    request: &EmitRequest,
    program: &Program,
    interface: &Interface,
    configure: &Routine,
) -> Result<(), EmitError> {
    let written = configure.written(&Rust { wide: true })?;
    let count = configure.outputs.len();
    let names = configure.names();
    let given = if names.is_empty() { "_parameters" } else { "parameters" };
    let _ = write!(
        text,
        "\n    /// Takes parameters; false, and nothing has changed, where a number that follows is not finite.\n    \
         #[must_use]\n    pub fn configure(&mut self, {given}: &Parameters) -> bool {{\n"
    );
    for (field, _, _) in interface.parameters(device, request, program) {
        if names.contains(&field) {
            let _ = writeln!(text, "        let {field} = parameters.{field};");
        }
    }
    for statement in &written.statements {
        let _ = writeln!(text, "        {statement}");
    }
    let values: Vec<String> =
        written.outputs.iter().map(|(_, _, value)| format!("({value}) as f32")).collect();
    let _ = write!(
        text,
        "        let constants: [f32; {count}] = [{}];\n        \
         if constants.iter().all(|constant| constant.is_finite()) {{\n            self.constants = constants;\n            \
         return true;\n        }}\n        false\n    }}\n",
        values.join(", ")
    );
    Ok(())
}

/// The prediction, the corrections and a whole step.
fn steps(
    text: &mut String,
    device: &Device,
    request: &EmitRequest,
    program: &Program,
    interface: &Interface,
) {
    let call = |routine: &Routine, of: &str, arguments: &[String]| {
        let constants = if routine.reads_constants() { ", &self.constants" } else { "" };
        let arguments: String = arguments.iter().map(|argument| format!(", {argument}")).collect();
        format!("{of}(&mut next{constants}{arguments})")
    };
    let predict = call(&program.predict, "predict", &interface.predict);
    let _ = write!(
        text,
        "\n    /// One interval on. True where it was taken; false where the result would not be finite, and nothing has changed.\n    \
         ///\n{}    pub fn predict(&mut self{}) -> bool {{\n        let mut next = self.state;\n        {predict};\n        \
         self.take(&next)\n    }}\n",
        interface.inputs("    /// "),
        typed(&interface.predict)
    );
    let (mut calls, mut apart) = (String::new(), String::new());
    for (place, update) in program.updates.iter().enumerate() {
        let inputs = Interface::inputs_of(device, program, update);
        let is_event = place >= request.measures.len();
        let (measured, what) = if is_event {
            (vec![], "Corrects where the event happened: its expression was zero.".to_owned())
        } else {
            let what = format!("Corrects by a measurement in {}.", interface.unit_of(place));
            (vec![program.names.measured(place)], what)
        };
        let arguments: Vec<String> = inputs.iter().chain(&measured).cloned().collect();
        let of = format!("update_{}", program.names.measure(place));
        let one = call(update, &of, &arguments);
        let says = update.variance.is_some();
        let taken = if says {
            format!("{one} && self.take(&next)")
        } else {
            format!("{{\n            {one};\n            self.take(&next)\n        }}")
        };
        let _ = write!(
            text,
            "\n    /// {what} True where it was taken; false where it is refused, and nothing has changed.\n    \
             pub fn {of}(&mut self{}) -> bool {{\n        let mut next = self.state;\n        {taken}\n    }}\n",
            typed(&arguments)
        );
        if !is_event {
            let _ = if says {
                writeln!(calls, "        taken &= {one};")
            } else {
                writeln!(calls, "        {one};")
            };
            let _ = writeln!(apart, "        taken &= self.{of}({});", arguments.join(", "));
        }
    }
    let mutable = if calls.contains("taken") { "let mut taken" } else { "let taken" };
    let all: Vec<String> = interface.step.iter().chain(&interface.measured).cloned().collect();
    let _ = write!(
        text,
        "\n    /// The prediction and all corrections of one sample. True where all were taken; false where one is refused and left out: a\n    \
         /// sample that is not a number is a gap, and refused behind the prediction.\n    \
         pub fn step(&mut self{}) -> bool {{\n        let mut next = self.state;\n        {mutable} = true;\n        {predict};\n{calls}        \
         if taken && self.take(&next) {{\n            return true;\n        }}\n        \
         // One is refused: each for itself.\n        if !self.predict({}) {{\n            return false;\n        }}\n        \
         let mut taken = true;\n{apart}        taken\n    }}\n",
        typed(&all),
        interface.predict.join(", ")
    );
}

/// The functions that are called.
fn functions(device: &Device, called: &BTreeSet<Called>) -> Result<String, EmitError> {
    let any = |of: &[Called]| of.iter().any(|one| called.contains(one));
    let atanhc = called.iter().any(|c| matches!(c, Called::Atanhc(_)));
    let disks_used = called.iter().any(|c| matches!(c, Called::Disks(_)));
    let atanh = atanhc || any(&[Called::Atanh]);
    let ln_cosh = any(&[Called::LnCosh]);
    let tanh = any(&[Called::Tanh]);
    let mut text = String::new();
    for (marker, is_used) in [
        ("EXP", disks_used || any(&[Called::Exp])),
        ("FALLING_EXP", tanh || ln_cosh || any(&[Called::FallingExp])),
        ("LN", atanh || ln_cosh || disks_used || any(&[Called::Ln])),
        ("SIN_COS", any(&[Called::Sin, Called::Cos])),
        ("SIN", any(&[Called::Sin])),
        ("COS", any(&[Called::Cos])),
        ("TANH", tanh),
        ("ATANH", atanh),
        ("SQRT", any(&[Called::Sqrt])),
        ("LN_COSH", ln_cosh),
        ("ATANHC", atanhc),
    ] {
        if is_used {
            text.push('\n');
            text += part(FUNCTIONS, &format!("// --- {marker}\n"), "// --- ");
        }
    }
    if disks_used {
        text += &disks()?;
    }
    let of_curve = |c: &Called| if let Called::Curve(curve, _) = c { Some(*curve) } else { None };
    for curve in called.iter().filter_map(of_curve).collect::<BTreeSet<usize>>() {
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
/// Chebyshev's coefficients of ln(C/(epsilon_0 a)) of two disks, over ln(d/a).
static DISKS: [f32; {count}] = [
    {table}
];

/// C/(epsilon_0 a) of two disks over d/a, and its first two derivatives.
fn disks(share: f32, order: u32) -> f32 {{
    let x = {factor} * ln(share) + {offset};
    if !(-1.0..=1.0).contains(&x) {{
        return f32::NAN;
    }}
    let (mut b1, mut b2, mut d1, mut d2, mut e1, mut e2) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    for c in DISKS[1..].iter().rev() {{
        let b = 2.0 * x * b1 - b2 + c;
        let d = 2.0 * (b1 + x * d1) - d2;
        let e = 2.0 * (2.0 * d1 + x * e1) - e2;
        (b2, b1, d2, d1, e2, e1) = (b1, b, d1, d, e1, e);
    }}
    let value = exp(x * b1 - b2 + DISKS[0]);
    let slope = b1 + x * d1 - d2;
    let bend = 2.0 * d1 + x * e1 - e2;
    let by_share = {factor} / share;
    match order {{
        0 => value,
        1 => value * slope * by_share,
        _ => value * by_share * by_share * (slope * slope + bend - slope / {factor}),
    }}
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
    let rows: Result<Vec<String>, EmitError> =
        table.pieces.iter().map(|piece| Ok(format!("[{}]", numbers(piece)?))).collect();
    let outside = match table.outside {
        Outside::Error => {
            "    if !(x >= CURVE_AT[0] && x <= CURVE_AT[LAST]) {\n        return f32::NAN;\n    }\n    let beyond = 0.0;\n"
        }
        Outside::Clamp => {
            "    let end = x.clamp(CURVE_AT[0], CURVE_AT[LAST]);\n    if x != end && order > 0 {\n        \
             return if x == x { 0.0 } else { x };\n    }\n    let (x, beyond) = (end, 0.0);\n"
        }
        Outside::Linear => {
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
        places = numbers(&table.places)?,
        pieces = count - 1,
        coefficients = rows?.join(",\n    "),
    );
    Ok(text
        .replace("CURVE_AT", &format!("CURVE{curve}_AT"))
        .replace("CURVE:", &format!("CURVE{curve}:"))
        .replace("CURVE[", &format!("CURVE{curve}["))
        .replace("LAST", &(count - 1).to_string()))
}

//! What is around the routines in Rust: start, parameters, and steps that are taken whole or not at all.

use super::{Rust, accessors, float, kept, kind, number, typed};
use crate::device::Device;
use crate::emit::accessors::state_accesses;
use crate::emit::error::EmitError;
use crate::emit::filter::FilterProgram;
use crate::emit::interface::{CallTargets, Interface, UpdateFunction};
use crate::emit::request::EmitRequest;
use crate::emit::routine::Routine;
use crate::emit::tables::listed;
use std::fmt::Write as _;

/// The functions that predict and correct, each whole or not at all, and what is around them.
pub(super) fn methods(
    text: &mut String,
    device: &Device,
    request: &EmitRequest,
    program: &FilterProgram,
    interface: &Interface,
) -> Result<(), EmitError> {
    let widths = program.widths;
    let list = |values: &[f64], wide: bool| listed(values, |value| number(value, wide));
    let (mean, covariance) = &program.start;
    let size = request.size();
    let triangle = if covariance.is_empty() {
        String::new()
    } else {
        format!(", covariance: [{}]", list(covariance, widths.covariance)?)
    };
    let _ = write!(
        text,
        "\n/// What is known before the first sample.\nconst START: State = State {{ mean: [{}]{triangle} }};\n",
        list(mean, widths.mean)?
    );
    // The sum is looked at for what is not a number, to which 32 bits are enough.
    let entry = |of: String, wide: bool| if wide { format!("narrow({of})") } else { of };
    let mut sum: Vec<String> = (0..size).map(|k| entry(format!("state.mean[{k}]"), widths.mean)).collect();
    let entries = 0..covariance.len();
    sum.extend(entries.map(|k| entry(format!("state.covariance[{k}]"), widths.covariance)));
    let _ = write!(
        text,
        "\n/// Whether all numbers of a state are finite.\n#[inline(always)]\nfn is_finite(state: &State) -> bool {{\n    \
         let sum = {};\n    sum - sum == 0.0\n}}\n",
        sum.join("\n        + ")
    );
    within(text, device, request, program, interface)?;
    if request.begins_again() {
        let updates = UpdateFunction::all(interface, (device, request), program);
        *text += &kept::functions(request, program, interface, updates);
    }
    let state = format!(
        "state: START, watch: [InnovationWatch::NEW; MEASUREMENTS], begun: 0, missing: 0, inputs: [0.0; INPUTS], left: 0{}",
        (if request.has_range() { ", saturated: [0; MEASUREMENTS]" } else { "" }).to_owned()
            + if request.begins_again() { ", kept: START, loss: KeptRecord::NONE" } else { "" }
    );
    text.push_str("\nimpl Filter {\n    /// Before the first sample.\n    pub fn new() -> Self {\n");
    match &program.configure {
        None => {
            let _ = writeln!(text, "        Self {{ {state} }}\n    }}");
        }
        Some(configure) => {
            let count = configure.outputs.len();
            let _ = write!(
                text,
                "        let mut filter = Self {{ {state}, constants: [0.0; {count}] }};\n        \
                 let _ = filter.configure(&Parameters::default());\n        filter\n    }}\n"
            );
            configured(text, device, request, program, configure)?;
        }
    }
    text.push_str(
        "\n    /// Takes over a state where all its numbers are finite.\n    fn take(&mut self, state: &State) -> bool {\n        \
         if is_finite(state) {\n            self.state = *state;\n            return true;\n        }\n        false\n    }\n",
    );
    steps(text, device, request, program, interface)?;
    let value = if widths.mean {
        "(f64::from(ORIGIN[k]) + f64::from(UNIT[k]) * self.state.mean[k]) as f32"
    } else {
        "ORIGIN[k] + UNIT[k] * self.state.mean[k]"
    };
    in_si(text, ("means", "values"), size, value);
    if !covariance.is_empty() {
        let variance = if widths.covariance {
            "(f64::from(UNIT[k] * UNIT[k]) * self.state.covariance[k * (k + 3) / 2]) as f32"
        } else {
            "UNIT[k] * UNIT[k] * self.state.covariance[k * (k + 3) / 2]"
        };
        in_si(text, ("variances", "variances"), size, variance);
    }
    accessors::methods(text, program, &state_accesses(device, request, program))?;
    text.push_str(
        "}\n\nimpl Default for Filter {\n    fn default() -> Self {\n        Self::new()\n    }\n}\n",
    );
    Ok(())
}

/// A function that gives a number of each state in SI.
fn in_si(text: &mut String, (what, name): (&str, &str), size: usize, of_state: &str) {
    let _ = write!(
        text,
        "\n    /// The {what} in SI.\n    pub fn {name}(&self) -> [f32; {size}] {{\n        \
         core::array::from_fn(|k| {of_state})\n    }}\n"
    );
}

/// The function that takes parameters.
fn configured(
    text: &mut String,
    device: &Device,
    request: &EmitRequest,
    program: &FilterProgram,
    configure: &Routine,
) -> Result<(), EmitError> {
    let written = configure.written(&Rust)?;
    let count = configure.outputs.len();
    let names = configure.names();
    let given = if names.is_empty() { "_parameters" } else { "parameters" };
    let _ = write!(
        text,
        "\n    /// Takes parameters; false, and nothing has changed, where a number that follows is not finite.\n    \
         #[must_use]\n    pub fn configure(&mut self, {given}: &Parameters) -> bool {{\n"
    );
    for (field, _, _) in Interface::parameters(device, request, program) {
        if names.contains(&field) {
            let _ = writeln!(text, "        let {field} = parameters.{field};");
        }
    }
    for statement in &written.statements {
        let _ = writeln!(text, "        {statement}");
    }
    let values: Vec<String> = written.outputs.iter().map(|(_, _, value)| value.clone()).collect();
    let of_constants = kind(program.widths.constants);
    let _ = write!(
        text,
        "        let constants: [{of_constants}; {count}] = [{}];\n        \
         if constants.iter().all(|constant| constant.is_finite()) {{\n            self.constants = constants;\n            \
         return true;\n        }}\n        false\n    }}\n",
        values.join(", ")
    );
    Ok(())
}

/// What goes over the interval between samples in several steps.
fn within(
    text: &mut String,
    device: &Device,
    request: &EmitRequest,
    program: &FilterProgram,
    interface: &Interface,
) -> Result<(), EmitError> {
    if request.parts == 1 {
        return Ok(());
    }
    let length = (request.parts as f64).recip();
    let arguments = interface.part_arguments(device, program, length, float)?;
    let asks_where = arguments.iter().any(|argument| argument.contains("from"));
    if asks_where {
        *text += "\n/// A number between those at the start, the middle and the end, by a parabola.\n#[inline(always)]\n\
                  fn between(start: f32, middle: f32, end: f32, place: f32) -> f32 {\n    \
                  start + place * (4.0 * middle - 3.0 * start - end + 2.0 * place * (start - 2.0 * middle + end))\n}\n";
    }
    let constants = match &program.configure {
        Some(configure) if program.predict.reads_constants() => {
            format!(", constants: &[{}; {}]", kind(program.widths.constants), configure.outputs.len())
        }
        _ => String::new(),
    };
    let from = format!("        let from = part as f32 * {};\n", float(length)?);
    let (variable, from) = if asks_where { ("part", &*from) } else { ("_", "") };
    let targets = CallTargets { state: "state", watch: "", constants: "constants" };
    let _ = write!(
        text,
        "\n/// The interval between samples, in steps.\n#[inline(always)]\nfn advance(state: &mut State{constants}{}) {{\n    \
         for {variable} in 0..{} {{\n{from}        {};\n    }}\n}}\n",
        typed(&interface.predict),
        request.parts,
        program.predict.call("predict", &targets, &arguments)
    );
    Ok(())
}

/// What is made of the numbers that a function is given.
fn given(text: &mut String, request: &EmitRequest, interface: &Interface) {
    if !interface.step.is_empty() {
        text.push_str(
            "\n    /// An input; where it is not a number, the last one that was: time goes on.\n    #[inline(always)]\n    \
             fn held(&mut self, place: usize, input: f32) -> f32 {\n        if input - input == 0.0 {\n            self.inputs[place] = input;\n        \
             } else {\n            self.missing = self.missing.saturating_add(1);\n        }\n        self.inputs[place]\n    }\n",
        );
    }
    if request.has_range() {
        text.push_str(
            "\n    /// A sample; at an end of its range or beyond, it is a gap.\n    #[inline(always)]\n    \
             fn in_range(&mut self, measurement: usize, value: f32, [low, high]: [f32; 2]) -> f32 {\n        \
             let is_at_end = value <= low || value >= high;\n        \
             self.saturated[measurement] = if is_at_end { self.saturated[measurement].saturating_add(1) } else { 0 };\n        \
             if is_at_end { f32::NAN } else { value }\n    }\n",
        );
    }
}

/// The prediction over an interval; `held` are the statements before it.
fn predicts(
    text: &mut String,
    request: &EmitRequest,
    program: &FilterProgram,
    (predict, held): (&str, &str),
    interface: &Interface,
) {
    let handed = interface.predict.join(", ");
    let predicts = if request.begins_again() {
        let kept = CallTargets { state: "&mut self.kept", watch: "", constants: "&self.constants" };
        format!(
            "        if self.loss.is_kept(&RULES) {{\n            {};\n        }}\n        self.predicted({handed})\n",
            program.predict.call("predict_alone", &kept, &interface.predict)
        )
    } else {
        format!(
            "        let mut next = self.state;\n        {predict};\n        \
             if self.take(&next) {{\n            return true;\n        }}\n        self.restart();\n        false\n"
        )
    };
    let _ = write!(
        text,
        "\n    /// One interval on. An input that is not a number is taken for the last one that was. True where it was taken; false where the\n    \
         /// result would not be finite, and the filter has begun again.\n    \
         ///\n{}    pub fn predict(&mut self{}) -> bool {{\n{}{predicts}    }}\n",
        interface.inputs("    /// "),
        typed(&interface.predict),
        held
    );
}

/// The prediction, the corrections and a whole step.
fn steps(
    text: &mut String,
    device: &Device,
    request: &EmitRequest,
    program: &FilterProgram,
    interface: &Interface,
) -> Result<(), EmitError> {
    text.push_str(kept::restart(request));
    given(text, request, interface);
    let held = |inputs: &[String]| {
        interface.held(inputs, |name, place| format!("        let {name} = self.held({place}, {name});\n"))
    };
    let ranged = |measured: &[String]| {
        interface.ranged(request, measured, |name, place, [low, high]| {
            let (low, high) = (float(low)?, float(high)?);
            Ok(format!("        let {name} = self.in_range({place}, {name}, [{low}, {high}]);\n"))
        })
    };
    let begins_again = request.begins_again();
    if begins_again {
        let updates = UpdateFunction::all(interface, (device, request), program);
        *text += &kept::methods(program, interface, updates);
    }
    let again = if begins_again {
        "        if self.is_open() {\n            self.recover();\n        }\n"
    } else {
        ""
    };
    let targets = CallTargets { state: "&mut next", watch: "", constants: "&self.constants" };
    let way = if request.parts > 1 { "advance" } else { "predict" };
    let predict = program.predict.call(way, &targets, &interface.predict);
    let handed = interface.predict.join(", ");
    predicts(text, request, program, (&*predict, &*held(&interface.predict)), interface);
    let mut calls = String::new();
    for update in UpdateFunction::all(interface, (device, request), program) {
        let what = update.description("`");
        let (of, arguments) = (&update.name, update.arguments());
        let watch = format!("&mut self.watch[{}]", update.place);
        let over = CallTargets { state: "&mut next", watch: &watch, constants: "&self.constants" };
        let one = update.routine.call(of, &over, &arguments);
        let corrects = if begins_again && !update.is_event {
            format!(
                "        let mut taken = {};\n        if self.is_open() {{\n            self.keep();\n            self.look_by_{of}({});\n        }}\n        \
                 taken = taken && self.take(&next);\n{again}",
                update.routine.call(&format!("{of}_alone"), &over, &arguments),
                arguments.join(", ")
            )
        } else {
            format!("        let taken = {one} && self.take(&next);\n")
        };
        let _ = write!(
            text,
            "\n    /// {what} True where it was taken; false where it is left out, and nothing has changed.\n    \
             pub fn {of}(&mut self{}) -> bool {{\n{}        let mut next = self.state;\n{corrects}        taken\n    }}\n",
            typed(&arguments),
            held(&update.inputs) + &ranged(&update.measured)?,
        );
        if !update.is_event {
            let _ = writeln!(calls, "        taken &= {one};");
        }
    }
    let all: Vec<String> = interface.step.iter().chain(&interface.measured).cloned().collect();
    let between = if request.update_every > 1 {
        format!(
            "        if self.left > 0 {{\n            self.left -= 1;\n            return self.predict({});\n        }}\n        \
             self.left = UPDATE_EVERY - 1;\n",
            interface.predict.join(", ")
        )
    } else {
        String::new()
    };
    let (goes_on, alone) = if begins_again {
        let goes_on = format!(
            "        if self.is_open() {{\n            self.keep();\n            self.go_on({});\n        }}\n",
            all.join(", ")
        );
        (goes_on, "predicted")
    } else {
        (String::new(), "predict")
    };
    let _ = write!(
        text,
        "\n    /// The prediction and all corrections of one sample. True where all were taken; false where one is left out: a sample that is not a\n    \
         /// number is a gap, and one that is too far from what is expected is none of the signal.\n    \
         pub fn step(&mut self{}) -> bool {{\n{between}{}        let mut next = self.state;\n        let mut taken = true;\n        {predict};\n{calls}{goes_on}        \
         if !self.take(&next) {{\n            // What follows from the measurements is not finite: the prediction alone.\n            \
         let _ = self.{alone}({handed});\n            taken = false;\n        }}\n{again}        taken\n    }}\n",
        typed(&all),
        held(&interface.step) + &ranged(&interface.measured)?
    );
    answers(text, request);
    Ok(())
}

/// What a program asks of a filter.
fn answers(text: &mut String, request: &EmitRequest) {
    let lost = if request.begins_again() { "self.begun > 0 || self.loss.age > 0" } else { "self.begun > 0" };
    let mut arms = String::new();
    if request.has_range() {
        arms += "            SignalStatus::Following | SignalStatus::LeftOut if self.saturated[measurement] > 0 => SignalStatus::Saturated,\n";
    }
    if request.mirrored {
        let _ = writeln!(arms, "            SignalStatus::Following if {lost} => SignalStatus::SignUnsure,");
    }
    let status = if arms.is_empty() {
        "watch.status(&RULES)".to_owned()
    } else {
        format!("match watch.status(&RULES) {{\n{arms}            other => other,\n        }}")
    };
    let _ = write!(
        text,
        "\n    /// How it stands to a measurement; `None` of one that there is not.\n    \
         pub fn status(&self, measurement: usize) -> Option<SignalStatus> {{\n        \
         self.watch.get(measurement).map(|watch| {status})\n    }}\n\n    \
         /// What was last measured of each measurement, minus what was predicted, in SI.\n    \
         pub fn innovations(&self) -> [f32; MEASUREMENTS] {{\n        \
         core::array::from_fn(|k| DEVIATION[k] * self.watch[k].residual)\n    }}\n\n    \
         /// The variances of these by the filter, in SI.\n    pub fn innovation_variances(&self) -> [f32; MEASUREMENTS] {{\n        \
         core::array::from_fn(|k| DEVIATION[k] * DEVIATION[k] * self.watch[k].variance)\n    }}\n"
    );
}

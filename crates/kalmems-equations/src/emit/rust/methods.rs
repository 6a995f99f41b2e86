//! What is around the routines in Rust: start, parameters, and steps that are taken whole or not at all.

use super::{Rust, kind, number, typed};
use crate::device::Device;
use crate::emit::error::EmitError;
use crate::emit::filter::FilterProgram;
use crate::emit::interface::{Interface, UpdateFunction};
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
    let state = format!("State {{ mean: [{}]{triangle} }}", list(mean, widths.mean)?);
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
            configured(text, device, request, program, configure)?;
        }
    }
    // The sum is looked at for what is not a number, to which 32 bits are enough.
    let entry = |of: String, wide: bool| if wide { format!("narrow({of})") } else { of };
    let mut sum: Vec<String> = (0..size).map(|k| entry(format!("state.mean[{k}]"), widths.mean)).collect();
    let entries = 0..covariance.len();
    sum.extend(entries.map(|k| entry(format!("state.covariance[{k}]"), widths.covariance)));
    let _ = write!(
        text,
        "\n    /// Takes over a state where all its numbers are finite.\n    fn take(&mut self, state: &State) -> bool {{\n        \
         let sum = {};\n        if sum - sum == 0.0 {{\n            self.state = *state;\n            return true;\n        }}\n        false\n    }}\n",
        sum.join("\n            + ")
    );
    steps(text, device, request, program, interface);
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

/// The prediction, the corrections and a whole step.
fn steps(
    text: &mut String,
    device: &Device,
    request: &EmitRequest,
    program: &FilterProgram,
    interface: &Interface,
) {
    let over = ("&mut next", "&self.constants");
    let predict = program.predict.call("predict", over, &interface.predict);
    let _ = write!(
        text,
        "\n    /// One interval on. True where it was taken; false where the result would not be finite, and nothing has changed.\n    \
         ///\n{}    pub fn predict(&mut self{}) -> bool {{\n        let mut next = self.state;\n        {predict};\n        \
         self.take(&next)\n    }}\n",
        interface.inputs("    /// "),
        typed(&interface.predict)
    );
    let (mut calls, mut apart) = (String::new(), String::new());
    for update in UpdateFunction::all(interface, (device, request), program) {
        let what = update.description("`");
        let (of, arguments) = (&update.name, update.arguments());
        let one = update.routine.call(of, over, &arguments);
        let says = update.routine.variance.is_some();
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
        if !update.is_event {
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

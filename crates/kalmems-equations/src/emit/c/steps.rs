//! What is around the routines in C99: start, parameters, and steps that are taken whole or not at all.

use super::{C, kind, number};
use crate::device::Device;
use crate::emit::error::EmitError;
use crate::emit::filter::FilterProgram;
use crate::emit::interface::{Interface, UpdateFunction};
use crate::emit::request::EmitRequest;
use std::fmt::Write as _;

/// What is around the routines.
pub(super) fn finish(
    text: &mut String,
    device: &Device,
    request: &EmitRequest,
    program: &FilterProgram,
    interface: &Interface,
) -> Result<(), EmitError> {
    let name = &request.name;
    let size = request.size();
    let (mean, covariance) = &program.start;
    let widths = program.widths;
    // The sum is looked at for what is not a number, to which 32 bits are enough.
    let narrow = |wide: bool| if wide { "(float)" } else { "" };
    let arrays: Vec<String> = (0..size)
        .map(|k| format!("{}state->mean[{k}]", narrow(widths.mean)))
        .chain((0..covariance.len()).map(|k| format!("{}state->covariance[{k}]", narrow(widths.covariance))))
        .collect();
    let _ = write!(
        text,
        "\n/* Takes over a state where all its numbers are finite. */\nWITHIN int take({name}_t *filter, const {name}_state_t *state)\n{{\n    \
         const float sum = {};\n    if (!(sum - sum == 0.0F)) {{\n        return 0;\n    }}\n    filter->state = *state;\n    return 1;\n}}\n",
        arrays.join("\n                      + ")
    );
    if let Some(configure) = &program.configure {
        let written = configure.written(&C)?;
        let _ = write!(text, "\nvoid {name}_default_parameters({name}_parameters_t *parameters)\n{{\n");
        for (field, _, value) in Interface::parameters(device, request, program) {
            let _ = writeln!(text, "    parameters->{field} = {value:?};");
        }
        let _ = write!(
            text,
            "}}\n\nint {name}_configure({name}_t *filter, const {name}_parameters_t *parameters)\n{{\n"
        );
        let count = configure.outputs.len();
        let names = configure.names();
        for (field, _, _) in Interface::parameters(device, request, program) {
            if names.contains(&field) {
                let _ = writeln!(text, "    const double {field} = parameters->{field};");
            }
        }
        if names.is_empty() {
            text.push_str("    (void)parameters;\n");
        }
        let of_constants = kind(widths.constants);
        let _ =
            writeln!(text, "    {of_constants} constants[{}], sum = 0.0F;\n    unsigned k;", count.max(1));
        for statement in &written.statements {
            let _ = writeln!(text, "    {statement}");
        }
        for (_, place, value) in &written.outputs {
            let _ = writeln!(text, "    constants[{place}] = {value};");
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
    for (array, values, wide) in [("mean", mean, widths.mean), ("covariance", covariance, widths.covariance)]
    {
        for (k, value) in values.iter().enumerate() {
            let _ = writeln!(text, "    filter->state.{array}[{k}] = {};", number(*value, wide)?);
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
    let value = "ORIGIN[state] + UNIT[state] * filter->state.mean[state]";
    let value = if widths.mean { format!("(float)({value})") } else { value.to_owned() };
    let _ = write!(
        text,
        "\nfloat {name}_value(const {name}_t *filter, unsigned state)\n{{\n    \
         return state < {size}U ? {value} : 0.0F;\n}}\n"
    );
    if !covariance.is_empty() {
        let variance = "UNIT[state] * UNIT[state] * filter->state.covariance[state * (state + 3U) / 2U]";
        let variance = if widths.covariance { format!("(float)({variance})") } else { variance.to_owned() };
        let _ = write!(
            text,
            "\nfloat {name}_variance(const {name}_t *filter, unsigned state)\n{{\n    return state < {size}U\n               \
             ? {variance}\n               : 0.0F;\n}}\n"
        );
    }
    Ok(())
}

/// The functions that predict and correct, each whole or not at all.
fn steps(
    text: &mut String,
    device: &Device,
    request: &EmitRequest,
    program: &FilterProgram,
    interface: &Interface,
) {
    let name = &request.name;
    let over = ("&next", "filter->constants");
    let predict = program.predict.call("predict", over, &interface.predict);
    let _ = write!(
        text,
        "\nint {name}_predict({})\n{{\n    {name}_state_t next = filter->state;\n    {predict};\n    return take(filter, &next);\n}}\n",
        Interface::arguments(name, &interface.predict, &[])
    );
    let (mut calls, mut apart) = (Vec::new(), Vec::new());
    for update in UpdateFunction::all(interface, (device, request), program) {
        let (of, arguments) = (&update.name, update.arguments());
        let one = update.routine.call(of, over, &arguments);
        let says = update.routine.variance.is_some();
        let taken = if says {
            format!("    return {one} && take(filter, &next);\n")
        } else {
            format!("    {one};\n    return take(filter, &next);\n")
        };
        let _ = write!(
            text,
            "\nint {name}_{of}({})\n{{\n    {name}_state_t next = filter->state;\n{taken}}}\n",
            Interface::arguments(name, &update.inputs, &update.measured)
        );
        if !update.is_event {
            calls.push((one, says));
            let all: Vec<String> = ["filter".to_owned()].into_iter().chain(arguments).collect();
            apart.push(format!("{name}_{of}({})", all.join(", ")));
        }
    }
    let _ = write!(
        text,
        "\nint {name}_step({})\n{{\n    {name}_state_t next = filter->state;\n    int taken = 1;\n    {predict};\n",
        Interface::arguments(name, &interface.step, &interface.measured)
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

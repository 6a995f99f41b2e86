//! What is around the routines in C99: start, parameters, and steps that are taken whole or not at all.

use super::{accessors, float, kind, loss, number, parameters};
use crate::device::Device;
use crate::emit::accessors::state_accesses;
use crate::emit::error::EmitError;
use crate::emit::filter::FilterProgram;
use crate::emit::interface::{CallTargets, Interface, UpdateFunction, further};
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
    let (covariance, widths) = (&program.start.1, program.widths);
    // The sum is looked at for what is not a number, to which 32 bits are enough.
    let narrow = |wide: bool| if wide { "(float)" } else { "" };
    let arrays: Vec<String> = (0..size)
        .map(|k| format!("{}state->mean[{k}]", narrow(widths.mean)))
        .chain((0..covariance.len()).map(|k| format!("{}state->covariance[{k}]", narrow(widths.covariance))))
        .collect();
    let _ = write!(
        text,
        "\n/* Whether all numbers of a state are finite. */\nWITHIN int is_finite(const {name}_state_t *state)\n{{\n    const float sum = {};\n    \
         return sum - sum == 0.0F;\n}}\n\n/* Takes over a state where all its numbers are finite. */\n\
         WITHIN int take({name}_t *filter, const {name}_state_t *state)\n{{\n    if (!is_finite(state)) {{\n        return 0;\n    }}\n    \
         filter->state = *state;\n    return 1;\n}}\n",
        arrays.join("\n                      + ")
    );
    if let Some(configure) = &program.configure {
        parameters::functions(text, (device, request, program), configure)?;
    }
    start(text, request, program, interface)?;
    steps(text, device, request, program, interface)?;
    answers(text, request, program);
    accessors::functions(text, request, program, &state_accesses(device, request, program))
}

/// Where a filter starts.
fn start(
    text: &mut String,
    request: &EmitRequest,
    program: &FilterProgram,
    interface: &Interface,
) -> Result<(), EmitError> {
    let (name, widths) = (&request.name, program.widths);
    let (mean, covariance) = &program.start;
    let _ =
        write!(text, "\n/* The first state. */\nWITHIN void first({name}_t *filter)\n{{\n    unsigned k;\n");
    for (array, values, wide) in [("mean", mean, widths.mean), ("covariance", covariance, widths.covariance)]
    {
        for (k, value) in values.iter().enumerate() {
            let _ = writeln!(text, "    filter->state.{array}[{k}] = {};", number(*value, wide)?);
        }
    }
    let upper = name.to_uppercase();
    if request.update_every > 1 {
        text.push_str("    filter->left = 0U;\n");
    }
    let _ = write!(
        text,
        "    for (k = 0U; k < {upper}_MEASUREMENTS; k++) {{\n        filter->watch[k] = FRESH;\n    }}\n}}\n\n\
         void {name}_start({name}_t *filter)\n{{\n{}",
        if interface.step.is_empty() { "" } else { "    unsigned k;\n" }
    );
    if program.configure.is_some() {
        let _ = writeln!(text, "    {name}_parameters_t parameters;");
    }
    text.push_str("    first(filter);\n    filter->begun = 0U;\n");
    if request.has_range() {
        (0..request.measures.len()).for_each(|k| {
            let _ = writeln!(text, "    filter->saturated[{k}] = 0U;");
        });
    }
    if request.begins_again() {
        text.push_str(
            "    filter->kept.state = filter->state;\n    filter->kept.age = 0U;\n    filter->kept.agrees = 0U;\n    \
             filter->kept.alike = 0U;\n    filter->kept.tries = 0U;\n",
        );
    }
    if !interface.step.is_empty() {
        let _ = write!(
            text,
            "    for (k = 0U; k < {}U; k++) {{\n        filter->inputs[k] = 0.0F;\n    }}\n    filter->missing = 0U;\n",
            interface.step.len()
        );
    }
    if program.configure.is_some() {
        let _ = write!(
            text,
            "    {name}_default_parameters(&parameters);\n    (void){name}_configure(filter, &parameters);\n"
        );
    }
    text.push_str("}\n");
    Ok(())
}

/// What a program asks of a filter.
fn answers(text: &mut String, request: &EmitRequest, program: &FilterProgram) {
    let (name, upper, size, widths) =
        (&request.name, request.name.to_uppercase(), request.size(), program.widths);
    let rules = request.watch_rules();
    let starting = if rules.settling == 0 {
        String::new()
    } else {
        format!("    if (watch->seen < {}U) {{\n        return {upper}_STARTING;\n    }}\n", rules.settling)
    };
    let unsure = if request.mirrored {
        format!(
            "    if ({} > 0U && watch->since == 0U) {{\n        return {upper}_SIGN_UNSURE;\n    }}\n",
            if request.begins_again() { "(filter->kept.age | filter->begun)" } else { "filter->begun" }
        )
    } else {
        String::new()
    };
    let saturated = if request.has_range() {
        format!(
            "    if (filter->saturated[measurement < {upper}_MEASUREMENTS ? measurement : 0U] > 0U) {{\n        return {upper}_SATURATED;\n    }}\n"
        )
    } else {
        String::new()
    };
    let _ = write!(
        text,
        "\n{name}_status_t {name}_status(const {name}_t *filter, unsigned measurement)\n{{\n    \
         const {name}_watch_t *const watch = &filter->watch[measurement < {upper}_MEASUREMENTS ? measurement : 0U];\n{starting}    \
         if (watch->open > 0U) {{\n        return {upper}_LOST;\n    }}\n    \
         if (watch->median > 4.0F * MEDIAN) {{\n        return {upper}_OVERCONFIDENT;\n    }}\n{saturated}{unsure}    \
         return watch->since > 0U ? {upper}_LEFT_OUT : {upper}_FOLLOWING;\n}}\n\n\
         float {name}_innovation(const {name}_t *filter, unsigned measurement)\n{{\n    \
         return measurement < {upper}_MEASUREMENTS ? DEVIATION[measurement] * filter->watch[measurement].residual : nothing();\n}}\n\n\
         float {name}_innovation_variance(const {name}_t *filter, unsigned measurement)\n{{\n    return measurement < {upper}_MEASUREMENTS\n               \
         ? DEVIATION[measurement] * DEVIATION[measurement] * filter->watch[measurement].variance\n               : nothing();\n}}\n\n\
         float {name}_nis(const {name}_t *filter, unsigned measurement)\n{{\n    \
         return measurement < {upper}_MEASUREMENTS ? filter->watch[measurement].nis : nothing();\n}}\n\n\
         unsigned {name}_since(const {name}_t *filter, unsigned measurement)\n{{\n    \
         return measurement < {upper}_MEASUREMENTS ? filter->watch[measurement].since : 0U;\n}}\n"
    );
    let value = if widths.mean {
        "(float)((double)ORIGIN[state] + (double)UNIT[state] * filter->state.mean[state])"
    } else {
        "ORIGIN[state] + UNIT[state] * filter->state.mean[state]"
    };
    let _ = write!(
        text,
        "\nfloat {name}_value(const {name}_t *filter, unsigned state)\n{{\n    \
         return state < {size}U ? {value} : nothing();\n}}\n"
    );
    if !program.start.1.is_empty() {
        let unit = if widths.covariance { "(double)" } else { "" };
        let variance = format!(
            "{unit}(UNIT[state] * UNIT[state]) * filter->state.covariance[state * (state + 3U) / 2U]"
        );
        let variance = if widths.covariance { format!("(float)({variance})") } else { variance };
        let _ = write!(
            text,
            "\nfloat {name}_variance(const {name}_t *filter, unsigned state)\n{{\n    return state < {size}U\n               \
             ? {variance}\n               : nothing();\n}}\n"
        );
    }
}

/// What goes over the interval between samples in several steps.
fn within(
    text: &mut String,
    device: &Device,
    request: &EmitRequest,
    program: &FilterProgram,
    interface: &Interface,
) -> Result<(), EmitError> {
    let name = &request.name;
    if request.parts > 1 {
        let length = (request.parts as f64).recip();
        let arguments = interface.part_arguments(device, program, length, float)?;
        let asks_where = arguments.iter().any(|argument| argument.contains("from"));
        if asks_where {
            *text += "\n/* A number between those at the start, the middle and the end, by a parabola. */\n\
                      WITHIN float between(float start, float middle, float end, float place)\n{\n    \
                      return start + place * (4.0F * middle - 3.0F * start - end + 2.0F * place * (start - 2.0F * middle + end));\n}\n";
        }
        let constants = if program.predict.reads_constants() {
            format!(", const {} *constants", kind(program.widths.constants))
        } else {
            String::new()
        };
        let from = format!("        const float from = (float)part * {};\n", float(length)?);
        let targets = CallTargets { state: "state", watch: "", constants: "constants" };
        let _ = write!(
            text,
            "\n/* The interval between samples, in steps. */\nWITHIN void advance({name}_state_t *state{constants}{})\n{{\n    \
             unsigned part;\n    for (part = 0U; part < {}U; part++) {{\n{}        {};\n    }}\n}}\n",
            further(&interface.predict, "float ", ""),
            request.parts,
            if asks_where { &from } else { "" },
            program.predict.call("predict", &targets, &arguments)
        );
    }
    Ok(())
}

/// What is made of the numbers that a function is given.
fn given(text: &mut String, request: &EmitRequest, interface: &Interface) {
    let name = &request.name;
    if !interface.step.is_empty() {
        let _ = write!(
            text,
            "\n/* An input; where it is not a number, the last one that was: time goes on. */\n\
             WITHIN float held({name}_t *filter, unsigned place, float input)\n{{\n    if (input - input == 0.0F) {{\n        \
             filter->inputs[place] = input;\n    }} else if (filter->missing + 1U != 0U) {{\n        filter->missing++;\n    }}\n    \
             return filter->inputs[place];\n}}\n"
        );
    }
    if request.has_range() {
        let _ = write!(
            text,
            "\n/* A sample; at an end of its range or beyond, it is a gap. */\n\
             WITHIN float in_range({name}_t *filter, unsigned measurement, float value, float low, float high)\n{{\n    \
             if (!(value <= low || value >= high)) {{\n        filter->saturated[measurement] = 0U;\n        return value;\n    }}\n    \
             if (filter->saturated[measurement] + 1U != 0U) {{\n        filter->saturated[measurement]++;\n    }}\n    return nothing();\n}}\n"
        );
    }
}

/// The prediction over an interval; `held` are the statements before it.
fn predicts(
    text: &mut String,
    request: &EmitRequest,
    program: &FilterProgram,
    (predict, held_first): (&str, &str),
    interface: &Interface,
) {
    let (name, handed) = (&request.name, further(&interface.predict, "", ""));
    let declared = Interface::arguments(name, &interface.predict, &[]);
    let _ = if request.begins_again() {
        let kept = CallTargets { state: "&filter->kept.state", watch: "", constants: "filter->constants" };
        let kept = program.predict.call("predict_alone", &kept, &interface.predict);
        write!(
            text,
            "\nint {name}_predict({declared})\n{{\n{held_first}    if (is_kept(filter)) {{\n        {kept};\n    }}\n    \
             return predicted(filter{handed});\n}}\n"
        )
    } else {
        write!(
            text,
            "\nint {name}_predict({declared})\n{{\n    {name}_state_t next = filter->state;\n{held_first}    {predict};\n    \
             if (take(filter, &next)) {{\n        return 1;\n    }}\n    restart(filter);\n    return 0;\n}}\n"
        )
    };
}

/// The functions that predict and correct, each whole or not at all.
fn steps(
    text: &mut String,
    device: &Device,
    request: &EmitRequest,
    program: &FilterProgram,
    interface: &Interface,
) -> Result<(), EmitError> {
    let name = &request.name;
    *text += &loss::restart(request);
    given(text, request, interface);
    let ranged = |measured: &[String]| {
        interface.ranged(request, measured, |name, place, [low, high]| {
            let (low, high) = (float(low)?, float(high)?);
            Ok(format!("    {name} = in_range(filter, {place}U, {name}, {low}, {high});\n"))
        })
    };
    within(text, device, request, program, interface)?;
    let held = |inputs: &[String]| {
        interface.held(inputs, |name, place| format!("    {name} = held(filter, {place}U, {name});\n"))
    };
    let begins_again = request.begins_again();
    if begins_again {
        let updates = UpdateFunction::all(interface, (device, request), program);
        *text += &loss::functions(request, program, interface, updates);
    }
    let again =
        if begins_again { "    if (is_open(filter)) {\n        recover(filter);\n    }\n" } else { "" };
    let targets = CallTargets { state: "&next", watch: "", constants: "filter->constants" };
    let way = if request.parts > 1 { "advance" } else { "predict" };
    let predict = program.predict.call(way, &targets, &interface.predict);
    let handed = further(&interface.predict, "", "");
    predicts(text, request, program, (&*predict, &*held(&interface.predict)), interface);
    let mut calls = Vec::new();
    for update in UpdateFunction::all(interface, (device, request), program) {
        let of = &update.name;
        let watch = format!("&filter->watch[{}]", update.place);
        let over = CallTargets { state: "&next", watch: &watch, constants: "filter->constants" };
        let arguments = update.arguments();
        let one = update.routine.call(of, &over, &arguments);
        let corrects = if begins_again && !update.is_event {
            let alone = update.routine.call(&format!("{of}_alone"), &over, &arguments);
            format!(
                "    taken = {alone};\n    if (is_open(filter)) {{\n        keep(filter);\n        look_by_{of}(filter{});\n    }}\n    \
                 taken = taken && take(filter, &next);\n{again}",
                further(&arguments, "", "")
            )
        } else {
            format!("    taken = {one} && take(filter, &next);\n")
        };
        let _ = write!(
            text,
            "\nint {name}_{of}({})\n{{\n    {name}_state_t next = filter->state;\n    int taken;\n{}{corrects}    return taken;\n}}\n",
            Interface::arguments(name, &update.inputs, &update.measured),
            held(&update.inputs) + &ranged(&update.measured)?,
        );
        if !update.is_event {
            calls.push(one);
        }
    }
    let between = if request.update_every > 1 {
        let every = format!("{}_UPDATE_EVERY", name.to_uppercase());
        format!(
            "    if (filter->left > 0U) {{\n        filter->left--;\n        return {name}_predict(filter{handed});\n    }}\n    filter->left = {every} - 1U;\n"
        )
    } else {
        String::new()
    };
    let _ = write!(
        text,
        "\nint {name}_step({})\n{{\n    {name}_state_t next = filter->state;\n    int taken = 1;\n{between}{}    {predict};\n",
        Interface::arguments(name, &interface.step, &interface.measured),
        held(&interface.step) + &ranged(&interface.measured)?
    );
    for one in calls {
        let _ = writeln!(text, "    taken &= {one};");
    }
    let (goes_on, alone) = if begins_again {
        let all = further(interface.step.iter().chain(&interface.measured), "", "");
        let goes_on = format!(
            "    if (is_open(filter)) {{\n        keep(filter);\n        go_on(filter{all});\n    }}\n"
        );
        (goes_on, "predicted".to_owned())
    } else {
        (String::new(), format!("{name}_predict"))
    };
    let _ = write!(
        text,
        "{goes_on}    if (!take(filter, &next)) {{\n        /* What follows from the measurements is not finite: the prediction alone. */\n        \
         (void){alone}(filter{handed});\n        taken = 0;\n    }}\n{again}    return taken;\n}}\n"
    );
    Ok(())
}

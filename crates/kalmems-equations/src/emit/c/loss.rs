//! What a filter in C99 does once it has lost its signal or its numbers.

use super::kind;
use crate::emit::filter::FilterProgram;
use crate::emit::interface::{CallTargets, Interface, UpdateFunction, further};
use crate::emit::request::EmitRequest;
use std::fmt::Write as _;

/// How it begins again.
pub(super) fn restart(request: &EmitRequest) -> String {
    let (name, upper) = (&request.name, request.name.to_uppercase());
    if !request.begins_again() {
        return format!(
            "\n/* Begins again as at the start, and counts it. */\nWITHIN void restart({name}_t *filter)\n{{\n    first(filter);\n    filter->begun++;\n}}\n"
        );
    }
    let rules = request.watch_rules();
    format!(
        "\n/* Begins again: in turn with the means that it has kept and the covariance of the start, and as at the start. */\n\
         static void restart({name}_t *filter)\n{{\n    unsigned k;\n    first(filter);\n    \
         if (!(filter->kept.age > 0U && filter->kept.age < {longest}U && is_finite(&filter->kept.state))) {{\n        filter->kept.age = 0U;\n        \
         filter->begun++;\n        return;\n    }}\n    filter->kept.age++;\n    filter->kept.tries++;\n    \
         if (filter->kept.tries % 2U == 0U) {{\n        return;\n    }}\n    for (k = 0U; k < {upper}_STATES; k++) {{\n        \
         filter->state.mean[k] = filter->kept.state.mean[k];\n    }}\n    for (k = 0U; k < {upper}_MEASUREMENTS; k++) {{\n        \
         filter->watch[k].seen = {settling}U;\n        filter->watch[k].open = 1U;\n        filter->watch[k].beyond = 0.07F;\n    }}\n}}\n",
        longest = rules.longest(),
        settling = rules.settling
    )
}

/// The functions that go on with what is kept, and those that it shares with the filter.
pub(super) fn functions<'p>(
    request: &EmitRequest,
    program: &FilterProgram,
    interface: &Interface,
    updates: impl Iterator<Item = UpdateFunction<'p>>,
) -> String {
    let name = &request.name;
    let over = |state, watch| CallTargets { state, watch, constants: "filter->constants" };
    let inner = CallTargets { state: "state", watch: "watch", constants: "constants" };
    let constants = format!(", const {} *constants", kind(program.widths.constants));
    let way = if request.parts > 1 { "advance" } else { "predict" };
    let mut text = request.loss_functions();
    let _ = write!(
        text,
        "\n/* The prediction of the filter or of what it has kept. */\nstatic void predict_alone({name}_state_t *state{}{})\n{{\n    {};\n}}\n",
        if program.predict.reads_constants() { &constants } else { "" },
        further(&interface.predict, "float ", ""),
        program.predict.call(way, &inner, &interface.predict)
    );
    let mut looks = String::new();
    for update in updates.filter(|update| !update.is_event) {
        let (of, routine, arguments) = (&update.name, update.routine, update.arguments());
        let alone = format!("{of}_alone");
        let _ = write!(
            text,
            "\nstatic int {alone}({name}_state_t *state, {name}_watch_t *watch{}{})\n{{\n    return {};\n}}\n\n\
             static void look_by_{of}({name}_t *filter{})\n{{\n    {name}_watch_t look = look_of(filter);\n    if (is_kept(filter)) {{\n        \
             (void){};\n        looked(filter, &look);\n    }}\n}}\n",
            if routine.reads_constants() { &constants } else { "" },
            further(&arguments, "float ", ""),
            routine.call(of, &inner, &arguments),
            further(&arguments, "float ", ""),
            routine.call(&alone, &over("&filter->kept.state", "&look"), &arguments)
        );
        let _ = writeln!(looks, "    look_by_{of}(filter{});", further(&arguments, "", ""));
    }
    let _ = write!(
        text,
        "\n/* Goes on with what is kept by a sample. */\nstatic void go_on({})\n{{\n    if (is_kept(filter)) {{\n        {};\n    }}\n{looks}}}\n\n\
         /* One interval on. */\nstatic int predicted({})\n{{\n    {name}_state_t next = filter->state;\n    {};\n    if (take(filter, &next)) {{\n        \
         return 1;\n    }}\n    restart(filter);\n    return 0;\n}}\n",
        Interface::arguments(name, &interface.step, &interface.measured),
        program.predict.call("predict_alone", &over("&filter->kept.state", ""), &interface.predict),
        Interface::arguments(name, &interface.predict, &[]),
        program.predict.call("predict_alone", &over("&next", ""), &interface.predict)
    );
    text
}

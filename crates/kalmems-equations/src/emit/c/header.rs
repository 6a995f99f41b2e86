//! The header in C99.

use super::{accessors, comment, float, kind};
use crate::device::Device;
use crate::emit::accessors::state_accesses;
use crate::emit::crc;
use crate::emit::error::EmitError;
use crate::emit::filter::FilterProgram;
use crate::emit::interface::{Interface, UpdateFunction};
use crate::emit::request::{EmitGain, EmitRequest};
use std::fmt::Write as _;

/// The header.
pub(super) fn header(
    device: &Device,
    request: &EmitRequest,
    program: &FilterProgram,
    interface: &Interface,
) -> Result<String, EmitError> {
    let (name, upper) = (&request.name, request.name.to_uppercase());
    let size = request.size();
    let mut text = comment(&interface.heading);
    let _ = write!(
        text,
        "#ifndef {upper}_H\n#define {upper}_H\n\n{}#ifdef __cplusplus\nextern \"C\" {{\n#endif\n\n\
         /* How many states there are:\n{} */\n#define {upper}_STATES {size}U\n\n\
         /* The sampling interval in s. */\n#define {upper}_INTERVAL_S {}\n\n\
         /* How many measurements correct it. */\n#define {upper}_MEASUREMENTS {}U\n\n\
         /* A step corrects by one sample in so many. */\n#define {upper}_UPDATE_EVERY {}U\n\n",
        if program.configure.is_some() { "#include <stdint.h>\n\n" } else { "" },
        interface.states(" * "),
        float(request.sampling_interval_s())?,
        request.measures.len(),
        request.update_every
    );
    let states = state_accesses(device, request, program);
    text += &accessors::places(request, &states);
    types(&mut text, (device, request), program, interface.step.len());
    if program.configure.is_some() {
        let _ = write!(
            text,
            "/* The parameters of the device, sealed. */\nvoid {name}_default_parameters({name}_parameters_t *parameters);\n\n\
             /* Writes version, experiment and checksum, before parameters that have changed go to a memory. */\n\
             void {name}_seal_parameters({name}_parameters_t *parameters);\n\n\
             /* Whether parameters from a memory are as they were sealed, and of this list and experiment. */\n\
             int {name}_parameters_are_whole(const {name}_parameters_t *parameters);\n\n\
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
        "/*\n * One interval on. An input that is not a number is taken for the last one that was. 1 where it was taken; 0 where the result would not be\n \
         * finite, and the filter has begun again.\n{} */\n\
         int {name}_predict({});\n\n",
        interface.inputs(" * "),
        Interface::arguments(name, &interface.predict, &[])
    );
    for update in UpdateFunction::all(interface, (device, request), program) {
        let what = update.description("");
        let _ = write!(
            text,
            "/* {what} 1 where it was taken; 0 where it is refused, and nothing has changed. */\n\
             int {name}_{}({});\n\n",
            update.name,
            Interface::arguments(name, &update.inputs, &update.measured)
        );
    }
    let again = if request.begins_again() {
        " * Where too many samples are none of the signal, it takes them all, and keeps its state from before: it goes on from that if that predicts the\n \
         * signal again. If it stays lost, it begins again, in turn with the means that it has kept and as at the start.\n"
    } else {
        ""
    };
    let _ = write!(
        text,
        "/*\n * The prediction and all corrections of one sample. 1 where all were taken; 0 where one is left out: a sample that is not a number is a\n \
         * gap, and one that is too far from what is expected is none of the signal.\n{again} */\nint {name}_step({});\n\n\
         /* How it stands to a measurement, the first of which is 0. */\n{name}_status_t {name}_status(const {name}_t *filter, unsigned measurement);\n\n\
         /* What was last measured of it, minus what was predicted, in SI. Not a number of a measurement that there is not. */\n\
         float {name}_innovation(const {name}_t *filter, unsigned measurement);\n\n\
         /* The variance of that by the filter, in SI. */\nfloat {name}_innovation_variance(const {name}_t *filter, unsigned measurement);\n\n\
         /* The normalised innovation squared; its mean is 1 of a consistent filter. */\nfloat {name}_nis(const {name}_t *filter, unsigned measurement);\n\n\
         /* Samples since the last one that was taken. */\nunsigned {name}_since(const {name}_t *filter, unsigned measurement);\n\n\
         /* The mean of a state in SI. Not a number of a state that there is not. */\nfloat {name}_value(const {name}_t *filter, unsigned state);\n\n",
        Interface::arguments(name, &interface.step, &interface.measured)
    );
    text += &accessors::declarations(request, program, &states);
    if request.gain == EmitGain::Covariance {
        let _ = write!(
            text,
            "/* The variance of a state in SI. */\nfloat {name}_variance(const {name}_t *filter, unsigned state);\n\n"
        );
    }
    text += "#ifdef __cplusplus\n}\n#endif\n\n#endif\n";
    Ok(documented(&text))
}

/// Comments as Doxygen reads them: of what follows, or of what stands before in their line.
fn documented(text: &str) -> String {
    let mut lines: Vec<String> = Vec::new();
    for line in text.lines() {
        lines.push(match line.split_once("/*") {
            Some(("", rest)) if lines.is_empty() => format!("/**\n * @file{rest}"),
            Some((before, rest)) if before.trim().is_empty() => format!("{before}/**{rest}"),
            Some((before, rest)) => format!("{before}/**<{rest}"),
            None => line.to_owned(),
        });
    }
    lines.join("\n") + "\n"
}

/// The types of a filter.
fn types(
    text: &mut String,
    (device, request): (&Device, &EmitRequest),
    program: &FilterProgram,
    inputs: usize,
) {
    let (name, upper, size) = (&request.name, request.name.to_uppercase(), request.size());
    let _ = write!(
        text,
        "/* What is estimated, each state in its unit. */\ntypedef struct {{\n    {} mean[{size}];\n",
        kind(program.widths.mean)
    );
    if request.gain == EmitGain::Covariance {
        let entries = size * (size + 1) / 2;
        let of = kind(program.widths.covariance);
        let _ = writeln!(text, "    {of} covariance[{entries}]; /* the lower triangle, row by row */");
    }
    let _ = write!(text, "}} {name}_state_t;\n\n");
    if program.configure.is_some() {
        let _ = writeln!(
            text,
            "/* What the names of the parameters are known by, and the experiment. */\n#define {upper}_PARAMETERS_VERSION 0x{:08X}U\n\
             #define {upper}_EXPERIMENT 0x{:08X}U\n\n\
             /* Parameters that may change while the program runs, in SI, and what tells whether they are whole. */\ntypedef struct {{\n    \
             uint32_t version;\n    uint32_t experiment;",
            crc::version(
                &Interface::parameters(device, request, program)
                    .into_iter()
                    .map(|(field, ..)| field)
                    .collect::<Vec<_>>()
            ),
            request.experiment
        );
        for (field, unit, _) in Interface::parameters(device, request, program) {
            let _ = writeln!(text, "    double {field}; /* {} */", unit.replace("*/", "* /"));
        }
        let _ = write!(text, "    uint32_t crc; /* of all before it */\n}} {name}_parameters_t;\n\n");
    }
    *text += &request.watch_types();
    *text += &request.kept_type();
    let _ = write!(
        text,
        "typedef struct {{\n    {name}_state_t state;\n    {name}_watch_t watch[{upper}_MEASUREMENTS];\n    \
         unsigned begun; /* how often it has lost its signal or its numbers, and what it knew of the motion */\n{}{}",
        (if request.begins_again() { format!("    {name}_kept_t kept;\n") } else { String::new() })
            + &if request.has_range() {
                format!(
                    "    unsigned saturated[{upper}_MEASUREMENTS]; /* samples in a row at an end of the range */\n"
                )
            } else {
                String::new()
            },
        if request.update_every > 1 {
            "    unsigned left; /* samples until the next correction */\n"
        } else {
            ""
        }
    );
    if let Some(configure) = &program.configure {
        let count = configure.outputs.len().max(1);
        let of = kind(program.widths.constants);
        let _ = writeln!(text, "    {of} constants[{count}]; /* what follows from the parameters */");
    }
    if inputs > 0 {
        let _ = write!(
            text,
            "    float inputs[{inputs}]; /* the last that were numbers */\n    unsigned missing; /* how many were none */\n"
        );
    }
    let _ = write!(text, "}} {name}_t;\n\n");
}

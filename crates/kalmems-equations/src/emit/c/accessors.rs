//! The states by names in C99.

use super::{kind, number};
use crate::emit::accessors::StateAccess;
use crate::emit::error::EmitError;
use crate::emit::filter::FilterProgram;
use crate::emit::request::EmitRequest;
use std::fmt::Write as _;

/// The enumeration of their places.
pub(super) fn places(request: &EmitRequest, states: &[StateAccess]) -> String {
    let upper = request.name.to_uppercase();
    let places: Vec<String> = states.iter().map(|state| format!("    {upper}_{}", state.constant)).collect();
    format!("/* The place of each state. */\nenum {{\n{}\n}};\n\n", places.join(",\n"))
}

/// The declarations of the functions.
pub(super) fn declarations(request: &EmitRequest, program: &FilterProgram, states: &[StateAccess]) -> String {
    let (name, of) = (&request.name, kind(program.widths.mean));
    let mut text = String::new();
    for StateAccess { function, argument, what, .. } in states {
        let _ = write!(
            text,
            "/* The mean of {what}. */\n{of} {name}_{function}(const {name}_t *filter);\n\n\
             /* Takes a mean of {what}, and leaves the covariance as it is. */\nvoid {name}_set_{function}({name}_t *filter, {of} {argument});\n\n"
        );
    }
    text
}

/// The functions that read and write their means in SI.
pub(super) fn functions(
    text: &mut String,
    request: &EmitRequest,
    program: &FilterProgram,
    states: &[StateAccess],
) -> Result<(), EmitError> {
    let (name, upper, wide) = (&request.name, request.name.to_uppercase(), program.widths.mean);
    let of = kind(wide);
    for StateAccess { constant, function, argument, scale, origin, .. } in states {
        let mean = format!("filter->state.mean[{upper}_{constant}]");
        let (scale, from) = (number(*scale, wide)?, number(*origin, wide)?);
        let [value, kept] = if *origin == 0.0 {
            [format!("{scale} * {mean}"), format!("{argument} / {scale}")]
        } else {
            [format!("{from} + {scale} * {mean}"), format!("({argument} - {from}) / {scale}")]
        };
        let _ = write!(
            text,
            "\n{of} {name}_{function}(const {name}_t *filter)\n{{\n    return {value};\n}}\n\n\
             void {name}_set_{function}({name}_t *filter, {of} {argument})\n{{\n    {mean} = {kept};\n}}\n"
        );
    }
    Ok(())
}

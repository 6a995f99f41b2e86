//! Parameters that a program may change, in C99.

use super::{C, kind};
use crate::device::Device;
use crate::emit::crc;
use crate::emit::error::EmitError;
use crate::emit::filter::FilterProgram;
use crate::emit::interface::Interface;
use crate::emit::request::EmitRequest;
use crate::emit::routine::Routine;
use std::fmt::Write as _;

/// The functions around them.
pub(super) fn functions(
    text: &mut String,
    (device, request, program): (&Device, &EmitRequest, &FilterProgram),
    configure: &Routine,
) -> Result<(), EmitError> {
    let (name, widths) = (&request.name, program.widths);
    let written = configure.written(&C)?;
    *text += &crc::IN_C.replace("@name@", name).replace("@NAME@", &name.to_uppercase());
    let _ = write!(text, "\nvoid {name}_default_parameters({name}_parameters_t *parameters)\n{{\n");
    for (field, _, value) in Interface::parameters(device, request, program) {
        let _ = writeln!(text, "    parameters->{field} = {value:?};");
    }
    let _ = writeln!(text, "    {name}_seal_parameters(parameters);");
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
    let _ = writeln!(
        text,
        "    {of_constants} constants[{}];\n    float sum = 0.0F;\n    unsigned k;",
        count.max(1)
    );
    for statement in &written.statements {
        let _ = writeln!(text, "    {statement}");
    }
    for (_, place, value) in &written.outputs {
        let _ = writeln!(text, "    constants[{place}] = {value};");
    }
    let _ = write!(
        text,
        "    for (k = 0; k < {count}U; k++) {{\n        sum += (float)constants[k];\n    }}\n    if (!(sum - sum == 0.0F)) {{\n        return 0;\n    }}\n    \
         for (k = 0; k < {count}U; k++) {{\n        filter->constants[k] = constants[k];\n    }}\n    return 1;\n}}\n"
    );
    Ok(())
}

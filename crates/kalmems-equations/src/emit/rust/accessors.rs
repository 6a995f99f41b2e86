//! The states by names in Rust.

use super::{kind, number};
use crate::emit::accessors::StateAccess;
use crate::emit::error::EmitError;
use crate::emit::filter::FilterProgram;
use std::fmt::Write as _;

/// Their places, and the functions that read and write their means.
pub(super) fn methods(
    text: &mut String,
    program: &FilterProgram,
    states: &[StateAccess],
) -> Result<(), EmitError> {
    let wide = program.widths.mean;
    let of = kind(wide);
    for (place, StateAccess { constant, function, argument, what, scale, origin }) in
        states.iter().enumerate()
    {
        let mean = format!("self.state.mean[Self::{constant}]");
        let (scale, from) = (number(*scale, wide)?, number(*origin, wide)?);
        let [value, kept] = if *origin == 0.0 {
            [format!("{scale} * {mean}"), format!("{argument} / {scale}")]
        } else {
            [format!("{from} + {scale} * {mean}"), format!("({argument} - {from}) / {scale}")]
        };
        let _ = write!(
            text,
            "\n    /// The place of {what}.\n    pub const {constant}: usize = {place};\n\n    /// The mean of {what}.\n    \
             pub fn {function}(&self) -> {of} {{\n        {value}\n    }}\n\n    \
             /// Takes a mean of {what}, and leaves the covariance as it is.\n    \
             pub fn set_{function}(&mut self, {argument}: {of}) {{\n        {mean} = {kept};\n    }}\n"
        );
    }
    Ok(())
}

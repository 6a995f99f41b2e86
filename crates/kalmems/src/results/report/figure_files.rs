//! Figures among the files of a result.

use kalmems_figures::{Figure, ReportError};
use kalmems_store::{Output, OutputError};

/// Writes the files of a figure into a result.
pub fn write_figure<E: From<OutputError> + From<ReportError>>(
    output: &Output,
    figure: &Figure,
) -> Result<(), E> {
    figure.files(|name, content| Ok(output.write(name, |w| w.write_all(content))?))
}

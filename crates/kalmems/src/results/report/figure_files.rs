//! Figures among the files of a result.

use kalmems_figures::Figure;
use kalmems_store::{Output, OutputError};

/// Writes the files of a figure into a result.
pub fn write_figure(output: &Output, figure: &Figure) -> Result<(), OutputError> {
    figure.files(|name, content| output.write(name, |w| w.write_all(content)))
}

//! Figures among the files of a result.

use super::error::ReportError;
use super::figure::Figure;
use kalmems_store::{Output, OutputError};

/// Writes a figure into a result, as SVG and as PNG in `figures/`, on as many sheets as it takes.
pub fn write_figure<E: From<OutputError> + From<ReportError>>(
    output: &Output,
    figure: &Figure,
) -> Result<(), E> {
    for page in figure.clone().pages() {
        output.write(&format!("figures/{}.svg", page.id), |w| w.write_all(page.to_svg().as_bytes()))?;
        let png = page.to_png()?;
        output.write(&format!("figures/{}.png", page.id), |w| w.write_all(&png))?;
    }
    Ok(())
}

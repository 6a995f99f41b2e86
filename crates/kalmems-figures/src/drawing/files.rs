//! The files that a figure is kept in.

use crate::drawing::error::ReportError;
use crate::figure::Figure;

impl Figure {
    /// Hands each file of the figure to `write`, name and content: of every sheet that it takes (see [`Figure::pages`]) the
    /// picture as SVG and as PNG, called `figures/ID.svg` and `figures/ID.png` by the name of the sheet.
    ///
    /// One file is held in memory at a time. Ends with the first error, of a picture that cannot be made or of `write`.
    pub fn files<E: From<ReportError>>(
        &self,
        mut write: impl FnMut(&str, &[u8]) -> Result<(), E>,
    ) -> Result<(), E> {
        for page in self.clone().pages() {
            write(&format!("figures/{}.svg", page.id), page.to_svg().as_bytes())?;
            write(&format!("figures/{}.png", page.id), &page.to_png()?)?;
        }
        Ok(())
    }
}

//! The files that a figure is kept in.

use crate::figure::Figure;

impl Figure {
    /// Hands each file of the figure to `write`, name and content: of every sheet that it takes (see [`Figure::pages`]) the
    /// picture as SVG, called `figures/ID.svg` by the name of the sheet.
    ///
    /// One file is held in memory at a time. Ends with the first error of `write`.
    pub fn files<E>(&self, mut write: impl FnMut(&str, &[u8]) -> Result<(), E>) -> Result<(), E> {
        self.clone()
            .pages()
            .iter()
            .try_for_each(|page| write(&format!("figures/{}.svg", page.id), page.to_svg().as_bytes()))
    }
}

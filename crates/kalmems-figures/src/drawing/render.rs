//! Pictures of figures.

use super::{draw, png, svg};
use crate::drawing::error::ReportError;
use crate::figure::Figure;

impl Figure {
    /// The picture as SVG, 900 units wide. The same figure gives the same bytes.
    pub fn to_svg(&self) -> String {
        svg::write(&draw::scene(self))
    }

    /// The same for a page, whose other parts it leads to.
    pub(crate) fn to_page_svg(&self) -> String {
        svg::write_with_links(&draw::scene(self))
    }

    /// The same picture as PNG, 1800 pixels wide.
    pub fn to_png(&self) -> Result<Vec<u8>, ReportError> {
        png::encode(&draw::scene(self), &self.id)
    }
}

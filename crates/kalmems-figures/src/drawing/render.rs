//! Pictures of figures.

use super::{draw, svg};
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
}

//! Figures, tables and report pages as plain data, drawn as SVG and HTML.
//!
//! Without the feature `draw` (on unless it is left out) there are the data alone, and tables as text: nothing of what draws is built.
//!
//! Nothing here knows a device or an estimate: others hand over series, tables and text. A [`Figure`] becomes SVG,
//! laid out once; a [`Page`] becomes one HTML file that needs nothing else. The same data give the
//! same bytes on every machine, without fonts or libraries of the system.
//!
//! ```
//! use kalmems_figures::{Axis, Figure, Page, Panel, SeriesRole, PageSection, Series};
//! let time = |i: u32| f64::from(i) * 1e-6;
//! let angle = |i: u32| (f64::from(i) / 10.0).sin();
//! let panel = Panel::new(Axis::new("time", "s"), Axis::new("angle", "deg"))
//!     .with(Series::line("estimate", SeriesRole::Estimate, (0..300).map(|i| (time(i), angle(i)))))
//!     .with(Series::band("±3σ", SeriesRole::Estimate, (0..300).map(|i| (time(i), angle(i) - 0.1, angle(i) + 0.1))));
//! let figure = Figure::new("angle", "Angle", "The angle over the first cycles.").with(panel);
//! assert!(figure.to_svg().starts_with("<svg"));
//!
//! let page = Page::new("One run", "an example").with(PageSection::new("Motion").figure(figure));
//! assert!(page.to_html()?.contains("time (µs)"));
//! # Ok::<(), kalmems_figures::ReportError>(())
//! ```

// Without the feature `draw` there are the data of figures, tables and pages alone; what only drawing asks of them is unused then.
#![cfg_attr(not(feature = "draw"), allow(dead_code))]

mod cell;
mod decimate;
#[cfg(feature = "draw")]
mod drawing;
mod figure;
mod page;
mod prefix;
mod record;
mod scene;
mod significant;
mod style;
mod table;
mod text;
mod text_table;

pub use cell::guarded;
pub use decimate::{DecimatedSignal, Thinning, decimate, decimate_band, pairs, triples};
#[cfg(feature = "draw")]
pub use drawing::{ReportError, SamplesWriter, escaped, page_scripts};
pub use figure::{
    Axis, AxisScale, Figure, MapGrid, Panel, SamplesPlace, Series, SeriesLink, SeriesRole, Shape,
};
pub use page::{Explanation, NoticeSeverity, Page, PageBlock, PagePart, PageSection, SamplesLink};
pub use record::{BandCentre, SampledQuantity, Track};
pub use significant::{number, significant, with_short_numbers};
pub use style::SeriesStyle;
pub use table::{ColumnHead, TextTable};
pub use text::{cut_to, first_clause, unit_sign};

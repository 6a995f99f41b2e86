//! Figures, tables and report pages as plain data, drawn as SVG, PNG and HTML.
//!
//! Nothing here knows a device or an estimate: others hand over series, tables and text. A [`Figure`] becomes SVG or PNG
//! from the same drawing, laid out once; a [`Page`] becomes one HTML file that needs nothing else. The same data give the
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

mod axis;
mod clip;
mod decimate;
mod draw;
mod error;
mod figure;
mod files;
mod layout;
mod live;
mod map;
mod notes;
mod page;
mod pages;
mod png;
mod prefix;
mod record;
mod render;
mod scene;
mod significant;
mod style;
mod svg;
mod table;
mod text;

pub use decimate::{DecimatedSignal, Thinning, decimate, decimate_band, pairs, triples};
pub use error::ReportError;
pub use figure::{Axis, AxisScale, Figure, MapGrid, Panel, Series, SeriesRole, Shape};
pub use page::{Explanation, NoticeSeverity, Page, PageBlock, PagePart, PageSection};
pub use record::Track;
pub use significant::{number, significant, with_short_numbers};
pub use style::SeriesStyle;
pub use table::{ColumnHead, TextTable};
pub use text::unit_sign;

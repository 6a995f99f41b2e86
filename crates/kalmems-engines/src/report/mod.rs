//! Figures and the report page.
//!
//! Nothing here knows a device: others hand over figures, tables and text as plain data. A [`Figure`] becomes
//! SVG or PNG from the same drawing; a [`Page`] becomes one HTML file that needs nothing else.
//!
//! ```
//! use kalmems_engines::report::{Axis, Figure, Page, Panel, Role, Section, Series};
//! let time = |i: u32| f64::from(i) * 1e-6;
//! let angle = |i: u32| (f64::from(i) / 10.0).sin();
//! let panel = Panel::new(Axis::new("time", "s"), Axis::new("angle", "deg"))
//!     .with(Series::line("estimate", Role::Estimate, (0..300).map(|i| (time(i), angle(i)))))
//!     .with(Series::band("±3σ", Role::Estimate, (0..300).map(|i| (time(i), angle(i) - 0.1, angle(i) + 0.1))));
//! let figure = Figure::new("angle", "Angle", "The angle over the first cycles.").with(panel);
//! assert!(figure.to_svg().starts_with("<svg"));
//!
//! let page = Page::new("One run", "an example").with(Section::new("Motion").figure(figure));
//! assert!(page.to_html()?.contains("time (µs)"));
//! # Ok::<(), kalmems_engines::report::ReportError>(())
//! ```

mod axis;
mod clip;
mod decimate;
mod draw;
mod error;
mod figure;
mod files;
mod layout;
mod map;
mod notes;
mod page;
mod pages;
mod png;
mod prefix;
mod render;
mod scene;
mod significant;
mod style;
mod svg;
mod table;
mod text;

pub use decimate::{Decimated, Thinning, decimate, decimate_band, pairs, triples};
pub use error::ReportError;
pub use figure::{Axis, Figure, Grid, Panel, Role, Scale, Series, Shape};
pub use files::write_figure;
pub use page::{Block, Page, Section, Severity};
pub use significant::significant;
pub use table::{Column, Table};
pub use text::unit_sign;

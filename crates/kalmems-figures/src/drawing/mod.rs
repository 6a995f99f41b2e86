//! Figures and pages drawn: pictures, and pages of HTML.

mod axis;
mod clip;
mod draw;
mod error;
mod files;
mod html;
mod layout;
mod live;
mod map;
mod notes;
mod pages;
mod render;
mod ruler;
mod samples;
mod svg;

pub use error::ReportError;
pub use html::{escaped, page_scripts};
pub use samples::SamplesWriter;

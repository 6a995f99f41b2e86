//! Spectra from interferograms: what a piston mirror moves for.
//!
//! Positions are optical path differences x in m, wavenumbers ν in 1/m: a line at ν gives cos(2π·ν·x). A mirror that
//! moves by d changes the path by 2·d.

mod apodisation;
mod budget;
mod line;
mod mertz;
mod nonuniform;
mod transform;
mod zero_path;

pub use apodisation::Apodisation;
pub use budget::{detector_limit, line_height, line_shift};
pub use line::{Line, dip_between, line_near};
pub use mertz::{MertzError, mertz};
pub use nonuniform::{path_weights, spectrum_at};
pub use transform::{Spectrum, TransformError, transform};
pub use zero_path::zero_path;

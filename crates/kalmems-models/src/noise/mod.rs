//! Where noise comes from: densities of the sources.
//!
//! One-sided per hertz, as spectra are drawn. A process noise of a filter is two-sided: half of that, see
//! [`NoiseDensity`](kalmems_core::NoiseDensity).

mod brownian;
mod mosfet;

pub use brownian::brownian_force_density;
pub use mosfet::Mosfet;

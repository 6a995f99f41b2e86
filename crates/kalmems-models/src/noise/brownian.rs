//! The force of the molecules around a moving part.

use crate::constants::BOLTZMANN;
use kalmems_core::Scalar;
use kalmems_macros::model;

/// 4·k_B·T·b in N²/Hz, one-sided: the density of the force that comes with a damping b in N·s/m at T in K (Zhang 2010,
/// equation 3-1).
///
/// As an acceleration it is 4·k_B·T·b/m² in (m/s²)²/Hz; the thesis's equation 3-2 takes a root too many.
///
/// ```
/// let density = kalmems_models::noise::brownian_force_density(7e-4_f64, 300.0);
/// let floor = density.sqrt() / (3.8e-9 * 9.80665);
/// assert!((floor * 1e6 - 91.4).abs() < 0.05, "µg/√Hz");
/// ```
#[model]
pub fn brownian_force_density<P: Scalar>(damping: P, temperature: P) -> P {
    damping * temperature * P::of(4.0 * BOLTZMANN)
}

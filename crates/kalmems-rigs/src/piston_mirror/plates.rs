//! The electrodes.

use super::device::PistonMirror;
use crate::config::Quantity;
use kalmems_models::capacitance::DistanceSeries;

/// The most coefficients that a series may have here: powers 0 to 8.
pub const COEFFICIENTS: usize = 9;

/// C(d) of the device.
pub type Plates = DistanceSeries<f64, COEFFICIENTS>;

/// As the device's table has them.
pub fn plates(mirror: &PistonMirror) -> Plates {
    let given = &mirror.capacitance.coefficients;
    let coefficients = std::array::from_fn(|k| given.get(k).map_or(0.0, Quantity::si));
    Plates { reference_distance: mirror.capacitance.reference_distance.si(), coefficients }
}

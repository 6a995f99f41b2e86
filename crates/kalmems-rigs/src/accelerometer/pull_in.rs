//! Whether the mass lay on a plate while it was recorded.

use super::data::AccelerometerSegment;
use super::settings::AccelerometerHardware;
use crate::estimate::EstimateError;
use kalmems_models::control::STOP;

/// Refuses a recording whose signal is that of a mass at its stops or beyond: what is on a plate measures nothing, and
/// the law of the plates ends there.
pub fn require_free(
    hardware: &AccelerometerHardware,
    data: &AccelerometerSegment,
    column: &str,
    place: &str,
) -> Result<(), EstimateError> {
    let stopped_v = hardware.readout.voltage(STOP * hardware.readout.plates.gap);
    // What noise alone may add to a mass that is still free.
    let most = stopped_v - 5.0 * hardware.noise_variance.sqrt();
    let touching = |y: &f64| y.abs() >= most;
    let Some(first) = data.signal.iter().position(touching) else { return Ok(()) };
    Err(EstimateError::PulledIn {
        place: place.to_owned(),
        column: column.to_owned(),
        time_s: data.time_s[first],
        volts: data.signal[first],
        stopped_v,
        count: data.signal.iter().filter(|y| touching(y)).count(),
    })
}

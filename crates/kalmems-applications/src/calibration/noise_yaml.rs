//! The noise of a unit at rest as visual-inertial calibration (Kalibr) and drivers of ROS read it.

use super::rest::{AxisAtRest, InertialSensor};
use std::fmt::Write as _;

/// A key of the file, its unit, and the size of an axis with the upper end of its interval.
type NoiseKey = (&'static str, &'static str, fn(&AxisAtRest) -> Option<[f64; 2]>);

const KEYS: [(InertialSensor, [NoiseKey; 2]); 2] = [
    (
        InertialSensor::Accelerometer,
        [
            ("accelerometer_noise_density", "m/s^2/sqrt(Hz)", white),
            ("accelerometer_random_walk", "m/s^3/sqrt(Hz)", walk),
        ],
    ),
    (
        InertialSensor::Gyroscope,
        [
            ("gyroscope_noise_density", "rad/s/sqrt(Hz)", white),
            ("gyroscope_random_walk", "rad/s^2/sqrt(Hz)", walk),
        ],
    ),
];

fn white(rest: &AxisAtRest) -> Option<[f64; 2]> {
    rest.noise_fit.map(|fit| [fit.angle_random_walk.0, fit.angle_random_walk.1[1]])
}

fn walk(rest: &AxisAtRest) -> Option<[f64; 2]> {
    rest.noise_fit.map(|fit| [fit.rate_random_walk.0, fit.rate_random_walk.1[1]])
}

/// The file: of each sensor the axis with the largest noise. A noise that no axis shows has the upper end of its interval, as a filter needs a number
/// above 0. Keys of sensors that were not at rest here, or whose noise was not fitted, are left out.
pub(super) fn noise_yaml(rests: &[AxisAtRest], rate_hz: f64) -> Option<String> {
    let mut text =
        "# Noise at rest by kalmems calibrate: continuous-time densities, the largest of the axes.\n"
            .to_owned();
    let mut keys = 0;
    for (sensor, of_sensor) in KEYS {
        let axes = || rests.iter().filter(|rest| rest.sensor == sensor);
        for (key, unit, of) in of_sensor {
            let sizes = || axes().filter_map(of);
            let seen = sizes().map(|[size, _]| size).fold(0.0, f64::max);
            let most = sizes().map(|[_, high]| high).fold(0.0, f64::max);
            let (value, note) = if seen > 0.0 { (seen, "") } else { (most, ", not seen: upper end of 95 %") };
            if value > 0.0 && value.is_finite() {
                // Writing to a string does not fail.
                let _ = writeln!(text, "{key}: {value:.6e}  # {unit}{note}");
                keys += 1;
            }
        }
    }
    let _ = writeln!(text, "update_rate: {rate_hz:.3}  # Hz\nrostopic: /imu");
    (keys > 0).then_some(text)
}

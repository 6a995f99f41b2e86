//! The part of a mean rate at rest that is the Earth's rotation.

use super::quantities::contribution;
use super::rest::{AxisAtRest, InertialSensor};
use super::tone::AXES;
use crate::metrology::{Evaluation, Input};
use kalmems_core::Portable;
use serde::Serialize;

/// The rate of the Earth's rotation in rad/s (WGS 84).
pub(super) const EARTH_RATE: f64 = 7.292_115e-5;

/// What a gyroscope at rest shows of the Earth's rotation, in rad/s.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct EarthAtRest {
    /// The part along its axis that is known.
    pub known: f64,
    /// The standard deviation of the part that is not.
    pub uncertainty: f64,
}

impl EarthAtRest {
    /// Along an axis of unknown direction: all of the rotation's components between −Ω and Ω are equally likely, as the cosine of the angle between
    /// two directions is.
    const fn unknown() -> Self {
        Self { known: 0.0, uncertainty: EARTH_RATE / SQRT_3 }
    }

    /// Along an axis whose cosine to the vertical is known, at a latitude in rad: Ω·sin φ·c, and of unknown azimuth Ω·cos φ·√(1 − c²)·cos α.
    fn at(latitude: f64, to_vertical: f64) -> Self {
        let level = (1.0 - to_vertical * to_vertical).max(0.0).sqrt();
        Self {
            known: EARTH_RATE * latitude.portable_sin() * to_vertical,
            uncertainty: EARTH_RATE * latitude.portable_cos().abs() * level / SQRT_2,
        }
    }
}

/// What a number has of the Earth's rotation along an axis of unknown direction, or along the vertical at an unknown latitude, which are distributed alike;
/// the number changes by `by` for a rate of 1 rad/s.
pub(super) fn earth_of_unknown_direction(by: f64) -> Input {
    let part = EarthAtRest::unknown().uncertainty * by;
    contribution("Earth's rotation, direction or latitude not stated", part, f64::INFINITY, Evaluation::B)
}

const SQRT_2: f64 = std::f64::consts::SQRT_2;
const SQRT_3: f64 = 1.732_050_807_568_877_2;

/// Sets what the gyroscopes show of the Earth. The vertical is the direction of the mean specific force, of a record with three accelerometers and a
/// stated latitude.
pub(super) fn set_earth(axes: &mut [AxisAtRest], latitude: Option<f64>) {
    let force = AXES.map(|axis| {
        let accelerometers = axes.iter().filter(|rest| rest.sensor == InertialSensor::Accelerometer);
        accelerometers.filter(|rest| rest.axis == axis).map(|rest| rest.bias).next()
    });
    let vertical = latitude.and_then(|latitude| {
        let [Some(x), Some(y), Some(z)] = force else { return None };
        let size = (x * x + y * y + z * z).sqrt();
        (size > 0.0).then(|| (latitude, [x / size, y / size, z / size]))
    });
    for rest in axes.iter_mut().filter(|rest| rest.sensor == InertialSensor::Gyroscope) {
        let place = AXES.iter().position(|axis| *axis == rest.axis);
        let known = vertical.zip(place).map(|((latitude, up), place)| EarthAtRest::at(latitude, up[place]));
        rest.earth = known.unwrap_or_else(EarthAtRest::unknown);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By sums over equidistant components and azimuths.
    #[test]
    fn uncertainties_are_those_of_unknown_directions() {
        let count = 1000;
        let middle = |k: i32| (f64::from(k) + 0.5) / f64::from(count);
        let of_any = (0..count).map(|k| (EARTH_RATE * (2.0 * middle(k) - 1.0)).powi(2)).sum::<f64>()
            / f64::from(count);
        assert!((of_any.sqrt() / EarthAtRest::unknown().uncertainty - 1.0).abs() < 1e-5);
        let (latitude, up) = (0.8_f64, 0.6_f64);
        let level = |k: i32| EARTH_RATE * latitude.cos() * 0.8 * (std::f64::consts::TAU * middle(k)).cos();
        let of_azimuth = (0..count).map(|k| level(k).powi(2)).sum::<f64>() / f64::from(count);
        let found = EarthAtRest::at(latitude, up);
        assert!((of_azimuth.sqrt() / found.uncertainty - 1.0).abs() < 1e-9);
        assert!((found.known / (EARTH_RATE * latitude.sin() * up) - 1.0).abs() < 1e-12);
    }
}

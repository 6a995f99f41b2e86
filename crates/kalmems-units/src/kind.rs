//! The kinds of quantity that a description of a device knows, with their dimensions.

use crate::Dimension;
use std::fmt;

/// A kind of quantity: what a key of an experiment file, or a column of a recording, must be.
#[derive(Debug, PartialEq, Eq)]
pub struct Kind {
    /// In words, with an article: "a torsional stiffness".
    pub name: &'static str,
    /// What it is in base units.
    pub dimension: Dimension,
    /// Whether rad is told from a plain number: yes for angles and rates, no for N·m against N·m/rad.
    pub angle_counts: bool,
    /// A value as one would write it.
    pub example: &'static str,
}

impl Kind {
    /// Whether a value of this dimension can be meant.
    pub fn accepts(&self, dimension: Dimension) -> bool {
        if self.angle_counts {
            dimension == self.dimension
        } else {
            dimension.without_angle() == self.dimension.without_angle()
        }
    }

    /// What a difference or a standard deviation of such values is.
    pub fn deviation(&'static self) -> &'static Self {
        if *self == TEMPERATURE { &TEMPERATURE_CHANGE } else { self }
    }
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} ({})", self.name, self.dimension)
    }
}

macro_rules! kinds {
    ($($(#[$angle:ident])? $id:ident = $name:literal, $of:ident [$($e:literal),+], $example:literal;)+) => {
        $(
            #[doc = concat!("Such as `", $example, "`: ", $name, ".")]
            pub static $id: Kind = Kind {
                name: $name,
                dimension: Dimension::$of([$($e),+]),
                angle_counts: kinds!(@angle $($angle)?),
                example: $example,
            };
        )+
        /// All of them.
        pub static ALL: &[&Kind] = &[$(&$id),+];
    };
    (@angle strict) => { true };
    (@angle) => { false };
}

// Exponents of kg, m, s, A, K, rad, whole or in halves.
kinds! {
    #[strict] RATIO = "a ratio", of [0, 0, 0, 0, 0, 0], "0.3 %";
    #[strict] ANGLE = "an angle", of [0, 0, 0, 0, 0, 1], "0.2 rad";
    #[strict] ANGULAR_RATE = "an angular rate", of [0, 0, -1, 0, 0, 1], "0.1 deg/s";
    #[strict] ANGULAR_ACCELERATION_DENSITY =
        "a power density of angular acceleration", of [0, 0, -3, 0, 0, 2], "1e8 rad^2/s^3";
    #[strict] FREQUENCY = "a frequency", of [0, 0, -1, 0, 0, 0], "15.5 kHz";
    TIME = "a time", of [0, 0, 1, 0, 0, 0], "8 ms";
    LENGTH = "a length", of [0, 1, 0, 0, 0, 0], "19.2 um";
    WAVENUMBER = "a wavenumber", of [0, -1, 0, 0, 0, 0], "2000 1/cm";
    AREA = "an area", of [0, 2, 0, 0, 0, 0], "1.86 mm^2";
    MASS = "a mass", of [1, 0, 0, 0, 0, 0], "3.8e-9 kg";
    INERTIA = "a moment of inertia", of [1, 2, 0, 0, 0, 0], "1.15e-14 kg m^2";
    STIFFNESS = "a torsional stiffness", of [1, 2, -2, 0, 0, 0], "1.10e-4 N m";
    TORSIONAL_DAMPING = "a torsional damping coefficient", of [1, 2, -1, 0, 0, 0], "5.95e-12 N m s";
    SPRING_CONSTANT = "a spring constant", of [1, 0, -2, 0, 0, 0], "3 N/m";
    DAMPING = "a damping coefficient", of [1, 0, -1, 0, 0, 0], "7e-4 N s/m";
    PRESSURE = "a pressure", of [1, -1, -2, 0, 0, 0], "100 Pa";
    VOLTAGE = "a voltage", of [1, 2, -3, -1, 0, 0], "6 V";
    VOLTAGE_VARIANCE = "a variance of a voltage", of [2, 4, -6, -2, 0, 0], "1.92e-4 V^2";
    VOLTAGE_DENSITY = "a power density of a voltage", of [2, 4, -5, -2, 0, 0], "1e-15 V^2/Hz";
    VOLTAGE_NOISE = "a noise density of a voltage", of_halves [2, 4, -5, -2, 0, 0], "2.09 nV/sqrt(Hz)";
    PER_VOLTAGE = "an inverse voltage", of [-1, -2, 3, 1, 0, 0], "0.5 1/V";
    CAPACITANCE = "a capacitance", of [-1, -2, 4, 2, 0, 0], "5.71 pF";
    RESISTANCE = "a resistance", of [1, 2, -3, -2, 0, 0], "17.86 kohm";
    VOLTAGE_PER_CAPACITANCE = "a voltage per capacitance", of [2, 4, -7, -3, 0, 0], "-0.3574 V/pF";
    TEMPERATURE = "an absolute temperature", of [0, 0, 0, 0, 1, 0], "300 K";
    TEMPERATURE_CHANGE = "a change of temperature", of [0, 0, 0, 0, 1, 0], "20 K";
    PER_TEMPERATURE = "a ratio per temperature", of [0, 0, 0, 0, -1, 0], "-64 ppm/K";
    VOLTAGE_PER_TEMPERATURE = "a voltage per temperature", of [1, 2, -3, -1, -1, 0], "0.2 mV/K";
    VELOCITY = "a velocity", of [0, 1, -1, 0, 0, 0], "5 mm/s";
    ACCELERATION = "an acceleration", of [0, 1, -2, 0, 0, 0], "9.80665 m/s^2";
    JERK = "a rate of change of an acceleration", of [0, 1, -3, 0, 0, 0], "314 gn/s";
    #[strict] VOLTAGE_PER_RATE = "a voltage per angular rate", of [1, 2, -2, -1, 0, -1], "2.82e-3 V s/rad";
    #[strict] PER_ANGLE = "an inverse angle", of [0, 0, 0, 0, 0, -1], "76 1/rad";
    LENGTH_PER_VOLTAGE = "a length per voltage", of [-1, -1, 3, 1, 0, 0], "0.5 mm/V";
    VOLTAGE_PER_VELOCITY = "a voltage per velocity", of [1, 1, -2, -1, 0, 0], "50 V/(m/s)";
    CURRENT_GAIN = "a bias voltage times a resistance", of [2, 4, -6, -3, 0, 0], "-2.4e7 V ohm";
    #[strict] DRIVE_GAIN = "an angular acceleration per voltage", of [-1, -2, 1, 1, 0, 1], "3782.5 rad/s^2/V";
    #[strict] SQUARE_DRIVE_GAIN =
        "an angular acceleration per square of a voltage", of [-2, -4, 4, 2, 0, 1], "12 rad/s^2/V^2";
    #[strict] RATE_VARIANCE = "a variance of an angular rate", of [0, 0, -2, 0, 0, 2], "3e-6 rad^2/s^2";
    #[strict] INTEGRAL_GAIN = "a gain per time", of [0, 0, -1, 0, 0, 0], "1 1/s";
    #[strict] RATIO_DRIFT = "a variance of a ratio per time", of [0, 0, -1, 0, 0, 0], "1e-7 1/s";
    #[strict] FREQUENCY_DRIFT = "a variance of a frequency per time", of [0, 0, -3, 0, 0, 0], "1e-8 Hz^2/s";
    LENGTH_DRIFT = "a variance of a length per time", of [0, 2, -1, 0, 0, 0], "1e-19 m^2/s";
    VELOCITY_DRIFT = "a variance of a velocity per time", of [0, 2, -3, 0, 0, 0], "1e-14 m^2/s^3";
    VOLTAGE_DRIFT = "a variance of a voltage per time", of [2, 4, -7, -2, 0, 0], "1e-8 V^2/s";
    CAPACITANCE_DRIFT = "a variance of a capacitance per time", of [-2, -4, 7, 4, 0, 0], "1e-40 F^2/s";
    CAPACITANCE_DENSITY =
        "a noise density of a capacitance", of_halves [-2, -4, 9, 4, 0, 0], "0.151 aF/sqrt(Hz)";
}

#[cfg(test)]
mod tests {
    use super::ALL;
    use crate::Value;

    #[test]
    fn every_example_is_of_its_kind() {
        for kind in ALL {
            let value = Value::parse(kind.example).unwrap();
            assert!(value.of_kind(kind).is_ok(), "{kind}: {}", kind.example);
        }
    }
}

//! The kinds of quantity that a description of a device knows, with their dimensions.

use super::Dimension;
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
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} ({})", self.name, self.dimension)
    }
}

macro_rules! kinds {
    ($($(#[$angle:ident])? $id:ident = $name:literal, [$($e:literal),+], $example:literal;)+) => {
        $(
            #[doc = concat!("Such as `", $example, "`: ", $name, ".")]
            pub static $id: Kind = Kind {
                name: $name,
                dimension: Dimension::of([$($e),+]),
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

// Exponents of kg, m, s, A, K, rad.
kinds! {
    #[strict] RATIO = "a ratio", [0, 0, 0, 0, 0, 0], "0.3 %";
    #[strict] ANGLE = "an angle", [0, 0, 0, 0, 0, 1], "0.2 rad";
    #[strict] ANGULAR_RATE = "an angular rate", [0, 0, -1, 0, 0, 1], "0.1 deg/s";
    #[strict] ANGULAR_ACCELERATION_DENSITY =
        "a power density of angular acceleration", [0, 0, -3, 0, 0, 2], "1e8 rad^2/s^3";
    #[strict] FREQUENCY = "a frequency", [0, 0, -1, 0, 0, 0], "15.5 kHz";
    TIME = "a time", [0, 0, 1, 0, 0, 0], "8 ms";
    LENGTH = "a length", [0, 1, 0, 0, 0, 0], "19.2 um";
    AREA = "an area", [0, 2, 0, 0, 0, 0], "1.86 mm^2";
    MASS = "a mass", [1, 0, 0, 0, 0, 0], "3.8e-9 kg";
    INERTIA = "a moment of inertia", [1, 2, 0, 0, 0, 0], "1.15e-14 kg m^2";
    STIFFNESS = "a torsional stiffness", [1, 2, -2, 0, 0, 0], "1.10e-4 N m";
    TORSIONAL_DAMPING = "a torsional damping coefficient", [1, 2, -1, 0, 0, 0], "5.95e-12 N m s";
    SPRING_CONSTANT = "a spring constant", [1, 0, -2, 0, 0, 0], "3 N/m";
    DAMPING = "a damping coefficient", [1, 0, -1, 0, 0, 0], "7e-4 N s/m";
    VOLTAGE = "a voltage", [1, 2, -3, -1, 0, 0], "6 V";
    VOLTAGE_VARIANCE = "a variance of a voltage", [2, 4, -6, -2, 0, 0], "1.92e-4 V^2";
    CAPACITANCE = "a capacitance", [-1, -2, 4, 2, 0, 0], "5.71 pF";
    RESISTANCE = "a resistance", [1, 2, -3, -2, 0, 0], "17.86 kohm";
    VOLTAGE_PER_CAPACITANCE = "a voltage per capacitance", [2, 4, -7, -3, 0, 0], "-0.3574 V/pF";
    TEMPERATURE = "an absolute temperature", [0, 0, 0, 0, 1, 0], "300 K";
    VELOCITY = "a velocity", [0, 1, -1, 0, 0, 0], "5 mm/s";
    ACCELERATION = "an acceleration", [0, 1, -2, 0, 0, 0], "9.80665 m/s^2";
}

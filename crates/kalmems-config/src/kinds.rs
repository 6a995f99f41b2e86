//! The kinds of quantity as types, so that a key of the experiment file and a field of a struct have one.

use crate::units::{Kind, kind};
use std::fmt::Debug;

/// A [`Kind`] known to the compiler.
pub trait KindOf: Debug + Clone + PartialEq {
    /// Which one.
    fn kind() -> &'static Kind;
}

macro_rules! markers {
    ($($name:ident = $kind:expr;)+) => { $(
        #[doc = concat!("Marks a [`Quantity`](super::Quantity) of the kind `", stringify!($kind), "`.")]
        #[derive(Clone, Debug, PartialEq, Eq)]
        pub enum $name {}
        impl KindOf for $name {
            fn kind() -> &'static Kind {
                &$kind
            }
        }
    )+ };
}

markers! {
    Ratio = kind::RATIO;
    Angle = kind::ANGLE;
    AngularRate = kind::ANGULAR_RATE;
    Frequency = kind::FREQUENCY;
    Time = kind::TIME;
    Length = kind::LENGTH;
    Wavenumber = kind::WAVENUMBER;
    Area = kind::AREA;
    Mass = kind::MASS;
    Inertia = kind::INERTIA;
    Stiffness = kind::STIFFNESS;
    TorsionalDamping = kind::TORSIONAL_DAMPING;
    SpringConstant = kind::SPRING_CONSTANT;
    Damping = kind::DAMPING;
    Pressure = kind::PRESSURE;
    Voltage = kind::VOLTAGE;
    VoltageVariance = kind::VOLTAGE_VARIANCE;
    VoltageDensity = kind::VOLTAGE_DENSITY;
    VoltageNoise = kind::VOLTAGE_NOISE;
    PerVoltage = kind::PER_VOLTAGE;
    Capacitance = kind::CAPACITANCE;
    Resistance = kind::RESISTANCE;
    VoltagePerCapacitance = kind::VOLTAGE_PER_CAPACITANCE;
    Temperature = kind::TEMPERATURE;
    TemperatureChange = kind::TEMPERATURE_CHANGE;
    PerTemperature = kind::PER_TEMPERATURE;
    VoltagePerTemperature = kind::VOLTAGE_PER_TEMPERATURE;
    Acceleration = kind::ACCELERATION;
    VoltagePerRate = kind::VOLTAGE_PER_RATE;
    PerAngle = kind::PER_ANGLE;
    LengthPerVoltage = kind::LENGTH_PER_VOLTAGE;
    VoltagePerVelocity = kind::VOLTAGE_PER_VELOCITY;
    CurrentGain = kind::CURRENT_GAIN;
    DriveGain = kind::DRIVE_GAIN;
    SquareDriveGain = kind::SQUARE_DRIVE_GAIN;
    RateVariance = kind::RATE_VARIANCE;
    IntegralGain = kind::INTEGRAL_GAIN;
    CapacitanceDensity = kind::CAPACITANCE_DENSITY;
}

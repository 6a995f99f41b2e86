//! What an operator writes of the resonator: the table `[device.comb_resonator]`.

use crate::model::CombResonator;
use kalmems::config::kinds::{Frequency, Length, LengthPerVoltage, Ratio, Time, Voltage, VoltageVariance};
use kalmems::config::{DeviceDescription, NotNegative, NotZero, Positive, Quantity};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// A mass on springs that a comb pulls sideways.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CombResonatorTable {
    /// The frequency of a small free motion.
    pub natural_frequency: Quantity<Frequency, Positive>,
    /// The ratio of damping to critical damping.
    pub damping_ratio: Quantity<Ratio, Positive>,
    /// The deflection at which the cubic part of the spring's force is as large as the linear part.
    pub cubic_deflection: Quantity<Length, Positive>,
    /// A constant voltage on the comb, and how far it deflects the mass.
    pub static_voltage: Quantity<Voltage, Positive>,
    /// See `static_voltage`.
    pub static_deflection: Quantity<Length, Positive>,
    /// The deflection by which the readout's output grows by one volt.
    pub sensitivity: Quantity<LengthPerVoltage, NotZero>,
    /// The time constant of the readout's pole.
    pub time_constant: Quantity<Time, Positive>,
    /// The variance of one sample's noise.
    pub noise_variance: Quantity<VoltageVariance, NotNegative>,
}

impl DeviceDescription for CombResonatorTable {
    const NAME: &'static str = "comb_resonator";
    const SUMMARY: &'static str = "A comb resonator with a cubic spring, read through one pole.";
}

impl CombResonatorTable {
    /// The model in SI.
    pub fn model(&self) -> CombResonator<f64> {
        CombResonator {
            rate: TAU * self.natural_frequency.si(),
            damping_ratio: self.damping_ratio.si(),
            hardening: self.cubic_deflection.si().powi(-2),
            per_square_volt: self.static_deflection.si() / self.static_voltage.si().powi(2),
            gain: self.sensitivity.si().recip(),
            pole: self.time_constant.si().recip(),
        }
    }
}

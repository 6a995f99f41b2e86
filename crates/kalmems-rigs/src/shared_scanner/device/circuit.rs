//! The circuit that modulates and demodulates, stage by stage.

use crate::config::Quantity;
use crate::config::kinds::{
    Angle, Capacitance, Frequency, PerVoltage, Ratio, Resistance, Voltage, VoltageDensity,
};
use crate::config::{NotNegative, NotZero, Positive};
use schemars::JsonSchema;
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize};

/// An amplifier, a high-pass, a detector and two low-pass stages.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ModulatedCircuit {
    /// The resistor that turns the electrodes' current into a voltage.
    pub feedback_resistance: Quantity<Resistance, Positive>,
    /// Where the amplifier's gain has fallen by 3 dB; left out for one that is fast enough not to matter.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"10 MHz")]
    pub amplifier_bandwidth: Option<Quantity<Frequency, Positive>>,
    /// What lies in parallel with the electrodes.
    pub parasitic_capacitance: Quantity<Capacitance, NotNegative>,
    /// The density of the noise at the amplifier's output, one-sided, up to half the integration rate. It takes the place of the readout's variance.
    pub noise_density: Quantity<VoltageDensity, NotNegative>,
    /// What keeps the drive out.
    pub high_pass: HighPassFilter,
    /// What makes an amplitude of the carrier: exactly one table, such as `[device.shared_scanner.circuit.detector.square_law]`.
    pub detector: DetectorSource,
    /// The poles of the two low-pass stages.
    #[schemars(example = poles())]
    pub low_pass: [Quantity<Frequency, Positive>; 2],
}

/// Butterworth's high-pass.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HighPassFilter {
    /// How many poles it has, 1 to 8.
    #[serde(deserialize_with = "order")]
    #[schemars(range(min = 1, max = 8))]
    pub order: usize,
    /// Where its gain is 3 dB below 1.
    #[schemars(example = &"482 kHz")]
    pub cutoff: Quantity<Frequency, Positive>,
}

/// What makes an amplitude of the carrier.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum DetectorSource {
    /// `linear v + square v^2`.
    SquareLaw(SquareLawDetector),
    /// A diode that charges a capacitor.
    Diode(DiodeDetector),
    /// A multiplication by the carrier.
    Synchronous(SynchronousDetector),
}

/// A detector that squares.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SquareLawDetector {
    /// The linear part.
    #[schemars(example = &"1")]
    pub linear: Quantity<Ratio>,
    /// The square part.
    pub square: Quantity<PerVoltage, NotZero>,
}

/// A diode with a resistance, a capacitor and a load.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DiodeDetector {
    /// What the diode takes before it conducts.
    pub forward_drop: Quantity<Voltage, NotNegative>,
    /// Diode and source while it conducts.
    pub series_resistance: Quantity<Resistance, Positive>,
    /// The load.
    pub load_resistance: Quantity<Resistance, Positive>,
    /// The capacitor.
    pub load_capacitance: Quantity<Capacitance, Positive>,
}

/// A detector that multiplies by the carrier.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SynchronousDetector {
    /// The phase of its reference, from that of the carrier behind the high-pass: with 0 rad the amplitude comes out whole.
    #[schemars(example = &"0 rad")]
    pub phase: Quantity<Angle>,
}

fn order<'de, D: Deserializer<'de>>(deserializer: D) -> Result<usize, D::Error> {
    let number = i64::deserialize(deserializer)?;
    usize::try_from(number)
        .ok()
        .filter(|order| (1..=8).contains(order))
        .ok_or_else(|| D::Error::custom(format!("`{number}` is not 1 to 8; write the poles, such as `4`")))
}

fn poles() -> serde_json::Value {
    serde_json::json!(["40.8 kHz", "41.1 kHz"])
}

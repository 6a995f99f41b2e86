//! The threshold-sensing scanner: a position is known when the angle passes the comb's steepest point.

use crate::config::kinds::{
    Angle, Capacitance, Frequency, Length, LengthPerVoltage, PerAngle, Ratio, Resistance, SquareDriveGain,
    Voltage, VoltagePerRate, VoltageVariance,
};
use crate::config::quantity::Quantity;
use crate::config::sign::{NotNegative, NotZero, Positive};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A resonant scanner whose comb's capacitance changes steeply at one angle.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ThresholdScanner {
    /// The mirror on its torsion bars.
    pub resonator: MirrorResonator,
    /// The comb's voltage per rate over the angle.
    pub comb: LogisticComb,
    /// The amplifier of the comb's current.
    pub readout: TransimpedanceReadout,
    /// The torque of the driving voltage; left out where the recordings are free decay.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub drive: Option<SquareDrive>,
    /// The detector of the beam's position, which is the reference.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub position_detector: Option<PositionDetector>,
}

/// A resonator known by its free decay.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MirrorResonator {
    /// The frequency without damping.
    pub natural_frequency: Quantity<Frequency, Positive>,
    /// The ratio of damping to critical damping.
    pub damping_ratio: Quantity<Ratio, NotNegative>,
}

/// A logistic curve: voltage per rate is `gain (1/(1 + exp(-steepness (angle - threshold_angle))) - 1/2)`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LogisticComb {
    /// The angle at which the signal changes its sign.
    pub threshold_angle: Quantity<Angle>,
    /// The difference of the curve's ends.
    pub gain: Quantity<VoltagePerRate, NotZero>,
    /// How steep the curve is.
    pub steepness: Quantity<PerAngle, Positive>,
}

/// A transimpedance amplifier: a voltage proportional to the comb's current.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TransimpedanceReadout {
    /// The resistance that turns current into voltage.
    pub feedback_resistance: Quantity<Resistance, Positive>,
    /// The voltage across the comb.
    pub bias: Quantity<Voltage, NotZero>,
    /// The output without motion.
    pub offset: Quantity<Voltage>,
    /// The capacitance through which the drive reaches the output.
    pub feedthrough_capacitance: Quantity<Capacitance>,
    /// The variance of one sample.
    pub noise_variance: Quantity<VoltageVariance, Positive>,
}

/// A torque that goes with the square of the driving voltage and the comb's curve.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SquareDrive {
    /// The angular acceleration per square of the voltage.
    pub gain: Quantity<SquareDriveGain>,
}

/// A position-sensing detector that the reflected beam falls on.
///
/// How late it shows the angle is the `delay` of the recording's reference.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PositionDetector {
    /// The position on the detector per volt.
    pub gain: Quantity<LengthPerVoltage, NotZero>,
    /// The distance from the mirror.
    pub distance: Quantity<Length, Positive>,
    /// The variance of one sample.
    pub noise_variance: Quantity<VoltageVariance, Positive>,
}

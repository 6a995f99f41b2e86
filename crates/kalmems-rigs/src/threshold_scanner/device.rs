//! The threshold-sensing scanner: a position is known when the angle passes the comb's steepest point.

use super::equations;
use crate::config::Quantity;
use crate::config::kinds::{
    Angle, Capacitance, Frequency, Length, LengthPerVoltage, PerAngle, Ratio, Resistance, SquareDriveGain,
    Time, Voltage, VoltagePerRate, VoltageVariance,
};
use crate::config::noise_schema;
use crate::config::{DeviceDescription, Key, OtherTerms};
use crate::config::{NotNegative, NotZero, Positive};
use crate::equations::meant;
use crate::evaluate::BeamPosition;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A resonant scanner whose comb's capacitance changes steeply at one angle.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ThresholdScanner {
    /// The mirror on its torsion bars.
    pub resonator: MirrorResonatorTable,
    /// The comb's voltage per rate over the angle.
    pub comb: SensingComb,
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
pub struct MirrorResonatorTable {
    /// The frequency without damping.
    pub natural_frequency: Quantity<Frequency, Positive>,
    /// The ratio of damping to critical damping.
    pub damping_ratio: Quantity<Ratio, NotNegative>,
}

/// A comb that is passed: voltage per rate is `gain s(steepness (angle - threshold_angle))`, where `s` is its shape.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SensingComb {
    /// The angle at which the signal changes its sign.
    pub threshold_angle: Quantity<Angle>,
    /// The curve; logistic if left out.
    #[serde(default)]
    pub shape: CombShape,
    /// The gain: of a logistic curve the difference of its ends. Above 0 the signal rises whenever the threshold is
    /// passed; an amplifier that does not invert has it below 0. Either this or `fingers`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gain: Option<Quantity<VoltagePerRate, NotZero>>,
    /// How steep the curve is.
    pub steepness: Quantity<PerAngle, Positive>,
    /// The fingers that a logistic curve's gain follows from, with the readout's resistance and bias.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fingers: Option<CombGeometry>,
}

/// The shape of a comb's curve.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum CombShape {
    /// `s(u) = 1/(1 + exp(-u)) - 1/2`.
    #[default]
    Logistic,
    /// `s(u) = u exp(-u^2)`: the slope of a Gaussian capacitance.
    Gaussian,
}

/// Fingers in the plane of the mirror, which turn past those beside them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CombGeometry {
    /// Pairs of facing sides.
    pub pairs: Quantity<Ratio, Positive>,
    /// The distance between facing sides.
    #[schemars(example = &"5 um")]
    pub gap: Quantity<Length, Positive>,
    /// The height of the fingers, normal to the mirror.
    #[schemars(example = &"30 um")]
    pub height: Quantity<Length, Positive>,
    /// Where facing sides begin, from the axis.
    #[schemars(example = &"250 um")]
    pub inner_radius: Quantity<Length, NotNegative>,
    /// Where they end.
    #[schemars(example = &"400 um")]
    pub outer_radius: Quantity<Length, Positive>,
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
    /// The variance of one sample. Where it is left out, the program finds it from the recording, as with
    /// `from_recording`.
    #[schemars(schema_with = "noise_schema::<VoltageVariance>")]
    pub noise_variance: Quantity<VoltageVariance, Positive>,
}

/// A torque that goes with the square of the driving voltage and the comb's curve.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SquareDrive {
    /// The angular acceleration per square of the voltage.
    pub gain: Quantity<SquareDriveGain>,
}

/// A position-sensing detector that the reflected beam falls on: `position gain = distance tan(angle)`.
///
/// How late a recording shows the angle is the `delay` of its reference.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PositionDetector {
    /// The position on the detector per volt.
    pub gain: Quantity<LengthPerVoltage, NotZero>,
    /// The distance from the mirror.
    pub distance: Quantity<Length, Positive>,
    /// Whose angle that is; the mirror's if left out.
    #[serde(default)]
    pub angle: DetectedAngle,
    /// How much later than the motion a simulated detector shows it, below 0 if it is the signal that is late; 0 s if
    /// left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"0.114 ms")]
    pub delay: Option<Quantity<Time>>,
    /// The variance of one sample.
    pub noise_variance: Quantity<VoltageVariance, Positive>,
}

/// Whose angle a position detector shows. A mirror turns the beam by twice its own.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum DetectedAngle {
    /// The mirror's, as published: the estimate is then of whatever angle the gain was calibrated with.
    #[default]
    Mirror,
    /// The beam's; the mirror has turned by half of it.
    Beam,
}

impl PositionDetector {
    /// How its voltage follows from the angle.
    pub fn beam(&self) -> BeamPosition {
        BeamPosition {
            gain: self.gain.si(),
            distance: self.distance.si(),
            multiple: match self.angle {
                DetectedAngle::Mirror => 1.0,
                DetectedAngle::Beam => 2.0,
            },
        }
    }
}

impl DeviceDescription for ThresholdScanner {
    const NAME: &'static str = "threshold_scanner";
    const SUMMARY: &'static str = "A scanner whose signal tells most when the angle passes a threshold.";

    fn in_other_terms(&self) -> Result<Option<OtherTerms>, (Key, String)> {
        let meant = meant(&equations::motion(self), equations::keys, Some(equations::threshold(self)));
        let meant = meant.map(|table| Some(Arc::new(table) as OtherTerms));
        meant.map_err(|error| (Key::from("device.threshold_scanner"), error.to_string()))
    }

    fn check(&self) -> Result<(), (Key, String)> {
        let at = |name: &str, why: String| {
            let way = ["device", "threshold_scanner", "comb"].into_iter().chain(name.split('.'));
            Err((way.fold(Key::default(), Key::child), why))
        };
        let example = "write `gain = \"2.82 mV s/rad\"`, or the table `fingers`";
        match (&self.comb.gain, &self.comb.fingers) {
            (None, None) => at("gain", format!("found no gain; {example}")),
            (Some(_), Some(_)) => {
                at("fingers", format!("found both `gain` and `fingers`; {example}, not both"))
            }
            (None, Some(fingers)) if fingers.inner_radius.si() >= fingers.outer_radius.si() => {
                let (outer, inner) = (fingers.outer_radius.text(), fingers.inner_radius.text());
                at("fingers.outer_radius", format!("`{outer}` is not beyond `inner_radius`, `{inner}`"))
            }
            (None, Some(_)) if self.comb.shape != CombShape::Logistic => {
                at("fingers", "from fingers follows the gain of a logistic curve; write `gain`".to_owned())
            }
            _ => Ok(()),
        }
    }
}

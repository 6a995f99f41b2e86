//! The micro-stage that shakes a gyroscope, with capacitors underneath.

use crate::config::Key;
use crate::config::kinds::{
    CurrentGain, DriveGain, Frequency, Length, RateVariance, Ratio, VoltagePerVelocity,
};
use crate::config::quantity::Quantity;
use crate::config::sign::{NotNegative, NotZero, Positive};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A tilting stage with parallel-plate capacitors whose currents are amplified.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MicroStage {
    /// The stage on its springs.
    pub resonator: StageResonator,
    /// The capacitors by name, such as `1A`.
    pub electrodes: BTreeMap<String, Electrode>,
    /// The laser vibrometer, which is the reference.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub vibrometer: Option<Vibrometer>,
    /// The gyroscope on the stage, which is to be calibrated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gyroscope: Option<Gyroscope>,
}

/// A resonator driven by a piezoelectric voltage.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StageResonator {
    /// The frequency without damping.
    pub natural_frequency: Quantity<Frequency, Positive>,
    /// The ratio of damping to critical damping.
    pub damping_ratio: Quantity<Ratio, NotNegative>,
    /// The angular acceleration per volt of drive.
    pub drive_gain: Quantity<DriveGain, NotZero>,
}

/// One capacitor: its rectangle under the stage, and its amplifier.
///
/// Distances are from the axis of rotation (`w1`, `w2`) and along it (`w3`, `w4`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Electrode {
    /// The near edge across the axis.
    pub w1: Quantity<Length>,
    /// The far edge across the axis.
    pub w2: Quantity<Length>,
    /// The near edge along the axis.
    pub w3: Quantity<Length>,
    /// The far edge along the axis.
    pub w4: Quantity<Length>,
    /// The distance of the plates at rest.
    pub gap: Quantity<Length, Positive>,
    /// The output per rate of change of the capacitance: minus the bias times the feedback resistance.
    pub gain: Quantity<CurrentGain, NotZero>,
}

/// A laser vibrometer that looks at the edge of the gyroscope.
///
/// How late it shows the velocity is the `delay` of the recording's reference.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Vibrometer {
    /// Volts per velocity.
    pub gain: Quantity<VoltagePerVelocity, NotZero>,
    /// The width of what it looks at: the angular rate is twice the edge's velocity by this width.
    pub target_width: Quantity<Length, Positive>,
}

/// The gyroscope that is to be calibrated.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Gyroscope {
    /// How far its sample rate may be off, relative to the nominal one.
    pub clock_tolerance: Quantity<Ratio, NotNegative>,
    /// The variance of one sample.
    pub noise_variance: Quantity<RateVariance, Positive>,
}

impl MicroStage {
    pub(super) fn check(&self) -> Result<(), (Key, String)> {
        let electrodes = Key::from("device.micro_stage.electrodes");
        if self.electrodes.is_empty() {
            let why =
                "found no electrode; expected at least one, such as `[device.micro_stage.electrodes.1A]`";
            return Err((electrodes, why.to_owned()));
        }
        for (name, electrode) in &self.electrodes {
            let edges =
                [("w1", &electrode.w1, "w2", &electrode.w2), ("w3", &electrode.w3, "w4", &electrode.w4)];
            for (near, low, far, high) in edges {
                if low.si() >= high.si() {
                    let (low, high) = (low.text(), high.text());
                    let why = format!("`{far}` (`{high}`) is not beyond `{near}` (`{low}`); exchange them");
                    return Err((electrodes.child(name).child(far), why));
                }
            }
        }
        Ok(())
    }
}

//! The micro-stage that shakes a gyroscope, with capacitors underneath.

use super::equations;
use crate::config::Quantity;
use crate::config::Vibrometer;
use crate::config::kinds::{
    AngularRate, CurrentGain, DriveGain, Frequency, Length, LengthPerVoltage, RateVariance, Ratio, Time,
    VoltageVariance,
};
use crate::config::noise_schema;
use crate::config::{DeviceDescription, Key, OtherTerms};
use crate::config::{NotNegative, NotZero, Positive};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A tilting stage with parallel-plate capacitors whose currents are amplified.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MicroStage {
    /// The stage on its springs.
    pub resonator: StageResonator,
    /// The vertical motion that the drive excites beside the tilt; none if left out. Only a simulation has it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub piston: Option<PistonMode>,
    /// The capacitors by name, such as `1A`.
    pub electrodes: BTreeMap<String, Electrode>,
    /// What the estimated rate was found to be wrong by; nothing if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub correction: Option<RateCorrection>,
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

/// The mode in which the stage rises and falls without tilting.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PistonMode {
    /// The frequency without damping.
    #[schemars(example = &"1002 Hz")]
    pub natural_frequency: Quantity<Frequency, Positive>,
    /// The ratio of damping to critical damping.
    pub damping_ratio: Quantity<Ratio, NotNegative>,
    /// How far a constant volt of drive lifts the stage towards the stators.
    #[schemars(example = &"1 nm/V")]
    pub static_rise: Quantity<LengthPerVoltage>,
}

/// The line that the rate which a filter says was found to follow: `scale` times the true one and `bias`.
///
/// Estimates are corrected by it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RateCorrection {
    /// The scale factor.
    pub scale: Quantity<Ratio, Positive>,
    /// The bias.
    pub bias: Quantity<AngularRate>,
}

/// What of the drive an amplifier shows beside the motion: `gain` times the drive and `slope` times its rate of change.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DriveFeedthrough {
    /// Volts per volt.
    pub gain: Quantity<Ratio>,
    /// Volts per volt per second.
    pub slope: Quantity<Time>,
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
    /// The variance of one sample's noise; an estimate needs it, or `from_recording`, with which the program finds it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(schema_with = "noise_schema::<VoltageVariance>")]
    pub noise_variance: Option<Quantity<VoltageVariance, Positive>>,
    /// What of the drive its amplifier shows; an estimate of a recording without its counterpart with the bias off takes
    /// it away.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub feedthrough: Option<DriveFeedthrough>,
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

impl DeviceDescription for MicroStage {
    const NAME: &'static str = "micro_stage";
    const SUMMARY: &'static str = "A stage that shakes a gyroscope to calibrate it.";

    fn in_other_terms(&self) -> Result<Option<OtherTerms>, (Key, String)> {
        let meant = equations::in_other_terms(self);
        meant.map(Some).map_err(|error| (Key::from("device.micro_stage"), error.to_string()))
    }

    fn check(&self) -> Result<(), (Key, String)> {
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

//! What an experiment file says about a drive that a regulator sets, and about the temperature under it.

use super::filter::FilterName;
use super::kinds::{
    Angle, Frequency, PerTemperature, TemperatureChange, Time, Voltage, VoltagePerTemperature,
};
use super::quantity::Quantity;
use super::sign::{NotNegative, Positive};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// `offset + voltage sin(...)`: a regulator acts on the estimate of one of the filters, and sets frequency and voltage so
/// that the motion has this amplitude and this phase against the drive.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RegulatedDrive {
    /// Which `[[estimate.filter]]` observes the motion, by its name; an `ekf`.
    #[schemars(example = &"EKF")]
    pub filter: FilterName,
    /// The amplitude of the motion that is held.
    #[schemars(example = &"10.5 deg")]
    pub amplitude: Quantity<Angle, Positive>,
    /// The phase of the motion that is held, in its cycle: how late its maximum is after a phase 0 of the drive. 0 rad,
    /// where the drive acts best, if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"0 deg")]
    pub phase: Option<Quantity<Angle>>,
    /// How fast the phase is regulated: the natural frequency of the closed loop.
    #[schemars(example = &"100 Hz")]
    pub phase_bandwidth: Quantity<Frequency, Positive>,
    /// How fast the amplitude is regulated.
    #[schemars(example = &"50 Hz")]
    pub amplitude_bandwidth: Quantity<Frequency, Positive>,
    /// The mean of the drive.
    #[schemars(example = &"90 V")]
    pub offset: Quantity<Voltage, Positive>,
    /// The lowest amplitude of the drive's sine.
    #[schemars(example = &"30 V")]
    pub lowest_voltage: Quantity<Voltage, Positive>,
    /// The highest, with which the motion is started.
    #[schemars(example = &"90 V")]
    pub highest_voltage: Quantity<Voltage, Positive>,
    /// The drive's frequency at which the sweep begins that starts the motion, above its resonance.
    #[schemars(example = &"31.5 kHz")]
    pub from: Quantity<Frequency, Positive>,
    /// The frequency at which that sweep ends. The regulator stays between half as much below it and above `from` as they
    /// are apart.
    #[schemars(example = &"31.15 kHz")]
    pub to: Quantity<Frequency, Positive>,
    /// How long that sweep takes.
    #[schemars(example = &"90 ms")]
    pub sweep: Quantity<Time, Positive>,
    /// From when on frequency and voltage are held as they are, to see what becomes of the motion without a regulator;
    /// never if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"200 ms")]
    pub hold_from: Option<Quantity<Time, NotNegative>>,
    /// Events that are told before they happen; none if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub trigger: Option<TriggerOutput>,
}

/// When a trigger tells that the motion will pass its middle.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TriggerOutput {
    /// On which of its ways.
    pub direction: TriggerDirection,
    /// How long before.
    #[schemars(example = &"10 us")]
    pub lead: Quantity<Time, Positive>,
}

/// The way of the motion through its middle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TriggerDirection {
    /// From below.
    Rising,
    /// From above.
    Falling,
}

/// A temperature that changes linearly, and what that makes of device and readout: to first order, relative to what the
/// device table says, which holds at the start.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TemperatureRamp {
    /// By how much it changes in all.
    #[schemars(example = &"-20 K")]
    pub change: Quantity<TemperatureChange>,
    /// When it begins to change.
    #[schemars(example = &"200 ms")]
    pub from: Quantity<Time, NotNegative>,
    /// When it has changed.
    #[schemars(example = &"700 ms")]
    pub to: Quantity<Time, Positive>,
    /// The change of the stiffness; none if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"-64 ppm/K")]
    pub stiffness: Option<Quantity<PerTemperature>>,
    /// The change of the damping; none if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"0.23 %/K")]
    pub damping: Option<Quantity<PerTemperature>>,
    /// The change of the readout's gain; none if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"100 ppm/K")]
    pub gain: Option<Quantity<PerTemperature>>,
    /// The change of the readout's offset; none if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"0.2 mV/K")]
    pub offset: Option<Quantity<VoltagePerTemperature>>,
}

/// How many samples a cycle of the motion has at least.
const SAMPLES_PER_CYCLE: f64 = 16.0;

impl RegulatedDrive {
    /// What is wrong with one of its keys.
    pub(super) fn check(&self, sampling_rate_hz: f64) -> Result<(), (&'static str, String)> {
        if self.to.si() >= self.from.si() {
            let why = format!(
                "`{}` is not below `from`, `{}`; the sweep goes down, onto the branch of large motions",
                self.to.text(),
                self.from.text()
            );
            return Err(("to", why));
        }
        if 0.5 * self.from.si() * SAMPLES_PER_CYCLE > sampling_rate_hz {
            let why = format!(
                "`{}` leaves less than {SAMPLES_PER_CYCLE} samples per cycle of the motion; raise `simulate.sampling_rate`",
                self.from.text()
            );
            return Err(("from", why));
        }
        if self.lowest_voltage.si() >= self.highest_voltage.si() {
            let (low, high) = (self.lowest_voltage.text(), self.highest_voltage.text());
            return Err(("lowest_voltage", format!("`{low}` is not below `highest_voltage`, `{high}`")));
        }
        for (name, bandwidth) in
            [("phase_bandwidth", &self.phase_bandwidth), ("amplitude_bandwidth", &self.amplitude_bandwidth)]
        {
            let highest = LARGEST_BANDWIDTH * self.to.si();
            if bandwidth.si() > highest {
                let why = format!(
                    "`{}` is too fast: the estimate's harmonics would come through; write at most `{highest:.0} Hz`",
                    bandwidth.text()
                );
                return Err((name, why));
            }
        }
        Ok(())
    }
}

/// The largest bandwidth of a loop, relative to the drive's frequency.
const LARGEST_BANDWIDTH: f64 = 0.02;

//! The force-rebalance accelerometer.

use super::equations;
use crate::config::kinds::{
    Acceleration, Area, Capacitance, Damping, Frequency, IntegralGain, Length, Mass, Ratio, SpringConstant,
    Temperature, Time, Voltage, VoltageVariance,
};
use crate::config::noise_schema;
use crate::config::{DeviceDescription, Key, OtherTerms, Quantity};
use crate::config::{NotNegative, Positive};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A proof mass between two plates that sense it, and push it back where the loop is closed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AccelerometerTable {
    /// The mass on its springs.
    pub proof_mass: ProofMassTable,
    /// The two capacitors.
    pub plates: ParallelPlates,
    /// From displacement to voltage.
    pub readout: SwitchedReadout,
    /// The feedback; left out for an open loop.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub feedback: Option<ForceFeedback>,
    /// What is known of the acceleration beforehand.
    pub acceleration: AccelerationPrior,
}

impl DeviceDescription for AccelerometerTable {
    const NAME: &'static str = "accelerometer";
    const SUMMARY: &'static str = "A force-rebalance accelerometer.";

    fn in_other_terms(&self) -> Result<Option<OtherTerms>, (Key, String)> {
        let meant = equations::in_other_terms(self);
        meant.map(Some).map_err(|error| (Key::from("device.accelerometer"), error.to_string()))
    }
}

/// A mass on a spring, moved by the molecules around it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ProofMassTable {
    /// Its mass.
    pub mass: Quantity<Mass, Positive>,
    /// The force per displacement of its springs.
    pub spring: Quantity<SpringConstant, Positive>,
    /// The force per velocity at rest.
    pub damping: Quantity<Damping, NotNegative>,
    /// The share of the damping that is gas squeezed between the plates, which grows near a plate; 0 if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"100 %")]
    pub squeezed_film: Option<Quantity<Ratio, NotNegative>>,
    /// The temperature, which sets the Brownian force.
    pub temperature: Quantity<Temperature, NotNegative>,
}

/// Two parallel-plate capacitors, one on each side of the mass.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ParallelPlates {
    /// The area of each.
    pub area: Quantity<Area, Positive>,
    /// The gap of each at rest.
    pub gap: Quantity<Length, Positive>,
    /// The permittivity in the gap, relative to vacuum.
    pub relative_permittivity: Quantity<Ratio, Positive>,
}

/// A charge amplifier with a carrier on the plates.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SwitchedReadout {
    /// The amplitude of the carrier.
    pub carrier_amplitude: Quantity<Voltage, Positive>,
    /// The mean square of the carrier over the square of its amplitude: 0.5 for a sine, 1 for a square wave.
    pub carrier_mean_square: Quantity<Ratio, Positive>,
    /// The frequency of the carrier; the outlook assumes 1 MHz if it is left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"1 MHz")]
    pub carrier_frequency: Option<Quantity<Frequency, Positive>>,
    /// The capacitance that turns charge into voltage.
    pub feedback_capacitance: Quantity<Capacitance, Positive>,
    /// The variance of one sample. Where it is left out, the program finds it from the recording, as with
    /// `from_recording`.
    #[schemars(schema_with = "noise_schema::<VoltageVariance>")]
    pub noise_variance: Quantity<VoltageVariance, Positive>,
}

/// A proportional and integral controller that pushes the mass back.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ForceFeedback {
    /// The bias of the plates, which makes the force linear in the feedback voltage.
    pub bias: Quantity<Voltage, Positive>,
    /// The feedback voltage per output voltage.
    pub proportional_gain: Quantity<Ratio>,
    /// The rate of change of the feedback voltage per output voltage.
    pub integral_gain: Quantity<IntegralGain>,
    /// Whether what is computed of a sample is applied one sample later; at once if left out.
    #[serde(default, skip_serializing_if = "is_false")]
    pub one_sample_late: bool,
    /// Whether the controller is an analogue one, which acts between the samples too; false if left out. For
    /// simulations, where it is computed at every step of the integration; what is recorded is then the output with the
    /// mean of its noise until the next sample, and the mean of the feedback over the same time.
    #[serde(default, skip_serializing_if = "is_false")]
    pub continuous: bool,
    /// One bit of the controller's output in its place, at each sample: a delta-sigma loop. None if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub one_bit: Option<OneBit>,
    /// Whether the controller acts on what a settled Kalman filter makes of the output, and not on the output itself;
    /// false if left out. For simulations: a recording holds what was applied.
    #[serde(default, skip_serializing_if = "is_false")]
    pub through_observer: bool,
}

/// A comparator behind the controller: its bit, as plus or minus one voltage, is what is fed back.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct OneBit {
    /// The voltage.
    #[schemars(example = &"86.5 mV")]
    pub level: Quantity<Voltage, Positive>,
    /// How far the output is carried on along its last change before it is compared: about the time in which the
    /// faster motion of the mass decays. None if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"5.6 us")]
    pub lead: Option<Quantity<Time, NotNegative>>,
}

/// An acceleration that varies like noise through a second-order low-pass.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AccelerationPrior {
    /// Its root mean square.
    pub rms: Quantity<Acceleration, Positive>,
    /// The natural frequency of the low-pass.
    pub bandwidth: Quantity<Frequency, Positive>,
    /// The damping ratio of the low-pass.
    pub damping_ratio: Quantity<Ratio, Positive>,
}

#[allow(clippy::trivially_copy_pass_by_ref)] // as serde calls it
fn is_false(value: &bool) -> bool {
    !*value
}

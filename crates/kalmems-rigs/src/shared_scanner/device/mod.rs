//! The shared-electrode scanner: one comb drives and senses.

mod circuit;
mod second_axis;

pub use circuit::{
    DetectorSource, DiodeDetector, HighPassFilter, ModulatedCircuit, SquareLawDetector, SynchronousDetector,
};
pub use second_axis::SecondAxis;

use super::equations;
use super::settings::{LONGEST_DELAY_RAD, ScannerHardware};
use crate::config::Quantity;
use crate::config::kinds::{
    Angle, Capacitance, Frequency, Inertia, Stiffness, Time, TorsionalDamping, Voltage,
    VoltagePerCapacitance, VoltageVariance,
};
use crate::config::noise_schema;
use crate::config::{DeviceDescription, Key, OtherTerms};
use crate::config::{NotNegative, NotZero, Positive};
use schemars::JsonSchema;
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize};

/// A resonant scanner that one comb drives by its charge and senses by a carrier.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SharedScanner {
    /// The mirror on its torsion bars.
    pub resonator: Resonator,
    /// The comb's capacitance over the angle.
    pub comb: GaussianCombTable,
    /// From capacitance to voltage.
    pub readout: DemodulatedReadout,
    /// The carrier that senses the capacitance.
    pub carrier: CarrierTable,
    /// A second axis on the same electrode; none if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub second_axis: Option<SecondAxis>,
    /// The circuit, stage by stage. With it a simulation computes the signal through the circuit, and not by `readout`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub circuit: Option<ModulatedCircuit>,
}

impl DeviceDescription for SharedScanner {
    const NAME: &'static str = "shared_scanner";
    const SUMMARY: &'static str = "A scanner whose comb drives and senses at once.";

    fn in_other_terms(&self) -> Result<Option<OtherTerms>, (Key, String)> {
        let meant = equations::in_other_terms(self);
        meant.map(Some).map_err(|error| (Key::from("device.shared_scanner"), error.to_string()))
    }

    fn check(&self) -> Result<(), (Key, String)> {
        let ScannerHardware { scanner, delay_s, .. } = ScannerHardware::of_table(self);
        let longest_s = LONGEST_DELAY_RAD / scanner.resonator.natural_rate();
        let why = if self.second_axis.is_some() && delay_s > 0.0 {
            "a scanner with two axes is read without a delay; leave `delay` out".to_owned()
        } else if delay_s > longest_s {
            format!(
                "filters read the angle that was by the motion that is, up to an eighth of a cycle back; write at most `{:.2} us`",
                longest_s * 1e6
            )
        } else {
            return Ok(());
        };
        let key = ["shared_scanner", "readout", "delay"].into_iter().fold(Key::from("device"), Key::child);
        Err((key, why))
    }
}

/// A rotating mass on a torsional spring.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Resonator {
    /// The moment of inertia about the axis.
    pub inertia: Quantity<Inertia, Positive>,
    /// The torque per angle of the torsion bars.
    pub stiffness: Quantity<Stiffness, Positive>,
    /// The torque per rate.
    pub damping: Quantity<TorsionalDamping, NotNegative>,
}

/// A capacitance that falls with the angle as a Gaussian: `C0 exp(-(angle/theta0)^2) + Cb`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GaussianCombTable {
    /// How much the capacitance varies at most, C0.
    pub nominal_capacitance: Quantity<Capacitance, Positive>,
    /// The angle at which it has fallen to 1/e, theta0.
    pub angular_width: Quantity<Angle, Positive>,
    /// The part that does not vary, Cb.
    pub bias_capacitance: Quantity<Capacitance, NotNegative>,
}

/// A demodulated carrier: a voltage affine in the capacitance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DemodulatedReadout {
    /// Volts per farad.
    pub gain: Quantity<VoltagePerCapacitance, NotZero>,
    /// The voltage at no capacitance.
    pub offset: Quantity<Voltage>,
    /// The variance of one sample. Where it is left out, the program finds it from the recording, as with
    /// `from_recording`.
    #[schemars(schema_with = "noise_schema::<VoltageVariance>")]
    pub noise_variance: Quantity<VoltageVariance, Positive>,
    /// The corner frequencies of the demodulator's two low-pass stages, such as `["31.35 kHz", "31.35 kHz"]`; for
    /// filters that track them as states.
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "two_poles")]
    #[schemars(example = poles())]
    pub poles: Option<[PoleFrequency; 2]>,
    /// How late the voltage is beside the poles, such as `1.16 us` for a high-pass of fourth order near its cut-off; at
    /// most an eighth of the motion's cycle. All filters and the simulation without a circuit heed it; none if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub delay: Option<Quantity<Time, NotNegative>>,
}

type PoleFrequency = Quantity<Frequency, Positive>;

fn two_poles<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<[PoleFrequency; 2]>, D::Error> {
    let poles = Vec::<PoleFrequency>::deserialize(deserializer)?;
    let two = <[PoleFrequency; 2]>::try_from(poles).map_err(|poles| {
        let found = poles.len();
        D::Error::custom(format!(
            "found {found} in the list; expected the two corner frequencies, such as `[\"31.35 kHz\", \"31.35 kHz\"]`"
        ))
    })?;
    Ok(Some(two))
}

fn poles() -> serde_json::Value {
    serde_json::json!(["31.35 kHz", "31.35 kHz"])
}

/// The carrier that senses the capacitance. Its mean square drives the device as well.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CarrierTable {
    /// Its amplitude.
    pub amplitude: Quantity<Voltage, NotNegative>,
    /// Its frequency; the estimate does not need it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frequency: Option<Quantity<Frequency, Positive>>,
    /// Whether the recorded drive voltage contains the carrier already.
    #[schemars(example = false)]
    pub included_in_drive: bool,
}

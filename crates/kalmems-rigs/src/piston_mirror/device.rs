//! The piston mirror, sensed by a capacitor of one plate behind it.

use super::equations;
use super::plates::COEFFICIENTS;
use crate::config::Quantity;
use crate::config::kinds::{
    Capacitance, CapacitanceDensity, Frequency, Length, Mass, Pressure, Ratio, Resistance, Voltage,
    VoltageNoise,
};
use crate::config::noise_schema;
use crate::config::{DeviceDescription, Key, OtherTerms};
use crate::config::{NotNegative, Positive};
use crate::equations::meant;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A mirror that moves along its axis before a fixed electrode.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PistonMirror {
    /// The capacitance over the distance.
    pub capacitance: DistanceSeriesTable,
    /// From capacitance to samples.
    pub readout: CapacitanceReadout,
    /// The mechanics and the drive; for a simulation of the driven mirror, and for what can be said before it moves.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mirror: Option<DrivenPlate>,
}

/// A series in powers of the inverse distance: the sum of `coefficients[k] (reference_distance/d)^k`.
///
/// `["0 F", "109.3 fF"]` is a parallel plate; higher powers describe fringing fields.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DistanceSeriesTable {
    /// The distance at which the capacitance is the sum of the coefficients.
    pub reference_distance: Quantity<Length, Positive>,
    /// The coefficients, from power 0 on.
    #[schemars(length(min = 2), example = parallel_plate())]
    pub coefficients: Vec<Quantity<Capacitance>>,
    /// The nearest distance of the table that the series was fitted to; unknown if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"0.45 mm")]
    pub nearest: Option<Quantity<Length, Positive>>,
    /// The farthest distance of that table; unknown if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"1.55 mm")]
    pub farthest: Option<Quantity<Length, Positive>>,
}

fn parallel_plate() -> serde_json::Value {
    serde_json::json!(["0 F", "109.3 fF"])
}

/// A readout whose output is the capacitance, with white noise.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CapacitanceReadout {
    /// The one-sided density; one sample has its square times half the sample rate as variance. Where it is left out, the program finds it from the recording, as with
    /// `from_recording`.
    #[schemars(schema_with = "noise_schema::<CapacitanceDensity>")]
    pub noise_density: Quantity<CapacitanceDensity, Positive>,
    /// The bandwidth before the sampling; half the sample rate if left out. Noise beyond half the sample rate is folded.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"97 kHz")]
    pub bandwidth: Option<Quantity<Frequency, Positive>>,
    /// The carrier circuit, from which `kalmems inspect` computes a noise density to set beside the stated one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub front_end: Option<CarrierFrontEnd>,
}

/// A carrier through the sensed capacitance into a shunt, with a parasitic capacitance beside it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CarrierFrontEnd {
    /// The carrier's voltage: root mean square, as the noise is.
    #[schemars(example = &"1 V")]
    pub excitation: Quantity<Voltage, Positive>,
    /// The carrier's frequency.
    #[schemars(example = &"20 MHz")]
    pub carrier: Quantity<Frequency, Positive>,
    /// The shunt.
    #[schemars(example = &"50 ohm")]
    pub shunt: Quantity<Resistance, Positive>,
    /// The parasitic capacitance beside the shunt.
    #[schemars(example = &"100 pF")]
    pub parallel_capacitance: Quantity<Capacitance, NotNegative>,
    /// The amplifier's noise at the shunt, one-sided.
    #[schemars(example = &"2.09 nV/sqrt(Hz)")]
    pub voltage_noise: Quantity<VoltageNoise, Positive>,
}

/// A plate on springs, driven through a comb in its plane that pulls it back to rest from either side.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DrivenPlate {
    /// The moving mass.
    #[schemars(example = &"1 mg")]
    pub mass: Quantity<Mass, Positive>,
    /// The resonance without drive and damping.
    #[schemars(example = &"500 Hz")]
    pub resonance: Quantity<Frequency, Positive>,
    /// What the comb's capacitance has more at rest than far away.
    #[schemars(example = &"2 pF")]
    pub comb_capacitance: Quantity<Capacitance, Positive>,
    /// The displacement at which that has fallen to 1/e.
    #[schemars(example = &"200 um")]
    pub comb_width: Quantity<Length, Positive>,
    /// The quality factor without gas.
    #[schemars(example = &"20000")]
    pub intrinsic_quality: Quantity<Ratio, Positive>,
    /// The gas around it; none if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gas: Option<SurroundingGas>,
}

/// Gas that brakes a plate: 1/Q = p/(p + `transition_pressure`)/`viscous_quality`, beside what the mechanics take.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SurroundingGas {
    /// Its pressure.
    #[schemars(example = &"100 Pa")]
    pub pressure: Quantity<Pressure, NotNegative>,
    /// The quality factor that the gas alone would leave where it is a fluid.
    #[schemars(example = &"150")]
    pub viscous_quality: Quantity<Ratio, Positive>,
    /// The pressure at which it brakes half as much as the fluid.
    #[schemars(example = &"400 Pa")]
    pub transition_pressure: Quantity<Pressure, Positive>,
}

impl CapacitanceReadout {
    /// The variance of one sample in F²: the density's square times half the sampling rate, or times the bandwidth where that is larger, because
    /// what lies beyond half the sampling rate is folded into the samples.
    pub fn noise_variance(&self, interval_s: f64) -> f64 {
        let half_rate = 0.5 / interval_s;
        self.noise_density.si().powi(2) * self.bandwidth.as_ref().map_or(half_rate, |b| b.si().max(half_rate))
    }
}

impl DeviceDescription for PistonMirror {
    const NAME: &'static str = "piston_mirror";
    const SUMMARY: &'static str = "A piston mirror for a Fourier-transform spectrometer.";

    fn in_other_terms(&self) -> Result<Option<OtherTerms>, (Key, String)> {
        let meant = meant(&equations::motion(self), equations::keys, None);
        let meant = meant.map(|table| Some(Arc::new(table) as OtherTerms));
        meant.map_err(|error| (Key::from("device.piston_mirror"), error.to_string()))
    }

    fn check(&self) -> Result<(), (Key, String)> {
        let given = self.capacitance.coefficients.len();
        if given > COEFFICIENTS {
            let why = format!(
                "found {given} coefficients; at most {COEFFICIENTS}, for the powers 0 to {}, are built; fit the capacitance with fewer",
                COEFFICIENTS - 1
            );
            return Err((Key::from("device.piston_mirror.capacitance.coefficients"), why));
        }
        if let (Some(nearest), Some(farthest)) = (&self.capacitance.nearest, &self.capacitance.farthest)
            && nearest.si() >= farthest.si()
        {
            let why = format!("`{}` is not beyond `nearest`, `{}`", farthest.text(), nearest.text());
            return Err((Key::from("device.piston_mirror.capacitance.farthest"), why));
        }
        // Without a power of the distance the signal says nothing about it.
        if self.capacitance.coefficients.iter().skip(1).any(|c| c.si() != 0.0) {
            return Ok(());
        }
        let why = "a capacitance that does not vary with the distance; expected at least two coefficients and one \
                   after the first that is not 0, such as `[\"0 F\", \"109.3 fF\"]`";
        Err((Key::from("device.piston_mirror.capacitance.coefficients"), why.to_owned()))
    }
}

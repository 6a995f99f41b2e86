//! The piston mirror, sensed by a capacitor of one plate behind it.

use crate::config::Key;
use crate::config::kinds::{Capacitance, CapacitanceDensity, Length};
use crate::config::quantity::Quantity;
use crate::config::sign::Positive;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A mirror that moves along its axis before a fixed electrode.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PistonMirror {
    /// The capacitance over the distance.
    pub capacitance: DistanceSeries,
    /// From capacitance to samples.
    pub readout: CapacitanceReadout,
}

/// A series in powers of the inverse distance: the sum of `coefficients[k] (reference_distance/d)^k`.
///
/// `["0 F", "109.3 fF"]` is a parallel plate; higher powers describe fringing fields.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DistanceSeries {
    /// The distance at which the capacitance is the sum of the coefficients.
    pub reference_distance: Quantity<Length, Positive>,
    /// The coefficients, from power 0 on.
    #[schemars(length(min = 2), example = parallel_plate())]
    pub coefficients: Vec<Quantity<Capacitance>>,
}

fn parallel_plate() -> serde_json::Value {
    serde_json::json!(["0 F", "109.3 fF"])
}

/// A readout whose output is the capacitance, with white noise.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CapacitanceReadout {
    /// The one-sided density; one sample has its square times half the sample rate as variance.
    pub noise_density: Quantity<CapacitanceDensity, Positive>,
}

impl PistonMirror {
    pub(super) fn check(&self) -> Result<(), (Key, String)> {
        // Without a power of the distance the signal says nothing about it.
        if self.capacitance.coefficients.iter().skip(1).any(|c| c.si() != 0.0) {
            return Ok(());
        }
        let why = "a capacitance that does not vary with the distance; expected at least two coefficients and one \
                   after the first that is not 0, such as `[\"0 F\", \"109.3 fF\"]`";
        Err((Key::from("device.piston_mirror.capacitance.coefficients"), why.to_owned()))
    }
}

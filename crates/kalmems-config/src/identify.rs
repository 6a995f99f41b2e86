//! What an experiment file says about the recordings that parameters are identified from.

use super::values::Values;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// How the recordings for an identification were taken. Which settings there are, the rig knows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Identify {
    /// The numbers of the device's table under which the recordings are the likeliest, by their keys below that table, such as
    /// `resonator.stiffness`; of a device of one's own the names of parameters. At most eight. What the rig identifies if left out.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(length(max = 8), example = likeliest())]
    pub parameters: Vec<String>,
    /// Whether numbers that `parameters` names are written also where the innovations contradict them, without an uncertainty: of a device
    /// whose equations are known to lack something. False if left out.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub despite_innovations: bool,
    /// Of the recording with the role `ring_down`, such as
    /// `{ bias = "23.76 V", feedback_resistance = "17.86 kohm" }`.
    #[serde(default, skip_serializing_if = "Values::is_empty")]
    pub ring_down: Values,
    /// Which records of the recording with the role `bias_on`, by their labels, parameters are identified from; the others
    /// are estimated. All of them serve for both if left out.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub training: Vec<String>,
    /// How what the drive alone makes of the signals is told from the motion; `bias_off` if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub feedthrough: Option<FeedthroughBy>,
    /// What of each electrode is taken from the device table where no vibrometer says how far the stage moves.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub trusted: Option<TrustedNumber>,
    /// Capacitances at known distances, by field simulations or measurements, which a piston mirror's series in the inverse distance is fitted to.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub capacitance_table: Option<CapacitanceTable>,
}

/// A file with a row for each distance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CapacitanceTable {
    /// The file, seen from the experiment file.
    #[schemars(example = &"capacitances.csv")]
    pub file: PathBuf,
    /// The column of the distance, whose name ends with its unit.
    #[schemars(example = &"distance_mm")]
    pub distance: String,
    /// The column of the capacitance, whose name ends with its unit.
    #[schemars(example = &"C_fF")]
    pub capacitance: String,
}

fn likeliest() -> serde_json::Value {
    serde_json::json!(["resonator.stiffness", "resonator.damping"])
}

/// How feedthrough is told from motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FeedthroughBy {
    /// By a recording with the role `bias_off`.
    BiasOff,
    /// By the harmonics: the drive makes none, so that they are the motion's alone. Less exact.
    Harmonics,
}

/// A number of an electrode that is trusted, so that the others follow from the signal alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TrustedNumber {
    /// Its gain: the gap follows.
    Gain,
    /// Its gap: the gain follows.
    Gap,
}

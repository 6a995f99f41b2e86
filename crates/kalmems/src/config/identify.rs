//! What an experiment file says about the recordings that parameters are identified from.

use super::values::Values;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How the recordings for an identification were taken. Which settings there are, the rig knows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Identify {
    /// Of the recording with the role `ring_down`, such as
    /// `{ bias = "23.76 V", feedback_resistance = "17.86 kohm" }`.
    #[serde(default, skip_serializing_if = "Values::is_empty")]
    pub ring_down: Values,
}

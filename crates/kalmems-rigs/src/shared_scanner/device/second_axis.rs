//! A second axis on the electrode of a shared-electrode scanner.

use super::{GaussianCombTable, Resonator};
use crate::config::Quantity;
use crate::config::kinds::Inertia;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The gimbal that carries the mirror, driven and sensed through the same electrode. The axis without it is x, this y.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SecondAxis {
    /// The gimbal, mirror included, on its torsion bars.
    pub resonator: Resonator,
    /// The capacitance of its comb over its angle.
    pub comb: GaussianCombTable,
    /// What the inertia about its axis gains as the mirror turns by a right angle: for a thin flat mirror the mirror's
    /// own. Left out, the two axes meet in the voltage and the signal alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gimbal_inertia: Option<Quantity<Inertia>>,
}

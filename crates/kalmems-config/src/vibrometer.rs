//! A vibrometer beside a device.

use super::kinds::{Length, VoltagePerVelocity};
use super::quantity::Quantity;
use super::sign::{NotZero, Positive};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

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

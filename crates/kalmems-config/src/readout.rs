//! What of a filter's recording is between the sensor and the file.

use super::kinds::{Frequency, Time};
use super::quantity::Quantity;
use super::sign::Positive;
use super::values::AnyValue;
use super::{ConfigFault, Key, Method, TrackedState};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The most lines of a filter.
pub const MOST_LINES: usize = 2;

/// What is between the sensor and the recording, as states of a filter with the mean 0: the recording is
/// (1 + scale)·signal + offset + feedthrough·drive + lines + coloured noise.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ReadoutStates {
    /// What is added to the signal, such as `{ start_sd = "10 mV" }`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub offset: Option<TrackedState>,
    /// By how much too large it is, relative to what the device table says, such as `{ start_sd = "1 %" }`. Of a device whose gain scales
    /// the whole signal that is the gain's deviation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scale: Option<TrackedState>,
    /// How much of the drive is added to the signal at the same sample, in V per V, such as `{ start_sd = "1e-4" }`. For a device with one
    /// drive.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub feedthrough: Option<TrackedState>,
    /// Lines of known frequencies, such as the mains': at most two.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub lines: Vec<InterferenceLine>,
    /// Noise that a sample shares with those before it, beside the readout's white noise, such as `{ sd = "1 mV", time = "100 us" }`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub coloured_noise: Option<ColouredNoise>,
}

/// Stationary noise of first order (Gauss-Markov): its autocovariance after a time t is sd²·e^(−t/time).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ColouredNoise {
    /// Its standard deviation, in the signal's unit.
    #[schemars(example = &"1 mV")]
    pub sd: AnyValue,
    /// Its correlation time.
    #[schemars(example = &"100 us")]
    pub time: Quantity<Time, Positive>,
}

/// A line of a known frequency whose amplitude and phase are found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct InterferenceLine {
    /// Its frequency.
    #[schemars(example = &"50 Hz")]
    pub frequency: Quantity<Frequency, Positive>,
    /// How large its cosine and its sine may be.
    #[schemars(example = &"1 mV")]
    pub start_sd: AnyValue,
    /// By how much the variance of either grows per second; they are constants if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"1e-8 V^2/s")]
    pub drift: Option<AnyValue>,
}

impl InterferenceLine {
    /// Its cosine or its sine as a state.
    pub fn size(&self) -> TrackedState {
        TrackedState { start_sd: self.start_sd.clone(), drift: self.drift.clone() }
    }
}

impl ReadoutStates {
    /// What no single value can be blamed for, of a filter of this method; `at` is the key of this table.
    pub(super) fn check(&self, method: Method, at: &Key) -> Result<(), (Key, ConfigFault)> {
        let refuse = |key: Key, why: String| Err((key, ConfigFault::Value { why }));
        let has_states = matches!(
            method,
            Method::Ekf
                | Method::Ukf
                | Method::SquareRootEkf
                | Method::SquareRootUkf
                | Method::IteratedEkf
                | Method::HybridEkf
        );
        if !has_states {
            let why =
                format!("the method `{}` has no states for it; leave it out, or use `ekf`", method.word());
            return refuse(at.clone(), why);
        }
        if *self == Self::default() {
            let why = "it names nothing; expected `offset`, `scale`, `feedthrough`, `lines` or `coloured_noise`, such as `offset = { start_sd = \"10 mV\" }`";
            return refuse(at.clone(), why.to_owned());
        }
        if self.lines.len() > MOST_LINES {
            let why = format!("these are {} lines; expected at most {MOST_LINES}", self.lines.len());
            return refuse(at.clone().child("lines"), why);
        }
        Ok(())
    }
}

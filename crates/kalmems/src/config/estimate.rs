//! What an experiment file says about the estimate that is wanted.

use super::kinds::Time;
use super::quantity::Quantity;
use super::sign::NotNegative;
use super::values::Values;
use schemars::JsonSchema;
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize};

/// The settings of the filters. Which states there are, the rig knows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Estimate {
    /// How much of the start of each record is not judged, because the filter still settles.
    pub skip: Quantity<Time, NotNegative>,
    /// The sign of the first extreme of the angle after `skip`. Where the measurement is even in the angle no
    /// filter can know it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub first_peak: Option<Peak>,
    /// The same for the second axis of a device that has two; `first_peak` is then that of the first.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub first_peak_y: Option<Peak>,
    /// The power density of the process noise by state, such as
    /// `{ angular_acceleration = "1e8 rad^2/s^3" }`.
    #[serde(default, skip_serializing_if = "Values::is_empty")]
    pub process_noise: Values,
    /// The model alone, without a measurement.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub model: Option<ModelAlone>,
    /// The extended Kalman filter.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ekf: Option<Ekf>,
    /// The unscented Kalman filter.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ukf: Option<Ukf>,
}

/// The sign of an extreme.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Peak {
    /// Above 0.
    Positive,
    /// Below 0.
    Negative,
}

/// Where the model alone starts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ModelAlone {
    /// The first value of each state, such as `{ angle = "0.05 rad", rate = "0 rad/s" }`.
    #[schemars(example = start())]
    pub start: Values,
}

/// Where the extended Kalman filter starts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Ekf {
    /// The first mean of each state, such as `{ angle = "0.05 rad", rate = "0 rad/s" }`.
    #[schemars(example = start())]
    pub start: Values,
    /// The first standard deviation of each state, such as `{ angle = "0.15 rad", rate = "15e3 rad/s" }`.
    #[schemars(example = start_sd())]
    pub start_sd: Values,
}

/// Where the unscented Kalman filter starts, and how its sigma points spread.
///
/// With `n` states they lie at `alpha * sqrt(n + kappa)` standard deviations. The defaults keep all weights
/// of the mean above 0 for every `n`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Ukf {
    /// The first mean of each state, such as `{ angle = "0.05 rad", rate = "0 rad/s" }`.
    #[schemars(example = start())]
    pub start: Values,
    /// The first standard deviation of each state, such as `{ angle = "0.01 rad", rate = "1e3 rad/s" }`.
    #[schemars(example = start_sd())]
    pub start_sd: Values,
    /// The spread of the sigma points; above 0, 1 if left out.
    #[serde(default = "one", deserialize_with = "above_zero")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub alpha: f64,
    /// What is known of the kurtosis, 2 for a Gaussian; 0 or more, 2 if left out.
    #[serde(default = "two", deserialize_with = "not_negative")]
    #[schemars(extend("minimum" = 0))]
    pub beta: f64,
    /// The second parameter of the spread; 0 or more, 1 if left out.
    #[serde(default = "one", deserialize_with = "not_negative")]
    #[schemars(extend("minimum" = 0))]
    pub kappa: f64,
}

fn one() -> f64 {
    1.0
}

fn two() -> f64 {
    2.0
}

fn above_zero<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    let number = f64::deserialize(deserializer)?;
    if number > 0.0 && number.is_finite() {
        Ok(number)
    } else {
        Err(D::Error::custom(format!("`{number}` is not a finite number above 0; write one, such as `1`")))
    }
}

fn not_negative<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    let number = f64::deserialize(deserializer)?;
    if number >= 0.0 && number.is_finite() {
        Ok(number)
    } else {
        Err(D::Error::custom(format!(
            "`{number}` is not a finite number of 0 or more; write one, such as `1`"
        )))
    }
}

fn start() -> serde_json::Value {
    serde_json::json!({ "angle": "0.05 rad", "rate": "0 rad/s" })
}

fn start_sd() -> serde_json::Value {
    serde_json::json!({ "angle": "0.15 rad", "rate": "15e3 rad/s" })
}

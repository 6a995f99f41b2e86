//! What an experiment file says about the estimate that is wanted.

use super::filter::Filter;
use super::kinds::Time;
use super::quantity::Quantity;
use super::sign::NotNegative;
use super::values::Values;
use super::{Fault, Key};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The filters that are wanted, and what they share. Which states there are, the rig knows.
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
    /// `{ angular_acceleration = "1e8 rad^2/s^3" }`, for every filter that does not state its own.
    #[serde(default, skip_serializing_if = "Values::is_empty")]
    pub process_noise: Values,
    /// The filters, at least one, each in a table `[[estimate.filter]]`.
    #[serde(rename = "filter", default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(length(min = 1))]
    pub filters: Vec<Filter>,
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

impl Estimate {
    /// What no single value can be blamed for: the key, and what is wrong.
    pub(super) fn check(&self) -> Result<(), (Key, Fault)> {
        let key = Key::from("estimate");
        if self.filters.is_empty() {
            let why =
                "found no filter; add at least one table `[[estimate.filter]]` with a `name` and a `method`";
            return Err((key, Fault::Value { why: why.to_owned() }));
        }
        let mut seen = BTreeMap::new();
        for (index, filter) in self.filters.iter().enumerate() {
            let at = key.clone().child("filter").index(index);
            filter.check(&at)?;
            if let Some(first) = seen.insert(filter.name.key(), at.clone()) {
                let fault = Fault::DuplicateName { name: filter.name.to_string(), first: first.to_string() };
                return Err((at.child("name"), fault));
            }
        }
        Ok(())
    }
}

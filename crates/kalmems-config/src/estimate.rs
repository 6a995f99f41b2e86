//! What an experiment file says about the estimate that is wanted.

use super::event::EventSource;
use super::filter::{FilterTable, above_zero};
use super::kinds::{Frequency, Time};
use super::process_noise::ProcessNoiseTable;
use super::quantity::Quantity;
use super::sign::{NotNegative, Positive};
use super::{ConfigFault, Key};
use schemars::JsonSchema;
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize};
use std::collections::BTreeMap;

/// The filters that are wanted, and what they share. Which states there are, the rig knows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Estimate {
    /// How much of the start of each record is not judged, because the filter still settles.
    pub skip: Quantity<Time, NotNegative>,
    /// The sign of the first extreme of the angle after the first maximum of the drive after `skip`. Where the measurement is even in
    /// the angle no filter can know it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub first_peak: Option<ExtremeSign>,
    /// The same for the second axis of a device that has two; `first_peak` is then that of the first.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub first_peak_y: Option<ExtremeSign>,
    /// The power density of the process noise by state, such as
    /// `{ angular_acceleration = "1e8 rad^2/s^3" }`, for every filter that does not state its own.
    /// `"from_recording"` in the place of a density, or of the table, has it found from the recording.
    #[serde(default, skip_serializing_if = "ProcessNoiseTable::is_empty")]
    pub process_noise: ProcessNoiseTable,
    /// In how many equal parts of its duration a record is judged beside the whole; none if left out.
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "parts")]
    #[schemars(range(min = 2, max = 100))]
    pub parts: Option<u32>,
    /// Whether the verdict asks of each number of the device whether the beginning of the recordings wants another value of it: one run of
    /// a filter over 25 000 samples for each number.
    #[serde(default = "yes", skip_serializing_if = "is_yes")]
    pub check_numbers: bool,
    /// How many samples behind an interval are waited for before the inputs within it are interpolated, 0, 1 or 2; 2 if left out. The estimates
    /// of a stream lag by as many. The polynomial goes through six samples; with 1 its error is 1.4 times as large, and with 0 it is 4.2 times.
    #[serde(default = "most_lag", skip_serializing_if = "is_most_lag", deserialize_with = "lag")]
    #[schemars(range(min = 0, max = 2))]
    pub interpolation_lag: u32,
    /// How the crossings of a threshold are found, for a device that has one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub crossings: Option<Crossings>,
    /// Where the times of a device's events come from, by the names of the events; from channels of the recording of those names if
    /// left out.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub events: BTreeMap<String, EventSource>,
    /// The filters, at least one, each in a table `[[estimate.filter]]`.
    #[serde(rename = "filter", default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(length(min = 1))]
    pub filters: Vec<FilterTable>,
}

const fn most_lag() -> u32 {
    2
}

#[allow(clippy::trivially_copy_pass_by_ref)] // as serde calls it
const fn is_most_lag(lag: &u32) -> bool {
    *lag == most_lag()
}

fn lag<'de, D: Deserializer<'de>>(deserializer: D) -> Result<u32, D::Error> {
    let number = i64::deserialize(deserializer)?;
    let lag = u32::try_from(number).ok().filter(|lag| *lag <= most_lag());
    lag.ok_or_else(|| {
        D::Error::custom(format!(
            "`{number}` is not 0, 1 or 2; write the samples that are waited for, such as `0`"
        ))
    })
}

const fn yes() -> bool {
    true
}

#[allow(clippy::trivially_copy_pass_by_ref)] // as serde calls it
const fn is_yes(value: &bool) -> bool {
    *value
}

/// A detector of crossings: a derivative of a Gaussian over the signal, of whose response the tops count.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Crossings {
    /// The standard deviation of the Gaussian.
    #[schemars(example = &"30 us")]
    pub width: Quantity<Time, Positive>,
    /// No two crossings are closer than this.
    #[schemars(example = &"300 us")]
    pub separation: Quantity<Time, Positive>,
    /// The smallest response that counts, in standard deviations of the response to noise. Either this or
    /// `false_alarms`.
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "above_zero")]
    #[schemars(extend("exclusiveMinimum" = 0), example = &4.0)]
    pub threshold: Option<f64>,
    /// How often noise without motion may pass for a crossing.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"10 Hz")]
    pub false_alarms: Option<Quantity<Frequency, Positive>>,
    /// The smallest response that counts while crossings follow each other, beside `false_alarms`: so that a motion is
    /// followed as it decays.
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "above_zero")]
    #[schemars(extend("exclusiveMinimum" = 0), example = &2.0)]
    pub keep: Option<f64>,
}

impl Crossings {
    /// What no single value can be blamed for: the key, and what is wrong; `table` is the key of this table.
    pub(super) fn check(&self, table: &Key) -> Result<(), (Key, ConfigFault)> {
        let at = |name: &str| table.clone().child(name);
        let refuse = |name: &str, why: &str| Err((at(name), ConfigFault::Value { why: why.to_owned() }));
        match (self.threshold, &self.false_alarms, self.keep) {
            (None, None, _) => {
                let remedy = "write `threshold = 4`, or `false_alarms = \"10 Hz\"`".to_owned();
                Err((at("threshold"), ConfigFault::MissingKey { remedy }))
            }
            (Some(_), Some(_), _) => refuse("false_alarms", "found `threshold` too; write one of them"),
            (Some(_), None, Some(_)) => refuse("keep", "it goes with `false_alarms`; leave it out"),
            _ => Ok(()),
        }
    }
}

/// The sign of an extreme.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ExtremeSign {
    /// Above 0.
    Positive,
    /// Below 0.
    Negative,
}

impl Estimate {
    /// What no single value can be blamed for: the key, and what is wrong; `table` is the key of this table.
    pub(super) fn check(&self) -> Result<(), (Key, ConfigFault)> {
        let key = Key::from("estimate");
        if self.filters.is_empty() {
            let why =
                "found no filter; add at least one table `[[estimate.filter]]` with a `name` and a `method`";
            return Err((key, ConfigFault::Value { why: why.to_owned() }));
        }
        if let Some(crossings) = &self.crossings {
            crossings.check(&key.clone().child("crossings"))?;
        }
        for (name, event) in &self.events {
            event.check(&key.clone().child("events").child(name))?;
        }
        let mut seen = BTreeMap::new();
        for (index, filter) in self.filters.iter().enumerate() {
            let at = key.clone().child("filter").index(index);
            filter.check(&at)?;
            if let Some(first) = seen.insert(filter.name.key(), at.clone()) {
                let fault =
                    ConfigFault::DuplicateName { name: filter.name.to_string(), first: first.to_string() };
                return Err((at.child("name"), fault));
            }
        }
        Ok(())
    }
}

fn parts<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<u32>, D::Error> {
    let number = i64::deserialize(deserializer)?;
    let parts = u32::try_from(number).ok().filter(|parts| (2..=100).contains(parts));
    parts
        .map(Some)
        .ok_or_else(|| D::Error::custom(format!("`{number}` is not 2 to 100; write the parts, such as `4`")))
}

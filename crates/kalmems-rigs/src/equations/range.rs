//! Quantities that a device is described for between some values alone, such as the ends of a table that a series was fitted to.

use super::names::kind_of;
use super::ordered::OfElement;
use super::table::EquationsTable;
use crate::config::{AnyValue, ConfigError, ConfigFault, Experiment, Key, Sign};
use crate::estimate::{Trajectory, TrajectoryKind};
use crate::inspect::quantity;
use kalmems_equations::{Device, VectorElement};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Between which values a quantity is described; without an end where one is left out.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RangeTable {
    /// The least value.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub from: Option<AnyValue>,
    /// The largest value.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub to: Option<AnyValue>,
}

impl OfElement for RangeTable {
    fn of_element(&self, _: &VectorElement) -> Result<Self, String> {
        Ok(self.clone())
    }
}

/// The same of a device, by the place of the quantity.
#[derive(Clone, Debug)]
pub struct QuantityRange {
    /// The place of the quantity.
    pub quantity: usize,
    name: String,
    unit: String,
    ends: [f64; 2],
}

/// The ranges of an experiment's device.
pub fn ranges(
    experiment: &Experiment,
    table: &EquationsTable,
    device: &Device,
) -> Result<Vec<QuantityRange>, ConfigError> {
    let one = |(name, range): (&str, &RangeTable)| {
        let at = Key::from("device.equations.range").child(name);
        let Some(place) = device.quantities().iter().position(|named| *named.name == *name) else {
            let known = device.quantities().iter().map(|named| &*named.name);
            return Err(experiment.error(at, ConfigFault::unknown_key(name, known)));
        };
        let kind = kind_of(&device.quantities()[place]);
        let end = |key: &str, value: &Option<AnyValue>, none: f64| {
            let read = |value| experiment.value(at.clone().child(key), value, kind, Sign::Any);
            value.as_ref().map_or(Ok(none), read)
        };
        let ends = [end("from", &range.from, f64::NEG_INFINITY)?, end("to", &range.to, f64::INFINITY)?];
        if ends[0] >= ends[1] {
            let why = "its end is not above its beginning".to_owned();
            return Err(experiment.error(at.child("to"), ConfigFault::Value { why }));
        }
        let unit = kind.dimension.to_string();
        Ok(QuantityRange { quantity: place, name: name.to_owned(), unit, ends })
    };
    table.range.iter().map(one).collect()
}

impl QuantityRange {
    /// Values within it that are not at its ends, where both are stated.
    pub fn inner(&self) -> impl Iterator<Item = f64> + use<> {
        let [from, to] = self.ends;
        let is_bounded = from.is_finite() && to.is_finite();
        [0.25, 0.5, 0.75].into_iter().filter(move |_| is_bounded).map(move |part| from + part * (to - from))
    }

    /// What is wrong with a value outside.
    pub fn left(&self, value: f64) -> Option<String> {
        let [from, to] = self.ends;
        let end = if value < from { from } else { to };
        (!(from..=to).contains(&value)).then(|| {
            format!(
                "`{}` comes to {}, outside of what the device is described for, which ends at {}",
                self.name,
                quantity(value, &self.unit),
                quantity(end, &self.unit)
            )
        })
    }
}

/// How often and how far each filter of a segment came outside of a range, until the segment ends.
#[derive(Clone, Debug, Default)]
pub struct RangeTally(Vec<LeftRange>);

/// What one filter made of one range.
#[derive(Clone, Debug)]
struct LeftRange {
    /// The filter's key, and the place of the range.
    of: (String, usize),
    count: usize,
    farthest: f64,
}

impl RangeTally {
    /// Counts what a part of a segment has.
    pub fn add(&mut self, ranges: &[QuantityRange], trajectories: &[Trajectory]) {
        for (place, range) in ranges.iter().enumerate() {
            let [from, to] = range.ends;
            let beyond = |value: f64| (from - value).max(value - to).max(0.0);
            let filtered = |one: &&Trajectory| one.kind == TrajectoryKind::Filtered && one.claims();
            for trajectory in trajectories.iter().filter(filtered) {
                let values = trajectory.state(&range.name);
                for value in values.iter().flat_map(|state| &state.mean).filter(|value| beyond(**value) > 0.0)
                {
                    let of = (trajectory.key.clone(), place);
                    let known = self.0.iter().position(|left| left.of == of).unwrap_or_else(|| {
                        self.0.push(LeftRange { of, count: 0, farthest: *value });
                        self.0.len() - 1
                    });
                    let left = &mut self.0[known];
                    left.count += 1;
                    if beyond(*value) > beyond(left.farthest) {
                        left.farthest = *value;
                    }
                }
            }
        }
    }

    /// What is to be said of a segment that ends.
    pub fn remarks(&self, ranges: &[QuantityRange], trajectories: &[Trajectory]) -> Vec<String> {
        let remark = |left: &LeftRange| {
            let trajectory = trajectories.iter().find(|trajectory| trajectory.key == left.of.0)?;
            let why = ranges.get(left.of.1)?.left(left.farthest)?;
            Some(format!("{}: in {} samples {why}", trajectory.name, left.count))
        };
        self.0.iter().filter_map(remark).collect()
    }
}

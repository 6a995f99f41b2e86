//! What is uncertain of a device: numbers of its table with standard uncertainties, and the correlations of their errors.

use super::reader::read_below;
use super::source::Source;
use super::variation::Variations;
use super::{ConfigError, ConfigFault, Experiment, Key, KeyStep, get};
use crate::units::Value;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// What the names of variances and densities of noise begin with.
const NOISE: &str = "noise";

/// The key beside the device's table at which the correlations stand.
pub const CORRELATION: &str = "correlation";

/// Correlations of the errors of numbers, each pair once, by their keys below the device's table:
/// `"resonator.stiffness" = { "resonator.inertia" = 0.98 }`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct Correlations(BTreeMap<String, BTreeMap<String, f64>>);

impl Correlations {
    /// Those that a file states; none if it states none.
    pub(super) fn of(source: &Source) -> Result<Self, ConfigError> {
        let table: toml::Table = source.text.parse().unwrap_or_default();
        if get(&table, &Key::from("device").child(CORRELATION)).is_none() {
            return Ok(Self::default());
        }
        read_below(source, &Key::from("device").child(CORRELATION))
    }

    /// States the correlations of the errors of these numbers with one another, with so many decimals, in the place of all that was
    /// stated of any of them.
    fn state(&mut self, names: &[String], correlation: &[Vec<f64>], decimals: i32) {
        self.keep(&|name| names.iter().all(|other| other != name));
        for (place, (name, row)) in names.iter().zip(correlation).enumerate() {
            let pairs = names
                .iter()
                .zip(row)
                .take(place)
                .map(|(other, value)| (other.clone(), round(*value, decimals)));
            self.0.insert(name.clone(), pairs.filter(|(_, value)| *value != 0.0).collect());
        }
        self.0.retain(|_, others| !others.is_empty());
    }

    /// Keeps those whose two numbers are wanted, by their names.
    pub(super) fn keep(&mut self, is_wanted: &dyn Fn(&str) -> bool) {
        self.0.retain(|first, others| {
            others.retain(|second, _| is_wanted(second));
            is_wanted(first) && !others.is_empty()
        });
    }

    /// Whether there is none.
    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

/// Decimals with which correlations are written that were computed.
const FEWEST_DECIMALS: i32 = 3;
const MOST_DECIMALS: i32 = 15;

fn round(value: f64, decimals: i32) -> f64 {
    let shift = (0..decimals).fold(1.0, |shift, _| shift * 10.0);
    (value * shift).round() / shift
}

/// Numbers with an uncertainty at most.
const MOST: usize = 64;

/// A number of the device's table with its standard uncertainty.
#[derive(Clone, Debug, PartialEq)]
pub struct UncertainNumber {
    /// Where it stands.
    pub key: Key,
    /// The same below the device's table, as messages and results have it.
    pub name: String,
    /// As it is written.
    pub value: Value,
    /// Its standard uncertainty in SI, above 0.
    pub sd: f64,
}

/// A direction in which the device may differ from its table, independent of the others: p = p₀ + b·s, with b of the standard normal
/// distribution. With the covariance Π of the uncertain numbers and its Cholesky factor L (Π = L·Lᵀ) the steps s are the columns of L, so
/// that numbers whose errors are uncorrelated with all others are a direction each.
#[derive(Clone, Debug, PartialEq)]
pub struct Direction {
    /// The numbers whose errors hang together with those that it changes, the same for all directions of such a group.
    pub group: Vec<String>,
    /// The numbers that it changes, each with its change in SI.
    pub steps: Vec<(UncertainNumber, f64)>,
}

impl Direction {
    /// What contributions to an uncertainty are listed under.
    pub fn name(&self) -> String {
        self.group.join(" with ")
    }
}

impl Experiment {
    /// The numbers of the device's table that are stated with an uncertainty above 0, in the order of the file; but for variances of noise,
    /// which enter no answer.
    pub fn uncertain(&self) -> Result<Vec<UncertainNumber>, ConfigError> {
        let mut found = Vec::new();
        let mut take = |key: &Key, value: Value| {
            // A variance of noise enters no answer to first order.
            if let Some(sd) = value.uncertainty().filter(|sd| *sd > 0.0 && !key.last().starts_with(NOISE)) {
                found.push(UncertainNumber { key: key.clone(), name: key.below(2), value, sd });
            }
        };
        each_number(self.device.written(), &self.device_key(), &mut take);
        if let Some(first) = found.get(MOST) {
            let why =
                format!("more than {MOST} numbers have an uncertainty; leave out those that matter least");
            return Err(self.error(first.key.clone(), ConfigFault::Value { why }));
        }
        Ok(found)
    }

    /// The same; of an experiment in one direction of a device's uncertainty those of that device.
    pub fn stated_uncertain(&self) -> Result<Vec<UncertainNumber>, ConfigError> {
        if self.was_uncertain.is_empty() { self.uncertain() } else { Ok(self.was_uncertain.clone()) }
    }

    /// The numbers of the device's table without one, by their keys below it; but for those that are zero, of which what is off may have any
    /// size, and variances of noise, which enter no answer.
    pub fn held_as_exact(&self) -> Vec<String> {
        let mut exact = Vec::new();
        let mut take = |key: &Key, value: Value| {
            let is_exact = value.uncertainty().is_none_or(|sd| sd == 0.0);
            if is_exact && value.si() != 0.0 && !key.last().starts_with(NOISE) {
                exact.push(key.below(2));
            }
        };
        each_number(self.device.written(), &self.device_key(), &mut take);
        exact
    }

    /// States how the errors of numbers of the device's table hang together, by their keys below it, in the place of what was stated of
    /// any of them: with as few decimals as leave a covariance, and of what is near 1 its distance from 1 to a hundredth, on which it
    /// depends how far two errors cancel.
    pub fn set_correlations(&mut self, names: &[String], correlation: &[Vec<f64>]) {
        let rounded = |decimals: i32| -> Vec<Vec<f64>> {
            correlation.iter().map(|row| row.iter().map(|value| round(*value, decimals)).collect()).collect()
        };
        let is_near = |(value, rounded): (&f64, &f64)| (value - rounded).abs() <= 0.01 * (1.0 - value.abs());
        // How well a number is known beside those before it is what many numbers that hang together closely lose first.
        let exact = cholesky(correlation);
        let is_kept = |decimals: &i32| {
            let rounded = rounded(*decimals);
            let near = correlation.iter().flatten().zip(rounded.iter().flatten()).all(is_near);
            let kept = |(place, row): (usize, &Vec<f64>)| {
                let own = exact.as_ref().map_or(row[place], |exact| exact[place][place]);
                (row[place] - own).abs() <= 0.01 * own
            };
            near && cholesky(&rounded).is_some_and(|root| root.iter().enumerate().all(kept))
        };
        let decimals = (FEWEST_DECIMALS..MOST_DECIMALS).find(is_kept);
        self.device.correlation.state(names, correlation, decimals.unwrap_or(MOST_DECIMALS));
        self.variations = Variations::default();
    }

    fn device_key(&self) -> Key {
        Key::from("device").child(self.device_name())
    }

    /// The independent directions in which the device may differ from its table, by the uncertainties and correlations that are stated.
    pub fn directions(&self) -> Result<Vec<Direction>, ConfigError> {
        let numbers = self.uncertain()?;
        let correlation = self.correlation_of(&numbers)?;
        let mut directions = Vec::new();
        for group in groups(&correlation) {
            let names: Vec<String> = group.iter().map(|place| numbers[*place].name.clone()).collect();
            let within: Vec<Vec<f64>> =
                group.iter().map(|i| group.iter().map(|j| correlation[*i][*j]).collect()).collect();
            let Some(root) = cholesky(&within) else {
                let why = format!(
                    "no errors have these correlations: the matrix of {} has a negative eigenvalue; correct one of them",
                    names.join(", ")
                );
                return Err(self.error(Key::from("device").child(CORRELATION), ConfigFault::Value { why }));
            };
            directions.extend((0..group.len()).filter_map(|column| {
                let steps = group.iter().zip(&root).filter_map(|(place, row)| {
                    let step = row[column] * numbers[*place].sd;
                    (step != 0.0).then(|| (numbers[*place].clone(), step))
                });
                let steps: Vec<_> = steps.collect();
                (!steps.is_empty()).then(|| Direction { group: names.clone(), steps })
            }));
        }
        Ok(directions)
    }

    /// The matrix of correlations of these numbers.
    fn correlation_of(&self, numbers: &[UncertainNumber]) -> Result<Vec<Vec<f64>>, ConfigError> {
        let mut matrix: Vec<Vec<f64>> = (0..numbers.len())
            .map(|i| (0..numbers.len()).map(|j| f64::from(u8::from(i == j))).collect())
            .collect();
        let place = |key: &Key, name: &str| {
            let known = || numbers.iter().map(|number| &*number.name);
            numbers.iter().position(|number| number.name == name).ok_or_else(|| {
                let fault = if numbers.is_empty() {
                    let why =
                        "no number of the device has an uncertainty; write one after it, such as `± 0.3 %`";
                    ConfigFault::Value { why: why.to_owned() }
                } else {
                    ConfigFault::unknown_key(name, known())
                };
                self.error(key.clone(), fault)
            })
        };
        for (first, others) in &self.device.correlation.0 {
            let key = Key::from("device").child(CORRELATION).child(first);
            let i = place(&key, first)?;
            for (second, value) in others {
                let key = key.clone().child(second);
                let j = place(&key, second)?;
                let twice = i == j || matrix[i][j] != 0.0;
                if twice || !(-1.0..=1.0).contains(value) {
                    let why = if twice {
                        format!("`{first}` and `{second}` have a correlation already; each pair stands once")
                    } else {
                        format!("a correlation lies between -1 and 1; found {value}")
                    };
                    return Err(self.error(key, ConfigFault::Value { why }));
                }
                (matrix[i][j], matrix[j][i]) = (*value, *value);
            }
        }
        Ok(matrix)
    }

    /// Refuses an uncertainty that nothing would take into account: behind a value outside of the device's table.
    pub(super) fn check_uncertainties(&self) -> Result<(), ConfigError> {
        let Ok(table) = self.text().parse::<toml::Table>() else { return Ok(()) };
        for (name, value) in &table {
            // Text for people.
            if ["device", "name", "description"].contains(&name.as_str()) {
                continue;
            }
            let mut first: Option<(Key, Value)> = None;
            let mut take = |key: &Key, value: Value| {
                if value.uncertainty().is_some() {
                    first.get_or_insert((key.clone(), value));
                }
            };
            if let Ok(value) = serde_json::to_value(value) {
                each_number(&value, &Key::default().child(name), &mut take);
            }
            if let Some((key, value)) = first {
                let why = format!(
                    "`{}` has an uncertainty, and only numbers of the device's table are taken as uncertain; write `{}`",
                    value.text(),
                    value.nominal()
                );
                return Err(self.error(key, ConfigFault::Value { why }));
            }
        }
        Ok(())
    }
}

/// Gives each value with a unit, and each number, to a function.
fn each_number(value: &serde_json::Value, key: &Key, take: &mut dyn FnMut(&Key, Value)) {
    let mut parsed = |text: &str| {
        if let Ok(value) = Value::parse(text) {
            take(key, value);
        }
    };
    match value {
        serde_json::Value::Object(table) => {
            table.iter().for_each(|(name, value)| each_number(value, &key.clone().child(name), take));
        }
        serde_json::Value::Array(list) => {
            list.iter().enumerate().for_each(|(i, value)| each_number(value, &key.clone().index(i), take));
        }
        serde_json::Value::String(text) => parsed(text),
        serde_json::Value::Number(number) => parsed(&number.to_string()),
        _ => {}
    }
}

/// Takes every uncertainty of a device away, and the correlations: its numbers as if they were exact.
pub fn exactly(document: &mut toml::Table) {
    fn strip(value: &mut toml::Value) {
        // `{ value = "3 N/m", sd = "1 %" }` is what reads as `3 N/m ± 1 %`.
        if let toml::Value::Table(table) = value
            && table.len() == 2
            && table.contains_key("sd")
            && let Some(number) = table.get("value")
        {
            *value = number.clone();
        }
        match value {
            toml::Value::Table(table) => table.iter_mut().for_each(|(_, value)| strip(value)),
            toml::Value::Array(list) => list.iter_mut().for_each(strip),
            toml::Value::String(text) => {
                if let Ok(value) = Value::parse(text)
                    && value.uncertainty().is_some()
                {
                    *text = value.nominal();
                }
            }
            _ => {}
        }
    }
    if let Some(toml::Value::Table(device)) = document.get_mut("device") {
        device.remove(CORRELATION);
        device.iter_mut().for_each(|(_, table)| strip(table));
    }
}

/// The places of numbers in groups that are uncorrelated with one another, in the order of their first.
fn groups(correlation: &[Vec<f64>]) -> Vec<Vec<usize>> {
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for (place, row) in correlation.iter().enumerate() {
        let is_near = |group: &Vec<usize>| group.iter().any(|other| row[*other] != 0.0);
        let (near, apart): (Vec<_>, Vec<_>) = groups.into_iter().partition(is_near);
        let mut own: Vec<usize> = near.into_iter().flatten().chain([place]).collect();
        own.sort_unstable();
        groups = apart;
        groups.push(own);
    }
    groups.sort_unstable();
    groups
}

/// The lower Cholesky factor of a matrix of correlations; a correlation of 1 gives a column of zeros. `None` where a pivot is negative by
/// more than rounding.
pub fn cholesky(matrix: &[Vec<f64>]) -> Option<Vec<Vec<f64>>> {
    // What is left of 1 by rounding, where correlations are written with a few digits.
    const ROUNDING: f64 = 1e-9;
    let n = matrix.len();
    let mut root = vec![vec![0.0; n]; n];
    for column in 0..n {
        let known: f64 = root[column][..column].iter().map(|value| value * value).sum();
        let pivot = matrix[column][column] - known;
        if pivot < -ROUNDING {
            return None;
        }
        if pivot <= ROUNDING {
            // Nothing of its own is left, so that nothing else may depend on it.
            for row in column + 1..n {
                let left = matrix[row][column] - dot(&root[row], &root[column], column);
                if left.abs() > ROUNDING.sqrt() {
                    return None;
                }
            }
            continue;
        }
        root[column][column] = pivot.sqrt();
        for row in column + 1..n {
            root[row][column] = (matrix[row][column] - dot(&root[row], &root[column], column)) / pivot.sqrt();
        }
    }
    Some(root)
}

fn dot(a: &[f64], b: &[f64], count: usize) -> f64 {
    a.iter().zip(b).take(count).map(|(a, b)| a * b).sum()
}

impl Key {
    /// The same without its first names, as text.
    fn below(&self, names: usize) -> String {
        let steps = self.steps().iter().skip(names);
        steps
            .fold(Self::default(), |key, step| match step {
                KeyStep::Name(name) => key.child(name),
                KeyStep::Index(index) => key.index(*index),
            })
            .to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_factor_times_its_transpose_is_the_matrix() {
        let matrix = vec![vec![1.0, 0.9, -0.3], vec![0.9, 1.0, 0.1], vec![-0.3, 0.1, 1.0]];
        let root = cholesky(&matrix).unwrap();
        for i in 0..3 {
            for j in 0..3 {
                assert!((dot(&root[i], &root[j], 3) - matrix[i][j]).abs() < 1e-15, "{i} {j}");
            }
        }
        // Errors that are one and the same, and such as there cannot be.
        assert!(cholesky(&[vec![1.0, 1.0], vec![1.0, 1.0]]).is_some());
        assert!(cholesky(&[vec![1.0, 1.0, 0.5], vec![1.0, 1.0, -0.5], vec![0.5, -0.5, 1.0]]).is_none());
        assert!(cholesky(&[vec![1.0, 0.9, -0.9], vec![0.9, 1.0, 0.9], vec![-0.9, 0.9, 1.0]]).is_none());
    }

    #[test]
    fn numbers_that_hang_together_are_one_group() {
        let mut correlation: Vec<Vec<f64>> =
            (0..5).map(|i| (0..5).map(|j| f64::from(u8::from(i == j))).collect()).collect();
        for (i, j) in [(0, 3), (3, 4)] {
            (correlation[i][j], correlation[j][i]) = (0.5, 0.5);
        }
        assert_eq!(groups(&correlation), [vec![0, 3, 4], vec![1], vec![2]]);
    }
}

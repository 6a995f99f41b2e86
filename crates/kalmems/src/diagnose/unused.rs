//! Parameters of equations that do not enter what a filter computes.

use super::suspect::{NumberRole, Suspect, equations_of};
use crate::config::Key;
use std::collections::BTreeSet;
use toml::{Table, Value};

/// Tables of equations whose entries count where something else names them.
const DEFINITIONS: [&str; 3] = ["let", "parameters", "quantities"];
/// Tables of equations with an entry for each measurement, and for others.
const OF_MEASUREMENTS: [&str; 2] = ["measure", "noise"];

/// The names that a filter of equations uses, of the document of its experiment; `None` of another device, and where it is not known which
/// measurements the filter uses.
///
/// They are words of texts: a unit of the same name counts as well.
pub(super) struct UsedNames(BTreeSet<String>);

impl UsedNames {
    pub(super) fn of(document: &Table) -> Option<Self> {
        let equations = equations_of(document)?;
        let measures = equations.get("measure")?.as_table()?;
        let filter = document.get("estimate")?.get("filter")?.as_array()?.first()?;
        let channels = filter.get("channels")?.as_array()?;
        let channels = channels.iter().map(Value::as_str).collect::<Option<Vec<&str>>>()?;
        if !channels.iter().all(|channel| measures.contains_key(*channel)) {
            return None;
        }
        let mut used = Self(BTreeSet::new());
        let is_definition = |name: &str| DEFINITIONS.contains(&name);
        for (name, table) in equations.iter().filter(|(name, _)| !is_definition(name)) {
            match table.as_table().filter(|_| OF_MEASUREMENTS.contains(&name.as_str())) {
                Some(entries) => {
                    let is_used = |name: &str| !measures.contains_key(name) || channels.contains(&name);
                    entries.iter().filter(|(name, _)| is_used(name)).for_each(|(_, entry)| used.take(entry));
                }
                None => used.take(table),
            }
        }
        document.get("estimate").into_iter().for_each(|estimate| used.take(estimate));
        used.follow(equations);
        Some(used)
    }

    /// Whether a suspect is of parameters alone that are not used.
    pub(super) fn leaves_out(&self, suspect: &Suspect) -> bool {
        let of_parameters = Key::from("device.equations.parameters");
        let NumberRole::Factor(numbers) = &suspect.what else { return false };
        numbers.iter().all(|number| {
            let name = number.key.last();
            number.key == of_parameters.clone().child(name) && !self.0.contains(first_word(name))
        })
    }

    /// Takes the definitions in that the names ask for.
    fn follow(&mut self, equations: &Table) {
        let definitions = DEFINITIONS.iter().filter_map(|name| equations.get(*name)?.as_table());
        let mut left: Vec<(&String, &Value)> = definitions.flatten().collect();
        loop {
            let (asked, others): (Vec<_>, Vec<_>) =
                left.iter().copied().partition(|(name, _)| self.0.contains(first_word(name)));
            if asked.is_empty() {
                return;
            }
            for (_, value) in asked {
                self.take(value);
            }
            left = others;
        }
    }

    /// Takes all words of texts in.
    fn take(&mut self, value: &Value) {
        match value {
            Value::String(text) => self.0.extend(words(text).map(ToOwned::to_owned)),
            Value::Table(table) => table.iter().for_each(|(name, value)| {
                self.0.extend(words(name).map(ToOwned::to_owned));
                self.take(value);
            }),
            Value::Array(list) => list.iter().for_each(|value| self.take(value)),
            _ => {}
        }
    }
}

fn words(text: &str) -> impl Iterator<Item = &str> {
    text.split(|c: char| !(c.is_alphanumeric() || c == '_')).filter(|word| !word.is_empty())
}

/// The name of what may be a vector.
fn first_word(name: &str) -> &str {
    words(name).next().unwrap_or(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    const STAGE: &str = r#"
[device.equations]
states = { x = "m", v = "m/s" }
let = { w = "2*pi*f0", gap = "rest - x", wide = "2*width" }
derivative = { x = "v", v = "-w^2*x" }
measure = { near = "gain_near/gap in V", far = "gain_far*wide in V" }
noise = { near = "noise_near", far = "noise_far", v = "strength" }
quantities = { edge = "arm*x in m" }
[device.equations.parameters]
f0 = "1 kHz"
rest = "2 um"
width = "3 um"
gain_near = "1 V um"
gain_far = "1 V/um"
noise_near = "1e-6 V^2"
noise_far = "1e-6 V^2"
strength = "1 m^2/s^3"
arm = "2"
kept = "3"
[[estimate.filter]]
name = "one"
channels = ["near"]
states = { kept = { start_sd = "1 %" } }
"#;

    #[test]
    fn only_what_a_filter_reads_is_used() {
        let document: Table = STAGE.parse().unwrap();
        let used = UsedNames::of(&document).unwrap();
        let parameters = document["device"]["equations"]["parameters"].as_table().unwrap();
        let unused: BTreeSet<&str> =
            parameters.keys().map(String::as_str).filter(|name| !used.0.contains(*name)).collect();
        assert_eq!(unused, BTreeSet::from(["arm", "gain_far", "noise_far", "width"]));
    }

    #[test]
    fn nothing_is_left_out_of_a_filter_of_all_channels() {
        let document: Table = STAGE.replace("channels = [\"near\"]\n", "").parse().unwrap();
        assert!(UsedNames::of(&document).is_none());
    }
}

//! A number that is wrong, as a state of the filter.

use super::bench::TrialBench;
use super::report::digits;
use super::suspect::{NumberRole, Suspect, below_device};
use crate::config::{Key, put, written};
use crate::estimate::DeviceParameter;
use kalmems_core::Portable;
use toml::{Table, Value};

/// About how many times what a number is wrong by its standard deviation at the start is, so that it is no surprise to the filter.
const PRIOR: f64 = 2.0;

/// The entry of the filter's `states` with which it estimates a number that is wrong by a size, such as
/// `stiffness = { start_sd = "0.6 %" }`; `None` where it cannot, or does already.
pub(super) fn entry(bench: &TrialBench, suspect: &Suspect, size: f64) -> Option<String> {
    let rig = bench.workbench.rig(&bench.experiment).ok()?;
    let parameters = rig.parameters(&bench.experiment);
    let parameter = parameters.iter().find(|parameter| stands_for(parameter, suspect))?;
    let start_sd = Value::String(start_sd(parameter, suspect, size)?);
    let table = Table::from_iter([("start_sd".to_owned(), start_sd)]);
    let key = Key::from("estimate").child("filter").index(0).child("states").child(parameter.name);
    if crate::config::get(&bench.document, &key).is_some() {
        return None;
    }
    // The method may refuse it, or the device.
    let mut document = bench.document.clone();
    put(&mut document, &key, Value::Table(table.clone())).ok()?;
    let text = toml::to_string(&document).ok()?;
    let experiment = bench.workbench.parse(&text, bench.experiment.path()).ok()?;
    rig.claims(&experiment).ok()?;
    Some(format!("{} = {}", parameter.name, Value::Table(table)))
}

/// Whether the filter has a number as a state already: what its innovations ask of the number is in that state.
pub(super) fn is_state(bench: &TrialBench, suspect: &Suspect) -> bool {
    let Ok(rig) = bench.workbench.rig(&bench.experiment) else { return false };
    let states = Key::from("estimate").child("filter").index(0).child("states");
    rig.parameters(&bench.experiment).iter().any(|parameter| {
        crate::config::get(&bench.document, &states.clone().child(parameter.name)).is_some()
            && stands_for(parameter, suspect)
    })
}

/// Whether a parameter is the same number, or the common factor of the same numbers.
fn stands_for(parameter: &DeviceParameter, suspect: &Suspect) -> bool {
    let [(pattern, 1)] = parameter.written else { return false };
    let is_it = |key: &Key| matches(pattern, &below_device(key));
    match &suspect.what {
        NumberRole::Factor(numbers) => {
            let is_common = numbers.len() > 1 || !pattern.contains('*');
            is_common && numbers.iter().all(|number| is_it(&number.key))
        }
        NumberRole::LeftOut { key, .. } => !parameter.is_factor() && is_it(key),
        _ => false,
    }
}

/// Whether a key is one of those that a pattern stands for, in which `*` is any name.
fn matches(pattern: &str, key: &str) -> bool {
    let (mut wanted, mut found) = (pattern.split('.'), key.split('.'));
    wanted.by_ref().zip(found.by_ref()).all(|(wanted, found)| wanted == "*" || wanted == found)
        && pattern.split('.').count() == key.split('.').count()
}

fn start_sd(parameter: &DeviceParameter, suspect: &Suspect, size: f64) -> Option<String> {
    let factor = size.portable_exp_m1().abs();
    if parameter.is_factor() {
        return Some(format!("{} %", prior(100.0 * factor)?));
    }
    let (number, unit) = match &suspect.what {
        NumberRole::Factor(numbers) => {
            let [number] = numbers.as_slice() else { return None };
            (number.written.abs() * factor, number.unit.as_str())
        }
        NumberRole::LeftOut { left_out, .. } => ((size * left_out.step).abs(), left_out.unit),
        _ => return None,
    };
    match written(prior(number)?, unit) {
        Value::String(text) => Some(text),
        _ => None,
    }
}

/// About so many times what the number is wrong by, to one digit.
fn prior(wrong_by: f64) -> Option<f64> {
    (wrong_by > 0.0 && wrong_by.is_finite()).then(|| digits(PRIOR * wrong_by, 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pattern_stands_for_every_name_at_its_star() {
        assert!(matches("electrodes.*.gap", "electrodes.1A.gap"));
        assert!(!matches("electrodes.*.gap", "electrodes.1A.gain"));
        assert!(!matches("resonator.stiffness", "second_axis.resonator.stiffness"));
        assert!(!matches("electrodes.*.gap", "electrodes.1A"));
    }

    #[test]
    fn the_prior_is_about_twice_what_a_number_is_wrong_by() {
        assert_eq!(prior(0.31), Some(0.6));
        assert_eq!(prior(4.8e-5), Some(1e-4));
        assert_eq!(prior(0.0), None);
    }
}

//! An experiment with the numbers that an identification found, whose noises are to be found again.

use super::FoundNoise;
use super::document::{document, text};
use crate::config::{ConfigError, Experiment, FROM_RECORDING, Key, put};
use crate::rigs::Workbench;
use crate::stated_start::write_start_sds;
use toml::Value;

/// The experiment with the numbers of `found` in the places of its own, and with these noises left to the recording again.
///
/// A noise that is found with wrong numbers contains a part of the motion. With the numbers that were identified it is found without that part, and
/// the numbers can be identified with it once more. Their uncertainties are left out: the recording that told them is the one that is used again.
///
/// # Errors
/// An experiment that cannot be written as a file.
pub fn with_found_numbers(
    workbench: &Workbench,
    experiment: &Experiment,
    found: &Experiment,
    noises: &[FoundNoise],
) -> Result<Experiment, ConfigError> {
    let (mut own, found) = (document(experiment)?, document(found)?);
    // What a filter takes from the uncertainties stays.
    write_start_sds(&mut own, experiment, workbench.rig(experiment)?.parameters(experiment))?;
    if let (Some(own), Some(found)) = (own.get_mut("device"), found.get("device")) {
        take(own, found);
    }
    for noise in noises {
        let (key, word) = (Key::from(noise.key.as_str()), Value::String(FROM_RECORDING.to_owned()));
        put(&mut own, &key, word).map_err(|fault| experiment.error(key.clone(), fault))?;
    }
    Experiment::parse(&text(&own, experiment)?, experiment.path())
}

/// The experiment with these noises in the places of its own.
///
/// # Errors
/// An experiment that cannot be written as a file.
pub fn with_noises(
    workbench: &Workbench,
    experiment: &Experiment,
    noises: &[FoundNoise],
) -> Result<Experiment, ConfigError> {
    let mut own = document(experiment)?;
    for noise in noises {
        let (key, value) = (Key::from(noise.key.as_str()), Value::String(noise.written.clone()));
        put(&mut own, &key, value).map_err(|fault| experiment.error(key.clone(), fault))?;
    }
    workbench.parse(&text(&own, experiment)?, experiment.path())
}

/// Takes the values that differ, where both have one.
fn take(own: &mut Value, found: &Value) {
    match (own, found) {
        (Value::Table(own), Value::Table(found)) => {
            for (key, own) in own {
                if let Some(found) = found.get(key) {
                    take(own, found);
                }
            }
        }
        (Value::Array(own), Value::Array(found)) if own.len() == found.len() => {
            own.iter_mut().zip(found).for_each(|(own, found)| take(own, found));
        }
        (own, Value::String(found)) => {
            let value = Value::String(without_uncertainty(found));
            if *own != value {
                *own = value;
            }
        }
        (own, found) => found.clone_into(own),
    }
}

/// A value without its uncertainty: `1.1 V ± 2 %` and `1.1 ± 0.1 V` are `1.1 V`.
fn without_uncertainty(text: &str) -> String {
    let Some((value, sd)) = text.split_once('±') else { return text.to_owned() };
    let (value, unit) = (value.trim(), sd.trim().split_once(' ').map_or("", |(_, unit)| unit.trim()));
    if value.contains(' ') || unit.is_empty() || unit == "%" {
        value.to_owned()
    } else {
        format!("{value} {unit}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_keeps_its_unit_without_its_uncertainty() {
        for (text, expected) in [
            ("1786.766 Hz ± 0.0055 %", "1786.766 Hz"),
            ("0.004773 ± 1.4 %", "0.004773"),
            ("23.0 ± 0.1 V", "23.0 V"),
            ("3865.3 rad/s^2/V ± 26 rad/s^2/V", "3865.3 rad/s^2/V"),
            ("5.71 pF", "5.71 pF"),
        ] {
            assert_eq!(without_uncertainty(text), expected);
        }
    }
}

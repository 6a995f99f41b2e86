//! Noises of a readout that an experiment does not state.

use super::unknown::{of_readout, step_name, with};
use super::with_stand_ins;
use crate::config::{ConfigError, ConfigFault, Experiment, FROM_RECORDING, Key};
use crate::rigs::Workbench;
use toml::{Table, Value};

/// The noises that may be unstated: more than any device has.
const MOST: usize = 64;

/// The experiment with each noise of a readout that its filters need and it does not state left to its recording. What else is wrong with it is said by
/// who reads its device.
pub(super) fn with_unstated_left_open(
    workbench: &Workbench,
    raw: &Experiment,
) -> Result<Experiment, ConfigError> {
    let mut left_open = raw.clone();
    if raw.estimate.as_ref().is_none_or(|estimate| estimate.filters.is_empty()) {
        return Ok(left_open);
    }
    let mut unstated = of_equations(raw);
    for _ in 0..MOST {
        let Some(key) = unstated.pop().or(missing(workbench, &left_open)?) else { break };
        let word = Value::String(FROM_RECORDING.to_owned());
        let text = with(left_open.text(), &key, &word);
        let Some(Ok(next)) = text.map(|text| Experiment::parse(&text, raw.path())) else { break };
        left_open = next;
    }
    Ok(left_open)
}

/// The noise of a readout that is missing where the device is read; `None` where nothing is wrong, or something else.
fn missing(workbench: &Workbench, raw: &Experiment) -> Result<Option<Key>, ConfigError> {
    let text = with_stand_ins(raw.text(), &of_readout(raw)?);
    let Err(error) = workbench.parse(&text, raw.path()) else { return Ok(None) };
    let is_missing = matches!(error.fault, ConfigFault::MissingKey { .. });
    Ok(Some(error.place.key).filter(|key| is_missing && is_noise_of_readout(key)))
}

/// The noises of what equations measure and a recording has: an equation that is not recorded needs none.
fn of_equations(raw: &Experiment) -> Vec<Key> {
    let Ok(document) = raw.text().parse::<Table>() else { return Vec::new() };
    let Some(equations) = document.get("device").and_then(|device| device.get("equations")) else {
        return Vec::new();
    };
    let stated = |name: &str| equations.get("noise").is_some_and(|noise| noise.get(name).is_some());
    let recorded = |name: &str| {
        raw.recordings.iter().any(|recording| recording.channels.iter().any(|(meaning, _)| meaning == name))
    };
    let measured = equations.get("measure").and_then(Value::as_table).into_iter().flat_map(Table::keys);
    let unstated = measured.filter(|name| recorded(name) && !stated(name));
    unstated.map(|name| Key::from("device.equations.noise").child(name)).collect()
}

/// Whether this is where a device states the noise of a signal of its filters.
fn is_noise_of_readout(key: &Key) -> bool {
    let names: Vec<&str> = key.steps().iter().filter_map(step_name).collect();
    matches!(*names.as_slice(), ["device", _, "readout", "noise_variance" | "noise_density"])
}

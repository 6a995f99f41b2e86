//! Which parameters of the mechanics a filter takes for uncertain.

use crate::config::{ConfigError, ConfigFault, Experiment, FilterTable, Key, Method};
use crate::estimate::DeviceParameter;

/// The parameters, in the order of their states.
pub const NAMES: [&str; 3] = ["spring", "damping", "mass"];

/// The same, with the keys that stand for them.
pub static PARAMETERS: [DeviceParameter; 3] = [
    DeviceParameter::factor(NAMES[0]).written(&[("proof_mass.spring", 1)]),
    DeviceParameter::factor(NAMES[1]).written(&[("proof_mass.damping", 1)]),
    DeviceParameter::factor(NAMES[2]).written(&[("proof_mass.mass", 1)]),
];

/// How far each of them may be off, relative to what the device table says; 0 where the filter does not ask.
pub fn spread(experiment: &Experiment, at: &Key, filter: &FilterTable) -> Result<[f64; 3], ConfigError> {
    let at = at.clone().child("states");
    let refuse = |key: Key, why: &str| Err(experiment.error(key, ConfigFault::Value { why: why.to_owned() }));
    if !matches!(filter.method, Method::ConsiderEkf | Method::Bank) {
        if filter.states.is_empty() {
            return Ok([0.0; 3]);
        }
        let why = "the accelerometer's parameters are no states of this method: the innovations hardly tell them; use \
                   `consider_ekf` or `bank`, or identify them";
        return refuse(at, why);
    }
    if filter.known_acceleration {
        return refuse(at, "this method has the acceleration as a state; leave `known_acceleration` out");
    }
    if let Some(name) = filter.states.keys().find(|name| !NAMES.contains(&name.as_str())) {
        return Err(experiment.error(at.child(name), ConfigFault::unknown_key(name, NAMES)));
    }
    let mut spread = [0.0; 3];
    for (slot, parameter) in spread.iter_mut().zip(&PARAMETERS) {
        let Some(state) = filter.states.get(parameter.name) else { continue };
        let key = at.clone().child(parameter.name);
        if state.drift.is_some() {
            return refuse(key.child("drift"), "the parameter is a constant here; leave it out");
        }
        *slot = parameter.start_sd(experiment, &key, state)?;
        if *slot >= 1.0 {
            return refuse(
                key.child("start_sd"),
                "a parameter that is off by all of itself may be 0; write less than 100 %",
            );
        }
    }
    Ok(spread)
}

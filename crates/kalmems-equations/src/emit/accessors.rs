//! Names of the states in a source: a place, and functions that say mean and unit.

use super::filter::FilterProgram;
use super::names::plain_names;
use super::request::EmitRequest;
use crate::device::{Device, Named};

/// What already stands in a header with the filter's name before it, in capitals.
const CONSTANTS: [&str; 14] = [
    "H",
    "STATES",
    "INTERVAL_S",
    "MEASUREMENTS",
    "UPDATE_EVERY",
    "STARTING",
    "FOLLOWING",
    "LEFT_OUT",
    "OVERCONFIDENT",
    "SIGN_UNSURE",
    "LOST",
    "SATURATED",
    "PARAMETERS_VERSION",
    "EXPERIMENT",
];

/// The same in small letters.
const FUNCTIONS: [&str; 18] = [
    "t",
    "state_t",
    "watch_t",
    "status_t",
    "kept_t",
    "parameters_t",
    "start",
    "predict",
    "step",
    "status",
    "innovation",
    "value",
    "values",
    "variance",
    "variances",
    "configure",
    "self_test",
    "new",
];

/// A state as a program names it.
pub(super) struct StateAccess {
    /// Its name in capitals: the place.
    pub(super) constant: String,
    /// Its name with the unit: `angle_rad`.
    pub(super) function: String,
    /// Its name as an argument.
    pub(super) argument: String,
    /// The state and its unit, for a comment.
    pub(super) what: String,
    /// The unit of its mean, and what it is counted from, in SI.
    pub(super) scale: f64,
    pub(super) origin: f64,
}

/// The states in their order.
pub(super) fn state_accesses(
    device: &Device,
    request: &EmitRequest,
    program: &FilterProgram,
) -> Vec<StateAccess> {
    let free = request.free.iter().filter_map(|free| device.parameters.get(free.parameter));
    let named: Vec<&Named> = device.states.iter().chain(free.map(|parameter| &parameter.named)).collect();
    let names = plain_names(named.iter().copied());
    let (mut constants, mut functions): (Vec<String>, Vec<String>) = (Vec::new(), Vec::new());
    let once = |mut name: String, of: &mut Vec<String>, reserved: &[&str]| {
        while of.contains(&name) || reserved.contains(&&*name) {
            name.push('_');
        }
        of.push(name.clone());
        name
    };
    let of = |(k, (named, name)): (usize, (&&Named, &String))| {
        let unit = named.unit.si_header();
        let is_ratio = unit.is_empty() || unit == "1";
        let with_unit = if is_ratio { name.clone() } else { format!("{name}_{unit}") };
        let what = if is_ratio {
            named.name.to_string()
        } else {
            format!("{} in {}", named.name, unit.replace('_', " "))
        };
        StateAccess {
            constant: once(name.to_ascii_uppercase(), &mut constants, &CONSTANTS),
            function: once(with_unit, &mut functions, &FUNCTIONS),
            argument: format!("x_{name}"),
            what,
            scale: program.units.scale(k),
            origin: program.units.origin(k),
        }
    };
    named.iter().zip(&names).enumerate().map(of).collect()
}

//! What no test of innovations can see, by the equations of a device.

use super::suspect::{equations_of, expressions_with};
use crate::config::Experiment;
use crate::expand::expand;
use crate::rigs::Workbench;
use toml::{Table, Value};

/// States that depend on one another and on no input, and are a part of the device that the rest follows: an input that is modelled, and that noise
/// alone drives.
pub(super) struct UnknownInput {
    /// The states.
    pub(super) states: Vec<String>,
    /// All that their equations and noises depend on.
    pub(super) names: Vec<String>,
}

/// Whether a table of the equations has this entry.
pub(super) fn is_entry(equations: &Table, table: &str, name: &str) -> bool {
    equations.get(table).and_then(Value::as_table).is_some_and(|table| table.contains_key(name))
}

/// The inputs of equations that noise alone drives.
pub(super) fn unknown_inputs(equations: &Table) -> Vec<UnknownInput> {
    let states = names(equations, "states");
    let mut inputs: Vec<UnknownInput> = Vec::new();
    for driven in states.iter().filter(|state| is_entry(equations, "noise", state)) {
        let found = followed(equations, driven);
        let has_input = found.names.iter().any(|name| is_entry(equations, "inputs", name));
        let mut others = states.iter().filter(|state| !found.states.contains(state));
        if !has_input && others.any(|state| followed(equations, state).states.contains(driven)) {
            inputs.push(found);
        }
    }
    inputs
}

fn names(equations: &Table, table: &str) -> Vec<String> {
    let table = equations.get(table).and_then(Value::as_table);
    table.map(|table| table.keys().cloned().collect()).unwrap_or_default()
}

/// A state with all states that it depends on, and what their equations and noises depend on, through what it is abbreviated by.
fn followed(equations: &Table, state: &str) -> UnknownInput {
    let all: Vec<String> =
        ["states", "inputs", "let", "parameters"].iter().flat_map(|table| names(equations, table)).collect();
    let entry = |table: &str, name: &str| equations.get(table).and_then(|table| table.get(name));
    let mut found = UnknownInput { states: vec![state.to_owned()], names: Vec::new() };
    let mut place = 0;
    while let Some(state) = found.states.get(place).cloned() {
        place += 1;
        let mut open: Vec<&Value> =
            ["derivative", "noise"].iter().filter_map(|table| entry(table, &state)).collect();
        while let Some(value) = open.pop() {
            for name in all.iter().filter(|name| expressions_with(value, name)) {
                if is_entry(equations, "states", name) && !found.states.contains(name) {
                    found.states.push(name.clone());
                }
                if !found.names.contains(name) {
                    found.names.push(name.clone());
                    open.extend(entry("let", name));
                }
            }
        }
    }
    found
}

/// What no test of the innovations of an experiment's filters can see, in whole sentences; nothing of a device without equations.
pub fn unseen(workbench: &Workbench, experiment: &Experiment) -> Vec<String> {
    let text = expand(workbench, experiment).map(|expanded| expanded.text);
    let document = text.unwrap_or_else(|_| experiment.text().to_owned()).parse::<Table>();
    let Ok(document) = document else { return Vec::new() };
    let Some(equations) = equations_of(&document) else { return Vec::new() };
    let mut said = Vec::new();
    for UnknownInput { states, .. } in unknown_inputs(equations) {
        let Some(first) = states.first() else { continue };
        said.push(format!(
            "a disturbance that is as slow as `{first}`, which noise alone drives in the equations, is taken for it: no test of the innovations sees an \
             offset that drifts or jumps seldom there, or a clock that is off"
        ));
    }
    let densities = document.get("estimate");
    let has_density = |state: &String| {
        is_entry(equations, "noise", state) || densities.is_some_and(|table| expressions_as_key(table, state))
    };
    let states = names(equations, "states");
    let is_random = |state: &String| followed(equations, state).states.iter().any(has_density);
    let exact: Vec<String> =
        states.iter().filter(|state| !is_random(state)).map(|state| format!("`{state}`")).collect();
    if !exact.is_empty() && exact.len() < states.len() {
        said.push(format!(
            "{}: no process noise reaches it, so that the filter takes it to follow its equations exactly. Its claim becomes the smaller the longer the \
             recording is, and no test of the innovations sees what moves it by less than the noise of the samples hides",
            exact.join(", ")
        ));
    }
    said.dedup();
    said
}

/// Whether a table has this key in one of its tables of process noise.
fn expressions_as_key(value: &Value, name: &str) -> bool {
    match value {
        Value::Table(table) => table.iter().any(|(key, value)| {
            (key == "process_noise" && value.get(name).is_some()) || expressions_as_key(value, name)
        }),
        Value::Array(list) => list.iter().any(|value| expressions_as_key(value, name)),
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rigs::published;
    use std::path::Path;

    fn said(noise: &str) -> Vec<String> {
        let text = format!(
            "name = \"a\"\n[device.equations]\nstates = {{ x = \"m\", v = \"m/s\", a = \"m/s^2\", T = \"K\" }}\n\
             derivative = {{ x = \"v\", v = \"a - k*x - b*v\", a = \"-w*a\", T = \"-g*T\" }}\nmeasure = {{ y = \"x in m\", z = \"T in K\" }}\n\
             noise = {{ y = \"1e-20[m^2]\", z = \"1e-6[K^2]\", {noise} }}\n\
             parameters = {{ k = \"1e6 1/s^2\", b = \"100 1/s\", w = \"100 1/s\", g = \"1 1/s\" }}\n\
             [[recording]]\nrole = \"test\"\nfile = \"r.csv\"\nclock = {{ column = \"t_s\" }}\nchannels = {{ y = \"y_m\", z = \"z_K\" }}\n"
        );
        unseen(published(), &published().parse(&text, Path::new("nowhere.toml")).unwrap())
    }

    #[test]
    fn a_modelled_input_and_a_state_that_no_noise_reaches_are_named() {
        let found = said("a = \"1[m^2/s^5]\"");
        assert!(found.len() == 2 && found[0].contains("`a`") && found[1].starts_with("`T`:"), "{found:?}");
        // A noise of the force is of the device itself, and reaches place and velocity.
        let found = said("v = \"1[m^2/s^3]\", T = \"1[K^2/s]\"");
        assert!(found.iter().all(|text| !text.contains("`x`") && !text.contains("`v`")), "{found:?}");
    }
}

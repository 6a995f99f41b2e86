//! What the numbers that are sought trade with: the size and the bandwidth of an input that nobody recorded.

use crate::config::Experiment;
use crate::diagnose::suspect::{NumberRole, Suspect, equations_of, expressions_with};
use crate::expand::expand;
use crate::rigs::Workbench;
use std::collections::BTreeSet;
use toml::{Table, Value};

/// The numbers of an unknown input among all that may be wrong, without those that are sought already.
///
/// An acceleration that is modelled as a state with a stated size moves the signal as the spring and the mass let it: with another size other springs
/// and masses are as likely. Which numbers are of such an input follows from the equations ([`of_unknown_input`]), those of a published device from
/// its equations as `kalmems expand` writes them.
pub(super) fn traded(
    workbench: &Workbench,
    experiment: &Experiment,
    all: &[Suspect],
    sought: &[Suspect],
) -> Vec<Suspect> {
    // A device without equations has no such input that could be found.
    let text = expand(workbench, experiment).map(|expanded| expanded.text);
    let text = text.unwrap_or_else(|_| experiment.text().to_owned());
    let Ok(document) = text.parse::<Table>() else { return Vec::new() };
    let names = equations_of(&document).map(of_unknown_input).unwrap_or_default();
    let is_named = |suspect: &&Suspect| match &suspect.what {
        NumberRole::Factor(numbers) => {
            numbers.len() == 1 && numbers.iter().all(|number| names.contains(number.key.last()))
        }
        NumberRole::Literal { key, .. } => names.contains(key.last()),
        _ => false,
    };
    let is_new = |suspect: &&Suspect| sought.iter().all(|own| own.name() != suspect.name());
    all.iter().filter(is_named).filter(is_new).cloned().collect()
}

/// The parameters that size and shape what noise alone drives, and the names of such states.
///
/// States that depend on one another and on no input, and are a part of the device that the rest follows.
fn of_unknown_input(equations: &Table) -> BTreeSet<String> {
    let table = |name: &str| equations.get(name).and_then(Value::as_table);
    let names = |name: &str| -> Vec<String> {
        table(name).map(|table| table.keys().cloned().collect()).unwrap_or_default()
    };
    let [states, inputs, lets, parameters] = ["states", "inputs", "let", "parameters"].map(names);
    let (Some(derivatives), Some(noises)) = (table("derivative"), table("noise")) else {
        return BTreeSet::new();
    };
    // All that an expression depends on, through what it is abbreviated by.
    let depends = |value: &Value| -> Vec<String> {
        let mut open = vec![value];
        let mut found: Vec<String> = Vec::new();
        while let Some(value) = open.pop() {
            for name in states.iter().chain(&inputs).chain(&lets).chain(&parameters) {
                if !found.contains(name) && expressions_with(value, name) {
                    found.push(name.clone());
                    open.extend(table("let").and_then(|table| table.get(name)));
                }
            }
        }
        found
    };
    let mut of_input = BTreeSet::new();
    for driven in states.iter().filter(|state| noises.contains_key(*state)) {
        let mut closed = vec![driven.clone()];
        let mut found: Vec<String> = Vec::new();
        let mut place = 0;
        while let Some(state) = closed.get(place).cloned() {
            place += 1;
            for value in [derivatives.get(&state), noises.get(&state)].into_iter().flatten() {
                found.extend(depends(value));
            }
            let new: Vec<String> = found.iter().filter(|name| states.contains(name)).cloned().collect();
            for name in new {
                if !closed.contains(&name) {
                    closed.push(name);
                }
            }
        }
        let has_input = found.iter().any(|name| inputs.contains(name));
        if has_input || closed.len() == states.len() {
            continue;
        }
        of_input.extend(found.into_iter().filter(|name| parameters.contains(name)));
        of_input.extend(closed.into_iter().filter(|state| noises.contains_key(state)));
    }
    of_input
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_an_input_that_only_noise_drives_are_found_by_the_equations() {
        let of = |text: &str| {
            let found = of_unknown_input(&text.parse().unwrap());
            found.into_iter().collect::<Vec<_>>().join(" ")
        };
        let accelerometer = "states = { x = \"m\", v = \"m/s\", a = \"m/s^2\" }\n\
                             derivative = { x = \"v\", v = \"a - k/m*x - b/m*v\", a = \"-w*a\" }\n\
                             noise = { signal = \"n\", v = \"4*kT*b/m^2\", a = \"2*w*rms^2\" }\nmeasure = { signal = \"x\" }\n\
                             parameters = { k = \"1\", m = \"1\", b = \"1\", w = \"1\", rms = \"1\", n = \"1\", kT = \"1\" }";
        assert_eq!(of(accelerometer), "a rms w");
        // All of a free decay follows from its noise as well; that is no input.
        let decay = "states = { x = \"V\", v = \"V/s\" }\nderivative = { x = \"v\", v = \"-w^2*x\" }\n\
                     noise = { v = \"q\" }\nparameters = { w = \"1\", q = \"1\" }";
        assert_eq!(of(decay), "");
    }
}

//! What the numbers that are sought trade with: the size and the bandwidth of an input that nobody recorded.

use crate::config::Experiment;
use crate::diagnose::suspect::{NumberRole, Suspect, equations_of};
use crate::diagnose::unseen::{UnknownInput, is_entry, unknown_inputs};
use crate::expand::expand;
use crate::rigs::Workbench;
use std::collections::BTreeSet;
use toml::Table;

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
fn of_unknown_input(equations: &Table) -> BTreeSet<String> {
    let mut of_input = BTreeSet::new();
    for UnknownInput { states, names } in unknown_inputs(equations) {
        of_input.extend(names.into_iter().filter(|name| is_entry(equations, "parameters", name)));
        of_input.extend(states.into_iter().filter(|state| is_entry(equations, "noise", state)));
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

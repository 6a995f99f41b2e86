//! The piston mirror before its electrode as differential equations: a phasor whose amplitude, frequency and rest position drift.

use super::settings::PistonHardware;
use crate::Expansion;
use crate::config::{ConfigError, Experiment};

/// The device of an experiment.
pub fn expanded(experiment: &Experiment) -> Result<Expansion, ConfigError> {
    let hardware = PistonHardware::of(experiment)?;
    let mut all = Expansion {
        noise: ["amplitude", "frequency", "phase", "offset", "amplitude_rate"]
            .map(|name| (name, name))
            .to_vec(),
        ..Expansion::default()
    };
    let states = [
        ("amplitude", "m"),
        ("frequency", "Hz"),
        ("phase", "rad"),
        ("offset", "m"),
        ("amplitude_rate", "m/s"),
    ];
    all.table("states", &states);
    let plates = &hardware.plates;
    // The highest power that there is: a series that goes on with zeros is the same.
    let powers = plates.coefficients.iter().rposition(|c| *c != 0.0).map_or(1, |last| last + 1);
    let names: Vec<String> = (0..powers).map(|k| format!("coefficient_{k}")).collect();
    let mut numbers = vec![("reference_distance", plates.reference_distance, "m")];
    numbers.extend(names.iter().zip(&plates.coefficients).map(|(name, c)| (name.as_str(), *c, "F")));
    numbers.push(("noise_density", hardware.noise_density, "F/sqrt(Hz)"));
    all.numbers("parameters", &numbers);
    all.table(
        "let",
        &[("distance", "offset + amplitude*cos(phase)"), ("near", "reference_distance/distance")],
    );
    all.table(
        "derivative",
        &[
            ("amplitude", "amplitude_rate"),
            ("frequency", "0"),
            ("phase", "2*pi*frequency"),
            ("offset", "0"),
            ("amplitude_rate", "0"),
        ],
    );
    let terms = names.iter().enumerate().map(|(k, name)| match k {
        0 => name.clone(),
        1 => format!("{name}*near"),
        k => format!("{name}*near^{k}"),
    });
    let seen = format!("{} in F", terms.collect::<Vec<_>>().join(" + "));
    all.table("measure", &[("signal", seen.as_str())]);
    all.table("cyclic", &[("phase", "2*pi")]);
    all.table("noise", &[("signal", "noise_density^2")]);
    if hardware.bandwidth_hz.is_some() {
        all.notes.push("The noise beyond half the sampling rate, which a `bandwidth` folds into the samples, is not added.".to_owned());
    }
    if hardware.mechanics.is_some() {
        all.notes.push("The mirror's mechanics and drive (`mirror`) are not part of the equations, as no filter has them.".to_owned());
    }
    Ok(all)
}

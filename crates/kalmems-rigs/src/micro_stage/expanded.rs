//! The stage as differential equations.

use super::hardware::StageHardware;
use crate::Expansion;
use crate::config::{ConfigError, Experiment};
use std::f64::consts::TAU;

/// The device of an experiment.
pub fn expanded(experiment: &Experiment) -> Result<Expansion, ConfigError> {
    let hardware = StageHardware::of(experiment)?;
    let mut all = Expansion { noise: vec![("angular_acceleration", "rate")], ..Expansion::default() };
    all.table("states", &[("angle", "rad"), ("rate", "rad/s")]);
    all.table("inputs", &[("drive", "V")]);
    // Its exact step holds the drive over an interval at what it is in the middle, on the line between both samples.
    all.table("interpolation", &[("drive", "mean")]);
    let resonator = hardware.stage.resonator;
    let mut numbers: Vec<(String, f64, &str)> = vec![
        ("natural_frequency".to_owned(), resonator.natural_rate / TAU, "Hz"),
        ("damping_ratio".to_owned(), resonator.damping_ratio, ""),
        ("drive_gain".to_owned(), hardware.stage.drive_gain, "rad/s^2/V"),
    ];
    let (mut measure, mut noise) = (Vec::new(), Vec::new());
    for channel in &hardware.channels {
        all.channels.push((channel.name.clone(), channel.meaning()));
        let (name, plate) = (&channel.name, &channel.current.plate);
        let along = plate.w4 - plate.w3;
        let own = [
            ("near", plate.w1, "m"),
            ("far", plate.w2, "m"),
            ("along", along, "m"),
            ("gap", plate.gap, "m"),
            ("permittivity", plate.permittivity, "F/m"),
            ("gain", channel.current.gain, "V ohm"),
        ];
        numbers.extend(own.map(|(what, value, unit)| (format!("{what}_{name}"), value, unit)));
        let seen = format!(
            "gain_{name}*d(tilting_plate(angle, near_{name}, far_{name}, along_{name}, gap_{name}, permittivity_{name}), angle)*rate in V"
        );
        measure.push((channel.meaning(), seen));
        if let Some(variance) = channel.noise_variance {
            numbers.push((format!("noise_{name}"), variance, "V^2"));
            noise.push((channel.meaning(), format!("noise_{name}")));
        }
        if channel.feedthrough.is_some() {
            all.notes.push(format!(
                "What the drive's slope makes of the signal of {name} (`feedthrough`) is not part of the equations: an input has no derivative."
            ));
        }
    }
    let numbers: Vec<(&str, f64, &str)> =
        numbers.iter().map(|(name, value, unit)| (name.as_str(), *value, *unit)).collect();
    all.numbers("parameters", &numbers);
    all.table("let", &[("natural_rate", "2*pi*natural_frequency")]);
    all.table(
        "derivative",
        &[
            ("angle", "rate"),
            ("rate", "drive_gain*drive - 2*damping_ratio*natural_rate*rate - natural_rate^2*angle"),
        ],
    );
    let borrowed = |all: &[(String, String)]| -> Vec<(String, String)> { all.to_vec() };
    for (table, entries) in [("measure", borrowed(&measure)), ("noise", borrowed(&noise))] {
        let entries: Vec<(&str, &str)> = entries.iter().map(|(a, b)| (a.as_str(), b.as_str())).collect();
        all.table(table, &entries);
    }
    if hardware.piston.is_some() {
        all.notes.push(
            "The stage's rise and fall under the same drive (`piston`) is not part of the equations."
                .to_owned(),
        );
    }
    all.text.push_str("\n[device.equations.oscillation]\nof = \"angle\"\n");
    Ok(all)
}

//! The stage as differential equations, and where their parameters stand in its table.

use super::device::{DriveFeedthrough, Electrode, MicroStage};
use super::hardware::StageHardware;
use super::records::{self, of_role};
use crate::Expansion;
use crate::config::{ConfigError, Experiment, OtherTerms, RecordingRole, Vibrometer};
use crate::equations::meant;
use crate::evaluate::EdgeVelocity;
use crate::progress::Silent;
use crate::units::name;
use kalmems_models::constants::VACUUM_PERMITTIVITY;
use std::sync::Arc;

/// The tables that are the same for every stage. Its exact step holds the drive over an interval at what it is in the middle, on the line between both
/// samples.
const MOTION: &str = "
[device.equations]
answer = \"rate\"

[device.equations.states]
angle = \"rad\"
rate = \"rad/s\"

[device.equations.inputs]
drive = \"V\"

[device.equations.interpolation]
drive = \"mean\"

[device.equations.let]
natural_rate = \"2*pi*natural_frequency\"

[device.equations.derivative]
angle = \"rate\"
rate = \"drive_gain*drive - 2*damping_ratio*natural_rate*rate - natural_rate^2*angle\"

[device.equations.oscillation]
of = \"angle\"
starts = true
";

/// The parameters of each electrode, by what stands before its name, and where they stand in its table. Gaps and gains of all electrodes are off by
/// one ratio each, `gap` and `gain`, as by a temperature or a bias voltage that all have in common.
const OF_ELECTRODE: [(&str, &str); 7] = [
    ("w1_", "w1"),
    ("w2_", "w2"),
    ("w3_", "w3"),
    ("w4_", "w4"),
    ("gap_", "gap"),
    ("gain_", "gain"),
    ("noise_", "noise_variance"),
];

/// The equations of its filters.
pub fn motion(stage: &MicroStage) -> Expansion {
    with_vibrometer(stage, None)
}

/// The same with what a vibrometer shows, whose output has this offset in V.
fn with_vibrometer(stage: &MicroStage, vibrometer: Option<(&Vibrometer, f64)>) -> Expansion {
    let mut all = Expansion {
        text: MOTION.to_owned(),
        noise: vec![("angular_acceleration", "rate")],
        channels: stage.electrodes.keys().map(|name| (name.clone(), meaning(name))).collect(),
        ..Expansion::default()
    };
    let resonator = &stage.resonator;
    let mut numbers = vec![
        ("natural_frequency".to_owned(), resonator.natural_frequency.si(), "Hz"),
        ("damping_ratio".to_owned(), resonator.damping_ratio.si(), ""),
        ("drive_gain".to_owned(), resonator.drive_gain.si(), "rad/s^2/V"),
        ("permittivity".to_owned(), VACUUM_PERMITTIVITY, "F/m"),
        ("gap".to_owned(), 1.0, ""),
        ("gain".to_owned(), 1.0, ""),
    ];
    if let Some((vibrometer, offset)) = vibrometer {
        let EdgeVelocity { gain, target_width } = EdgeVelocity::from(vibrometer);
        numbers.push(("vibrometer_gain".to_owned(), gain, "V s/m"));
        numbers.push(("target_width".to_owned(), target_width, "m/rad"));
        numbers.push(("vibrometer_offset".to_owned(), offset, "V"));
    }
    let (mut measure, mut noise) = (Vec::new(), Vec::new());
    for (name, electrode) in &stage.electrodes {
        let of = |what: &str| format!("{what}_{name}");
        let Electrode { w1, w2, w3, w4, gap, gain, noise_variance, feedthrough: _ } = electrode;
        let lengths = [("w1", w1.si()), ("w2", w2.si()), ("w3", w3.si()), ("w4", w4.si()), ("gap", gap.si())];
        numbers.extend(lengths.map(|(what, value)| (of(what), value, "m")));
        numbers.push((of("gain"), gain.si(), "V ohm"));
        let plate = format!(
            "tilting_plate(angle, w1_{name}, w2_{name}, w4_{name} - w3_{name}, gap*gap_{name}, permittivity)"
        );
        measure.push((meaning(name), format!("gain*gain_{name}*d({plate}, angle)*rate in V")));
        if let Some(variance) = noise_variance {
            numbers.push((of("noise"), variance.si(), "V^2"));
            noise.push((meaning(name), of("noise")));
        }
    }
    let numbers: Vec<(&str, f64, &str)> =
        numbers.iter().map(|(name, value, unit)| (name.as_str(), *value, *unit)).collect();
    all.numbers("parameters", &numbers);
    for (table, entries) in [("measure", measure), ("noise", noise)] {
        let entries: Vec<(&str, &str)> = entries.iter().map(|(a, b)| (a.as_str(), b.as_str())).collect();
        all.table(table, &entries);
    }
    if vibrometer.is_some() {
        let edge = "vibrometer_gain*0.5*target_width*rate + vibrometer_offset in V";
        all.table("quantities", &[("edge_velocity", edge)]);
    }
    feedthrough(stage, &mut all);
    all
}

/// What reaches the signals of the drive beside the motion, and what the estimated rate is corrected by.
fn feedthrough(stage: &MicroStage, all: &mut Expansion) {
    all.table("feedthrough", &[("of", "drive")]);
    for (name, electrode) in &stage.electrodes {
        if let Some(DriveFeedthrough { gain, slope }) = &electrode.feedthrough {
            let table = format!("feedthrough.signals.{}", meaning(name));
            all.numbers(&table, &[("gain", gain.si(), ""), ("slope", slope.si(), "s")]);
        }
    }
    if let Some(correction) = &stage.correction {
        let (scale, bias) = (correction.scale.si(), correction.bias.si());
        all.numbers("correction.rate", &[("scale", scale, ""), ("bias", bias, "rad/s")]);
    }
}

/// The meaning of an electrode's column in a recording.
pub fn meaning(name: &str) -> String {
    format!("signal_{name}")
}

/// The equations that its table means.
pub fn in_other_terms(stage: &MicroStage) -> Result<OtherTerms, ConfigError> {
    let mut table = meant(&motion(stage), keys, None)?;
    table.start_tells_itself = true;
    Ok(Arc::new(table))
}

/// Where a parameter of the equations stands in the device's table, with the power of it there.
fn keys(parameter: &str) -> Vec<(&'static str, i32)> {
    let key = match parameter {
        "natural_frequency" => "resonator.natural_frequency",
        "damping_ratio" => "resonator.damping_ratio",
        "drive_gain" => "resonator.drive_gain",
        "gap" => "electrodes.*.gap",
        "gain" => "electrodes.*.gain",
        _ => {
            let of = OF_ELECTRODE.iter().find_map(|(own, key)| Some((parameter.strip_prefix(own)?, key)));
            let Some((electrode, key)) = of else { return Vec::new() };
            name(&format!("electrodes.{electrode}.{key}"))
        }
    };
    vec![(key, 1)]
}

/// What the vibrometer shows as a rate beside the motion, in rad/s: the mean over the records with the bias on, where they can be read.
fn vibrometer_offset(experiment: &Experiment) -> Option<f64> {
    let on = of_role(experiment, RecordingRole::BiasOn).first().copied()?;
    let records = records::read(experiment, &StageHardware::of(experiment).ok()?, on, &Silent).ok()?;
    let offsets: Vec<f64> =
        records.all.iter().filter_map(|record| record.rate.as_ref()).map(|rate| rate.offset).collect();
    (!offsets.is_empty()).then(|| offsets.iter().sum::<f64>() / offsets.len() as f64)
}

/// The equations for a reader to change.
pub fn expanded(stage: &MicroStage, experiment: &Experiment) -> Expansion {
    let vibrometer = stage.vibrometer.as_ref().map(|vibrometer| {
        let rate = vibrometer_offset(experiment).unwrap_or(0.0);
        (vibrometer, rate / EdgeVelocity::from(vibrometer).rate_per_volt())
    });
    let mut all = with_vibrometer(stage, vibrometer);
    if vibrometer.is_some() {
        all.notes.push(
            "The offset of the vibrometer is the mean over the records; its rig takes that of each record off."
                .to_owned(),
        );
    }
    if stage.piston.is_some() {
        all.notes.push(
            "The stage's rise and fall under the same drive (`piston`) is not part of the equations."
                .to_owned(),
        );
    }
    all
}

//! The stage as differential equations.

use super::feedthrough::BiasOffRecord;
use super::hardware::StageHardware;
use super::records::{self, StageRecord, StageRecords, of_role};
use crate::Expansion;
use crate::config::{ConfigError, Experiment, RecordingRole};
use crate::progress::Silent;
use std::f64::consts::TAU;

/// What an electrode shows beside the motion.
#[derive(Clone, Copy)]
struct ElectrodeFeedthrough {
    /// Of the drive, in V/V.
    gain: f64,
    /// Of its rate, in s.
    slope_s: f64,
    /// In V.
    offset: f64,
}

/// That of each electrode: as the file states it, or the mean over the records with the bias off.
fn feedthrough(
    experiment: &Experiment,
    hardware: &StageHardware,
    all: &mut Expansion,
) -> Vec<Option<ElectrodeFeedthrough>> {
    let stated = hardware.channels.iter().map(|channel| channel.feedthrough);
    let stated =
        stated.map(|known| known.map(|[gain, slope_s]| ElectrodeFeedthrough { gain, slope_s, offset: 0.0 }));
    let stated: Vec<_> = stated.collect();
    let is_measured = !of_role(experiment, RecordingRole::BiasOn).is_empty();
    let Some(off) = of_role(experiment, RecordingRole::BiasOff).first().copied().filter(|_| is_measured)
    else {
        return stated;
    };
    match records::read(experiment, hardware, off, &Silent) {
        Ok(records) => {
            all.notes.push(
                "What the drive makes of each signal is the mean over the records with the bias off; its rig takes that of each record off \
                 its counterpart."
                    .to_owned(),
            );
            (0..hardware.channels.len()).map(|electrode| mean_of(&records, electrode)).collect()
        }
        Err(why) => {
            all.notes.push(format!(
                "What the drive makes of each signal is left out, as the records with the bias off cannot be read: {why}."
            ));
            stated
        }
    }
}

/// What the vibrometer shows as a rate beside the motion, in rad/s: the mean over the records with the bias on, where they can be read.
fn vibrometer_offset(experiment: &Experiment, hardware: &StageHardware) -> Option<f64> {
    let on = of_role(experiment, RecordingRole::BiasOn).first().copied()?;
    let records = records::read(experiment, hardware, on, &Silent).ok()?;
    let offsets: Vec<f64> =
        records.all.iter().filter_map(|record| record.rate.as_ref()).map(|rate| rate.offset).collect();
    (!offsets.is_empty()).then(|| offsets.iter().sum::<f64>() / offsets.len() as f64)
}

/// The mean over records of what an electrode shows with the bias off.
fn mean_of(records: &StageRecords, electrode: usize) -> Option<ElectrodeFeedthrough> {
    let place = records.electrodes.iter().position(|of| *of == electrode)?;
    let one = |record: &StageRecord| {
        let signals: Vec<&[f64]> = record.signals.iter().map(Vec::as_slice).collect();
        let off = BiasOffRecord::of(&record.label, &record.time_s, record.drive, &signals)?;
        let [gain, slope_s] = off.gain_and_slope(place)?;
        Some([gain, slope_s, off.signals[place].offset - gain * off.drive.offset])
    };
    let found: Vec<[f64; 3]> = records.all.iter().filter_map(one).collect();
    let mean = |which: usize| found.iter().map(|one| one[which]).sum::<f64>() / found.len() as f64;
    (!found.is_empty()).then(|| ElectrodeFeedthrough { gain: mean(0), slope_s: mean(1), offset: mean(2) })
}

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
    let through = feedthrough(experiment, &hardware, &mut all);
    for (channel, through) in hardware.channels.iter().zip(through) {
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
        let mut seen = format!(
            "gain_{name}*d(tilting_plate(angle, near_{name}, far_{name}, along_{name}, gap_{name}, permittivity_{name}), angle)*rate"
        );
        if let Some(ElectrodeFeedthrough { gain, slope_s, offset }) = through {
            let through =
                [("feedthrough", gain, ""), ("feedthrough_slope", slope_s, "s"), ("offset", offset, "V")];
            numbers.extend(through.map(|(what, value, unit)| (format!("{what}_{name}"), value, unit)));
            seen +=
                &format!(" + feedthrough_{name}*drive + feedthrough_slope_{name}*ddt(drive) + offset_{name}");
        }
        measure.push((channel.meaning(), format!("{seen} in V")));
        if let Some(variance) = channel.noise_variance {
            numbers.push((format!("noise_{name}"), variance, "V^2"));
            noise.push((channel.meaning(), format!("noise_{name}")));
        }
    }
    if let Some(vibrometer) = &hardware.vibrometer {
        numbers.push(("vibrometer_gain".to_owned(), vibrometer.gain, "V s/m"));
        numbers.push(("target_width".to_owned(), vibrometer.target_width, "m/rad"));
        let offset = vibrometer_offset(experiment, &hardware).map(|rate| rate / vibrometer.rate_per_volt());
        numbers.push(("vibrometer_offset".to_owned(), offset.unwrap_or(0.0), "V"));
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
    if hardware.vibrometer.is_some() {
        all.table(
            "quantities",
            &[("edge_velocity", "vibrometer_gain*0.5*target_width*rate + vibrometer_offset in V")],
        );
        all.notes.push("The offset of the vibrometer is the mean over the records; its rig takes that of each record off.".to_owned());
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

//! The threshold scanner as differential equations.

use super::course::LEAST_VARIANCE;
use super::hardware::ThresholdHardware;
use crate::Expansion;
use crate::config::{ConfigError, ConfigFault, Estimate, Experiment, Quantity};
use kalmems_models::capacitance::CurveShape;
use toml::{Table, Value};

/// The motion, which is the same for every experiment.
const MOTION: &str = r#"
[device.equations.let]
natural_rate = "2*pi*natural_frequency"
form = "logistic_comb(angle, threshold_angle, 1, steepness)"

[device.equations.derivative]
angle = "rate"
rate = "-2*damping_ratio*natural_rate*rate - natural_rate^2*angle - drive_gain*form*drive^2"
"#;

/// The device of an experiment.
pub fn expanded(experiment: &Experiment) -> Result<Expansion, ConfigError> {
    let hardware = ThresholdHardware::of(experiment)?;
    let comb = hardware.mirror.comb;
    if !matches!(comb.shape, CurveShape::Logistic) {
        let why = "a comb of Gaussian shape is no law of the equations yet; write `shape = \"logistic\"`, or the integral of its curve as a \
                   table";
        return Err(experiment
            .error("device.threshold_scanner.comb.shape", ConfigFault::Value { why: why.to_owned() }));
    }
    let mut all = Expansion { noise: vec![("angular_acceleration", "rate")], ..Expansion::default() };
    all.table("states", &[("angle", "rad"), ("rate", "rad/s")]);
    all.table("inputs", &[("drive", "V")]);
    let passed = passed(experiment);
    let stated = passed.iter().filter_map(|passed| Some((passed.parameter.as_str(), passed.angle?, "rad")));
    let through = hardware.feedthrough != 0.0;
    let mut parameters = vec![
        ("natural_frequency", hardware.natural_hz(), "Hz"),
        ("damping_ratio", hardware.mirror.resonator.damping_ratio, ""),
        ("drive_gain", hardware.mirror.drive_gain, "rad/s^2/V^2"),
        ("threshold_angle", comb.centre, "rad"),
        ("gain", comb.gain, "V s/rad"),
        ("steepness", comb.steepness, "1/rad"),
        ("offset", hardware.readout.offset, "V"),
        ("noise_variance", hardware.noise_variance, "V^2"),
    ];
    if through {
        parameters.extend([
            ("feedback_resistance", hardware.feedback_resistance, "ohm"),
            ("feedthrough", hardware.feedthrough, "F"),
        ]);
    }
    let beam = super::instruments(experiment)?.beam;
    if let Some(beam) = beam {
        parameters.extend([
            ("detector_distance", beam.distance, "m"),
            ("detector_gain", beam.gain, "m/V"),
            ("detector_multiple", beam.multiple, ""),
        ]);
    }
    all.numbers("parameters", &parameters.into_iter().chain(stated).collect::<Vec<_>>());
    all.text.push_str(MOTION);
    let seen = "logistic_comb(angle, threshold_angle, gain, steepness)*rate + offset";
    let passed_on = if through { " - feedback_resistance*feedthrough*ddt(drive)" } else { "" };
    all.table("measure", &[("signal", &*format!("{seen}{passed_on} in V"))]);
    if beam.is_some() {
        let position = "detector_distance*tan(detector_multiple*angle)/detector_gain in V";
        all.table("quantities", &[("position", position)]);
    }
    let expressions: Vec<String> =
        passed.iter().map(|passed| format!("angle - {}", passed.parameter)).collect();
    let events = passed.iter().zip(&expressions);
    all.table("events", &events.map(|(passed, text)| (&*passed.name, &**text)).collect::<Vec<_>>());
    let known = format!("{LEAST_VARIANCE:?}[rad^2]");
    let mut noise = vec![("signal", "noise_variance")];
    if let Some(estimate) = experiment.estimate.as_ref().filter(|estimate| estimate.crossings.is_some()) {
        noise.extend(passed.iter().map(|passed| (&*passed.name, &*known)));
        crossings(&mut all, estimate, &passed, (hardware.readout.offset, comb.steepest() < 0.0));
    }
    all.table("noise", &noise);
    if through {
        all.notes.push(
            "The rate of the drive comes from its samples; where the drive bends its rig leaves a sample out, and the equations do not."
                .to_owned(),
        );
    }
    if !all.events.is_empty() {
        let note = "The variance of an angle at a crossing follows from that of its time by the rate that the filter has; its rig takes the \
                    rate from the slope of the signal.";
        all.notes.push(note.to_owned());
    }
    Ok(all)
}

/// An angle that filters are told of.
struct PassedAngle {
    /// The event.
    name: String,
    /// The parameter that is the angle.
    parameter: String,
    /// The angle in rad where a filter states it, and not the comb's.
    angle: Option<f64>,
}

/// The angles whose passage filters are told of, each once; the comb's where there is no filter that is told.
fn passed(experiment: &Experiment) -> Vec<PassedAngle> {
    let filters = experiment.estimate.iter().flat_map(|estimate| &estimate.filters);
    let mut angles: Vec<Option<f64>> = Vec::new();
    for threshold in filters.filter_map(|filter| filter.threshold.as_ref()) {
        let angle = threshold.angle.as_ref().map(Quantity::si);
        if !angles.contains(&angle) {
            angles.push(angle);
        }
    }
    if angles.is_empty() {
        angles.push(None);
    }
    let numbered = |name: &str, place: usize| match place {
        0 => name.to_owned(),
        _ => format!("{name}_{}", place + 1),
    };
    let one = |(place, angle): (usize, Option<f64>)| PassedAngle {
        name: numbered("crossing", place),
        parameter: angle.map_or("threshold_angle".to_owned(), |_| numbered("crossing_angle", place)),
        angle,
    };
    angles.into_iter().enumerate().map(one).collect()
}

/// Where the times of the crossings come from, and how the filters are told of them.
fn crossings(all: &mut Expansion, estimate: &Estimate, passed: &[PassedAngle], (offset, falls): (f64, bool)) {
    let Some(detector) = estimate.crossings.as_ref().and_then(|found| Value::try_from(found).ok()) else {
        return;
    };
    for passed in passed {
        let mut source = Table::new();
        source.insert("signal".to_owned(), Value::from("signal"));
        source.insert("level".to_owned(), Value::from(format!("{offset:?} V")));
        source.insert("follows_mean".to_owned(), Value::from(true));
        if falls {
            source.insert("edge".to_owned(), Value::from("falling"));
        }
        source.insert("detector".to_owned(), detector.clone());
        all.events.insert(passed.name.clone(), Value::Table(source));
    }
    all.filter_events = estimate
        .filters
        .iter()
        .map(|filter| {
            let mut uses = Table::new();
            let Some(threshold) = &filter.threshold else { return uses };
            let angle = threshold.angle.as_ref().map(Quantity::si);
            let told = passed.iter().find(|passed| passed.angle == angle);
            if let (Some(told), Ok(Value::Table(mut table))) = (told, Value::try_from(threshold)) {
                table.remove("angle");
                if let Some(sd) = table.remove("angle_sd") {
                    table.insert("sd".to_owned(), sd);
                }
                uses.insert(told.name.clone(), Value::Table(table));
            }
            uses
        })
        .collect();
}

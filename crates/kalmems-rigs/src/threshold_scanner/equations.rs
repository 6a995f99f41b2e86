//! The threshold scanner as differential equations.

use super::device::{CombShape, DetectedAngle, ThresholdScanner};
use super::hardware::ThresholdHardware;
use crate::Expansion;
use crate::config::{Estimate, Experiment, Quantity};
use crate::equations::PassedThreshold;
use toml::{Table, Value};

/// The motion, which is the same for every experiment, but for the form of the comb's curve.
const MOTION: &str = r#"
[device.equations.derivative]
angle = "rate"
rate = "-2*damping_ratio*natural_rate*rate - natural_rate^2*angle - drive_gain*form*drive^2"

[device.equations.angles]
angle = "rate"

# The current changes its sign where the comb is passed, twice a cycle; the drive pulls at either side.
[device.equations.oscillation]
of = "angle"
harmonic = 2
drive_cycles = 2

[device.equations.events]
crossing = "angle - threshold_angle"
"#;

/// The event that an angle is passed, and the measurement that shows it.
const CROSSING: &str = "crossing";
const SIGNAL: &str = "signal";

/// The smallest variance of an angle at a crossing whose own follows from its time, in rad²: what the threshold itself is
/// known to, (0.01 mrad)².
pub const LEAST_VARIANCE: f64 = 1e-10;

/// The equations of its filters and its simulation.
pub fn motion(device: &ThresholdScanner) -> Expansion {
    let hardware = ThresholdHardware::of_table(device);
    let comb = hardware.mirror.comb;
    let mut all = Expansion { noise: vec![("angular_acceleration", "rate")], ..Expansion::default() };
    all.table("states", &[("angle", "rad"), ("rate", "rad/s")]);
    all.table("inputs", &[("drive", "V")]);
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
    if let Some(detector) = &device.position_detector {
        let multiple = match detector.angle {
            DetectedAngle::Mirror => 1.0,
            DetectedAngle::Beam => 2.0,
        };
        parameters.extend([
            ("detector_distance", detector.distance.si(), "m"),
            ("detector_gain", detector.gain.si(), "m/V"),
            ("detector_multiple", multiple, ""),
        ]);
    }
    all.numbers("parameters", &parameters);
    let form = match device.comb.shape {
        CombShape::Logistic => "logistic_comb(angle, threshold_angle, 1, steepness)",
        CombShape::Gaussian => {
            "steepness*(angle - threshold_angle)*exp(-(steepness*(angle - threshold_angle))^2)"
        }
    };
    all.table("let", &[("natural_rate", "2*pi*natural_frequency"), ("form", form)]);
    all.text.push_str(MOTION);
    let passed_on = if through { " - feedback_resistance*feedthrough*ddt(drive)" } else { "" };
    all.table("measure", &[(SIGNAL, &*format!("gain*form*rate + offset{passed_on} in V"))]);
    if let Some(detector) = &device.position_detector {
        let position = "detector_distance*tan(detector_multiple*angle)/detector_gain in V";
        all.table("quantities", &[("position", position)]);
        let late = detector.delay.as_ref().map(|delay| format!("{:?} s", delay.si()));
        let sd = format!("{:?} V", detector.noise_variance.si().sqrt());
        let shown = [("of", "position"), ("sd", &*sd)].into_iter();
        all.table(
            "instruments.position",
            &shown.chain(late.as_deref().map(|late| ("delay", late))).collect::<Vec<_>>(),
        );
    }
    all.table("noise", &[(SIGNAL, "noise_variance"), (CROSSING, &*format!("{LEAST_VARIANCE:?}[rad^2]"))]);
    all
}

/// What the keys of its threshold are of.
pub fn threshold(device: &ThresholdScanner) -> PassedThreshold {
    let readout = ThresholdHardware::of_table(device).readout;
    PassedThreshold {
        event: CROSSING,
        signal: SIGNAL,
        level: readout.offset,
        falls: readout.comb.steepest() < 0.0,
        angle: readout.comb.centre,
    }
}

/// Where a parameter of the equations stands in the device's table, with the power of it there.
pub fn keys(parameter: &str) -> Vec<(&'static str, i32)> {
    let key = match parameter {
        "natural_frequency" => "resonator.natural_frequency",
        "damping_ratio" => "resonator.damping_ratio",
        "drive_gain" => "drive.gain",
        "threshold_angle" => "comb.threshold_angle",
        "gain" => "comb.gain",
        "steepness" => "comb.steepness",
        "offset" => "readout.offset",
        "noise_variance" => "readout.noise_variance",
        "feedback_resistance" => "readout.feedback_resistance",
        "feedthrough" => "readout.feedthrough_capacitance",
        "detector_distance" => "position_detector.distance",
        "detector_gain" => "position_detector.gain",
        _ => return Vec::new(),
    };
    vec![(key, 1)]
}

/// The equations for a reader to change, with what filters are told of crossings.
pub fn expanded(device: &ThresholdScanner, experiment: &Experiment) -> Expansion {
    let mut all = motion(device);
    if device.position_detector.is_some() {
        // A reference of equations knows the position and not the angle behind it.
        all.text = all.text.replace("[device.equations.angles]\nangle = \"rate\"\n\n", "");
    }
    if let Some(estimate) = experiment.estimate.as_ref().filter(|estimate| estimate.crossings.is_some()) {
        crossings(&mut all, estimate, &threshold(device));
    }
    all
}

/// Where the times of the crossings come from, and how the filters are told of them.
fn crossings(all: &mut Expansion, estimate: &Estimate, passed: &PassedThreshold) {
    let Some(detector) = estimate.crossings.as_ref().and_then(|found| Value::try_from(found).ok()) else {
        return;
    };
    let mut source = Table::new();
    source.insert("signal".to_owned(), Value::from(passed.signal));
    source.insert("level".to_owned(), Value::from(format!("{:?} V", passed.level)));
    source.insert("follows_mean".to_owned(), Value::from(true));
    if passed.falls {
        source.insert("edge".to_owned(), Value::from("falling"));
    }
    source.insert("detector".to_owned(), detector);
    all.events.insert(passed.event.to_owned(), Value::Table(source));
    let uses = estimate.filters.iter().map(|filter| {
        let mut uses = Table::new();
        let Some(threshold) = &filter.threshold else { return uses };
        if let Ok(Value::Table(mut table)) = Value::try_from(threshold) {
            table.remove("angle");
            if let Some(sd) = table.remove("angle_sd") {
                table.insert("sd".to_owned(), sd);
            }
            if let Some(angle) = &threshold.angle {
                let value = format!("{:?} rad", Quantity::si(angle) - passed.angle);
                table.insert("value".to_owned(), Value::from(value));
            }
            uses.insert(passed.event.to_owned(), Value::Table(table));
        }
        uses
    });
    all.filter_events = uses.collect();
}

//! The accelerometer as differential equations, with the acceleration as a process of stated size and bandwidth, and where their parameters stand in
//! its table.

use super::device::AccelerometerTable;
use super::settings::AccelerometerHardware;
use crate::Expansion;
use crate::config::{ConfigError, OtherTerms};
use crate::equations::{AbsentInput, EquationsTable, meant};
use crate::units::kind;
use kalmems_models::constants::BOLTZMANN;
use std::sync::Arc;

/// What it is for.
const ANSWER: &str = "[device.equations]\nanswer = \"acceleration\"\n";

/// The tables that are the same for every experiment.
const EQUATIONS: &str = r#"
[device.equations.derivative]
displacement = "velocity"
velocity = "acceleration + (force - film - spring*displacement)/mass"
acceleration = "jerk"
jerk = "-rate^2*acceleration - 2*prior_damping*rate*jerk"

[device.equations.measure]
signal = "charge_amplifier(differential_plates(displacement, area, gap, permittivity), carrier_amplitude, feedback_capacitance) in V"

[device.equations.noise]
velocity = "2*thermal_energy*damping/mass^2"
jerk = "4*prior_damping*rate^3*rms^2"
signal = "noise_variance"
"#;

/// The squares of the voltages of both plates, under the feedback and without one.
const UNDER_FEEDBACK: [(&str, &str); 2] = [
    ("near_square", "(bias - feedback)^2 + carrier_square"),
    ("far_square", "(bias + feedback)^2 + carrier_square"),
];
const OPEN: [(&str, &str); 2] = [("near_square", "carrier_square"), ("far_square", "carrier_square")];

/// What moves the mass besides its spring.
const FORCES: [(&str, &str); 3] = [
    ("force", "differential_force(displacement, area, gap, permittivity, near_square, far_square)"),
    ("film", "squeeze_film(displacement/gap, damping, squeezed)*velocity"),
    ("rate", "2*pi*bandwidth"),
];

/// The equations of its filters.
pub fn motion(device: &AccelerometerTable) -> Expansion {
    let AccelerometerHardware { sensed, readout, noise_variance, has_feedback, .. } =
        AccelerometerHardware::of_table(device);
    let (instrument, prior) = (sensed.device, sensed.prior);
    let mut all = Expansion { text: ANSWER.to_owned(), ..Expansion::default() };
    let states = [("displacement", "m"), ("velocity", "m/s"), ("acceleration", "m/s^2"), ("jerk", "m/s^3")];
    all.table("states", &states);
    if has_feedback {
        all.table("inputs", &[("feedback", "V")]);
        all.table("interpolation", &[("feedback", "hold")]);
    }
    let mut numbers = vec![
        ("mass", instrument.mass.mass, "kg"),
        ("spring", instrument.mass.spring, "N/m"),
        ("damping", instrument.mass.damping, "N s/m"),
        ("squeezed", instrument.mass.squeezed, ""),
        ("thermal_energy", BOLTZMANN * device.proof_mass.temperature.si(), "J"),
        ("area", instrument.plates.area, "m^2"),
        ("gap", instrument.plates.gap, "m"),
        ("permittivity", instrument.plates.permittivity, "F/m"),
        ("carrier_amplitude", readout.carrier_amplitude, "V"),
        ("carrier_mean_square", device.readout.carrier_mean_square.si(), ""),
        ("feedback_capacitance", readout.feedback_capacitance, "F"),
        ("noise_variance", noise_variance, "V^2"),
        ("rms", prior.rms, "m/s^2"),
        ("bandwidth", device.acceleration.bandwidth.si(), "Hz"),
        ("prior_damping", prior.damping_ratio, ""),
    ];
    if has_feedback {
        numbers.push(("bias", instrument.bias, "V"));
    }
    all.numbers("parameters", &numbers);
    let mut lets = vec![("carrier_square", "carrier_mean_square*carrier_amplitude^2")];
    lets.extend(if has_feedback { UNDER_FEEDBACK } else { OPEN });
    lets.extend(FORCES);
    all.table("let", &lets);
    all.text.push_str(EQUATIONS);
    all.numbers("usual", &[("acceleration", prior.rms, "m/s^2"), ("jerk", prior.rms * prior.rate, "m/s^3")]);
    all
}

/// What a recording of a device without a feedback may not hold.
const NO_FEEDBACK: AbsentInput = AbsentInput {
    channel: "feedback",
    kind: &kind::VOLTAGE,
    words: [
        "V are fed back",
        "the device has no feedback: add the table `[device.accelerometer.feedback]` with its `bias`",
    ],
};

/// The equations that its table means.
pub fn in_other_terms(device: &AccelerometerTable) -> Result<OtherTerms, ConfigError> {
    let mut table: EquationsTable = meant(&motion(device), keys, None)?;
    table.check = Some(super::require_right);
    table.absent = device.feedback.is_none().then_some(NO_FEEDBACK).into_iter().collect();
    Ok(Arc::new(table))
}

/// Where a parameter of the equations stands in the device's table, with the power of it there.
fn keys(parameter: &str) -> Vec<(&'static str, i32)> {
    let key = match parameter {
        "mass" => "proof_mass.mass",
        "spring" => "proof_mass.spring",
        "damping" => "proof_mass.damping",
        "squeezed" => "proof_mass.squeezed_film",
        "thermal_energy" => "proof_mass.temperature",
        "area" => "plates.area",
        "gap" => "plates.gap",
        "permittivity" => "plates.relative_permittivity",
        "carrier_amplitude" => "readout.carrier_amplitude",
        "carrier_mean_square" => "readout.carrier_mean_square",
        "feedback_capacitance" => "readout.feedback_capacitance",
        "noise_variance" => "readout.noise_variance",
        "bias" => "feedback.bias",
        "rms" => "acceleration.rms",
        "bandwidth" => "acceleration.bandwidth",
        "prior_damping" => "acceleration.damping_ratio",
        _ => return Vec::new(),
    };
    vec![(key, 1)]
}

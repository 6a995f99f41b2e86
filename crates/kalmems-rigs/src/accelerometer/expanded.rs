//! The accelerometer as differential equations, with the acceleration as a process of stated size and bandwidth.

use super::settings::AccelerometerHardware;
use crate::Expansion;
use crate::config::{ConfigError, Experiment, Method};

/// The tables that are the same for every experiment.
const EQUATIONS: &str = r#"
[device.equations.let]
near_square = "(bias - feedback)^2 + carrier_square"
far_square = "(bias + feedback)^2 + carrier_square"
force = "differential_force(displacement, area, gap, permittivity, near_square, far_square)"
film = "squeeze_film(displacement/gap, damping, squeezed)*velocity"

[device.equations.derivative]
displacement = "velocity"
velocity = "acceleration + (force - film - spring*displacement)/mass"
acceleration = "jerk"
jerk = "-bandwidth^2*acceleration - 2*prior_damping*bandwidth*jerk"

[device.equations.measure]
signal = "charge_amplifier(differential_plates(displacement, area, gap, permittivity), carrier_amplitude, feedback_capacitance) in V"

[device.equations.noise]
velocity = "force_density/mass^2"
jerk = "4*prior_damping*bandwidth^3*rms^2"
signal = "noise_variance"
"#;

/// The device of an experiment.
pub fn expanded(experiment: &Experiment) -> Result<Expansion, ConfigError> {
    let hardware = AccelerometerHardware::of(experiment)?;
    let (instrument, prior) = (hardware.sensed.device, hardware.sensed.prior);
    let mut all = Expansion::default();
    let states = [("displacement", "m"), ("velocity", "m/s"), ("acceleration", "m/s^2"), ("jerk", "m/s^3")];
    all.table("states", &states);
    if hardware.has_feedback {
        all.table("inputs", &[("feedback", "V")]);
        all.table("interpolation", &[("feedback", "hold")]);
    }
    let mut numbers = vec![
        ("mass", instrument.mass.mass, "kg"),
        ("spring", instrument.mass.spring, "N/m"),
        ("damping", instrument.mass.damping, "N s/m"),
        ("squeezed", instrument.mass.squeezed, ""),
        ("area", instrument.plates.area, "m^2"),
        ("gap", instrument.plates.gap, "m"),
        ("permittivity", instrument.plates.permittivity, "F/m"),
        ("carrier_square", instrument.carrier_mean_square, "V^2"),
        ("bias", instrument.bias, "V"),
        ("carrier_amplitude", hardware.readout.carrier_amplitude, "V"),
        ("feedback_capacitance", hardware.readout.feedback_capacitance, "F"),
        ("force_density", hardware.force_density, "N^2/Hz"),
        ("noise_variance", hardware.noise_variance, "V^2"),
        ("rms", prior.rms, "m/s^2"),
        ("bandwidth", prior.rate, "1/s"),
        ("prior_damping", prior.damping_ratio, ""),
    ];
    if !hardware.has_feedback {
        numbers.push(("feedback", 0.0, "V"));
    }
    all.numbers("parameters", &numbers);
    all.text.push_str(EQUATIONS);
    let mut filters = experiment.estimate.iter().flat_map(|estimate| &estimate.filters);
    if filters.any(|filter| filter.method == Method::Luenberger) {
        all.notes.push(
            "All poles of an observer of equations are those of a Butterworth low-pass; its rig leaves those of the device that decay faster."
                .to_owned(),
        );
    }
    Ok(all)
}

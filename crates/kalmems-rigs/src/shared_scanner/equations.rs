//! The scanner of one axis or two as differential equations, and where their parameters stand in its table.

use super::device::{GaussianCombTable, Resonator, SecondAxis, SharedScanner};
use super::settings::DRIVE_GAIN;
use crate::Expansion;
use crate::config::{ConfigError, Experiment, OtherTerms, Quantity};
use crate::equations::{Demodulator, EquationsTable, meant};
use std::sync::Arc;

/// The tables that are the same for every experiment with one axis.
const MOTION: &str = "
[device.equations.derivative]
angle = \"rate\"
rate = \"acceleration\"

[device.equations.oscillation]
of = \"angle\"
harmonic = 2
drive_cycles = 2

[device.equations.angles]
angle = \"rate\"
";

/// The capacitance and the acceleration.
const LETS: [(&str, &str); 3] = [
    ("capacitance", "gaussian_comb(angle, nominal_capacitance, angular_width, bias_capacitance)"),
    ("torque", "electrostatic_force(d(capacitance, angle), (drive_gain*drive)^2 + carrier_square)"),
    ("acceleration", "(torque - damping*rate - stiffness*angle)/inertia"),
];

/// The angle a while ago: what the free motion of the resonator makes of its acceleration now. Chen et al., shared electrodes, 2020, Figure 2, has the
/// delay.
const LATE: [(&str, &str); 5] = [
    ("natural_rate", "sqrt(stiffness/inertia)"),
    ("late_rate", "sin(natural_rate*readout_delay)/natural_rate"),
    ("late_acceleration", "2*(sin(natural_rate*readout_delay/2)/natural_rate)^2"),
    ("before", ""),
    ("seen", "gaussian_comb(before, nominal_capacitance, angular_width, bias_capacitance)"),
];

/// How its filters follow the readout's low-passes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LowPasses {
    /// As states.
    Followed,
    /// Not at all.
    LeftOut,
}

/// The tables that are the same for every experiment with two axes. Each angle mirrored is a motion as well, with the same signal.
const TWO_AXES: &str = "
[device.equations.derivative]
angle_x = \"rate_x\"
rate_x = \"(torque_x - damping_x*rate_x - stiffness_x*angle_x)/inertia_x\"
angle_y = \"rate_y\"
rate_y = \"(torque_y - damping_y*rate_y - stiffness_y*angle_y)/(inertia_y + gimbal*sin(angle_x)^2)\"

[device.equations.oscillation]
of = [\"angle_x\", \"angle_y\"]
harmonic = 2
drive_cycles = 2

[device.equations.angles]
angle_x = \"rate_x\"
angle_y = \"rate_y\"
";

/// The capacitances and torques of two axes, which the inertia of the gimbal couples.
const COUPLED: [(&str, &str); 6] = [
    ("capacitance_x", "gaussian_comb(angle_x, nominal_capacitance_x, angular_width_x, bias_capacitance_x)"),
    ("capacitance_y", "gaussian_comb(angle_y, nominal_capacitance_y, angular_width_y, bias_capacitance_y)"),
    ("square", "(drive_gain*drive)^2 + carrier_square"),
    ("swing", "gimbal*sin(angle_x)*cos(angle_x)"),
    ("torque_x", "electrostatic_force(d(capacitance_x, angle_x), square) + swing*rate_y^2"),
    ("torque_y", "electrostatic_force(d(capacitance_y, angle_y), square) - 2*swing*rate_x*rate_y"),
];

/// What one axis is made of, under the names of its parameters.
fn axis_numbers(
    names: [&'static str; 6],
    (resonator, comb): (&Resonator, &GaussianCombTable),
) -> [(&'static str, f64, &'static str); 6] {
    let values = [
        (resonator.inertia.si(), "kg m^2"),
        (resonator.damping.si(), "N m s"),
        (resonator.stiffness.si(), "N m"),
        (comb.nominal_capacitance.si(), "F"),
        (comb.angular_width.si(), "rad"),
        (comb.bias_capacitance.si(), "F"),
    ];
    std::array::from_fn(|k| (names[k], values[k].0, values[k].1))
}

/// Drive and readout, which are those of all axes, and what the square of the carrier is.
fn shared_numbers(
    device: &SharedScanner,
    all: &mut Vec<(&'static str, f64, &'static str)>,
) -> (&'static str, &'static str) {
    all.extend([
        ("drive_gain", 1.0, ""),
        ("gain", device.readout.gain.si(), "V/F"),
        ("offset", device.readout.offset.si(), "V"),
        ("noise_variance", device.readout.noise_variance.si(), "V^2"),
    ]);
    if device.carrier.included_in_drive {
        return ("carrier_square", "0[V^2]");
    }
    all.push(("carrier_amplitude", device.carrier.amplitude.si(), "V"));
    ("carrier_square", "carrier_amplitude^2/2")
}

/// The equations of the filters of two axes.
fn both_axes(device: &SharedScanner, second: &SecondAxis) -> Expansion {
    let mut all = Expansion {
        noise: vec![("angular_acceleration_x", "rate_x"), ("angular_acceleration_y", "rate_y")],
        ..Expansion::default()
    };
    let states = [("angle_x", "rad"), ("rate_x", "rad/s"), ("angle_y", "rad"), ("rate_y", "rad/s")];
    all.table("states", &states);
    all.table("inputs", &[("drive", "V")]);
    let of_x = [
        "inertia_x",
        "damping_x",
        "stiffness_x",
        "nominal_capacitance_x",
        "angular_width_x",
        "bias_capacitance_x",
    ];
    let of_y = [
        "inertia_y",
        "damping_y",
        "stiffness_y",
        "nominal_capacitance_y",
        "angular_width_y",
        "bias_capacitance_y",
    ];
    let mut parameters = axis_numbers(of_x, (&device.resonator, &device.comb)).to_vec();
    parameters.extend(axis_numbers(of_y, (&second.resonator, &second.comb)));
    parameters.push(("gimbal", second.gimbal_inertia.as_ref().map_or(0.0, Quantity::si), "kg m^2"));
    let mut lets = vec![shared_numbers(device, &mut parameters)];
    lets.extend(COUPLED);
    all.numbers("parameters", &parameters);
    all.table("let", &lets);
    all.text.push_str(TWO_AXES);
    all.table("measure", &[("signal", "gain*(capacitance_x + capacitance_y) + offset in V")]);
    all.table("noise", &[("signal", "noise_variance")]);
    all
}

/// The equations of its filters.
pub fn motion(device: &SharedScanner, low_passes: LowPasses) -> Expansion {
    if let Some(second) = &device.second_axis {
        return both_axes(device, second);
    }
    let followed = device.readout.poles.as_ref().filter(|_| low_passes == LowPasses::Followed);
    let delay_s = device.readout.delay.as_ref().map_or(0.0, Quantity::si);
    let mut all = Expansion { noise: vec![("angular_acceleration", "rate")], ..Expansion::default() };
    all.table("states", &[("angle", "rad"), ("rate", "rad/s")]);
    all.table("inputs", &[("drive", "V")]);
    let names =
        ["inertia", "damping", "stiffness", "nominal_capacitance", "angular_width", "bias_capacitance"];
    let mut parameters = axis_numbers(names, (&device.resonator, &device.comb)).to_vec();
    let carrier_square = shared_numbers(device, &mut parameters);
    if let Some(poles) = followed {
        let [first, second] = poles.each_ref().map(Quantity::si);
        parameters.extend([("first_pole", first, "Hz"), ("second_pole", second, "Hz")]);
    }
    if delay_s > 0.0 {
        parameters.push(("readout_delay", delay_s, "s"));
    }
    all.numbers("parameters", &parameters);
    let mut lets = vec![carrier_square];
    lets.extend(LETS);
    let mut seen = "gain*capacitance + offset in V";
    if delay_s > 0.0 {
        // Behind states that follow the signal the acceleration is the whole one; a measurement knows no input, and has that of the free motion.
        let before = if followed.is_some() {
            "angle - late_rate*rate + late_acceleration*acceleration"
        } else {
            "angle - late_rate*rate - late_acceleration*(stiffness*angle + damping*rate)/inertia"
        };
        lets.extend(LATE.map(|(name, text)| (name, if text.is_empty() { before } else { text })));
        seen = "gain*seen + offset in V";
    }
    all.table("let", &lets);
    all.text.push_str(MOTION);
    if followed.is_some() {
        all.table("lag.stage_1", &[("of", seen), ("time", "1/(2*pi*first_pole)")]);
        all.table("lag.stage_2", &[("of", "stage_1 in V"), ("time", "1/(2*pi*second_pole)")]);
        seen = "stage_2 in V";
    }
    all.table("measure", &[("signal", seen)]);
    all.table("noise", &[("signal", "noise_variance")]);
    all
}

/// The amplitude from which there are zero phases, in widths of the comb: far below any motion that is used, far above what a filter makes of noise.
const LEAST_AMPLITUDE: f64 = 0.01;

/// The equations that its table means.
pub fn in_other_terms(device: &SharedScanner) -> Result<OtherTerms, ConfigError> {
    let table = |low_passes| -> Result<EquationsTable, ConfigError> {
        let mut meant = meant(&motion(device, low_passes), keys, None)?;
        meant.least_amplitude = Some(LEAST_AMPLITUDE * device.comb.angular_width.si());
        meant.start_tells_itself = true;
        Ok(meant)
    };
    let poles = device.readout.poles.as_ref().filter(|_| device.second_axis.is_none());
    let followed = poles.map(|_| table(LowPasses::Followed)).transpose()?;
    let two = device.second_axis.is_some();
    let demodulator = Demodulator {
        device: followed.map(Arc::new),
        remedy: if two {
            "with two axes the demodulator's stages are no states; leave it out"
        } else {
            "the device's readout states no `poles`; add them, such as `poles = [\"31.35 kHz\", \"31.35 kHz\"]`, or leave `demodulator` out"
        },
    };
    let mut table = table(LowPasses::LeftOut)?;
    table.demodulator = Some(demodulator);
    Ok(Arc::new(table))
}

/// Where a parameter of the equations stands in the device's table, with the power of it there.
fn keys(parameter: &str) -> Vec<(&'static str, i32)> {
    let key = match parameter {
        "inertia" | "inertia_x" => "resonator.inertia",
        "damping" | "damping_x" => "resonator.damping",
        "stiffness" | "stiffness_x" => "resonator.stiffness",
        "nominal_capacitance" | "nominal_capacitance_x" => "comb.nominal_capacitance",
        "angular_width" | "angular_width_x" => "comb.angular_width",
        "bias_capacitance" | "bias_capacitance_x" => "comb.bias_capacitance",
        "inertia_y" => "second_axis.resonator.inertia",
        "damping_y" => "second_axis.resonator.damping",
        "stiffness_y" => "second_axis.resonator.stiffness",
        "nominal_capacitance_y" => "second_axis.comb.nominal_capacitance",
        "angular_width_y" => "second_axis.comb.angular_width",
        "bias_capacitance_y" => "second_axis.comb.bias_capacitance",
        "gimbal" => "second_axis.gimbal_inertia",
        "drive_gain" => return DRIVE_GAIN.to_vec(),
        "carrier_amplitude" => "carrier.amplitude",
        "gain" => "readout.gain",
        "offset" => "readout.offset",
        "noise_variance" => "readout.noise_variance",
        "readout_delay" => "readout.delay",
        _ => return Vec::new(),
    };
    vec![(key, 1)]
}

/// The equations for a reader to change: with the low-passes, where a filter follows them.
pub fn expanded(device: &SharedScanner, experiment: &Experiment) -> Expansion {
    let mut filters = experiment.estimate.iter().flat_map(|estimate| &estimate.filters);
    if device.readout.poles.is_none() || !filters.any(|filter| filter.demodulator) {
        return motion(device, LowPasses::LeftOut);
    }
    let mut all = motion(device, LowPasses::Followed);
    all.notes.push(
        "Every filter has the low-passes of the readout as states, as those with `demodulator = true` had."
            .to_owned(),
    );
    all
}

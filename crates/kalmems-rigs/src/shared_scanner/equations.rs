//! The scanner of one axis as differential equations, and where their parameters stand in its table.

use super::device::SharedScanner;
use super::settings::DRIVE_GAIN;
use crate::Expansion;
use crate::config::{ConfigError, Experiment, OtherTerms, Quantity};
use crate::equations::{Demodulator, EquationsTable, meant};
use std::sync::Arc;

/// The tables that are the same for every experiment.
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

/// The equations of its filters.
pub fn motion(device: &SharedScanner, low_passes: LowPasses) -> Expansion {
    let followed = device.readout.poles.as_ref().filter(|_| low_passes == LowPasses::Followed);
    let delay_s = device.readout.delay.as_ref().map_or(0.0, Quantity::si);
    let mut all = Expansion { noise: vec![("angular_acceleration", "rate")], ..Expansion::default() };
    all.table("states", &[("angle", "rad"), ("rate", "rad/s")]);
    all.table("inputs", &[("drive", "V")]);
    let mut parameters = vec![
        ("inertia", device.resonator.inertia.si(), "kg m^2"),
        ("damping", device.resonator.damping.si(), "N m s"),
        ("stiffness", device.resonator.stiffness.si(), "N m"),
        ("nominal_capacitance", device.comb.nominal_capacitance.si(), "F"),
        ("angular_width", device.comb.angular_width.si(), "rad"),
        ("bias_capacitance", device.comb.bias_capacitance.si(), "F"),
        ("drive_gain", 1.0, ""),
        ("gain", device.readout.gain.si(), "V/F"),
        ("offset", device.readout.offset.si(), "V"),
        ("noise_variance", device.readout.noise_variance.si(), "V^2"),
    ];
    let carrier_square = if device.carrier.included_in_drive {
        "0[V^2]"
    } else {
        parameters.push(("carrier_amplitude", device.carrier.amplitude.si(), "V"));
        "carrier_amplitude^2/2"
    };
    if let Some(poles) = followed {
        let [first, second] = poles.each_ref().map(Quantity::si);
        parameters.extend([("first_pole", first, "Hz"), ("second_pole", second, "Hz")]);
    }
    if delay_s > 0.0 {
        parameters.push(("readout_delay", delay_s, "s"));
    }
    all.numbers("parameters", &parameters);
    let mut lets = vec![("carrier_square", carrier_square)];
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
    let followed = device.readout.poles.as_ref().map(|_| table(LowPasses::Followed)).transpose()?;
    let demodulator = Demodulator {
        device: followed.map(Arc::new),
        remedy: "the device's readout states no `poles`; add them, such as `poles = [\"31.35 kHz\", \"31.35 kHz\"]`, or leave `demodulator` out",
    };
    let mut table = table(LowPasses::LeftOut)?;
    table.demodulator = Some(demodulator);
    Ok(Arc::new(table))
}

/// Where a parameter of the equations stands in the device's table, with the power of it there.
fn keys(parameter: &str) -> Vec<(&'static str, i32)> {
    let key = match parameter {
        "inertia" => "resonator.inertia",
        "damping" => "resonator.damping",
        "stiffness" => "resonator.stiffness",
        "nominal_capacitance" => "comb.nominal_capacitance",
        "angular_width" => "comb.angular_width",
        "bias_capacitance" => "comb.bias_capacitance",
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

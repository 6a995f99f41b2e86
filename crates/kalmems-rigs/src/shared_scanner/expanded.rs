//! The scanner as differential equations.

use super::settings::ScannerHardware;
use super::two_axes;
use crate::Expansion;
use crate::config::{ConfigError, Experiment};

/// The capacitance and the torque of an axis.
const COMB: [&str; 2] = [
    "gaussian_comb(angle, nominal_capacitance, angular_width, bias_capacitance)",
    "electrostatic_force(d(capacitance, angle), drive^2 + carrier_square)",
];

/// The device of an experiment with one axis.
pub fn expanded(experiment: &Experiment) -> Result<Expansion, ConfigError> {
    let hardware = ScannerHardware::of(experiment)?;
    let ScannerHardware { scanner, readout, poles, delay_s, noise_variance } = hardware;
    let mut all = Expansion { noise: vec![("angular_acceleration", "rate")], ..Expansion::default() };
    all.table("states", &[("angle", "rad"), ("rate", "rad/s")]);
    all.table("inputs", &[("drive", "V")]);
    let mut numbers = vec![
        ("inertia", scanner.resonator.inertia, "kg m^2"),
        ("damping", scanner.resonator.damping, "N m s"),
        ("stiffness", scanner.resonator.stiffness, "N m"),
        ("nominal_capacitance", scanner.comb.nominal, "F"),
        ("angular_width", scanner.comb.angular_width, "rad"),
        ("bias_capacitance", scanner.comb.bias, "F"),
        ("carrier_square", scanner.carrier_mean_square, "V^2"),
        ("gain", readout.gain, "V/F"),
        ("offset", readout.offset, "V"),
        ("noise_variance", noise_variance, "V^2"),
    ];
    if let Some([first, second]) = poles {
        numbers.extend([("first_pole", first, "rad/s"), ("second_pole", second, "rad/s")]);
    }
    if delay_s > 0.0 {
        numbers.push(("readout_delay", delay_s, "s"));
    }
    all.numbers("parameters", &numbers);
    all.table("let", &[("capacitance", COMB[0]), ("torque", COMB[1])]);
    all.table(
        "derivative",
        &[("angle", "rate"), ("rate", "(torque - damping*rate - stiffness*angle)/inertia")],
    );
    let mut seen = "gain*capacitance + offset in V";
    if delay_s > 0.0 {
        all.table("delay.late", &[("of", seen), ("time", "readout_delay")]);
        seen = "late in V";
    }
    if poles.is_some() {
        all.table("lag.envelope", &[("of", seen), ("time", "1/first_pole")]);
        all.table("lag.passed", &[("of", "envelope in V"), ("time", "1/second_pole")]);
        seen = "passed in V";
        all.notes.push(
            "Every filter has the low-passes of the readout as states, as those with `demodulator = true` had.".to_owned(),
        );
    }
    all.table("measure", &[("signal", seen)]);
    all.table("noise", &[("signal", "noise_variance")]);
    all.text.push_str(OSCILLATION);
    Ok(all)
}

/// The drive excites the motion parametrically, and the signal is the same for both signs of the angle.
const OSCILLATION: &str = "
[device.equations.oscillation]
of = \"angle\"
harmonic = 2
drive_cycles = 2

[device.equations.angles]
angle = \"rate\"
";

const SIGN: &str = "The signal is the same for the mirrored motions; without a table `angles` equations know no `first_peak`, so that the signs \
                    are those of the start.";

/// The tables of a device with two axes that are the same for every experiment.
const TWO_AXES: &str = r#"
[device.equations.let]
capacitance_x = "gaussian_comb(angle_x, nominal_x, width_x, bias_x)"
capacitance_y = "gaussian_comb(angle_y, nominal_y, width_y, bias_y)"
square = "drive^2 + carrier_square"
swing = "gimbal*sin(angle_x)*cos(angle_x)"
torque_x = "electrostatic_force(d(capacitance_x, angle_x), square) + swing*rate_y^2"
torque_y = "electrostatic_force(d(capacitance_y, angle_y), square) - 2*swing*rate_x*rate_y"

[device.equations.derivative]
angle_x = "rate_x"
rate_x = "(torque_x - damping_x*rate_x - stiffness_x*angle_x)/inertia_x"
angle_y = "rate_y"
rate_y = "(torque_y - damping_y*rate_y - stiffness_y*angle_y)/(inertia_y + gimbal*sin(angle_x)^2)"

[device.equations.measure]
signal = "gain*(capacitance_x + capacitance_y) + offset in V"

[device.equations.noise]
signal = "noise_variance"
"#;

/// The device of an experiment with two axes.
pub fn expanded_two_axes(experiment: &Experiment) -> Result<Expansion, ConfigError> {
    let two_axes::hardware::TwoAxisHardware { scanner, readout, noise_variance } =
        two_axes::hardware::TwoAxisHardware::of(experiment)?;
    let mut all = Expansion {
        noise: vec![("angular_acceleration_x", "rate_x"), ("angular_acceleration_y", "rate_y")],
        ..Expansion::default()
    };
    let states = [("angle_x", "rad"), ("rate_x", "rad/s"), ("angle_y", "rad"), ("rate_y", "rad/s")];
    all.table("states", &states);
    all.table("inputs", &[("drive", "V")]);
    let (x, y) = (scanner.x, scanner.y);
    all.numbers(
        "parameters",
        &[
            ("inertia_x", x.resonator.inertia, "kg m^2"),
            ("damping_x", x.resonator.damping, "N m s"),
            ("stiffness_x", x.resonator.stiffness, "N m"),
            ("nominal_x", x.comb.nominal, "F"),
            ("width_x", x.comb.angular_width, "rad"),
            ("bias_x", x.comb.bias, "F"),
            ("inertia_y", y.resonator.inertia, "kg m^2"),
            ("damping_y", y.resonator.damping, "N m s"),
            ("stiffness_y", y.resonator.stiffness, "N m"),
            ("nominal_y", y.comb.nominal, "F"),
            ("width_y", y.comb.angular_width, "rad"),
            ("bias_y", y.comb.bias, "F"),
            ("gimbal", scanner.gimbal_inertia, "kg m^2"),
            ("carrier_square", x.carrier_mean_square, "V^2"),
            ("gain", readout.gain, "V/F"),
            ("offset", readout.offset, "V"),
            ("noise_variance", noise_variance, "V^2"),
        ],
    );
    all.text.push_str(TWO_AXES);
    all.notes.push(SIGN.to_owned());
    Ok(all)
}

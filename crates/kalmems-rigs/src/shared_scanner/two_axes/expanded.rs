//! The scanner of two axes as differential equations.

use super::hardware::TwoAxisHardware;
use crate::Expansion;
use crate::config::{ConfigError, Experiment};

const SIGN: &str = "The signal is the same for the mirrored motions; without a table `angles` equations know no `first_peak`, so that the signs \
                    are those of the start.";

/// The tables that are the same for every experiment.
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

/// The device of an experiment.
pub fn expanded(experiment: &Experiment) -> Result<Expansion, ConfigError> {
    let TwoAxisHardware { scanner, readout, noise_variance } = TwoAxisHardware::of(experiment)?;
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

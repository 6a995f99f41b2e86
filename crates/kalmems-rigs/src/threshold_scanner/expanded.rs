//! The threshold scanner as differential equations.

use super::hardware::Hardware;
use crate::Expansion;
use crate::config::{ConfigError, Experiment, Fault};
use kalmems_models::capacitance::CurveShape;

/// The device of an experiment.
pub fn expanded(experiment: &Experiment) -> Result<Expansion, ConfigError> {
    let hardware = Hardware::of(experiment)?;
    let comb = hardware.mirror.comb;
    if !matches!(comb.shape, CurveShape::Logistic) {
        let why = "a comb of Gaussian shape is no law of the equations yet; write `shape = \"logistic\"`, or the integral of its curve as a \
                   table";
        return Err(
            experiment.error("device.threshold_scanner.comb.shape", Fault::Value { why: why.to_owned() })
        );
    }
    let mut all = Expansion { noise: vec![("angular_acceleration", "rate")], ..Expansion::default() };
    all.table("states", &[("angle", "rad"), ("rate", "rad/s")]);
    all.table("inputs", &[("drive", "V")]);
    all.numbers(
        "parameters",
        &[
            ("natural_frequency", hardware.natural_hz(), "Hz"),
            ("damping_ratio", hardware.mirror.resonator.damping_ratio, ""),
            ("drive_gain", hardware.mirror.drive_gain, "rad/s^2/V^2"),
            ("threshold_angle", comb.centre, "rad"),
            ("gain", comb.gain, "V s/rad"),
            ("steepness", comb.steepness, "1/rad"),
            ("offset", hardware.readout.offset, "V"),
            ("noise_variance", hardware.noise_variance, "V^2"),
        ],
    );
    all.table(
        "let",
        &[
            ("natural_rate", "2*pi*natural_frequency"),
            ("form", "logistic_comb(angle, threshold_angle, 1, steepness)"),
        ],
    );
    all.table(
        "derivative",
        &[
            ("angle", "rate"),
            ("rate", "-2*damping_ratio*natural_rate*rate - natural_rate^2*angle - drive_gain*form*drive^2"),
        ],
    );
    all.table(
        "measure",
        &[("signal", "logistic_comb(angle, threshold_angle, gain, steepness)*rate + offset in V")],
    );
    all.table("events", &[("crossing", "angle - threshold_angle")]);
    all.table("noise", &[("signal", "noise_variance")]);
    if hardware.feedthrough != 0.0 {
        all.notes.push(
            "What the drive's slope makes of the signal (`feedthrough_capacitance`) is not part of the equations: an input has no derivative."
                .to_owned(),
        );
    }
    all.notes.push(
        "Crossings of the threshold are not used by filters of equations: they follow the signal alone."
            .to_owned(),
    );
    Ok(all)
}

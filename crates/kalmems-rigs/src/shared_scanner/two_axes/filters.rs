//! The filters that an experiment file asks for, and where each starts.

use super::hardware::TwoAxisHardware;
use crate::config::{
    self, ConfigError, ConfigFault, Estimate, ExpectedEntry, Experiment, FilterTable, Key, Sign,
};
use crate::estimate::{DeviceParameter, FilterBasics, StateName, process_noise, refuse_demodulator};
use crate::units::kind;
use kalmems_core::Covariance;

/// The states: name, unit in column names, kind.
pub const STATES: [StateName; 4] = [
    ("angle_x", "rad", &kind::ANGLE),
    ("rate_x", "rad_per_s", &kind::ANGULAR_RATE),
    ("angle_y", "rad", &kind::ANGLE),
    ("rate_y", "rad_per_s", &kind::ANGULAR_RATE),
];

/// The states as entries of a table of values.
pub fn four(sign: Sign) -> [ExpectedEntry; 4] {
    STATES.map(|(name, _, kind)| ExpectedEntry { name, kind, sign })
}

/// One filter.
#[derive(Clone, Debug)]
pub struct TwoAxisFilterSettings {
    /// What every filter has.
    pub basics: FilterBasics,
    /// Where it starts.
    pub start: TwoAxisStart,
    /// The densities of the angular accelerations' noise of x and y, in rad²/s³.
    pub acceleration_density: [f64; 2],
}

/// Where a filter starts.
#[derive(Clone, Copy, Debug)]
pub enum TwoAxisStart {
    /// Where the first samples of the signal say that the axes are.
    Signal,
    /// At a given state.
    Given {
        /// The state.
        mean: [f64; 4],
        /// How well it is known.
        covariance: Covariance<f64, 4>,
    },
}

/// The densities of its process noise.
pub const NOISE: [ExpectedEntry; 2] = [
    ExpectedEntry::new("angular_acceleration_x", &kind::ANGULAR_ACCELERATION_DENSITY, Sign::NotNegative),
    ExpectedEntry::new("angular_acceleration_y", &kind::ANGULAR_ACCELERATION_DENSITY, Sign::NotNegative),
];

/// The parameters that can be states. The drive is one for both axes; what acts on one axis alone is its stiffness and
/// its damping.
pub static PARAMETERS: [DeviceParameter; 7] = [
    DeviceParameter::factor("stiffness_x")
        .in_motion("scanner.x.resonator.stiffness")
        .written(&[("resonator.stiffness", 1)]),
    DeviceParameter::factor("stiffness_y")
        .in_motion("scanner.y.resonator.stiffness")
        .written(&[("second_axis.resonator.stiffness", 1)]),
    DeviceParameter::factor("damping_x")
        .in_motion("scanner.x.resonator.damping")
        .written(&[("resonator.damping", 1)]),
    DeviceParameter::factor("damping_y")
        .in_motion("scanner.y.resonator.damping")
        .written(&[("second_axis.resonator.damping", 1)]),
    DeviceParameter::factor("drive_gain")
        .in_motion("drive_gain")
        .written(&super::super::settings::DRIVE_GAIN),
    DeviceParameter::factor("gain").in_readout("gain").written(&[("readout.gain", 1)]),
    DeviceParameter::volts("offset").in_readout("offset").written(&[("readout.offset", 1)]),
];

/// What a deviation of 1 adds to each of them.
fn scales(hardware: &TwoAxisHardware) -> [f64; 7] {
    let [x, y] = [&hardware.scanner.x.resonator, &hardware.scanner.y.resonator];
    [x.stiffness, y.stiffness, x.damping, y.damping, 1.0, hardware.readout.gain, 1.0]
}

impl TwoAxisFilterSettings {
    /// Reads and checks the filter at this place of the file.
    pub fn of(
        experiment: &Experiment,
        estimate: &Estimate,
        hardware: &TwoAxisHardware,
        index: usize,
    ) -> Result<Self, ConfigError> {
        let filter = &estimate.filters[index];
        let at = Key::from("estimate").child("filter").index(index);
        refuse_demodulator(
            experiment,
            (&at, filter),
            "with two axes the demodulator's stages are no states; leave it out",
        )?;
        let (noise_key, noise) = process_noise(experiment, &at, filter)?;
        Ok(Self {
            basics: FilterBasics::of(experiment, &at, filter, (&PARAMETERS, &scales(hardware)))?,
            start: start(experiment, &at, filter)?,
            acceleration_density: experiment.values(noise_key, noise, NOISE)?,
        })
    }
}

/// A start from the signal brings its own standard deviations.
fn start(experiment: &Experiment, at: &Key, filter: &FilterTable) -> Result<TwoAxisStart, ConfigError> {
    let (start_key, sd_key) = (at.clone().child("start"), at.clone().child("start_sd"));
    let Some(config::FilterStart::Values(values)) = &filter.start else {
        if let Some((name, _)) = filter.start_sd.iter().next() {
            let why = "a start from the signal brings its own standard deviations; leave `start_sd` out";
            return Err(experiment.error(sd_key.child(name), ConfigFault::Value { why: why.to_owned() }));
        }
        return Ok(TwoAxisStart::Signal);
    };
    let mean = experiment.values(start_key.clone(), values, four(Sign::Any))?;
    for (axis, name) in [(0, "x"), (2, "y")] {
        if mean[axis..axis + 2] == [0.0, 0.0] {
            let why = format!(
                "angle and rate of {name} are exactly 0; signal and torque are symmetric there, so that neither a \
                 filter nor the model would ever leave it; start from a small angle, such as `angle_{name} = \
                 \"1e-6 rad\"`, or from the signal, `start = \"from_signal\"`"
            );
            return Err(experiment.error(start_key, ConfigFault::Value { why }));
        }
    }
    let covariance = if filter.method.claims() {
        let sd = experiment.values(sd_key, &filter.start_sd, four(Sign::Positive))?;
        Covariance::from_standard_deviations(sd)
    } else {
        Covariance::zero()
    };
    Ok(TwoAxisStart::Given { mean, covariance })
}

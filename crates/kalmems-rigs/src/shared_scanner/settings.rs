//! What the rig takes from an experiment file, in SI.

use crate::config::{
    ConfigError, ConfigFault, Estimate, ExpectedEntry, Experiment, Key, Quantity, Sign, Values,
};
use crate::estimate::process_noise;
use crate::shared_scanner::device::SharedScanner;
use crate::units::kind;
use kalmems_models::capacitance::GaussianComb;
use kalmems_models::dynamics::{ParametricScanner, TorsionalResonator};
use kalmems_models::readout::{DelayedComb, DemodulatedComb};
use std::f64::consts::{FRAC_PI_4, TAU};

/// The keys of the device's table that stand for a gain g of the drive's voltage, with their powers of g. The torque is
/// \\(\\tfrac12 C'(\\theta)(g^2V^2 + V_c^2)\\), and what moves by it is the same for all of the resonators divided by g² and the
/// carrier's amplitude by g.
pub const DRIVE_GAIN: [(&str, i32); 7] = [
    ("resonator.inertia", -2),
    ("resonator.stiffness", -2),
    ("resonator.damping", -2),
    ("second_axis.resonator.inertia", -2),
    ("second_axis.resonator.stiffness", -2),
    ("second_axis.resonator.damping", -2),
    ("carrier.amplitude", -1),
];

/// The scanner: how it moves, how it is read, and the noise of a sample.
#[derive(Clone, Copy, Debug)]
pub struct ScannerHardware {
    /// How it moves.
    pub scanner: ParametricScanner<f64>,
    /// What is recorded of it.
    pub readout: DemodulatedComb<f64>,
    /// How late the signal is beside the poles, in s.
    pub delay_s: f64,
    /// The variance of the recorded signal's noise per sample, in V².
    pub noise_variance: f64,
}

impl ScannerHardware {
    /// What the file says of the device.
    pub fn of(experiment: &Experiment) -> Result<Self, ConfigError> {
        Ok(Self::of_table(&*experiment.device::<SharedScanner>()?))
    }

    /// The same of its table.
    pub fn of_table(device: &SharedScanner) -> Self {
        let comb = GaussianComb {
            nominal: device.comb.nominal_capacitance.si(),
            angular_width: device.comb.angular_width.si(),
            bias: device.comb.bias_capacitance.si(),
        };
        let carrier = if device.carrier.included_in_drive { 0.0 } else { device.carrier.amplitude.si() };
        let resonator = TorsionalResonator {
            inertia: device.resonator.inertia.si(),
            damping: device.resonator.damping.si(),
            stiffness: device.resonator.stiffness.si(),
        };
        let delay_s = device.readout.delay.as_ref().map_or(0.0, Quantity::si);
        Self {
            scanner: ParametricScanner { resonator, comb, carrier_mean_square: carrier * carrier / 2.0 },
            readout: DemodulatedComb {
                comb,
                gain: device.readout.gain.si(),
                offset: device.readout.offset.si(),
            },
            delay_s,
            noise_variance: device.readout.noise_variance.si(),
        }
    }

    /// The frequency at which it swings without a drive, in Hz.
    pub fn natural_hz(&self) -> f64 {
        self.scanner.resonator.natural_rate() / TAU
    }

    /// The readout as late as it is, for filters without the demodulator's stages.
    pub fn late_readout(&self) -> DelayedComb<f64> {
        DelayedComb::of(&self.readout, self.delay_s, &self.scanner.resonator)
    }
}

/// An eighth of a cycle: farther back, what [`DelayedComb`] leaves out is more than half a percent of the amplitude.
pub const LONGEST_DELAY_RAD: f64 = FRAC_PI_4;

/// The states of the motion, as tables of values name them.
pub const fn states(sign: Sign) -> [ExpectedEntry; 2] {
    [
        ExpectedEntry { name: "angle", kind: &kind::ANGLE, sign },
        ExpectedEntry { name: "rate", kind: &kind::ANGULAR_RATE, sign },
    ]
}

/// The density of its process noise.
const NOISE: [ExpectedEntry; 1] =
    [ExpectedEntry::new("angular_acceleration", &kind::ANGULAR_ACCELERATION_DENSITY, Sign::NotNegative)];

/// The density of the angular acceleration's noise that the filter at a place has, in rad²/s³.
pub fn acceleration_density(
    experiment: &Experiment,
    estimate: &Estimate,
    index: usize,
) -> Result<f64, ConfigError> {
    let at = Key::from("estimate").child("filter").index(index);
    let (key, noise) = process_noise(experiment, &at, &estimate.filters[index])?;
    let [density] = experiment.values(key, noise, NOISE)?;
    Ok(density)
}

/// The table that an estimate needs.
pub fn estimate_table(experiment: &Experiment) -> Result<&Estimate, ConfigError> {
    experiment.estimate.as_ref().ok_or_else(|| {
        let remedy =
            "add the table `[estimate]` with `skip`, `process_noise` and at least one `[[estimate.filter]]`";
        experiment.error("estimate", ConfigFault::MissingKey { remedy: remedy.to_owned() })
    })
}

/// A state to start from; refused at exactly zero.
pub fn state_at(
    experiment: &Experiment,
    key: impl Into<Key>,
    values: &Values,
) -> Result<[f64; 2], ConfigError> {
    let key = key.into();
    let mean = experiment.values(key.clone(), values, states(Sign::Any))?;
    if mean == [0.0, 0.0] {
        let why = "angle and rate are exactly 0; signal and torque are symmetric there, so that neither a filter \
                   nor the model would ever leave it; start from a small angle, such as `angle = \"1e-6 rad\"`"
            .to_owned();
        return Err(experiment.error(key, ConfigFault::Value { why }));
    }
    Ok(mean)
}

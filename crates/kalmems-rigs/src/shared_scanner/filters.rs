//! What the rig takes from the tables of filters, in SI.

use super::settings::{ScannerHardware, state_at, states};
use crate::config::{
    ConfigError, ConfigFault, Estimate, ExpectedEntry, Experiment, FilterStart, FilterTable, Key, Sign,
};
use crate::estimate::{DeviceParameter, FilterBasics, StateName, process_noise};
use crate::units::kind;

/// What one `[[estimate.filter]]` says of a filter of one axis: its states, where they start, and its process noise.
#[derive(Clone, Debug)]
pub struct ScannerFilterSettings {
    /// What every filter has.
    pub basics: FilterBasics,
    /// Angle in rad and rate in rad/s to start from; `None` starts from the signal.
    pub start: Option<[f64; 2]>,
    /// Their standard deviations, 0 for what claims none.
    pub start_sd: [f64; 2],
    /// Whether the start and its covariance come from the signal, by all of its first samples.
    pub by_batch: bool,
    /// The standard deviation of each low-pass stage's first voltage, where the stages are states.
    pub demodulator_sd: Option<f64>,
    /// The density of the angular acceleration's noise, in rad²/s³.
    pub acceleration_density: f64,
}

/// All of them, for one axis.
pub static PARAMETERS: [DeviceParameter; 5] = [
    DeviceParameter::factor("stiffness")
        .in_motion("scanner.resonator.stiffness")
        .in_whole("device.scanner.resonator.stiffness")
        .written(&[("resonator.stiffness", 1)]),
    DeviceParameter::factor("damping")
        .in_motion("scanner.resonator.damping")
        .in_whole("device.scanner.resonator.damping")
        .written(&[("resonator.damping", 1)]),
    DeviceParameter::factor("drive_gain")
        .in_motion("drive_gain")
        .in_whole("device.drive_gain")
        .written(&super::settings::DRIVE_GAIN),
    DeviceParameter::factor("gain").in_readout("gain").in_whole("gain").written(&[("readout.gain", 1)]),
    DeviceParameter::volts("offset")
        .in_readout("offset")
        .in_whole("offset")
        .written(&[("readout.offset", 1)]),
];

/// What a deviation of 1 adds to each of them.
fn scales(hardware: &ScannerHardware) -> [f64; 5] {
    let resonator = &hardware.scanner.resonator;
    [resonator.stiffness, resonator.damping, 1.0, hardware.readout.gain, 1.0]
}

/// The states of the motion and of the demodulator, as trajectories name them.
const MOTION: [StateName; 4] = [
    ("angle", "rad", &kind::ANGLE),
    ("rate", "rad_per_s", &kind::ANGULAR_RATE),
    ("stage_1", "V", &kind::VOLTAGE),
    ("stage_2", "V", &kind::VOLTAGE),
];

/// The density of its process noise.
pub const NOISE: [ExpectedEntry; 1] =
    [ExpectedEntry::new("angular_acceleration", &kind::ANGULAR_ACCELERATION_DENSITY, Sign::NotNegative)];

impl ScannerFilterSettings {
    /// Reads and checks the filter at this place of the file.
    pub fn of(
        experiment: &Experiment,
        estimate: &Estimate,
        hardware: &ScannerHardware,
        index: usize,
    ) -> Result<Self, ConfigError> {
        let filter = &estimate.filters[index];
        let at = Key::from("estimate").child("filter").index(index);
        let start = match &filter.start {
            Some(FilterStart::Values(values)) => {
                Some(state_at(experiment, at.clone().child("start"), values)?)
            }
            Some(FilterStart::FromSignal) | None => None,
        };
        if filter.demodulator && hardware.poles.is_none() {
            let why = "the device's readout states no `poles`; add them, such as `poles = [\"31.35 kHz\", \
                       \"31.35 kHz\"]`, or leave `demodulator` out";
            return Err(experiment.error(at.child("demodulator"), ConfigFault::Value { why: why.to_owned() }));
        }
        if filter.demodulator && filter.method.has_fixed_gain() {
            let why =
                "the gain for all of a swing is that of angle and rate alone; leave it out, or use `ekf`";
            return Err(experiment.error(at.child("demodulator"), ConfigFault::Value { why: why.to_owned() }));
        }
        let by_batch = start.is_none() && filter.method.claims() && filter.start_sd.is_empty();
        let (start_sd, demodulator_sd) = if by_batch {
            ([0.0; 2], filter.demodulator.then_some(0.0))
        } else {
            deviations(experiment, &at, filter)?
        };
        let (noise_key, noise) = process_noise(experiment, &at, filter)?;
        // The lock-in has no process; every other one has this noise, or for the model alone none.
        let [acceleration_density] =
            if filter.method.claims() { experiment.values(noise_key, noise, NOISE)? } else { [0.0] };
        let basics = FilterBasics::of(experiment, &at, filter, (&PARAMETERS, &scales(hardware)))?;
        Ok(Self { basics, start, start_sd, by_batch, demodulator_sd, acceleration_density })
    }

    /// The names of its states.
    pub fn states(&self) -> Vec<StateName> {
        self.basics.states(&MOTION[..if self.demodulator_sd.is_some() { 4 } else { 2 }])
    }
}

/// The standard deviations of the motion, and of the demodulator where it is a state.
fn deviations(
    experiment: &Experiment,
    at: &Key,
    filter: &FilterTable,
) -> Result<([f64; 2], Option<f64>), ConfigError> {
    let key = at.clone().child("start_sd");
    let [angle, rate] = states(Sign::Positive);
    if !filter.method.claims() {
        return Ok(([0.0; 2], filter.demodulator.then_some(0.0)));
    }
    if filter.demodulator {
        let stages = ExpectedEntry::new("demodulator", &kind::VOLTAGE, Sign::Positive);
        let [angle, rate, volts] = experiment.values(key, &filter.start_sd, [angle, rate, stages])?;
        return Ok(([angle, rate], Some(volts)));
    }
    Ok((experiment.values(key, &filter.start_sd, [angle, rate])?, None))
}

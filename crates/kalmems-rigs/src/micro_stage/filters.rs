//! What the rig takes from the tables of filters, in SI.

use super::hardware::StageHardware;
use crate::config::{
    ConfigError, ConfigFault, Estimate, ExpectedEntry, Experiment, FilterStart, Key, Sign, Values,
};
use crate::estimate::{
    DeviceParameter, FilterBasics, process_noise, refuse_demodulator, rows_to_start_again,
};
use crate::units::kind;

/// The density of its process noise.
pub const NOISE: ExpectedEntry =
    ExpectedEntry::new("angular_acceleration", &kind::ANGULAR_ACCELERATION_DENSITY, Sign::NotNegative);

/// One filter.
#[derive(Clone, Debug)]
pub struct StageFilterSettings {
    /// What every filter has.
    pub basics: FilterBasics,
    /// The electrodes whose signals it takes, as places in the hardware; empty for all that a recording has.
    pub electrodes: Vec<usize>,
    /// θ in rad and θ̇ in rad/s to start from; `None` starts from the signals.
    pub start: Option<[f64; 2]>,
    /// Their standard deviations; 0 for what claims none.
    pub start_sd: [f64; 2],
    /// Whether the start and its covariance come from the signals, by all of their first samples.
    pub by_batch: bool,
    /// The density of the angular acceleration in rad²/s³.
    pub density: f64,
}

impl StageFilterSettings {
    /// The rows that it is started again by where it has lost the signal, of a motion with this cycle and interval in s.
    pub fn rows_to_start_again(&self, motion: (f64, f64)) -> usize {
        rows_to_start_again(motion, 2 + self.basics.parameters().len())
    }
}

/// The parameters that can be states. Gap and gain are off by one ratio for all electrodes.
pub static PARAMETERS: [DeviceParameter; 5] = [
    DeviceParameter::factor("natural_frequency")
        .in_motion("resonator.natural_rate")
        .written(&[("resonator.natural_frequency", 1)]),
    DeviceParameter::factor("damping_ratio")
        .in_motion("resonator.damping_ratio")
        .written(&[("resonator.damping_ratio", 1)]),
    DeviceParameter::factor("drive_gain").in_motion("drive_gain").written(&[("resonator.drive_gain", 1)]),
    DeviceParameter::factor("gap").in_readout("plate.gap").written(&[("electrodes.*.gap", 1)]),
    DeviceParameter::factor("gain").in_readout("gain").written(&[("electrodes.*.gain", 1)]),
];

/// The states, as tables of values name them.
pub const fn states(sign: Sign) -> [ExpectedEntry; 2] {
    [ExpectedEntry::new("angle", &kind::ANGLE, sign), ExpectedEntry::new("rate", &kind::ANGULAR_RATE, sign)]
}

impl StageFilterSettings {
    /// Reads and checks the filter at this place of the file.
    pub fn of(
        experiment: &Experiment,
        estimate: &Estimate,
        hardware: &StageHardware,
        index: usize,
    ) -> Result<Self, ConfigError> {
        let filter = &estimate.filters[index];
        let at = Key::from("estimate").child("filter").index(index);
        let refuse = |name: &str, why: String| {
            Err(experiment.error(at.clone().child(name), ConfigFault::Value { why }))
        };
        refuse_demodulator(experiment, (&at, filter), "a micro-stage has none; leave it out")?;
        let mut electrodes = Vec::new();
        for name in &filter.channels {
            let place = hardware.channels.iter().position(|channel| channel.name == *name);
            let Some(place) = place else {
                let known = hardware.channels.iter().map(|channel| channel.name.as_str());
                return Err(experiment.error(at.child("channels"), ConfigFault::unknown_word(name, known)));
            };
            if electrodes.contains(&place) {
                return refuse("channels", format!("`{name}` is named twice; a signal counts once"));
            }
            electrodes.push(place);
        }
        let read = |name: &str, values: &Values, sign| {
            experiment.values(at.clone().child(name), values, states(sign))
        };
        let start = match &filter.start {
            Some(FilterStart::Values(values)) => Some(read("start", values, Sign::Any)?),
            _ => None,
        };
        let by_batch = start.is_none() && filter.method.claims() && filter.start_sd.is_empty();
        let start_sd = if filter.method.claims() && !by_batch {
            read("start_sd", &filter.start_sd, Sign::NotNegative)?
        } else {
            [0.0; 2]
        };
        let (noise_key, noise) = process_noise(experiment, &at, filter)?;
        let density = if filter.method.claims() {
            let [density] = experiment.values(noise_key, noise, [NOISE])?;
            density
        } else {
            0.0
        };
        // A channel scales gap and gain by its own.
        let plate = hardware.channels.first().map(|channel| channel.current);
        let scale = |parameter: &DeviceParameter| {
            plate.map_or(1.0, |current| parameter.scale(&hardware.stage, &current))
        };
        let basics =
            FilterBasics::of(experiment, &at, filter, (&PARAMETERS, &PARAMETERS.each_ref().map(scale)))?;
        Ok(Self { basics, electrodes, start, start_sd, by_batch, density })
    }
}

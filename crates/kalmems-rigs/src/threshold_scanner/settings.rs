//! What the rig takes from an experiment file, in SI.

use super::filters::ThresholdFilterSettings;
use super::hardware::ThresholdHardware;
use crate::config::{ConfigError, ConfigFault, ExpectedEntry, Experiment, Key, Method, Sign, Values};
use crate::crossings::{CrossingDelivery, DetectorSettings};
use crate::units::kind;

/// What an experiment says of a threshold-sensing scanner, of the detector of its crossings and of its filters, checked and in SI.
#[derive(Clone, Debug)]
pub struct ThresholdScannerSettings {
    /// The device.
    pub hardware: ThresholdHardware,
    /// How long a filter has to settle before it is scored, in s.
    pub skip_s: f64,
    /// In how many parts a record is judged beside the whole.
    pub parts: u32,
    /// How crossings are found, where the file says so.
    pub crossings: Option<DetectorSettings>,
    /// The filters, in the order of the file.
    pub filters: Vec<ThresholdFilterSettings>,
}

impl ThresholdScannerSettings {
    /// Reads and checks what the rig needs.
    pub fn of(experiment: &Experiment) -> Result<Self, ConfigError> {
        let hardware = ThresholdHardware::of(experiment)?;
        let Some(estimate) = &experiment.estimate else {
            let remedy = "add the table `[estimate]` with `skip`, `process_noise` and at least one `[[estimate.filter]]`";
            return Err(experiment.error("estimate", ConfigFault::MissingKey { remedy: remedy.to_owned() }));
        };
        for (name, given) in
            [("first_peak", estimate.first_peak.is_some()), ("first_peak_y", estimate.first_peak_y.is_some())]
        {
            if given {
                let why = "the signal of this device says itself which way it moves; leave it out".to_owned();
                return Err(experiment.error(Key::from("estimate").child(name), ConfigFault::Value { why }));
            }
        }
        let crossings = estimate.crossings.as_ref().map(DetectorSettings::from);
        let filters = (0..estimate.filters.len())
            .map(|i| ThresholdFilterSettings::of(experiment, estimate, &hardware, i));
        let filters = filters.collect::<Result<Vec<_>, _>>()?;
        if crossings.is_none() && filters.iter().any(|filter| filter.threshold.is_some()) {
            let remedy = "a filter uses the crossings of the threshold; write `[estimate.crossings]` with `width = \
                          \"30 us\"`, `separation = \"300 us\"` and `threshold = 4`";
            return Err(
                experiment.error("estimate.crossings", ConfigFault::MissingKey { remedy: remedy.to_owned() })
            );
        }
        Ok(Self {
            hardware,
            skip_s: estimate.skip.si(),
            parts: estimate.parts.unwrap_or(1),
            crossings,
            filters,
        })
    }
}

impl ThresholdScannerSettings {
    /// How filters are told of crossings.
    pub fn deliveries(&self) -> impl Iterator<Item = CrossingDelivery> + '_ {
        self.filters.iter().filter_map(|filter| filter.threshold.map(|threshold| threshold.delivery))
    }

    /// How crossings are looked for. Where the file asks for none they are looked for all the same, to see that the signal is
    /// the comb's, as soon as a filter relies on it.
    pub fn detector(&self) -> Option<DetectorSettings> {
        let relied_on = self.filters.iter().any(|filter| filter.basics.method != Method::Model);
        self.crossings
            .or_else(|| relied_on.then(|| DetectorSettings::usual(1.0 / self.hardware.natural_hz())))
    }

    /// The angle in rad by which every filter is judged at a crossing: the first that one is told, or the comb's.
    pub fn judged_angle(&self) -> f64 {
        let told = self.filters.iter().find_map(|filter| filter.threshold.map(|threshold| threshold.angle));
        told.unwrap_or(self.hardware.readout.comb.centre)
    }
}

/// The states of the motion, as tables of values name them.
pub const fn states(sign: Sign) -> [ExpectedEntry; 2] {
    [ExpectedEntry::new("angle", &kind::ANGLE, sign), ExpectedEntry::new("rate", &kind::ANGULAR_RATE, sign)]
}

/// A state to start from.
pub fn state_at(
    experiment: &Experiment,
    key: impl Into<Key>,
    values: &Values,
) -> Result<[f64; 2], ConfigError> {
    experiment.values(key, values, states(Sign::Any))
}

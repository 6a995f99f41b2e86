//! How the ring-down was taken.

use crate::config::{ConfigError, ConfigFault, ExpectedEntry, Experiment, Sign};
use crate::units::kind;

/// What `[identify.ring_down]` says, in SI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RingDownSettings {
    /// The constant voltage on the electrodes during the ring-down, in V.
    pub bias: f64,
    /// R_f of the transimpedance stage in Ω; negative for one that inverts.
    pub feedback_resistance: f64,
}

const ENTRIES: [ExpectedEntry; 2] = [
    ExpectedEntry::new("bias", &kind::VOLTAGE, Sign::NotZero),
    ExpectedEntry::new("feedback_resistance", &kind::RESISTANCE, Sign::NotZero),
];

impl RingDownSettings {
    /// Reads and checks the table.
    pub fn of(experiment: &Experiment) -> Result<Self, ConfigError> {
        let Some(identify) = &experiment.identify else {
            let remedy = "add the table `[identify.ring_down]` with `bias = \"23.76 V\"` and \
                          `feedback_resistance = \"17.86 kohm\"`"
                .to_owned();
            return Err(experiment.error("identify", ConfigFault::MissingKey { remedy }));
        };
        let [bias, feedback_resistance] =
            experiment.values("identify.ring_down", &identify.ring_down, ENTRIES)?;
        Ok(Self { bias, feedback_resistance })
    }
}

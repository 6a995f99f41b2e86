//! What the rig takes from an experiment file for an estimate, in SI.

use super::filters::StageFilterSettings;
use super::hardware::{ElectrodeChannel, StageHardware};
use crate::config::{ConfigError, ConfigFault, Experiment, Key};

/// Device and filter settings.
#[derive(Clone, Debug)]
pub struct StageSettings {
    /// The device.
    pub hardware: StageHardware,
    /// How long a filter has to settle before it is scored, in s.
    pub skip_s: f64,
    /// The filters, in the order of the file.
    pub filters: Vec<StageFilterSettings>,
}

impl StageSettings {
    /// Reads and checks what the rig needs.
    pub fn of(experiment: &Experiment) -> Result<Self, ConfigError> {
        let hardware = StageHardware::of(experiment)?;
        let Some(estimate) = &experiment.estimate else {
            let remedy = "add the table `[estimate]` with `skip`, `process_noise` and at least one `[[estimate.filter]]`";
            return Err(experiment.error("estimate", ConfigFault::MissingKey { remedy: remedy.to_owned() }));
        };
        let unused = [
            ("first_peak", estimate.first_peak.is_some()),
            ("first_peak_y", estimate.first_peak_y.is_some()),
        ];
        if let Some((name, _)) = unused.into_iter().find(|(_, given)| *given) {
            let why = "the signals of this device say themselves which way it moves; leave it out".to_owned();
            return Err(experiment.error(Key::from("estimate").child(name), ConfigFault::Value { why }));
        }
        for channel in &hardware.channels {
            noise_of(experiment, channel)?;
        }
        let filters =
            (0..estimate.filters.len()).map(|i| StageFilterSettings::of(experiment, estimate, &hardware, i));
        let filters = filters.collect::<Result<_, _>>()?;
        Ok(Self { skip_s: estimate.skip.si(), filters, hardware })
    }
}

/// The variance of a channel's noise in V², which must be known.
pub fn noise_of(experiment: &Experiment, channel: &ElectrodeChannel) -> Result<f64, ConfigError> {
    channel.noise_variance.ok_or_else(|| {
        let key = ["micro_stage", "electrodes", &channel.name, "noise_variance"];
        let key = key.into_iter().fold(Key::from("device"), Key::child);
        let remedy = "write it, such as `noise_variance = \"1.6e-11 V^2\"`, or let `kalmems identify` find it from a \
                      recording with the role `zero_drive`";
        experiment.error(key, ConfigFault::MissingKey { remedy: remedy.to_owned() })
    })
}

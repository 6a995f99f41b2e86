//! What the rig takes from an experiment file, in SI.

use super::filters::{STATES, TwoAxisFilterSettings, four};
use super::hardware::TwoAxisHardware;
use crate::config::{ConfigError, ConfigFault, Experiment, ExtremeSign, Sign, Values};
use crate::shared_scanner::settings::estimate_table;

/// Device, noise and filter settings.
#[derive(Clone, Debug)]
pub struct TwoAxisSettings {
    /// The device.
    pub hardware: TwoAxisHardware,
    /// How long a filter has to settle before it is scored, in s.
    pub skip_s: f64,
    /// For x and y, whether the first angle extreme after the settling time and the peak of the axis's own drive that
    /// follows it is a maximum; `None` leaves the sign as the filter started.
    pub first_peak_positive: [Option<bool>; 2],
    /// The filters, in the order of the file.
    pub filters: Vec<TwoAxisFilterSettings>,
}

impl TwoAxisSettings {
    /// Reads and checks what the rig needs.
    pub fn of(experiment: &Experiment) -> Result<Self, ConfigError> {
        let hardware = TwoAxisHardware::of(experiment)?;
        let estimate = estimate_table(experiment)?;
        let positive = |peak: &Option<ExtremeSign>| peak.as_ref().map(|peak| *peak == ExtremeSign::Positive);
        let filters = (0..estimate.filters.len())
            .map(|i| TwoAxisFilterSettings::of(experiment, estimate, &hardware, i));
        Ok(Self {
            filters: filters.collect::<Result<_, _>>()?,
            hardware,
            skip_s: estimate.skip.si(),
            first_peak_positive: [positive(&estimate.first_peak), positive(&estimate.first_peak_y)],
        })
    }
}

/// A state to simulate from; refused where both axes lie exactly still.
pub fn state_at(experiment: &Experiment, key: &str, values: &Values) -> Result<[f64; 4], ConfigError> {
    let state = experiment.values(key, values, four(Sign::Any))?;
    if state == [0.0; 4] {
        let [angle, ..] = STATES.map(|(name, ..)| name);
        let why = format!(
            "all of it is exactly 0, where neither axis would ever move; start from a small angle, such as \
             `{angle} = \"1e-6 rad\"`"
        );
        return Err(experiment.error(key, ConfigFault::Value { why }));
    }
    Ok(state)
}

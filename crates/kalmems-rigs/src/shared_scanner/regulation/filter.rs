//! What the loop takes of the filter that observes in it, in SI.

use super::super::settings::{ScannerHardware, acceleration_density, states};
use super::design::MOST;
use crate::config::{ConfigError, ConfigFault, Estimate, Experiment, FilterStart, Key, Method, Sign};
use crate::estimate::{DeviceParameter, FilterBasics};
use crate::shared_scanner::settings::DRIVE_GAIN;

/// An extended filter of angle and rate, with some parameters.
#[derive(Clone, Debug)]
pub struct ObserverFilter {
    /// What every filter has.
    pub basics: FilterBasics,
    /// The standard deviations of angle in rad and rate in rad/s at the start.
    pub start_sd: [f64; 2],
    /// The density of the angular acceleration's noise, in rad²/s³.
    pub acceleration_density: f64,
}

/// The parameters that it may have as states.
static PARAMETERS: [DeviceParameter; 5] = [
    DeviceParameter::factor("stiffness")
        .in_motion("scanner.resonator.stiffness")
        .written(&[("resonator.stiffness", 1)]),
    DeviceParameter::factor("damping")
        .in_motion("scanner.resonator.damping")
        .written(&[("resonator.damping", 1)]),
    DeviceParameter::factor("drive_gain").in_motion("drive_gain").written(&DRIVE_GAIN),
    DeviceParameter::factor("gain").in_readout("gain").written(&[("readout.gain", 1)]),
    DeviceParameter::volts("offset").in_readout("offset").written(&[("readout.offset", 1)]),
];

impl ObserverFilter {
    /// The filter at this place of the file, which the key of a fault names; refused if it cannot observe in the loop.
    pub fn of(
        experiment: &Experiment,
        estimate: &Estimate,
        hardware: &ScannerHardware,
        (index, named): (usize, Key),
    ) -> Result<Self, ConfigError> {
        let filter = &estimate.filters[index];
        let at = Key::from("estimate").child("filter").index(index);
        let resonator = &hardware.scanner.resonator;
        let scales = [resonator.stiffness, resonator.damping, 1.0, hardware.readout.gain, 1.0];
        let basics = FilterBasics::of(experiment, &at, filter, (&PARAMETERS, &scales))?;
        let wrong = |why: String| Err(experiment.error(named, ConfigFault::Value { why }));
        if basics.method != Method::Ekf
            || filter.demodulator
            || basics.tracked.len() > MOST
            || !basics.readout.is_empty()
        {
            return wrong(format!(
                "`{}` cannot observe in the loop; expected the method `ekf` without `demodulator` and with at most {MOST} \
                 parameters in `states`",
                filter.name
            ));
        }
        if filter.start_sd.is_empty() && !matches!(filter.start, Some(FilterStart::Values(_))) {
            return wrong(format!(
                "`{}` finds its start from recorded samples, and in the loop there are none; state `start_sd`, such as \
                 `{{ angle = \"0.05 rad\", rate = \"1000 rad/s\" }}`",
                filter.name
            ));
        }
        let start_sd = experiment.values(at.child("start_sd"), &filter.start_sd, states(Sign::Positive))?;
        Ok(Self {
            basics,
            start_sd,
            acceleration_density: acceleration_density(experiment, estimate, index)?,
        })
    }
}

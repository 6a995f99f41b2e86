//! What an estimator of arriving samples gives besides estimates: amplitude, phase and predicted zero phases.

use crate::config::{ConfigError, ConfigFault, Experiment, Key, Method, Quantity, TriggerDirection};
use crate::estimate::driven::InterpolationLag;
use crate::estimate::{FilterBasics, PhasePrediction, PhasePredictor, SideOutputs};
use std::f64::consts::TAU;

/// The amplitude in rad from which there are zero phases where neither file nor device says one: a device at rest has none.
const LEAST_AMPLITUDE: f64 = 1e-3;

/// What the table `stream` of the file wants of these filters, checked, of a device with this natural frequency in Hz and a least amplitude of its own
/// in rad, if it has one.
pub fn side_outputs(
    experiment: &Experiment,
    filters: &[&FilterBasics],
    (natural_hz, least_amplitude): (f64, Option<f64>),
) -> Result<SideOutputs, ConfigError> {
    let Some(stream) = &experiment.stream else { return Ok(SideOutputs::default()) };
    let Some(trigger) = &stream.trigger else {
        return Ok(SideOutputs { phase: stream.phase, prediction: None });
    };
    let wrong = |key: &str, why: String| {
        let key = Key::from("stream").child("trigger").child(key);
        experiment.error(key, ConfigFault::Value { why })
    };
    let names = || filters.iter().map(|filter| filter.name.as_str());
    let place = match &trigger.filter {
        None => 0,
        Some(name) => names().position(|known| known == name.as_str()).ok_or_else(|| {
            let known: Vec<String> = names().map(|name| format!("`{name}`")).collect();
            let (name, known) = (name.as_str(), known.join(", "));
            wrong("filter", format!("no `[[estimate.filter]]` has the name `{name}`; there are: {known}"))
        })?,
    };
    let Some(basics) = filters.get(place) else { return Ok(SideOutputs::default()) };
    if matches!(basics.method, Method::Model | Method::LockIn | Method::DirectInversion | Method::Bank) {
        let name = &basics.name;
        let why = format!(
            "`{name}` cannot predict when the motion will pass zero, nor how certain that is; name a filter with a model and a sensor"
        );
        return Err(wrong("filter", why));
    }
    let stated = trigger.least_amplitude.as_ref().map(Quantity::si);
    let prediction = PhasePrediction {
        ahead_s: trigger.ahead.si(),
        behind: InterpolationLag::of(experiment).samples(),
        directions: trigger.direction.map_or([true; 2], |direction| {
            [direction == TriggerDirection::Rising, direction == TriggerDirection::Falling]
        }),
        least_amplitude: stated.or(least_amplitude).unwrap_or(LEAST_AMPLITUDE),
    };
    // Whether there can be one; the interval between samples is known better when they have come.
    let motion = (1.0 / stream.rate.si(), TAU * natural_hz);
    if let Err(why) = PhasePredictor::new(&basics.key, prediction, motion, [None; 2]) {
        return Err(wrong("ahead", format!("`{}`: {why}", trigger.ahead.text())));
    }
    Ok(SideOutputs { phase: stream.phase, prediction: Some((place, prediction)) })
}

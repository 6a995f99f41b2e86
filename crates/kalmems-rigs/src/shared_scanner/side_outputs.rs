//! What an estimator of arriving samples gives besides estimates: amplitude, phase and predicted zero phases.

use super::settings::ScannerSettings;
use crate::config::{ConfigError, ConfigFault, Experiment, Key, Method, TriggerDirection};
use crate::estimate::driven::InterpolationLag;
use crate::estimate::{PhasePrediction, PhasePredictor, SideOutputs};
use std::f64::consts::TAU;

/// The amplitude from which there are zero phases, in widths of the comb: far below any motion that is used, far above what
/// a filter makes of noise.
const LEAST: f64 = 0.01;

/// What the table `stream` of the file wants, checked.
pub fn of(experiment: &Experiment, settings: &ScannerSettings) -> Result<SideOutputs, ConfigError> {
    let Some(stream) = &experiment.stream else { return Ok(SideOutputs::default()) };
    let Some(trigger) = &stream.trigger else {
        return Ok(SideOutputs { phase: stream.phase, prediction: None });
    };
    let wrong = |key: &str, why: String| {
        let key = Key::from("stream").child("trigger").child(key);
        experiment.error(key, ConfigFault::Value { why })
    };
    let names = || settings.filters.iter().map(|filter| filter.basics.name.as_str());
    let place = match &trigger.filter {
        None => 0,
        Some(name) => names().position(|known| known == name.as_str()).ok_or_else(|| {
            let known: Vec<String> = names().map(|name| format!("`{name}`")).collect();
            let (name, known) = (name.as_str(), known.join(", "));
            wrong("filter", format!("no `[[estimate.filter]]` has the name `{name}`; there are: {known}"))
        })?,
    };
    let basics = &settings.filters[place].basics;
    if matches!(basics.method, Method::Model | Method::LockIn) {
        let name = &basics.name;
        let why = format!(
            "`{name}` cannot predict when the motion will pass zero, nor how certain that is; name a filter with a model and a sensor"
        );
        return Err(wrong("filter", why));
    }
    let prediction = PhasePrediction {
        ahead_s: trigger.ahead.si(),
        behind: InterpolationLag::of(experiment).samples(),
        directions: trigger.direction.map_or([true; 2], |direction| {
            [direction == TriggerDirection::Rising, direction == TriggerDirection::Falling]
        }),
        least_amplitude: LEAST * settings.hardware.scanner.comb.angular_width,
    };
    // Whether there can be one; the interval between samples is known better when they have come.
    let motion = (1.0 / stream.rate.si(), TAU * settings.hardware.natural_hz());
    if let Err(why) = PhasePredictor::new(&basics.key, prediction, motion, [None; 2]) {
        return Err(wrong("ahead", format!("`{}`: {why}", trigger.ahead.text())));
    }
    Ok(SideOutputs { phase: stream.phase, prediction: Some((place, prediction)) })
}

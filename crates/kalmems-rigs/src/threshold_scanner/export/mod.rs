//! Which filter can be exported, and its source.

mod c;
mod scaled;

use super::equations::LEAST_VARIANCE;
use super::hardware::ThresholdHardware;
use crate::config::{
    CrossingApplication, CrossingTiming, ExpectedEntry, Experiment, FilterStart, Key, Method, Quantity, Sign,
    Values, Variant,
};
use crate::crossings::{Acceptance, DetectorSettings};
use crate::estimate::process_noise;
use crate::export::{ExportError, ExportTask, ExportableFilter, FilterSource, SourceLanguage};
use crate::source_code::rust_module;
use crate::units::kind;
use scaled::{CrossingSettings, ThresholdFilter};

/// The filter at this place of the file, which is told of crossings; `None` of one whose equations say all of it.
pub fn exported(experiment: &Experiment, place: usize) -> Result<Option<ThresholdFilter>, ExportError> {
    let hardware = ThresholdHardware::of(experiment)?;
    let mut estimate = experiment.estimate.iter();
    let Some((estimate, filter)) = estimate.find_map(|all| Some((all, all.filters.get(place)?))) else {
        return Ok(None);
    };
    let Some(threshold) = &filter.threshold else { return Ok(None) };
    let refuse =
        |why: &str| Err(ExportError::Filter { filter: filter.name.to_string(), why: why.to_owned() });
    if filter.method != Method::Ekf || filter.variant.unwrap_or_default() != Variant::Full {
        return refuse(
            "of the filters that use crossings, the method `ekf` with the variant `full` can be exported",
        );
    }
    if !filter.states.is_empty() {
        return refuse("it has other states than angle and rate; leave `states` out");
    }
    if hardware.mirror.drive_gain != 0.0 || hardware.feedthrough != 0.0 {
        return refuse(
            "the drive moves the mirror or reaches the signal; a mirror that swings freely can be exported with its detector",
        );
    }
    let detector = estimate.crossings.as_ref().map(DetectorSettings::from);
    let Some((detector, Acceptance::Deviations(deviations))) =
        detector.map(|detector| (detector, detector.acceptance))
    else {
        return refuse(
            "its crossings are accepted by a rate of false alarms; give `threshold` in `[estimate.crossings]`",
        );
    };
    let told = (threshold.timing, threshold.applied, &threshold.lag, &threshold.angle_sd);
    let (CrossingTiming::ZeroCrossing, CrossingApplication::Late, None, None) = told else {
        return refuse(
            "it takes crossings otherwise than by their zero as soon as they are known; leave `timing`, `applied`, `lag` and `angle_sd` out",
        );
    };
    let Some(FilterStart::Values(start)) = &filter.start else {
        return refuse(
            "it starts from the signal; give `start` as values, such as `{ angle = \"-0.1 rad\", rate = \"400 rad/s\" }`",
        );
    };
    let at = Key::from("estimate").child("filter").index(place);
    let values = |key: &str, values: &Values, sign: Sign| {
        let entries = [
            ExpectedEntry::new("angle", &kind::ANGLE, sign),
            ExpectedEntry::new("rate", &kind::ANGULAR_RATE, sign),
        ];
        experiment.values(at.clone().child(key), values, entries)
    };
    let noise =
        [ExpectedEntry::new("angular_acceleration", &kind::ANGULAR_ACCELERATION_DENSITY, Sign::NotNegative)];
    let (noise_key, of_noise) = process_noise(experiment, &at, filter)?;
    let [acceleration_density] = experiment.values(noise_key, of_noise, noise)?;
    Ok(Some(ThresholdFilter {
        resonator: hardware.mirror.resonator,
        readout: hardware.readout,
        noise_variance: hardware.noise_variance,
        signal_variance: filter.signal_variance.as_ref().map_or(hardware.noise_variance, Quantity::si),
        acceleration_density,
        start: values("start", start, Sign::Any)?,
        start_sd: values("start_sd", &filter.start_sd, Sign::Positive)?,
        crossings: CrossingSettings {
            width_s: detector.width_s,
            separation_s: detector.separation_s,
            deviations,
            angle: threshold.angle.as_ref().map_or(hardware.readout.comb.centre, Quantity::si),
            least_variance: LEAST_VARIANCE,
            gate_nis: threshold.gate.map_or(f64::INFINITY, |sds| sds * sds),
        },
    }))
}

impl ExportableFilter for ThresholdFilter {
    fn source(&self, task: &ExportTask<'_>) -> Result<FilterSource, ExportError> {
        let &ExportTask { prefix, heading, interval_s, .. } = task;
        if task.update_every.get() > 1 {
            let why = "its detector needs every sample; leave `--update-every` out".to_owned();
            return Err(ExportError::Filter { filter: task.filter.to_owned(), why });
        }
        let scaled = self.scaled(interval_s);
        let files = match task.target {
            SourceLanguage::Rust => {
                let what =
                    "The filter of a threshold-sensing scanner and its detector, for a microcontroller.";
                vec![("filter.rs".to_owned(), rust_module(what, heading, &scaled.to_rust()?))]
            }
            SourceLanguage::C => c::files(&scaled, interval_s, prefix, heading)?,
        };
        Ok(FilterSource { files })
    }
}

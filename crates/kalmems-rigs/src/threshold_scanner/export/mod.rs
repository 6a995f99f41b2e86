//! Which filter can be exported, and its source.

mod c;
mod scaled;

use super::course::LEAST_VARIANCE;
use super::settings::ThresholdScannerSettings;
use crate::config::{CrossingApplication, CrossingTiming, Experiment, Method, Variant};
use crate::crossings::Acceptance;
use crate::export::{ExportError, ExportTask, ExportableFilter, FilterSource, SourceLanguage};
use crate::source_code::rust_module;
use scaled::{CrossingSettings, ThresholdFilter};

/// The filter at this place of the file.
pub fn exported(experiment: &Experiment, place: usize) -> Result<ThresholdFilter, ExportError> {
    let settings = ThresholdScannerSettings::of(experiment)?;
    let (hardware, filter) = (&settings.hardware, &settings.filters[place]);
    let refuse =
        |why: &str| Err(ExportError::Filter { filter: filter.basics.name.clone(), why: why.to_owned() });
    if filter.basics.method != Method::Ekf || filter.variant != Variant::Full {
        return refuse("of this device, the method `ekf` with the variant `full` can be exported");
    }
    if !(filter.basics.tracked.is_empty() && filter.basics.readout.is_empty()) {
        return refuse("it has other states than angle and rate; leave `states` out");
    }
    if hardware.mirror.drive_gain != 0.0 || hardware.feedthrough != 0.0 {
        return refuse(
            "the drive moves the mirror or reaches the signal; a mirror that swings freely can be exported",
        );
    }
    let (Some(detector), Some(threshold)) = (settings.crossings, filter.threshold) else {
        return refuse("it uses no crossings; add `[estimate.crossings]` and `threshold = {}`");
    };
    let Acceptance::Deviations(deviations) = detector.acceptance else {
        return refuse(
            "its crossings are accepted by a rate of false alarms; give `threshold` in `[estimate.crossings]`",
        );
    };
    let told = (threshold.timing, threshold.delivery.applied, threshold.delivery.lag_s, threshold.angle_sd);
    let (CrossingTiming::ZeroCrossing, CrossingApplication::Late, None, None) = told else {
        return refuse(
            "it takes crossings otherwise than by their zero as soon as they are known; leave `timing`, `applied`, `lag` and `angle_sd` out",
        );
    };
    if filter.from_signal {
        return refuse(
            "it starts from the signal; give `start` as values, such as `{ angle = \"-0.1 rad\", rate = \"400 rad/s\" }`",
        );
    }
    Ok(ThresholdFilter {
        resonator: hardware.mirror.resonator,
        readout: hardware.readout,
        noise_variance: hardware.noise_variance,
        signal_variance: filter.signal_variance,
        acceleration_density: filter.acceleration_density,
        start: filter.start,
        start_sd: filter.start_sd,
        crossings: CrossingSettings {
            width_s: detector.width_s,
            separation_s: detector.separation_s,
            deviations,
            angle: threshold.angle,
            least_variance: LEAST_VARIANCE,
            gate_nis: threshold.gate_nis.unwrap_or(f64::INFINITY),
        },
    })
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

//! Which filter can be exported, and what of it.

use super::course::LEAST_VARIANCE;
use super::settings::ThresholdScannerSettings;
use crate::config::{CrossingApplication, CrossingTiming, Experiment, Method, Variant};
use crate::crossings::Acceptance;
use crate::export::{CrossingSettings, ExportError, ExportableFilter, ThresholdFilter};

/// The filter at this place of the file.
pub fn exported(experiment: &Experiment, place: usize) -> Result<ExportableFilter, ExportError> {
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
    Ok(ExportableFilter::Threshold(ThresholdFilter {
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
    }))
}

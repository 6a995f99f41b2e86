//! What is left of the estimated rate's scale factor and bias after the identification.

use super::gaps::GapFit;
use crate::config::Experiment;
use crate::estimate::{self, EstimateError, Past};
use crate::fit::DerivedNumber;
use crate::identify::{AffineFit, IdentifyError, fit_affine};
use crate::micro_stage::records::StageRecords;
use crate::micro_stage::segment::{self, StageSamples};
use crate::micro_stage::settings::StageSettings;
use crate::progress::Progress;
use kalmems_core::Portable;
use std::f64::consts::TAU;

/// ω_EST = α·ω_LDV + β over the training records (Chen, dissertation, 2018, equations 59 to 61 and the end of section
/// 3.5.4).
#[derive(Clone, Debug)]
pub struct RateLine {
    /// The filter whose rate it is of.
    pub filter: String,
    /// α.
    pub scale: DerivedNumber,
    /// β in rad/s.
    pub bias: DerivedNumber,
}

/// The line of the first filter that claims an uncertainty, run over the training records with what was identified.
/// `None` without a vibrometer or an `[estimate]` table.
pub fn correction(
    experiment: &Experiment,
    on: &StageRecords,
    found: &GapFit,
    progress: &dyn Progress,
) -> Result<Option<RateLine>, IdentifyError> {
    let Some(delay) = found.delay.filter(|_| experiment.estimate.is_some()) else { return Ok(None) };
    let mut settings = StageSettings::of(experiment)?;
    settings.hardware.correction = [1.0, 0.0];
    let Some(first) = settings.filters.iter().position(|filter| filter.basics.method.claims()) else {
        return Ok(None);
    };
    settings.filters = vec![settings.filters.swap_remove(first)];
    settings.filters[0].basics.smooth = false;
    settings.filters[0].basics.lag_s = None;
    let (mut known, mut said) = (Vec::new(), Vec::new());
    for ((record, label), rate) in found.records.iter().zip(&found.labels).zip(&found.rates) {
        let Some(read) = on.all.iter().find(|read| read.label == *label) else { continue };
        // Signals of a variant without the bias off still have the drive in them.
        let drive: Vec<f64> = record.time_s.iter().map(|t| record.drive.at(*t)).collect();
        let samples = StageSamples {
            place: &read.place,
            time_s: &record.time_s,
            taken: estimate::SampleSelection::whole(record.time_s.len(), read.interval_s),
            drive: &drive,
            sines: &[],
            drive_hz: record.drive.frequency_hz,
            electrodes: &on.electrodes,
            signals: found.signals_without_drive(record, &on.electrodes),
            feedthrough_sd: vec![0.0; on.electrodes.len()],
        };
        let mut past = Past::from(record.time_s.first().copied().unwrap_or(0.0));
        let trajectories =
            segment::estimate(&settings, &samples, &mut past, progress).map_err(as_identify_error)?;
        let Some(state) = trajectories.first().and_then(|trajectory| trajectory.state("rate")) else {
            continue;
        };
        let start_s = record.time_s.first().copied().unwrap_or(0.0) + settings.skip_s;
        let from = record.time_s.partition_point(|t| *t < start_s);
        for (t, rate_found) in record.time_s.iter().zip(&state.mean).skip(from) {
            // The vibrometer shows the rate late, and with an offset of its own.
            let phase = TAU * rate.frequency_hz * (t + delay.value) + rate.phase_rad;
            known.push(rate.amplitude * phase.portable_cos());
            said.push(*rate_found);
        }
    }
    let line: Option<AffineFit> = fit_affine(&known, &said);
    Ok(line.map(|line| RateLine {
        filter: settings.filters[0].basics.name.clone(),
        scale: line.slope(),
        bias: line.at(0.0),
    }))
}

fn as_identify_error(error: EstimateError) -> IdentifyError {
    match error {
        EstimateError::Config(error) => error.into(),
        EstimateError::Read(error) => error.into(),
        EstimateError::Interrupted => IdentifyError::Interrupted,
        other => {
            IdentifyError::Unfit { recording: "the training records".to_owned(), why: other.to_string() }
        }
    }
}

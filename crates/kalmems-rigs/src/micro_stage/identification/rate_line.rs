//! What is left of the estimated rate's scale factor and bias after the identification.

use super::gaps::GapFit;
use super::waveform::WaveRecord;
use crate::Rig;
use crate::config::{Channels, Clock, ColumnChoice, Experiment, Recording, RecordingRole};
use crate::equations::PresetRig;
use crate::estimate::{EstimateError, SegmentEstimate};
use crate::fit::DerivedNumber;
use crate::identify::{AffineFit, IdentifyError, fit_affine};
use crate::micro_stage::device::MicroStage;
use crate::micro_stage::hardware::StageHardware;
use crate::micro_stage::records::{DRIVE, StageRecords};
use crate::progress::Progress;
use crate::recording::RecordingFromRows;
use kalmems_core::Portable;
use kalmems_engines::rig::estimate_by;
use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::path::PathBuf;

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
    let Some((mut alone, filter)) = alone(experiment, on)? else { return Ok(None) };
    let skip_s = alone.estimate.as_ref().map_or(0.0, |estimate| estimate.skip.si());
    let (mut known, mut said) = (Vec::new(), Vec::new());
    for ((record, label), rate) in found.records.iter().zip(&found.labels).zip(&found.rates) {
        let Some(read) = on.all.iter().find(|read| read.label == *label) else { continue };
        if let Some(recording) = alone.recordings.first_mut() {
            recording.file = read.place.clone().into();
        }
        let estimated = estimated(&alone, (found, record), on, progress).map_err(as_identify_error)?;
        let trajectory = estimated.first().and_then(|segment| segment.trajectories.first());
        let Some(state) = trajectory.and_then(|trajectory| trajectory.state("rate")) else { continue };
        let start_s = record.time_s.first().copied().unwrap_or(0.0) + skip_s;
        let from = record.time_s.partition_point(|t| *t < start_s);
        for (t, rate_found) in record.time_s.iter().zip(&state.mean).skip(from) {
            // The vibrometer shows the rate late, and with an offset of its own.
            let phase = TAU * rate.frequency_hz * (t + delay.value) + rate.phase_rad;
            known.push(rate.amplitude * phase.portable_cos());
            said.push(*rate_found);
        }
    }
    let line: Option<AffineFit> = fit_affine(&known, &said);
    Ok(line.map(|line| RateLine { filter, scale: line.slope(), bias: line.at(0.0) }))
}

/// The column of an electrode's signal in a record in memory.
fn column(electrode: usize) -> String {
    format!("signal{electrode}_V")
}

/// The experiment with its first filter that claims an uncertainty alone, and the name of that, on a record of which all that the drive makes has been
/// taken off; `None` without such a filter.
fn alone(experiment: &Experiment, on: &StageRecords) -> Result<Option<(Experiment, String)>, IdentifyError> {
    let hardware = StageHardware::of(experiment)?;
    let mut device = (*experiment.device::<MicroStage>()?).clone();
    device.correction = None;
    device.electrodes.values_mut().for_each(|electrode| electrode.feedthrough = None);
    let mut alone = experiment.clone();
    alone.set_device(device);
    let Some(estimate) = &mut alone.estimate else { return Ok(None) };
    let Some(mut first) = estimate.filters.iter().find(|filter| filter.method.claims()).cloned() else {
        return Ok(None);
    };
    (first.smooth, first.smooth_lag) = (false, None);
    let name = first.name.to_string();
    estimate.filters = vec![first];
    let signals = on
        .electrodes
        .iter()
        .map(|place| (hardware.channels[*place].meaning(), column(*place).as_str().into()));
    let columns: BTreeMap<String, ColumnChoice> =
        signals.chain([(DRIVE.to_owned(), DRIVE_COLUMN.into())]).collect();
    let Ok(channels) = Channels::try_from(columns) else { return Ok(None) };
    let clock = Clock::column(TIME_COLUMN);
    alone.recordings = vec![Recording::of(RecordingRole::Test, PathBuf::new(), clock, channels, None)];
    Ok(Some((alone, name)))
}

const TIME_COLUMN: &str = "time_s";
const DRIVE_COLUMN: &str = "drive_V";

/// What that filter says of a record.
fn estimated(
    alone: &Experiment,
    (found, record): (&GapFit, &WaveRecord),
    on: &StageRecords,
    progress: &dyn Progress,
) -> Result<Vec<SegmentEstimate>, EstimateError> {
    let rig = PresetRig::<MicroStage>::new();
    let columns: Vec<String> = on.electrodes.iter().map(|place| column(*place)).collect();
    let header: Vec<&str> =
        [TIME_COLUMN, DRIVE_COLUMN].into_iter().chain(columns.iter().map(String::as_str)).collect();
    let place = alone.recording(0)?.file.display().to_string();
    let mut rows = RecordingFromRows::new(&place, &header, &rig.layout(alone, 0)?)?;
    // Signals of a variant without the bias off still have the drive in them.
    let signals = found.signals_without_drive(record, &on.electrodes);
    for (k, time_s) in record.time_s.iter().enumerate() {
        let own = [*time_s, record.drive.at(*time_s)];
        rows.push(&own.into_iter().chain(signals.iter().map(|signal| signal[k])).collect::<Vec<_>>());
    }
    // Without what the device may be besides.
    Ok(estimate_by(&mut *rig.estimator(alone, 0, progress)?, &rows.finish()?)?.0)
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

//! The stage's parameters from its recordings.
//!
//! | role | channels | what it says |
//! |---|---|---|
//! | `sweep` | `drive`; one record per frequency, and a vibrometer | f_n, ζ, b_c, the vibrometer's delay |
//! | `bias_on`, `bias_off` | `drive`, `signal_<electrode>`; one record per drive amplitude | gaps, gains, delay, feedthrough |
//! | `zero_drive` | `bias_on_<electrode>` or `signal_<electrode>` | the noise of each channel |

mod common_noise;
mod crests;
mod figures;
mod gaps;
mod in_situ;
mod messages;
mod noise;
mod rate_line;
mod sweep;
mod unfitted;
mod waveform;

pub use crests::{ByCrests, Crests, by_crests, crests, expected};
pub use figures::sweep as sweep_figure;
pub use gaps::GapFit;
pub use in_situ::{InSitu, in_situ};
use kalmems_core::Portable;
pub use sweep::{StageSweepPoint, SweepError, SweepFit, fit_sweep};
pub use waveform::{
    ELECTRODES, ElectrodeUnknowns, Indeterminate, UNKNOWNS, WaveRecord, Waveforms, correlation,
    indeterminate, motion_by, unknown,
};

use super::hardware::StageHardware;
use super::records::{self, StageRecords, of_role};
use crate::config::kinds::KindOf;
use crate::config::{ConfigFault, Experiment, Key, Quantity, RecordingRole, SignOf};
use crate::fit::{DerivedNumber, FitError};
use crate::identify::{Entries, Identification, IdentifyError};
use crate::micro_stage::device::MicroStage;
use crate::progress::Progress;
use std::f64::consts::TAU;

/// What keeps an identification from its beginning.
const NO_RECORDING: &str = "no recording has the role `sweep`, `bias_on` or `zero_drive`; parameters are identified from those, or \
    from any moving recording where `[identify]` names them, such as `parameters = [\"resonator.natural_frequency\"]`";

/// Identifies what the recordings' roles allow.
pub fn identify(experiment: &Experiment, progress: &dyn Progress) -> Result<Identification, IdentifyError> {
    let mut hardware = StageHardware::of(experiment)?;
    let mut found = Identification::begun("micro_stage", experiment);
    let index = |role| only(experiment, role);
    let (sweep, on, off, still) = (
        index(RecordingRole::Sweep)?,
        index(RecordingRole::BiasOn)?,
        index(RecordingRole::BiasOff)?,
        index(RecordingRole::ZeroDrive)?,
    );
    if sweep.is_none() && on.is_none() && still.is_none() {
        let fault = ConfigFault::Value { why: NO_RECORDING.to_owned() };
        return Err(experiment.error("recording", fault).into());
    }
    let mut device = (*experiment.device::<MicroStage>()?).clone();
    let mut entries = Entries::default();
    if let Some(index) = still {
        noise::identify(experiment, &mut hardware, &mut device, index, &mut found, progress)?;
        stop(progress)?;
    }
    if let Some(index) = sweep {
        let records = records::read(experiment, &hardware, index, progress)?;
        let (points, fitted) = sweep_of(&records)?;
        messages::sweep(&mut found, &records, &fitted);
        found.figures.push(figures::sweep(&points, &fitted, "measured"));
        let resonator = &mut device.resonator;
        let damping = fitted.damping_ratio();
        let damping = DerivedNumber { value: 100.0 * damping.value, deviation: 100.0 * damping.deviation };
        let place = (NATURAL_FREQUENCY, &mut resonator.natural_frequency);
        entries.set(experiment, place, fitted.natural_frequency_hz(), "Hz")?;
        entries.set(experiment, (DAMPING_RATIO, &mut resonator.damping_ratio), damping, "%")?;
        entries.set(experiment, (DRIVE_GAIN, &mut resonator.drive_gain), fitted.drive_gain(), "rad/s^2/V")?;
        entries
            .correlate_all(&[NATURAL_FREQUENCY, DAMPING_RATIO, DRIVE_GAIN], &|i, j| fitted.covariance(i, j));
        hardware.stage.resonator.natural_rate = TAU * fitted.natural_frequency_hz().value;
        hardware.stage.resonator.damping_ratio = fitted.damping_ratio().value;
        hardware.stage.drive_gain = fitted.drive_gain().value;
        set_delay(&mut found.experiment, index, records.delay_s + fitted.delay_s().value)?;
        found.materials.push(records.material);
        stop(progress)?;
    }
    found.experiment.set_device(device.clone());
    entries.write(&mut found.experiment);
    if let Some(index) = on {
        let records = records::read(experiment, &hardware, index, progress)?;
        let off = match off {
            Some(off) => Some(records::read(experiment, &hardware, off, progress)?),
            None => None,
        };
        let fitted = gaps::identify(experiment, &hardware, &records, off.as_ref())?;
        messages::gaps(&mut found, &hardware, &records, &fitted);
        found.figures.extend(figures::gaps(&hardware, &fitted));
        let mut names = Vec::new();
        for (electrode, by) in &fitted.electrodes {
            let name = &hardware.channels[*electrode].name;
            let Some(table) = device.electrodes.get_mut(name) else { continue };
            let [gap, gain] = ["gap", "gain"].map(|own| format!("electrodes.{name}.{own}"));
            entries.set(experiment, (&gap, &mut table.gap), by.gap, "m")?;
            entries.set(experiment, (&gain, &mut table.gain), by.gain, "V ohm")?;
            names.extend([gap, gain]);
            if let Some(feedthrough) = by.feedthrough {
                table.feedthrough = Some(crate::micro_stage::device::DriveFeedthrough {
                    gain: quantity(experiment, feedthrough[0], "")?,
                    slope: quantity(experiment, feedthrough[1], "s")?,
                });
            }
        }
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        entries.correlate_all(&names, &|i, j| fitted.covariance[i][j]);
        if let Some(delay) = fitted.delay {
            set_delay(&mut found.experiment, index, delay.value)?;
        }
        found.experiment.set_device(device.clone());
        entries.write(&mut found.experiment);
        stop(progress)?;
        if let Some(line) = rate_line::correction(&found.experiment, &records, &fitted, progress)? {
            messages::correction(&mut found, &records, &line);
            let correction = crate::micro_stage::device::RateCorrection {
                scale: quantity(experiment, line.scale.value, "")?,
                bias: quantity(experiment, line.bias.value, "rad/s")?,
            };
            device.correction = Some(correction);
            found.experiment.set_device(device);
        }
        found.materials.push(records.material);
        found.materials.extend(off.map(|off| off.material));
    }
    for material in &found.materials {
        found.notes.extend(material.diagnosis.iter().map(|finding| format!("{}: {finding}", material.name)));
    }
    Ok(found)
}

/// The one recording of a role.
fn only(experiment: &Experiment, role: RecordingRole) -> Result<Option<usize>, IdentifyError> {
    match of_role(experiment, role)[..] {
        [first, second, ..] => {
            let key = Key::from("recording").index(second).child("role");
            let why = format!(
                "this is the second recording of its role, after `{}`; an identification takes one: put its records into \
                 one file with a `segments` column, or into another experiment",
                Key::from("recording").index(first)
            );
            Err(experiment.error(key, ConfigFault::Value { why }).into())
        }
        [index] => Ok(Some(index)),
        [] => Ok(None),
    }
}

/// The steps of a sweep, and the fit.
fn sweep_of(records: &StageRecords) -> Result<(Vec<StageSweepPoint>, SweepFit), IdentifyError> {
    let mut points = Vec::new();
    for record in &records.all {
        let Some(rate) = record.rate else {
            let why = "it has no reference; what the drive makes of the stage is not known without one: name the \
                       vibrometer's column under `[recording.reference]`";
            return Err(IdentifyError::Unfit { recording: record.place.clone(), why: why.to_owned() });
        };
        let frequency_hz = stepped_frequency(record)?;
        // As if the reference were as late as is stated: what is left of its delay is found.
        let turned = rate.phase_rad - record.drive.phase_rad + TAU * frequency_hz * records.delay_s;
        let (sine, cosine) = turned.portable_sin_cos();
        let size = rate.amplitude / record.drive.amplitude;
        let samples = record.time_s.len() as f64;
        let relative = (rate.residual_rms / rate.amplitude)
            .portable_hypot(record.drive.residual_rms / record.drive.amplitude);
        let deviation = size * relative * (2.0 / samples).sqrt();
        points.push(StageSweepPoint { frequency_hz, re: size * cosine, im: size * sine, deviation });
    }
    points.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
    let fitted = fit_sweep(&points).map_err(|error| match error {
        SweepError::Fit(source) => fit_error(&records.name, source),
        error @ SweepError::NotThrough { .. } => {
            IdentifyError::Unfit { recording: records.name.clone(), why: error.to_string() }
        }
    })?;
    Ok((points, fitted))
}

/// How far a record's label may be from what its drive shows, in Hz: a few standard errors of four cycles.
const LABEL_HZ: f64 = 0.5;

/// The frequency of a step: its label where that is a number, which is what the generator was set to; else what the
/// drive shows.
fn stepped_frequency(record: &records::StageRecord) -> Result<f64, IdentifyError> {
    match record.label.parse::<f64>() {
        Ok(stated) if (stated - record.drive.frequency_hz).abs() <= LABEL_HZ => Ok(stated),
        Ok(stated) => {
            let why = format!(
                "its label says {stated} Hz and its drive has {:.3} Hz; correct the label, or the clock of the recording",
                record.drive.frequency_hz
            );
            Err(IdentifyError::Unfit { recording: record.place.clone(), why })
        }
        Err(_) => Ok(record.drive.frequency_hz),
    }
}

fn fit_error(recording: &str, source: FitError) -> IdentifyError {
    IdentifyError::Fit { recording: recording.to_owned(), source }
}

fn stop(progress: &dyn Progress) -> Result<(), IdentifyError> {
    if progress.reached(0).is_break() { Err(IdentifyError::Interrupted) } else { Ok(()) }
}

/// Keys below the device's table.
const NATURAL_FREQUENCY: &str = "resonator.natural_frequency";
const DAMPING_RATIO: &str = "resonator.damping_ratio";
const DRIVE_GAIN: &str = "resonator.drive_gain";

fn value_error(experiment: &Experiment, why: String) -> IdentifyError {
    experiment.error("device.micro_stage", ConfigFault::Value { why }).into()
}

fn quantity<K: KindOf, S: SignOf>(
    experiment: &Experiment,
    value: f64,
    unit: &str,
) -> Result<Quantity<K, S>, IdentifyError> {
    Quantity::of(value, unit).map_err(|why| value_error(experiment, why))
}

/// Puts the delay of a recording's reference into the experiment.
fn set_delay(experiment: &mut Experiment, index: usize, delay_s: f64) -> Result<(), IdentifyError> {
    let delay = quantity(experiment, delay_s, "s")?;
    if let Some(reference) = experiment.recordings.get_mut(index).and_then(|r| r.reference.as_mut()) {
        reference.set_delay(delay);
    }
    Ok(())
}

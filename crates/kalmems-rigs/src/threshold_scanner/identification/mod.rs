//! The scanner's parameters from a free decay.
//!
//! One recording of the role `ring_down`, with the drive off: the channel `signal`, the comb's output in V; `drive` and
//! `position` may stand beside it. Its reference, an angle or the position of the beam, is needed: it gives the angle its
//! scale.

mod curve;
mod decay;
mod figures;
mod messages;

pub use curve::{CurvePoint, fit_curve};
pub use decay::{DecayError, DecayFit, DecayRecord, fit_decay, unknown};

use super::hardware::ThresholdHardware;
use super::{MEANINGS, POSITION};
use crate::config::{ConfigFault, Experiment, Quantity, RecordingRole, Reference};
use crate::equations::Preset;
use crate::evaluate::ReferenceChannels;
use crate::fit::DerivedNumber;
use crate::identify::{Entries, Identification, IdentifyError, Material, exact};
use crate::progress::Progress;
use crate::recording::SampledRecording;
use crate::threshold_scanner::device::ThresholdScanner;
use crate::units::kind;
use std::f64::consts::TAU;

/// What a free decay gave.
struct DecayResult {
    decay: DecayFit,
    curve: Vec<CurvePoint>,
    /// How much later than the motion the reference shows it, in s: what is stated and what was found beyond.
    delay: DerivedNumber,
    /// tan(m·θ) of one volt of the reference's detector, where there is one.
    per_volt: Option<f64>,
}

/// Identifies the device from the experiment's free decay.
pub fn identify(experiment: &Experiment, progress: &dyn Progress) -> Result<Identification, IdentifyError> {
    let hardware = ThresholdHardware::of(experiment)?;
    let instruments = experiment.device::<ThresholdScanner>()?.instruments();
    let [drive, signal] = MEANINGS;
    let material = Material::of_role(
        experiment,
        RecordingRole::RingDown,
        (signal, &kind::VOLTAGE),
        &[drive, POSITION],
        &ReferenceChannels::one_angle(instruments),
        progress,
    )?
    .ok_or_else(|| {
        let why =
            "no recording has the role `ring_down`; parameters are identified from a free decay, or from any moving recording where \
             `[identify]` names them, such as `parameters = [\"resonator.natural_frequency\"]`"
                .to_owned();
        experiment.error("recording", ConfigFault::Value { why })
    })?;
    if material.angle.is_empty() {
        let why = "it has no reference, and the signal alone does not know the scale of the angle: an angle and a threshold that are both larger \
                   by a factor, with gain and steepness smaller by it, give the same signal. Name the column of the position detector or of the \
                   angle under `[recording.reference]`, or identify what does not depend on the scale: `[identify]` with `parameters = \
                   [\"resonator.natural_frequency\", \"resonator.damping_ratio\"]`";
        return Err(material.unfit(why.to_owned()));
    }
    drive_is_off(experiment, &material, progress)?;
    let beam = instruments.beam;
    let record = DecayRecord {
        interval_s: material.interval_s,
        signal: &material.signal,
        angle: &material.angle,
        multiple: beam.map_or(1.0, |beam| beam.multiple),
        shape: hardware.readout.comb.shape,
    };
    let unfit = |error: DecayError| match error {
        DecayError::Fit(source) => IdentifyError::Fit { recording: material.name.clone(), source },
        error => material.unfit(error.to_string()),
    };
    let decay = fit_decay(&record, progress).map_err(unfit)?;
    if progress.reached(0).is_break() {
        return Err(IdentifyError::Interrupted);
    }
    let mut device = (*experiment.device::<ThresholdScanner>()?).clone();
    let transimpedance = device.readout.feedback_resistance.si() * device.readout.bias.si();
    let threshold = decay.fit.parameters[unknown::THRESHOLD];
    let curve = fit_curve(&material.signal, &decay.motion, threshold, transimpedance)
        .map_err(|source| IdentifyError::Fit { recording: material.name.clone(), source })?;
    let place = experiment.recordings.iter().position(|recording| recording.role == RecordingRole::RingDown);
    let stated = match place {
        Some(index) => experiment.recording(index)?.reference.as_ref().map_or(0.0, Reference::delay_s),
        None => 0.0,
    };
    let late = decay.fit.parameter(unknown::DELAY);
    let found = DecayResult {
        delay: DerivedNumber { value: stated + late.value, ..late },
        per_volt: beam.map(|beam| beam.gain / beam.distance),
        decay,
        curve,
    };

    let mut identification = Identification {
        figures: figures::of(&material, &found, (&hardware, transimpedance)),
        ..Identification::begun("threshold_scanner", experiment)
    };
    messages::of(&mut identification, &material, &found);
    let entries = apply(experiment, &mut device, &found)?;
    identification.experiment.set_device(device);
    entries.write(&mut identification.experiment);
    let reference =
        place.and_then(|index| identification.experiment.recordings.get_mut(index)?.reference.as_mut());
    if let Some(reference) = reference {
        let delay = Quantity::of(found.delay.value, "s").map_err(|why| value_error(experiment, why))?;
        reference.set_delay(delay);
    }
    identification.materials.push(material);
    Ok(identification)
}

/// A drive that stays below this, in V, is off: K_d·V²/2 of it is 10⁻⁵ of ω_n²·θ of the published device.
const OFF_V: f64 = 1.0;

/// Refuses a recording whose drive is on, where the drive was recorded.
fn drive_is_off(
    experiment: &Experiment,
    material: &Material,
    progress: &dyn Progress,
) -> Result<(), IdentifyError> {
    let place = experiment.recordings.iter().position(|recording| recording.role == RecordingRole::RingDown);
    let Some(described) = place.map(|index| experiment.recording(index)).transpose()? else { return Ok(()) };
    let Some(column) = described.channels.column(MEANINGS[0]) else { return Ok(()) };
    let path = experiment.resolve(&described.file);
    let recording = SampledRecording::read_with(&path, &described.layout(&[column]), &mut |done, _| {
        progress.reached(done)
    })?;
    let drive = recording.column_of(column, &kind::VOLTAGE)?;
    for segment in recording.segments() {
        let volts = drive.of(segment);
        let mut on = volts.iter().enumerate().filter(|(_, volts)| volts.abs() > OFF_V);
        if let Some((first, volts)) = on.next() {
            let at_s = segment.time.at(first);
            let count = 1 + on.count();
            return Err(material.unfit(format!(
                "its drive `{column}` is not off: {volts} V at {at_s} s, and above {OFF_V} V at {count} of {samples} samples; a free \
                 decay begins when the drive has died away: cut the recording there",
                samples = segment.time.len()
            )));
        }
    }
    Ok(())
}

fn value_error(experiment: &Experiment, why: String) -> IdentifyError {
    experiment.error("device.threshold_scanner", ConfigFault::Value { why }).into()
}

/// A parameter known worse than this, relative to itself, is not put into the experiment.
const WORTH_SETTING: f64 = 0.1;

/// Whether a parameter is known well enough to be used.
fn is_known(decay: &DecayFit, index: usize) -> bool {
    let parameter = decay.fit.parameter(index);
    parameter.deviation < WORTH_SETTING * parameter.value.abs() && !decay.fit.at_bound[index]
}

/// Puts what is known well enough into the device table. An offset and a threshold near 0 are known as absolute values,
/// and are put there whenever they have a standard error.
fn apply(
    experiment: &Experiment,
    device: &mut ThresholdScanner,
    found: &DecayResult,
) -> Result<Entries, IdentifyError> {
    let decay = &found.decay;
    let of = |index: usize| decay.fit.parameter(index);
    let scaled = |found: DerivedNumber, by: f64| DerivedNumber {
        value: by * found.value,
        deviation: by * found.deviation,
    };
    let mut entries = Entries::default();
    if is_known(decay, unknown::NATURAL_RATE) {
        let place = (NATURAL_FREQUENCY, &mut device.resonator.natural_frequency);
        entries.set(experiment, place, scaled(of(unknown::NATURAL_RATE), 1.0 / TAU), "Hz")?;
    }
    if is_known(decay, unknown::DAMPING_RATIO) {
        let place = (DAMPING_RATIO, &mut device.resonator.damping_ratio);
        entries.set(experiment, place, scaled(of(unknown::DAMPING_RATIO), 100.0), "%")?;
    }
    if is_known(decay, unknown::GAIN) && is_known(decay, unknown::STEEPNESS) {
        let mut gain =
            Quantity::of(of(unknown::GAIN).value, "V s/rad").map_err(|why| value_error(experiment, why))?;
        entries.set(experiment, (GAIN, &mut gain), of(unknown::GAIN), "V s/rad")?;
        (device.comb.gain, device.comb.fingers) = (Some(gain), None);
        entries.set(experiment, (STEEPNESS, &mut device.comb.steepness), of(unknown::STEEPNESS), "1/rad")?;
        entries.set(
            experiment,
            (THRESHOLD, &mut device.comb.threshold_angle),
            of(unknown::THRESHOLD),
            "rad",
        )?;
        entries.set(experiment, (OFFSET, &mut device.readout.offset), of(unknown::OFFSET), "V")?;
    }
    let c = &decay.fit.covariance;
    let (names, places): (Vec<&str>, Vec<usize>) = FREE_DECAY.into_iter().unzip();
    entries.correlate_all(&names, &|i, j| c.get(places[i], places[j]));
    let place = ("readout.noise_variance", &mut device.readout.noise_variance);
    entries.set(experiment, place, exact(decay.deviations[0].powi(2)), "V^2")?;
    if let (Some(detector), Some(per_volt)) = (&mut device.position_detector, found.per_volt) {
        let place = ("position_detector.noise_variance", &mut detector.noise_variance);
        entries.set(experiment, place, exact((decay.deviations[1] / per_volt).powi(2)), "V^2")?;
    }
    Ok(entries)
}

/// Keys below the device's table.
const NATURAL_FREQUENCY: &str = "resonator.natural_frequency";
const DAMPING_RATIO: &str = "resonator.damping_ratio";
const GAIN: &str = "comb.gain";
const STEEPNESS: &str = "comb.steepness";
const THRESHOLD: &str = "comb.threshold_angle";
const OFFSET: &str = "readout.offset";

/// What a free decay tells of the device, by these keys, and its place in the fit.
const FREE_DECAY: [(&str, usize); 6] = [
    (NATURAL_FREQUENCY, unknown::NATURAL_RATE),
    (DAMPING_RATIO, unknown::DAMPING_RATIO),
    (GAIN, unknown::GAIN),
    (STEEPNESS, unknown::STEEPNESS),
    (THRESHOLD, unknown::THRESHOLD),
    (OFFSET, unknown::OFFSET),
];

//! The drive as the experiment file describes it.

use super::{Drive, SimulateError, Tone};
use crate::config::{ConfigFault, DriveSource, Experiment, Key, Quantity, RecordedDrive, Simulate};
use crate::recording::{RecordingSource, SampledRecording};
use crate::units::{Kind, kind};

/// The drive in SI units, and the file that it comes from, if it comes from one. Of a ring-down, the drive before it.
pub fn drive_of(
    experiment: &Experiment,
    simulate: &Simulate,
) -> Result<(Drive, Option<RecordingSource>), SimulateError> {
    let drive = match &simulate.drive {
        DriveSource::Constant(constant) => Drive::Constant { level: constant.voltage.si() },
        DriveSource::Sine(sine) => Drive::Sine {
            offset: sine.offset.si(),
            amplitude: sine.amplitude.si(),
            frequency_hz: sine.frequency.si(),
            phase_rad: sine.phase.as_ref().map_or(0.0, Quantity::si),
        },
        DriveSource::Square(square) => Drive::Square {
            low: square.low.si(),
            high: square.high.si(),
            frequency_hz: square.frequency.si(),
            duty: square.duty_cycle.si(),
        },
        DriveSource::Sweep(sweep) => Drive::Sweep {
            offset: sweep.offset.si(),
            amplitude: sweep.amplitude.si(),
            from_hz: sweep.from.si(),
            to_hz: sweep.to.si(),
            duration_s: simulate.duration.si(),
        },
        DriveSource::Tones(sum) => Drive::Tones {
            offset: sum.offset.si(),
            tones: (sum.tone.iter())
                .map(|tone| Tone {
                    amplitude: tone.amplitude.si(),
                    frequency_hz: tone.frequency.si(),
                    phase_rad: tone.phase.as_ref().map_or(0.0, Quantity::si),
                })
                .collect(),
        },
        DriveSource::RingDown(before) => Drive::Sine {
            offset: before.offset.si(),
            amplitude: before.amplitude.si(),
            frequency_hz: before.frequency.si(),
            phase_rad: 0.0,
        },
        DriveSource::Capture(_) => {
            let why =
                "this device is not caught by a sweep; use another drive, such as `[simulate.drive.sine]`";
            let key = Key::from("simulate").child("drive").child("capture");
            return Err(experiment.error(key, ConfigFault::Value { why: why.to_owned() }).into());
        }
        DriveSource::Acceleration(_) => {
            let why = "this device is not driven by an acceleration; use a voltage, such as `[simulate.drive.sine]`";
            let key = Key::from("simulate").child("drive").child("acceleration");
            return Err(experiment.error(key, ConfigFault::Value { why: why.to_owned() }).into());
        }
        DriveSource::Prescribed(_) => {
            let why = "this device is simulated by its drive, not by a motion; write one, such as `constant` or `sine`";
            return Err(experiment
                .error("simulate.drive.prescribed", ConfigFault::Value { why: why.to_owned() })
                .into());
        }
        DriveSource::Regulated(_) => {
            let why = "this device is not regulated; use another drive, such as `[simulate.drive.sine]`";
            return Err(experiment
                .error("simulate.drive.regulated", ConfigFault::Value { why: why.to_owned() })
                .into());
        }
        DriveSource::Inputs(_) => {
            let why = "this device has one drive, a voltage; write one, such as `[simulate.drive.sine]`, or write the device as \
                       equations (`kalmems expand`)";
            let key = Key::from("simulate.drive.inputs");
            return Err(experiment.error(key, ConfigFault::Value { why: why.to_owned() }).into());
        }
        DriveSource::Recorded(recorded) => {
            let key = Key::from("simulate").child("drive").child("recorded").child("file");
            let (drive, source) = read((experiment, key), simulate, recorded, &kind::VOLTAGE)?;
            return Ok((drive, Some(source)));
        }
    };
    Ok((drive, None))
}

/// The samples of a file, as a drive of this kind; `key` is that of the file.
pub(super) fn read(
    (experiment, key): (&Experiment, Key),
    simulate: &Simulate,
    recorded: &RecordedDrive,
    kind: &'static Kind,
) -> Result<(Drive, RecordingSource), SimulateError> {
    let recording =
        SampledRecording::read(&experiment.resolve(&recorded.file), &recorded.layout(kind.ending()))?;
    let column = recording.column_of(recorded.column.name(), kind)?;
    let refuse = |why: String| Err(experiment.error(key, ConfigFault::Value { why }).into());
    let Some(segment) = recording.segments().first() else {
        return refuse("the file holds no samples".to_owned());
    };
    let (time_s, volts) = (segment.time.to_vec(), column.of(segment).to_vec());
    if let Some(missing) = volts.iter().position(|v| !v.is_finite()) {
        return refuse(format!("the drive is missing at {} s", time_s[missing]));
    }
    let (first, last) =
        (time_s.first().copied().unwrap_or(f64::NAN), time_s.last().copied().unwrap_or(f64::NAN));
    let tiny = 1e-9 * simulate.duration.si();
    if !(first <= tiny && last >= simulate.duration.si() - tiny) {
        return refuse(format!(
            "the drive was recorded from {first} s to {last} s; expected from 0 s to the end at `{}`",
            simulate.duration.text()
        ));
    }
    Ok((Drive::Recorded { time_s, volts }, recording.source().clone()))
}

//! The recordings of a stage: one record per drive amplitude or frequency, each of steady motion.

use super::hardware::StageHardware;
use crate::config::{self, ConfigError, ConfigFault, Experiment, Key, RecordingRole};
use crate::equations::differs_in_frequency;
use crate::identify::{IdentifyError, Material};
use crate::progress::Progress;
use crate::recording::{FindingKind, Instant, ReadError, RecordingLayout, SampledRecording, unusable_signal};
use crate::signal::{Sine, fit_sine, fit_sine_at};
use crate::units::kind;

/// One record.
#[derive(Clone, Debug)]
pub struct StageRecord {
    /// The recording and the record's label, for messages.
    pub place: String,
    /// Its label.
    pub label: String,
    /// When, in s.
    pub time_s: Vec<f64>,
    /// The drive.
    pub drive: Sine,
    /// The signals of the electrodes that the recording has, in V.
    pub signals: Vec<Vec<f64>>,
    /// The angular rate in rad/s, as late and with the offset that the reference shows it; `None` where there is none.
    pub rate: Option<Sine>,
}

/// All records of one recording.
#[derive(Clone, Debug)]
pub struct StageRecords {
    /// The recording's name.
    pub name: String,
    /// Which electrodes its signals are of: places in the hardware.
    pub electrodes: Vec<usize>,
    /// In the order of the file.
    pub all: Vec<StageRecord>,
    /// How late the experiment says that the reference is, in s.
    pub delay_s: f64,
    /// What an identification tells of it.
    pub material: Material,
}

/// The meaning of the drive's column.
pub const DRIVE: &str = "drive";

/// The reference's channel.
pub const EDGE: &str = "edge_velocity";

/// The recordings of a role, as places in the experiment.
pub fn of_role(experiment: &Experiment, role: RecordingRole) -> Vec<usize> {
    (0..experiment.recordings.len()).filter(|i| experiment.recordings[*i].role == role).collect()
}

/// Columns of signals with the electrodes that they are of, as places in the hardware.
pub type SignalColumns<'a> = Vec<(usize, &'a str)>;

/// The columns of drive and signals of a recording, and the electrodes that the signals are of.
pub fn columns<'a>(
    experiment: &'a Experiment,
    hardware: &StageHardware,
    index: usize,
) -> Result<(&'a str, SignalColumns<'a>), ConfigError> {
    let channels = &experiment.recording(index)?.channels;
    let key = || Key::from("recording").index(index).child("channels");
    let meanings: Vec<String> =
        hardware.channels.iter().map(super::hardware::ElectrodeChannel::meaning).collect();
    for (name, _) in channels.iter() {
        if name != DRIVE && !meanings.iter().any(|meaning| meaning == name) {
            let known: Vec<&str> = [DRIVE].into_iter().chain(meanings.iter().map(String::as_str)).collect();
            return Err(experiment.error(key().child(name), ConfigFault::unknown_key(name, known)));
        }
    }
    let drive = channels.column(DRIVE).ok_or_else(|| {
        let remedy = "name the column of the drive, such as `drive = \"drive_V\"`".to_owned();
        experiment.error(key().child(DRIVE), ConfigFault::MissingKey { remedy })
    })?;
    let signals =
        meanings.iter().enumerate().filter_map(|(i, meaning)| Some((i, channels.column(meaning)?))).collect();
    Ok((drive, signals))
}

/// Reads a recording of driven motion.
pub fn read(
    experiment: &Experiment,
    hardware: &StageHardware,
    index: usize,
    progress: &dyn Progress,
) -> Result<StageRecords, IdentifyError> {
    let described = experiment.recording(index)?;
    let (drive, signals) = columns(experiment, hardware, index)?;
    let wanted: Vec<&str> = [drive].into_iter().chain(signals.iter().map(|(_, column)| *column)).collect();
    let recording = read_file(experiment, described, &described.layout(&wanted), progress)?;
    let reference = StageReference::read(experiment, hardware, (index, recording.origin()), progress)?;
    let name = described.name.as_ref().map_or_else(|| recording.source().file.clone(), ToString::to_string);
    let unfit = |place: &str, why: String| IdentifyError::Unfit { recording: place.to_owned(), why };
    let drive_column = recording.column_of(drive, &kind::VOLTAGE)?;
    let mut records = Vec::new();
    for segment in recording.segments() {
        let place = place(&name, &segment.label);
        if let Some(finding) = unusable_signal(recording.diagnosis(), &wanted, |label| label == segment.label)
        {
            let (column, count) = (finding.column.as_deref().unwrap_or_default(), finding.count);
            if finding.kind == FindingKind::Repeats {
                let found = &finding.detail;
                let why = format!(
                    "the column `{column}` {found}: name the column that is the channel, or check the wiring"
                );
                return Err(unfit(&place, why));
            }
            if finding.kind == FindingKind::DroppedBit {
                let why = format!(
                    "the column `{column}` {}: check the converter, its cable and the number format of the file",
                    finding.detail
                );
                return Err(unfit(&place, why));
            }
            let why = format!(
                "the column `{column}` is clipped in {count} samples; what it was there is not known, and its waveform is \
                 what gap and gain come from: lower the drive or the amplifier's gain, and record again"
            );
            return Err(unfit(&place, why));
        }
        let time_s = segment.time.to_vec();
        let interval_s = segment.time.interval_s().ok_or_else(|| {
            unfit(&place, "it holds one sample; expected at least three cycles of the drive".to_owned())
        })?;
        let volts = drive_column.of(segment);
        let sine = fit_sine(&time_s, volts, interval_s).filter(Sine::is_steady).ok_or_else(|| {
            unfit(
                &place,
                format!("the drive `{drive}` is not a steady sine; expected at least three cycles of one frequency"),
            )
        })?;
        let columns = signals.iter().map(|(_, column)| recording.column_of(column, &kind::VOLTAGE));
        let columns = columns.collect::<Result<Vec<_>, _>>()?;
        let rate = match &reference {
            Some(reference) => Some(reference.rate(&segment.label, sine.frequency_hz).ok_or_else(|| {
                unfit(
                    &place,
                    "its reference has no record of this label, or too few samples in it".to_owned(),
                )
            })?),
            None => None,
        };
        records.push(StageRecord {
            place,
            label: segment.label.clone(),
            time_s,

            drive: sine,
            signals: columns.iter().map(|column| column.of(segment).to_vec()).collect(),
            rate,
        });
    }
    let mut sources = vec![recording.source().clone()];
    sources.extend(reference.iter().map(|r| r.recording.source().clone()));
    sources.dedup();
    Ok(StageRecords {
        electrodes: signals.iter().map(|(electrode, _)| *electrode).collect(),
        all: records,
        delay_s: described.reference.as_ref().map_or(0.0, config::Reference::delay_s),
        material: Material {
            name: name.clone(),
            role: described.role,
            time_s: Vec::new(),
            interval_s: 0.0,
            signal: Vec::new(),
            angle: Vec::new(),
            sources,
            diagnosis: recording.diagnosis().to_vec(),
        },
        name,
    })
}

/// The reference of a recording.
struct StageReference {
    recording: SampledRecording,
    column: String,
    /// rad/s of one unit of the column.
    scale: f64,
}

impl StageReference {
    fn read(
        experiment: &Experiment,
        hardware: &StageHardware,
        (index, origin): (usize, Instant),
        progress: &dyn Progress,
    ) -> Result<Option<Self>, IdentifyError> {
        let described = experiment.recording(index)?;
        let Some(reference) = &described.reference else { return Ok(None) };
        let key = || Key::from("recording").index(index).child("reference").child("channels");
        let (column, scale, kind) = match (reference.channels.column(EDGE), &hardware.vibrometer) {
            (Some(column), Some(vibrometer)) => (column, vibrometer.rate_per_volt(), &kind::VOLTAGE),
            (Some(_), None) => {
                let remedy =
                    "write `[device.micro_stage.vibrometer]` with `gain` and `target_width`".to_owned();
                let key = Key::from("device").child("micro_stage").child("vibrometer");
                return Err(experiment.error(key, ConfigFault::MissingKey { remedy }).into());
            }
            (None, _) => {
                let column = reference.channels.column("rate").ok_or_else(|| {
                    let remedy = format!("name the vibrometer's column, such as `{EDGE} = \"ldv_V\"`");
                    experiment.error(key().child(EDGE), ConfigFault::MissingKey { remedy })
                })?;
                (column, 1.0, &kind::ANGULAR_RATE)
            }
        };
        let path = experiment.resolve(reference.file(described));
        let layout =
            RecordingLayout { origin: Some(origin), ..described.reference_layout(reference, &[column]) };
        let recording = SampledRecording::read_with(&path, &layout, &mut |done, _| progress.reached(done))?;
        recording.column_of(column, kind)?;
        Ok(Some(Self { column: column.to_owned(), scale, recording }))
    }

    /// The sine of this frequency in the record with this label, in rad/s.
    fn rate(&self, label: &str, frequency_hz: f64) -> Option<Sine> {
        let segment = self.recording.segments().iter().find(|segment| segment.label == label)?;
        let values = self.recording.column(&self.column).ok()?.of(segment);
        let sine = fit_sine_at(&segment.time.to_vec(), values, frequency_hz)?;
        Some(Sine {
            offset: sine.offset * self.scale,
            amplitude: sine.amplitude * self.scale.abs(),
            phase_rad: sine.phase_rad + if self.scale < 0.0 { std::f64::consts::PI } else { 0.0 },
            residual_rms: sine.residual_rms * self.scale.abs(),
            ..sine
        })
    }
}

/// Reads a file and says how far it has come.
pub fn read_file(
    experiment: &Experiment,
    described: &config::Recording,
    layout: &RecordingLayout,
    progress: &dyn Progress,
) -> Result<SampledRecording, ReadError> {
    let mut started = false;
    SampledRecording::read_with(&experiment.resolve(&described.file), layout, &mut |done, total| {
        if !started {
            progress.begin("reading", total);
            started = true;
        }
        progress.reached(done)
    })
}

/// A record for messages.
pub fn place(name: &str, label: &str) -> String {
    match label {
        "" => name.to_owned(),
        label => format!("{name}, record `{label}`"),
    }
}

/// Refuses records whose drives differ in frequency.
pub fn require_one_frequency<'a>(
    records: impl IntoIterator<Item = (&'a str, &'a Sine)>,
) -> Result<(), IdentifyError> {
    let mut first: Option<(&str, &Sine)> = None;
    for (place, drive) in records {
        if let Some(why) = differs_in_frequency(drive, *first.get_or_insert((place, drive))) {
            return Err(IdentifyError::Unfit { recording: place.to_owned(), why });
        }
    }
    Ok(())
}

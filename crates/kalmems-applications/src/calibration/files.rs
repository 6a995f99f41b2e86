//! Reading what a calibration file names.

use super::error::CalibrationError;
use super::tone::{AXES, AxisSignals};
use super::unit_record::{RecordOfUnit, UnitSamples};
use crate::calibration::file::{
    Condition, GyroscopeCalibration, InertialUnit, MotionReference, is_per_record,
};
use crate::config::{Channels, ConfigFault, Key};
use crate::estimate::EstimateError;
use crate::named_files::{NamedFileError, NamedFiles};
use crate::recording::{Finding, Instant, RecordingLayout, SampledRecording, Segment, moved_by};
use crate::recording::{Stretch, StretchSize};
use crate::units::{Kind, Unit, kind};
use kalmems_figures::Figure;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

/// What a column of a reference is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReferenceQuantity {
    /// Angular rates.
    Rate,
    /// Angles, whose rates are jω times them.
    Angle,
}

/// A gyroscope's record with its accelerometers.
pub struct UnitRecord {
    pub name: String,
    pub place: String,
    pub rates: AxisSignals,
    pub forces: AxisSignals,
}

/// A reference's record.
pub struct ReferenceRecord {
    pub place: String,
    pub signals: AxisSignals,
    pub shows: [ReferenceQuantity; 3],
    /// What of the device behind an estimated motion is uncertain, and by how much one standard deviation of it moves the motion.
    pub moved: Vec<(String, AxisSignals)>,
}

/// Reads files and remembers what they were.
pub struct InputFiles<'a> {
    pub file: &'a GyroscopeCalibration,
    pub named: NamedFiles<'a>,
    /// Where the times of each record of the gyroscope count from.
    pub origins: BTreeMap<String, Instant>,
    /// The still and the moving parts of each record, as they were found.
    pub parts: &'a mut Vec<Figure>,
}

impl InputFiles<'_> {
    /// The gyroscope's records of one condition.
    pub fn unit(&mut self, index: usize, condition: &Condition) -> Result<Vec<UnitRecord>, CalibrationError> {
        let key = || Key::from("condition").index(index);
        let unit = &self.file.gyroscope;
        let layout = condition.layout(unit);
        let per_record = is_per_record(&condition.file);
        let mut records = Vec::new();
        let names = condition.records.clone().unwrap_or_default();
        let passes = if per_record { names.clone() } else { vec![String::new()] };
        for name in &passes {
            let path = self.file.resolve(&condition.file, name);
            let recording = self.read(key().child("file"), &path, &layout)?;
            let labels: Vec<String> = recording.segments().iter().map(|s| s.label.clone()).collect();
            let wanted: Vec<String> = match (per_record, &condition.records) {
                (true, _) => labels.iter().take(1).cloned().collect(),
                (false, Some(names)) => names.clone(),
                (false, None) => labels.clone(),
            };
            for label in wanted {
                let Some(segment) = recording.segments().iter().find(|s| s.label == label) else {
                    let place = path.display().to_string();
                    return Err(CalibrationError::NoRecord { place, record: label, known: labels });
                };
                let all = [unit.channels.as_ref(), unit.accelerometers.as_ref()];
                require_usable(&recording, segment, &all.map(|channels| columns(channels)).concat())?;
                let time_s = segment.time.to_vec();
                let axes = |channels: Option<&Channels>, kind: &Kind| -> Result<_, CalibrationError> {
                    let mut axes = [None, None, None];
                    for (axis, slot) in AXES.iter().zip(&mut axes) {
                        if let Some(column) = channels.and_then(|channels| channels.column(axis)) {
                            *slot = Some(recording.column_of(column, kind)?.of(segment).to_vec());
                        }
                    }
                    Ok(AxisSignals { time_s: time_s.clone(), axes })
                };
                let name = if per_record { name.clone() } else { label };
                self.origins.insert(name.clone(), recording.origin());
                records.push(UnitRecord {
                    name,
                    place: path.display().to_string(),
                    rates: axes(unit.channels.as_ref(), &kind::ANGULAR_RATE)?,
                    forces: axes(unit.accelerometers.as_ref(), &kind::ACCELERATION)?,
                });
            }
        }
        Ok(records)
    }

    /// A reference's records, in the order of these names.
    pub fn reference(
        &mut self,
        key: &Key,
        reference: &MotionReference,
        names: &[&str],
    ) -> Result<Vec<ReferenceRecord>, CalibrationError> {
        let layout = reference.layout();
        let per_record = is_per_record(&reference.file);
        let mut records = Vec::new();
        let mut whole: Option<SampledRecording> = None;
        for name in names {
            let layout = RecordingLayout { origin: self.origins.get(*name).copied(), ..layout.clone() };
            let path = self.file.resolve(&reference.file, name);
            let contributions = contribution_columns(&path, reference);
            let of_each =
                |(_, own): &(String, [Option<String>; 3])| own.iter().flatten().cloned().collect::<Vec<_>>();
            let layout = RecordingLayout {
                columns: layout
                    .columns
                    .map(|own| own.into_iter().chain(contributions.iter().flat_map(of_each)).collect()),
                ..layout
            };
            let there = whole.as_ref().map(SampledRecording::origin);
            if per_record || there.is_none() || layout.origin.is_some_and(|origin| there != Some(origin)) {
                whole = Some(self.read(key.clone().child("file"), &path, &layout)?);
            }
            let Some(recording) = &whole else { continue };
            let mut segments = recording.segments().iter();
            let alone = per_record || (names.len() == 1 && reference.segments.is_none());
            let found = if alone { segments.next() } else { segments.find(|s| s.label == *name) };
            let Some(segment) = found else {
                return Err(CalibrationError::NoRecord {
                    place: path.display().to_string(),
                    record: (*name).to_owned(),
                    known: recording.segments().iter().map(|s| s.label.clone()).collect(),
                });
            };
            require_usable(recording, segment, &columns(Some(&reference.channels)))?;
            let mut axes = [None, None, None];
            let mut shows = [ReferenceQuantity::Rate; 3];
            for ((axis, slot), shows) in AXES.iter().zip(&mut axes).zip(&mut shows) {
                let Some(column) = reference.channels.column(axis) else { continue };
                let values = recording.column(column)?;
                let unit = values.header.unit.unwrap_or(Unit::ONE).dimension();
                let factor = if let Some(vibrometer) = &reference.vibrometer {
                    recording.column_of(column, &kind::VOLTAGE)?;
                    2.0 / (vibrometer.gain.si() * vibrometer.target_width.si())
                } else {
                    if kind::ANGLE.accepts(unit) {
                        *shows = ReferenceQuantity::Angle;
                    } else {
                        recording.column_of(column, &kind::ANGULAR_RATE)?;
                    }
                    1.0
                };
                *slot = Some(values.of(segment).iter().map(|v| v * factor).collect());
            }
            let time_s = segment.time.to_vec();
            let mut moved = Vec::with_capacity(contributions.len());
            for (by, columns) in &contributions {
                let mut axes = [None, None, None];
                for (column, slot) in columns.iter().zip(&mut axes) {
                    if let Some(column) = column {
                        *slot = Some(recording.column(column)?.of(segment).to_vec());
                    }
                }
                moved.push((by.clone(), AxisSignals { time_s: time_s.clone(), axes }));
            }
            records.push(ReferenceRecord {
                moved,
                place: path.display().to_string(),
                signals: AxisSignals { time_s, axes },
                shows,
            });
        }
        Ok(records)
    }

    /// Reads a file and remembers it.
    pub fn read(
        &mut self,
        key: Key,
        path: &Path,
        layout: &RecordingLayout,
    ) -> Result<SampledRecording, CalibrationError> {
        self.named.read(path, layout).map_err(|error| self.not_read(key, error))
    }

    /// Reads a file of any length in parts and remembers it; with what was found in it.
    pub fn read_in_parts(
        &mut self,
        key: Key,
        path: &Path,
        layout: &RecordingLayout,
        size: StretchSize,
        take: impl FnMut(&Stretch),
    ) -> Result<Vec<Finding>, CalibrationError> {
        let found = self.named.read_in_parts(path, layout, size, take);
        found.map_err(|error| self.not_read(key, error))
    }

    fn not_read(&self, key: Key, error: NamedFileError) -> CalibrationError {
        match error {
            NamedFileError::Missing(why) => self.file.error(key, ConfigFault::Value { why }).into(),
            NamedFileError::Read(error) => error.into(),
        }
    }
}

impl<'f> InputFiles<'f> {
    /// Measures each record of a table of the calibration file.
    pub fn each<R, T>(
        &mut self,
        table: &str,
        records: &'f [R],
        of_unit: impl Fn(&'f R, &'f InertialUnit) -> RecordOfUnit<'f>,
        measure: impl Fn(&R, &UnitSamples, &mut Vec<Figure>) -> Result<T, CalibrationError>,
    ) -> Result<Vec<T>, CalibrationError> {
        let unit = &self.file.gyroscope;
        let each = records.iter().enumerate().map(|(index, record)| {
            let samples = of_unit(record, unit).read(self, Key::from(table).index(index).child("file"))?;
            measure(record, &samples, self.parts)
        });
        each.collect()
    }
}

/// The columns of some channels.
pub(super) fn columns(channels: Option<&Channels>) -> Vec<&str> {
    AXES.iter().filter_map(|axis| channels?.column(axis)).collect()
}

/// Refuses a segment in which one of these columns is clipped, or is another channel, as an estimate does.
pub(super) fn require_usable(
    recording: &SampledRecording,
    segment: &Segment,
    columns: &[&str],
) -> Result<(), CalibrationError> {
    require_usable_record(recording.diagnosis(), &recording.source().file, &segment.label, columns)
}

/// The same of a record that was read in parts, by what was found in its file.
pub(super) fn require_usable_record(
    diagnosis: &[Finding],
    file: &str,
    record: &str,
    columns: &[&str],
) -> Result<(), CalibrationError> {
    let place = match record {
        "" => file.to_owned(),
        label => format!("{file}, record `{label}`"),
    };
    EstimateError::of_unusable_signal(diagnosis, (&place, columns), |label| label == record)?;
    Ok(())
}

/// Refuses rates at or beyond the full scale, if that is stated.
pub(super) fn require_within(
    unit: &InertialUnit,
    values: &[f64],
    (place, column): (&str, &str),
) -> Result<(), CalibrationError> {
    let limit = unit.full_scale.as_ref().map_or(f64::INFINITY, |full| full.si() * (1.0 - 1e-9));
    let count = values.iter().filter(|value| value.abs() >= limit).count();
    if count == 0 {
        return Ok(());
    }
    Err(EstimateError::Clipped { place: place.to_owned(), column: column.to_owned(), count }.into())
}

/// The bytes of a file among which its names of columns are looked for.
const HEAD: u64 = 1 << 20;

/// The columns of an estimated motion's file that say by how much the device's uncertain numbers move it: what is uncertain, and its
/// column for each axis. None of a file that has no such columns.
fn contribution_columns(path: &Path, reference: &MotionReference) -> Vec<(String, [Option<String>; 3])> {
    // What cannot be read is told when the columns are that the reference names.
    let Ok(file) = File::open(path) else { return Vec::new() };
    let mut lines = BufReader::new(file.take(HEAD)).lines().map_while(Result::ok);
    let Some(names) = lines.find(|line| !line.starts_with('#')) else { return Vec::new() };
    let mut found: Vec<(String, [Option<String>; 3])> = Vec::new();
    for (place, axis) in AXES.iter().enumerate() {
        let Some(column) = reference.channels.column(axis) else { continue };
        for name in names.split(',') {
            let Some(by) = moved_by(column, name) else { continue };
            let known = found.iter().position(|(own, _)| own == by).unwrap_or_else(|| {
                found.push((by.to_owned(), [None, None, None]));
                found.len() - 1
            });
            found[known].1[place] = Some(name.to_owned());
        }
    }
    found
}

//! The files that a spectrum is computed from.

use super::measure::SpectrumError;
use super::scans::DetectorSignal;
use super::track::PositionTrack;
use crate::config::{ConfigFault, Key};
use crate::named_files::{NamedFileError, NamedFiles};
use crate::recording::{Instant, RecordingLayout, SampledRecording, TimeSource};
use crate::spectrum::file::{PathTrajectory, ReferenceSpectrum, SpectrumFile};
use crate::units::kind;
use std::path::Path;

/// What is read, and what was found in it.
pub(super) struct SpectrumInput<'a> {
    pub(super) file: &'a SpectrumFile,
    pub(super) files: NamedFiles<'a>,
    /// Where the times of all files count from: the first says it.
    pub(super) origin: Option<Instant>,
}

impl SpectrumInput<'_> {
    /// The columns of the interferograms, each with the times of its samples.
    pub(super) fn detectors(&mut self) -> Result<Vec<DetectorSignal>, SpectrumError> {
        let Some(interferogram) = &self.file.interferogram else { return Ok(Vec::new()) };
        let recording = self.read("interferogram", &interferogram.file, &interferogram.layout())?;
        let time_s = times(&recording);
        let columns = interferogram.columns.iter().map(|column| {
            let value = recording.column(column.name())?.values.clone();
            Ok(DetectorSignal { time_s: time_s.clone(), value })
        });
        columns.collect()
    }

    /// A trajectory's positions.
    pub(super) fn track(&mut self, key: &str, of: &PathTrajectory) -> Result<PositionTrack, SpectrumError> {
        let recording = self.read(key, &of.file, &of.layout())?;
        let position = recording.column_of(of.column.name(), &kind::LENGTH)?.values.clone();
        PositionTrack::new(times(&recording), position).map_err(|fault| SpectrumError::Track {
            place: format!("{}, column `{}`", self.file.resolve(&of.file).display(), of.column),
            fault,
        })
    }

    /// The wavenumbers and values of a spectrum.
    pub(super) fn spectrum(&mut self, of: &ReferenceSpectrum) -> Result<[Vec<f64>; 2], SpectrumError> {
        let recording = self.read("reference.spectrum", &of.file, &of.layout())?;
        let wavenumber = recording.column_of(of.wavenumber.name(), &kind::WAVENUMBER)?.values.clone();
        Ok([wavenumber, recording.column(of.column.name())?.values.clone()])
    }

    fn read(
        &mut self,
        key: &str,
        file: &Path,
        layout: &RecordingLayout,
    ) -> Result<SampledRecording, SpectrumError> {
        let layout = RecordingLayout { origin: self.origin, ..layout.clone() };
        let read = self.files.read(&self.file.resolve(file), &layout);
        let recording = read.map_err(|error| match error {
            NamedFileError::Missing(why) => {
                self.file.error(Key::from(key).child("file"), ConfigFault::Value { why }).into()
            }
            NamedFileError::Read(error) => SpectrumError::from(error),
        })?;
        if matches!(layout.clock, TimeSource::Column(_)) {
            self.origin = Some(recording.origin());
        }
        Ok(recording)
    }
}

fn times(recording: &SampledRecording) -> Vec<f64> {
    recording.segments().first().map(|segment| segment.time.to_vec()).unwrap_or_default()
}

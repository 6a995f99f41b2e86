//! The files that a spectrum is computed from.

use super::measure::SpectrumError;
use super::scans::Detector;
use super::track::PositionTrack;
use crate::config::{Fault, Key, PathTrajectory, ReferenceSpectrum, SpectrumFile};
use crate::estimate::Progress;
use crate::recording::{Clock, Finding, Instant, Layout, Recording, Source};
use crate::units::{Header, kind};
use kalmems_formats::Hints;
use std::path::Path;

/// What is read, and what was found in it.
pub(super) struct Input<'a> {
    pub(super) file: &'a SpectrumFile,
    pub(super) progress: &'a dyn Progress,
    /// Where the times of all files count from: the first says it.
    pub(super) origin: Option<Instant>,
    pub(super) sources: Vec<Source>,
    pub(super) findings: Vec<(String, Finding)>,
}

impl Input<'_> {
    /// The columns of the interferograms, each with the times of its samples.
    pub(super) fn detectors(&mut self) -> Result<Vec<Detector>, SpectrumError> {
        let Some(interferogram) = &self.file.interferogram else { return Ok(Vec::new()) };
        let recording = self.read("interferogram", &interferogram.file, interferogram.layout())?;
        let time_s = times(&recording);
        let columns = interferogram.columns.iter().map(|column| {
            let value = recording.column(column)?.values.clone();
            Ok(Detector { time_s: time_s.clone(), value })
        });
        columns.collect()
    }

    /// A trajectory's positions.
    pub(super) fn track(&mut self, key: &str, of: &PathTrajectory) -> Result<PositionTrack, SpectrumError> {
        let recording = self.read(key, &of.file, of.layout())?;
        let position = recording.column_of(&of.column, &kind::LENGTH)?.values.clone();
        PositionTrack::new(times(&recording), position).map_err(|fault| SpectrumError::Track {
            place: format!("{}, column `{}`", self.file.resolve(&of.file).display(), of.column),
            fault,
        })
    }

    /// The wavenumbers and values of a spectrum.
    pub(super) fn spectrum(&mut self, of: &ReferenceSpectrum) -> Result<[Vec<f64>; 2], SpectrumError> {
        let layout = Layout {
            clock: Clock::Rate { rate_hz: 1.0, start_s: 0.0 },
            segment_column: None,
            columns: Some(vec![of.wavenumber.clone(), of.column.clone()]),
            hints: Hints::default(),
            origin: None,
            restarts: None,
        };
        let recording = self.read("reference.spectrum", &of.file, layout)?;
        // A name's ending that is an inverse unit alone is no unit of a recording.
        let per_m = match of.wavenumber.rsplit_once("_per_").map(|(_, unit)| unit) {
            Some("m") => 1.0,
            Some("cm") => 100.0,
            _ => {
                let why = format!("`{}` does not end with `_per_m` or `_per_cm`", of.wavenumber);
                let key = Key::from("reference.spectrum").child("wavenumber");
                return Err(self.file.error(key, Fault::Value { why }).into());
            }
        };
        let wavenumber = recording.column(&of.wavenumber)?.values.iter().map(|nu| per_m * nu).collect();
        Ok([wavenumber, recording.column(&of.column)?.values.clone()])
    }

    fn read(&mut self, key: &str, file: &Path, mut layout: Layout) -> Result<Recording, SpectrumError> {
        let path = self.file.resolve(file);
        if !path.is_file() {
            let why = format!(
                "there is no file `{}`; give its path from the folder of the spectrum file, or put it there",
                path.display()
            );
            return Err(self.file.error(Key::from(key).child("file"), Fault::Value { why }).into());
        }
        // An instrument's own unit, such as `_au`, is no unit here: such columns are read with all others, as numbers.
        let wanted = layout.columns.clone().unwrap_or_default();
        if wanted.iter().any(|column| Header::parse(column).unit.is_none()) {
            layout.columns = None;
        }
        layout.origin = self.origin;
        let mut started = false;
        let recording = Recording::read_with(&path, &layout, &mut |done, total| {
            if !started {
                self.progress.begin("reading", total);
                started = true;
            }
            self.progress.reached(done)
        })?;
        if matches!(layout.clock, Clock::Column(_)) {
            self.origin = Some(recording.origin());
        }
        let source = recording.source().clone();
        self.findings.extend(recording.diagnosis().iter().map(|f| (source.file.clone(), f.clone())));
        if !self.sources.contains(&source) {
            self.sources.push(source);
        }
        Ok(recording)
    }
}

fn times(recording: &Recording) -> Vec<f64> {
    recording.segments().first().map(|segment| segment.time.to_vec()).unwrap_or_default()
}

//! Reading the files that a calibration, an image or a spectrum names.

use crate::earlier_command::earlier_command;
use crate::progress::Progress;
use crate::recording::{Finding, Purpose, ReadError, RecordingLayout, RecordingSource, SampledRecording};
use std::path::Path;

/// Reads files and remembers what they were and what was found in them.
pub(super) struct NamedFiles<'a> {
    /// What the settings are called, in a message: `image file`.
    settings: &'static str,
    purpose: Purpose,
    pub(super) progress: &'a dyn Progress,
    pub(super) sources: Vec<RecordingSource>,
    /// The name of a file, and what was found in it; each once.
    pub(super) findings: Vec<(String, Finding)>,
}

/// Why a file was not read.
pub(super) enum NamedFileError {
    /// It is not there; in words.
    Missing(String),
    /// It cannot be read.
    Read(ReadError),
}

impl<'a> NamedFiles<'a> {
    pub(super) const fn new(settings: &'static str, purpose: Purpose, progress: &'a dyn Progress) -> Self {
        Self { settings, purpose, progress, sources: Vec::new(), findings: Vec::new() }
    }

    /// Reads a file.
    pub(super) fn read(
        &mut self,
        path: &Path,
        layout: &RecordingLayout,
    ) -> Result<SampledRecording, NamedFileError> {
        if !path.exists() {
            let remedy = earlier_command(path).unwrap_or_else(|| {
                format!("give its path from the folder of the {}, or put it there", self.settings)
            });
            let why = format!("there is no file `{}`; {remedy}", path.display());
            return Err(NamedFileError::Missing(why));
        }
        let mut started = false;
        let progress = self.progress;
        let read = SampledRecording::read_with(path, layout, &mut |done, total| {
            if !started {
                progress.begin("reading", total);
                started = true;
            }
            progress.reached(done)
        });
        let recording = read.map_err(|error| NamedFileError::Read(error.read_for(self.purpose)))?;
        let source = recording.source().clone();
        for finding in recording.diagnosis() {
            let found = (source.file.clone(), finding.clone().read_for(self.purpose));
            if !self.findings.contains(&found) {
                self.findings.push(found);
            }
        }
        if !self.sources.contains(&source) {
            self.sources.push(source);
        }
        Ok(recording)
    }
}

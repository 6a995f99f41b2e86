//! Reading the files that a calibration, an image or a spectrum names.

use crate::earlier_command::earlier_command;
use crate::progress::Progress;
use crate::recording::{Finding, Purpose, ReadError, RecordingLayout, RecordingSource, SampledRecording};
use crate::recording::{Stretch, StretchSize, Stretches};
use std::ops::ControlFlow;
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
        self.require(path)?;
        let read = SampledRecording::read_with(path, layout, &mut reading(self.progress));
        let recording = read.map_err(|error| NamedFileError::Read(error.read_for(self.purpose)))?;
        self.remember(recording.source().clone(), recording.diagnosis());
        Ok(recording)
    }

    /// Reads a file of any length in parts, each of which is taken before the next is read; what was found in it comes last.
    pub(super) fn read_in_parts(
        &mut self,
        path: &Path,
        layout: &RecordingLayout,
        size: StretchSize,
        mut take: impl FnMut(&Stretch),
    ) -> Result<Vec<Finding>, NamedFileError> {
        self.require(path)?;
        let purpose = self.purpose;
        let failed = |error: ReadError| NamedFileError::Read(error.read_for(purpose));
        let mut stretches = Stretches::open(path, layout, size).map_err(failed)?;
        let mut progress = reading(self.progress);
        while let Some(stretch) = stretches.next(&mut progress).map_err(failed)? {
            take(&stretch);
            stretches.reuse(stretch);
        }
        let (source, diagnosis) = stretches.finish();
        self.remember(source, &diagnosis);
        Ok(diagnosis)
    }

    fn require(&self, path: &Path) -> Result<(), NamedFileError> {
        if path.exists() {
            return Ok(());
        }
        let remedy = earlier_command(path).unwrap_or_else(|| {
            format!("give its path from the folder of the {}, or put it there", self.settings)
        });
        Err(NamedFileError::Missing(format!("there is no file `{}`; {remedy}", path.display())))
    }

    fn remember(&mut self, source: RecordingSource, diagnosis: &[Finding]) {
        for finding in diagnosis {
            let found = (source.file.clone(), finding.clone().read_for(self.purpose));
            if !self.findings.contains(&found) {
                self.findings.push(found);
            }
        }
        if !self.sources.contains(&source) {
            self.sources.push(source);
        }
    }
}

/// Tells how far the reading has come.
fn reading(progress: &dyn Progress) -> impl FnMut(u64, u64) -> ControlFlow<()> {
    let mut started = false;
    move |done, total| {
        if !started {
            progress.begin("reading", total);
            started = true;
        }
        progress.reached(done)
    }
}

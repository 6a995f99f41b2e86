//! Reads a file from its first byte to its last.

use super::blocks::Blocks;
use super::findings::Findings;
use super::pass::Pass;
use super::plan::ReadingPlan;
use super::request::ReadRequest;
use super::{ReadError, RecordingSource, SampledRecording, TimeSource};
use kalmems_formats::{Digest, Table, TableEvidence};
use std::io;
use std::ops::ControlFlow;
use std::path::Path;

/// How many rows are read between two reports of progress.
const ROWS_PER_REPORT: usize = 1 << 16;

/// Called with the bytes read and the bytes in all.
pub(crate) type ReadProgress<'a> = &'a mut dyn FnMut(u64, u64) -> ControlFlow<()>;

/// A file that is being read: its blocks, and the pass that takes them.
pub(super) struct RecordingReader {
    pub(super) pass: Pass,
    blocks: Blocks,
    source: RecordingSource,
}

impl RecordingReader {
    /// Opens a file and begins to read it. `head`: rows of a segment over which its usual interval is found.
    pub(super) fn open(path: &Path, request: &ReadRequest, head: usize) -> Result<Self, ReadError> {
        let file = || path.display().to_string();
        if let TimeSource::Rate { rate_hz, start_s } = *request.clock
            && !(rate_hz > 0.0 && rate_hz.is_finite() && start_s.is_finite())
        {
            return Err(ReadError::Clock { file: file(), rate_hz, start_s });
        }
        let table = kalmems_formats::open(path, request.hints)
            .map_err(|source| ReadError::of_format(path, source))?;
        Self::of(table, path, request, head)
    }

    /// Begins to read a table; `path` is what messages call it.
    pub(super) fn of(
        table: Box<dyn Table>,
        path: &Path,
        request: &ReadRequest,
        head: usize,
    ) -> Result<Self, ReadError> {
        let file = || path.display().to_string();
        let description = table.description();
        let format = format!("{}: {}", description.format, description.recognised);
        let line = usize::try_from(table.header_line()).unwrap_or(usize::MAX);
        let in_arrays = description.evidence == TableEvidence::Arrays;
        let mut findings = if in_arrays { Findings::of_arrays() } else { Findings::default() };
        let kind = |column: usize| table.time_kind(column);
        let plan = ReadingPlan::of(description, &kind, line, request, &mut findings)
            .map_err(|findings| ReadError::Unusable { file: file(), findings })?;
        let blocks = Blocks::start(table, path, &plan.wanted())?;
        let name =
            path.file_name().map_or_else(|| path.display().to_string(), |n| n.to_string_lossy().into_owned());
        Ok(Self {
            pass: Pass::new(plan, findings, request, head),
            blocks,
            source: RecordingSource { file: name, sha256: String::new(), bytes: 0, format, origin: None },
        })
    }

    /// The memory does not suffice.
    fn too_large(&self) -> ReadError {
        let why = format!(
            "the memory does not suffice for more than {} of its rows; use a part of the file, or allow this program more memory",
            self.pass.rows()
        );
        ReadError::Io {
            file: self.source.file.clone(),
            source: io::Error::new(io::ErrorKind::OutOfMemory, why),
        }
    }

    /// Takes one block; `false` after the last, when the pass is at its end.
    pub(super) fn step(&mut self, progress: ReadProgress) -> Result<bool, ReadError> {
        let before = self.pass.rows();
        if let Some(block) = self.blocks.next(progress)? {
            self.pass.reserve(block.rows).map_err(|_| self.too_large())?;
            self.pass.take(&block);
            self.source.origin = self.pass.origin();
            self.blocks.reuse(block);
            if before / ROWS_PER_REPORT < self.pass.rows() / ROWS_PER_REPORT {
                self.blocks.report(progress)?;
            }
            return Ok(true);
        }
        self.blocks.report(progress)?;
        if let Some(Digest { sha256, bytes }) = self.blocks.digest() {
            self.source.sha256.clone_from(sha256);
            self.source.bytes = *bytes;
        }
        Ok(false)
    }

    /// The file; its digest and its length are there when it is read.
    pub(super) const fn source(&self) -> &RecordingSource {
        &self.source
    }
}

/// Reads the whole file; the recording is there even where a finding is fatal, for it to be looked at.
pub(crate) fn read(
    path: &Path,
    request: &ReadRequest,
    progress: ReadProgress,
) -> Result<SampledRecording, ReadError> {
    let mut reading = RecordingReader::open(path, request, usize::MAX)?;
    while reading.step(progress)? {}
    Ok(reading.pass.finish(reading.source))
}

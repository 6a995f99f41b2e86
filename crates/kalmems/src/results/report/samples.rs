//! The file beside a report that has each sample of the series that it shows.

use super::long_estimate::PICTURED;
use super::names::prefix;
use crate::results::ResultWriteError;
use crate::results::tracks::{PartPlace, SampleSink, each_track};
use crate::workflow::{Outcome, RecordingOutcome, SegmentOutcome};
use kalmems_figures::{SampledQuantity, SamplesLink, SamplesWriter};
use kalmems_store::{Output, ResultFile};
use std::io;

/// Its name.
const NAME: &str = "report_samples.bin";

/// The file on its way.
pub(super) struct SamplesFile<'a> {
    output: &'a Output,
    writer: SamplesWriter<ResultFile>,
}

impl<'a> SamplesFile<'a> {
    /// Begins the file in a result.
    pub(super) fn begin(output: &'a Output) -> Result<Self, ResultWriteError> {
        let file = output.create(NAME)?;
        let writer = SamplesWriter::new(file).map_err(|e| output.error(NAME, e))?;
        Ok(Self { output, writer })
    }

    /// Takes the next part of a segment; `prefix` tells its tracks from those of other segments.
    pub(super) fn take_part(
        &mut self,
        recording: &RecordingOutcome,
        segment: &SegmentOutcome,
        (part, prefix): (PartPlace, &str),
    ) -> Result<(), ResultWriteError> {
        let mut sink = FileSink { writer: &mut self.writer, prefix, done: Ok(()) };
        each_track(recording, segment, part, &mut sink);
        Ok(sink.done.map_err(|e| self.output.error(NAME, e))?)
    }

    /// Completes the file; what the page needs to know of it.
    pub(super) fn finish(self) -> Result<SamplesLink, ResultWriteError> {
        let (file, link) = self.writer.finish(NAME).map_err(|e| self.output.error(NAME, e))?;
        self.output.seal(file)?;
        Ok(link)
    }

    /// All samples of an outcome that is in memory, as far as its segments have pictures.
    pub(super) fn write(output: &Output, outcome: &Outcome) -> Result<SamplesLink, ResultWriteError> {
        let mut file = SamplesFile::begin(output)?;
        for recording in &outcome.recordings {
            let drawn = recording.segments.iter();
            for segment in drawn.filter(|segment| segment.estimate.segment.stretch.number <= PICTURED) {
                let prefix = prefix(outcome, recording, &segment.estimate.segment);
                file.take_part(recording, segment, (PartPlace::WHOLE, &prefix))?;
            }
        }
        file.finish()
    }
}

/// Writes the tracks of a segment, until that fails.
struct FileSink<'a> {
    writer: &'a mut SamplesWriter<ResultFile>,
    prefix: &'a str,
    done: io::Result<()>,
}

impl SampleSink for FileSink<'_> {
    fn take(&mut self, key: &str, quantity: SampledQuantity, samples: impl Iterator<Item = (f64, [f64; 2])>) {
        if self.done.is_ok() {
            self.done = self.writer.take(&format!("{}{key}", self.prefix), quantity, samples);
        }
    }
}

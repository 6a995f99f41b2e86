//! The reference of a recording that is read in parts.

use super::reference::ReferenceColumns;
use super::{ReferenceChannels, ReferenceError, ReferenceRecording};
use crate::config::Experiment;
use crate::recording::{
    Finding, Instant, ReadError, RecordingLayout, RecordingSource, SampledRecording, Segment, StretchSize,
    Stretches,
};
use std::ops::ControlFlow;
use std::path::Path;

/// Rows that are read at a time.
const ROWS: usize = 1 << 15;

/// A reference of any length, of which the rows around a part of the recording are held.
///
/// Its segments come in the order of the recording's; one that comes in another order is not found.
pub struct ReferenceParts {
    stretches: Stretches,
    columns: ReferenceColumns,
    /// The rows that are held, of one segment, and whether that has ended.
    held: Option<(SampledRecording, bool)>,
}

impl ReferenceParts {
    /// Opens the reference of a recording, if the experiment names one; see [`ReferenceRecording::read`].
    pub fn open(
        experiment: &Experiment,
        (index, origin): (usize, Instant),
        known: &ReferenceChannels,
    ) -> Result<Option<Self>, ReferenceError> {
        let Some((layout, columns)) = ReferenceColumns::of(experiment, index, known)? else {
            return Ok(None);
        };
        let layout = RecordingLayout { origin: Some(origin), ..layout };
        let described = experiment.recording(index)?;
        let file = described.reference.as_ref().map_or(Path::new(""), |reference| reference.file(described));
        let rows = StretchSize { rows: ROWS, first: ROWS, before: 0, after: 0 };
        let stretches = Stretches::open(&experiment.resolve(file), &layout, rows)?;
        Ok(Some(Self { stretches, columns, held: None }))
    }

    /// The rows of the segment that goes with one of the recording between two times of the motion in s, and some after. What came before is
    /// let go of.
    pub fn over(
        &mut self,
        of: &Segment,
        from_s: f64,
        to_s: f64,
        progress: &mut dyn FnMut(u64, u64) -> ControlFlow<()>,
    ) -> Result<Option<ReferenceRecording>, ReadError> {
        let delay_s = self.columns.delay_s;
        loop {
            if let Some((held, ended)) = &mut self.held
                && let Some(segment) = held.segments().first()
                && self.columns.go_together(of, segment)
            {
                let last_s = segment.time.at(segment.time.len().saturating_sub(1));
                if *ended || last_s - delay_s > to_s {
                    held.forget_before(from_s + delay_s);
                    return Ok(Some(ReferenceRecording::new(held.clone(), self.columns.clone())));
                }
            }
            let Some(stretch) = self.stretches.next(progress)? else { return Ok(None) };
            let ends = stretch.ends;
            match &mut self.held {
                Some((held, ended)) if !stretch.begins => {
                    // Of a segment that is not asked for nothing is held but its label.
                    if held.segments().first().is_some_and(|segment| !self.columns.go_together(of, segment)) {
                        held.forget_before(f64::INFINITY);
                    }
                    held.extend(&stretch.recording);
                    *ended = ends;
                    self.stretches.reuse(stretch);
                }
                _ => self.held = Some((stretch.recording, ends)),
            }
        }
    }

    /// The file, and what was found in it as far as it was read.
    pub fn finish(self) -> (RecordingSource, Vec<Finding>) {
        self.stretches.finish()
    }
}

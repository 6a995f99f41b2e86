//! Parts of a segment.

use crate::recording::{SampledRecording, Segment};
use std::ops::Range;

/// Rows of a segment that are new, and some of those around them.
///
/// An estimator takes a segment part by part, in order, and goes on where it was. What it says of a row does not depend on
/// where the parts end.
#[derive(Clone, Debug)]
pub struct SegmentPart<'a> {
    /// The columns.
    pub recording: &'a SampledRecording,
    /// The rows that are there, new or not.
    pub segment: &'a Segment,
    /// Which of them are new.
    pub fresh: Range<usize>,
    /// Whether the segment begins with the first of them.
    pub begins: bool,
    /// Whether it ends with the last of them.
    pub ends: bool,
}

impl<'a> SegmentPart<'a> {
    /// All of a segment.
    pub fn whole(recording: &'a SampledRecording, segment: &'a Segment) -> Self {
        Self { recording, segment, fresh: 0..segment.time.len(), begins: true, ends: true }
    }
}

/// What an estimator needs around the rows that are new, and of a segment's beginning, in rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RowsAround {
    /// The first part has at least so many rows, or all that there are.
    pub head: usize,
    /// Rows before.
    pub before: usize,
    /// Rows after, but for the last part.
    pub after: usize,
    /// Whether all new rows of the part before are needed again, to be smoothed.
    pub smooths: bool,
}

impl RowsAround {
    /// The rows of a first part at most, however long a segment's beginning is.
    pub const LONGEST_HEAD: usize = 1 << 18;
}

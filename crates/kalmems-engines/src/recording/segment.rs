//! Segments of a recording and their time.

use super::StretchPlace;
use serde::Serialize;
use std::ops::Range;

/// A run of rows that belong to one record, or to one stretch of a record; the time may start again with each.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Segment {
    /// Its label as it first stands in the segment column; empty where there is no such column.
    pub label: String,
    /// Its rows, counted from 0 over the whole recording.
    pub rows: Range<usize>,
    /// The times of its rows.
    pub time: TimeBase,
    /// Which stretch of its record it is.
    pub stretch: StretchPlace,
}

impl Segment {
    /// Some of its rows, counted from its first.
    #[must_use]
    pub fn part(&self, rows: &Range<usize>) -> Self {
        let time = TimeBase { times: self.time.times.part(rows), ..self.time };
        let start = self.rows.start;
        let rows = start + rows.start..start + rows.end;
        Self { label: self.label.clone(), rows, time, stretch: self.stretch }
    }
}

/// The times of a segment.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TimeBase {
    #[serde(skip)]
    pub(super) times: SegmentTimes,
    pub(super) interval_s: Option<f64>,
    pub(super) uniform: bool,
}

#[derive(Clone, Debug, PartialEq)]
pub(super) enum SegmentTimes {
    /// As the file has them.
    Column(Vec<f64>),
    /// From a clock that the file does not hold.
    Rate {
        rate_hz: f64,
        start_s: f64,
        /// The row of the segment that is the first here.
        first: usize,
        len: usize,
    },
}

impl SegmentTimes {
    /// Those of some rows.
    fn part(&self, rows: &Range<usize>) -> Self {
        match self {
            Self::Column(times) => Self::Column(times.get(rows.clone()).unwrap_or_default().to_vec()),
            Self::Rate { rate_hz, start_s, first, len } => Self::Rate {
                rate_hz: *rate_hz,
                start_s: *start_s,
                first: first + rows.start,
                len: rows.end.min(*len).saturating_sub(rows.start),
            },
        }
    }
}

impl TimeBase {
    /// The time of the first row.
    pub fn start_s(&self) -> f64 {
        self.at(0)
    }

    /// The time of the segment's row `i`, counted from 0: the file's own value, not start and interval put
    /// together again. NaN past the end.
    pub fn at(&self, i: usize) -> f64 {
        match &self.times {
            SegmentTimes::Column(times) => times.get(i).copied().unwrap_or(f64::NAN),
            SegmentTimes::Rate { rate_hz, start_s, first, len } if i < *len => {
                start_s + (first + i) as f64 / rate_hz
            }
            SegmentTimes::Rate { .. } => f64::NAN,
        }
    }

    /// The times of all rows.
    pub fn to_vec(&self) -> Vec<f64> {
        (0..self.len()).map(|i| self.at(i)).collect()
    }

    /// The median interval between rows; `None` where one row, or none that follows another in time, has
    /// no interval.
    pub const fn interval_s(&self) -> Option<f64> {
        self.interval_s
    }

    /// Whether every interval is the median one, within [`TIME_TOLERANCE`](super::TIME_TOLERANCE).
    pub const fn is_uniform(&self) -> bool {
        self.uniform
    }

    /// The number of rows.
    pub fn len(&self) -> usize {
        match &self.times {
            SegmentTimes::Column(times) => times.len(),
            SegmentTimes::Rate { len, .. } => *len,
        }
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// Which line of the file a row stands on: one entry per break in the numbering.
#[derive(Debug, Default)]
pub(super) struct LineNumbers {
    breaks: Vec<(usize, usize)>,
    rows: usize,
}

impl LineNumbers {
    pub(super) fn of(&self, row: usize) -> usize {
        self.known(row).unwrap_or(0)
    }

    fn known(&self, row: usize) -> Option<usize> {
        let after = self.breaks.partition_point(|(first, _)| *first <= row);
        let (first, line) = self.breaks.get(after.checked_sub(1)?)?;
        Some(line + row - first)
    }

    /// The next rows stand on these lines, each entry being a row and its line, the others on the lines after.
    pub(super) fn push_many(&mut self, rows: usize, lines: &[(usize, u64)]) {
        for (row, line) in lines {
            let (row, line) = (self.rows + row, usize::try_from(*line).unwrap_or(usize::MAX));
            if self.known(row) != Some(line) {
                self.breaks.push((row, line));
            }
        }
        self.rows += rows;
    }

    /// Drops what is known of the rows before one alone.
    pub(super) fn forget(&mut self, row: usize) {
        let after = self.breaks.partition_point(|(first, _)| *first <= row);
        self.breaks.drain(..after.saturating_sub(1));
    }

    pub(super) const fn rows(&self) -> usize {
        self.rows
    }
}

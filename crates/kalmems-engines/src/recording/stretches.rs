//! Recordings of any length, a stretch at a time, in bounded memory.

use super::read::{ReadProgress, RecordingReader};
use super::request::ReadRequest;
use super::segment::SegmentTimes;
use super::{Finding, ReadError, RecordingLayout, RecordingSource, Restarts, SampledRecording};
use kalmems_formats::Table;
use std::ops::Range;
use std::path::Path;

/// How much of a segment is given at a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StretchSize {
    /// New rows of a stretch, at least 1.
    pub rows: usize,
    /// New rows of a segment's first stretch, over which its usual interval is found; at least 1.
    pub first: usize,
    /// Rows before the new ones that are given again, as far as the segment has them.
    pub before: usize,
    /// Rows after the new ones that are given in advance, but for the last stretch of a segment: it takes fewer new rows
    /// than these in as well.
    pub after: usize,
}

/// A stretch of one segment, with some of the rows around it.
#[derive(Clone, Debug, PartialEq)]
pub struct Stretch {
    /// The rows as one segment with its label and its usual interval. Its source has neither digest nor length, which
    /// are not known before the end.
    pub recording: SampledRecording,
    /// Which of its rows are new.
    pub fresh: Range<usize>,
    /// Whether the first new row is the first of the segment.
    pub begins: bool,
    /// Whether the last new row is the last of the segment.
    pub ends: bool,
}

/// The stretches of a file, in the order of their rows.
///
/// The file is read once, from front to back, on a thread of its own; so it can be a pipe. The new rows of all stretches
/// together are the rows of [`SampledRecording::read`], bit for bit, and so are the findings, with these differences, which
/// only a segment longer than its first stretch has:
///
/// - The usual interval, by which gaps and irregular intervals are judged, is the median over the first stretch.
/// - A run at the highest or lowest value of 8192 rows or more ([`LONG_RUN`](super::LONG_RUN)) may be judged by 8192 rows
///   before and after it, not by as many as it has.
///
/// A finding that makes the file unusable ends the stretches: the rest is read for the diagnosis alone, which is the
/// error.
///
/// ```no_run
/// use kalmems_engines::recording::{StretchSize, TimeSource, RecordingLayout, Stretches};
/// # use std::ops::ControlFlow;
/// let layout = RecordingLayout { clock: TimeSource::Column("time_s".to_owned()), segment_column: None, columns: None, declared: Vec::new(), hints: Default::default(), restarts: None, nominal_rate_hz: None, origin: None };
/// let around = StretchSize { rows: 65_536, first: 65_536, before: 0, after: 0 };
/// let mut stretches = Stretches::open("recording.csv".as_ref(), &layout, around)?;
/// let mut sum = 0.0;
/// while let Some(stretch) = stretches.next(&mut |_, _| ControlFlow::Continue(()))? {
///     sum += stretch.recording.column("cap_V")?.values[stretch.fresh.clone()].iter().sum::<f64>();
///     stretches.reuse(stretch);
/// }
/// let (source, diagnosis) = stretches.finish();
/// # Ok::<(), kalmems_engines::recording::ReadError>(())
/// ```
pub struct Stretches {
    reading: RecordingReader,
    around: StretchSize,
    file: String,
    /// The segment that comes next and its next row.
    segment: usize,
    next: usize,
    /// The segment and the first new row of the stretch that was given last, and the rows before which none is needed once the next one is asked for.
    given: (usize, usize),
    needed: usize,
    /// The row at which a segment begins anew.
    begun: Option<(usize, usize)>,
    /// Whether a stretch holds as many new rows as there are.
    arriving: bool,
    /// Rows after the new ones that are waited for at least: one tells whether the segment goes on.
    waits_for: usize,
    ended: bool,
    /// Vectors that are used again.
    spare: Vec<Vec<f64>>,
}

impl Stretches {
    /// Opens a file. Columns that are not there are an error of the first stretch.
    pub fn open(path: &Path, layout: &RecordingLayout, around: StretchSize) -> Result<Self, ReadError> {
        let request = ReadRequest::of(layout);
        let reading = RecordingReader::open(path, &request, around.first.max(1))?;
        Ok(Self::of_reading(reading, path, around, false))
    }

    /// Of a table of the file at `path`.
    pub(crate) fn of_table(
        table: Box<dyn Table>,
        path: &Path,
        request: &ReadRequest,
        around: StretchSize,
    ) -> Result<Self, ReadError> {
        let reading = RecordingReader::of(table, path, request, around.first.max(1))?;
        Ok(Self::of_reading(reading, path, around, false))
    }

    /// Of a table whose rows arrive now and then: a stretch holds what has arrived, `around.rows` new rows at most.
    pub fn of_arriving(
        table: Box<dyn Table>,
        path: &Path,
        layout: &RecordingLayout,
        around: StretchSize,
    ) -> Result<Self, ReadError> {
        let request = ReadRequest {
            // What arrives cannot be sorted: it is taken as it comes.
            restarts: layout.restarts.map(|restarts| Restarts { at_any_rate: true, ..restarts }),
            ..ReadRequest::of(layout)
        };
        let reading = RecordingReader::of(table, path, &request, around.first.max(1))?;
        Ok(Self::of_reading(reading, path, around, true))
    }

    /// The same that gives a row without waiting for the next one: where no row comes after it, its segment ends with an empty stretch.
    #[must_use]
    pub fn without_waiting(self) -> Self {
        Self { waits_for: 0, ..self }
    }

    fn of_reading(reading: RecordingReader, path: &Path, around: StretchSize, arriving: bool) -> Self {
        let around = StretchSize { rows: around.rows.max(1), first: around.first.max(1), ..around };
        let file = path.display().to_string();
        Self {
            reading,
            around,
            file,
            segment: 0,
            next: 0,
            given: (0, 0),
            needed: 0,
            begun: None,
            arriving,
            waits_for: 1,
            ended: false,
            spare: Vec::new(),
        }
    }

    /// Takes what has been read for all there is.
    pub fn cut_off(&mut self) {
        if !self.ended {
            self.ended = true;
            self.reading.pass.end();
        }
    }

    /// What was recognised of the format.
    pub fn recognised(&self) -> &str {
        &self.reading.source().format
    }

    /// The usual interval in s of a segment whose first stretch comes next, once it is known; `None` within a segment, after
    /// the last one, and where no row follows another in time.
    pub fn beginning(&mut self, progress: ReadProgress) -> Result<Option<f64>, ReadError> {
        loop {
            if let Some((start, end)) = self.place() {
                let interval = self.reading.pass.interval_s(self.segment);
                if start != self.next || end.is_some() || interval.is_some() {
                    return Ok(interval.filter(|_| start == self.next));
                }
            }
            if self.ended {
                return Ok(None);
            }
            self.read(progress)?;
        }
    }

    /// Where the present segment begins, if only anew, and the row behind it, once that is known.
    fn place(&self) -> Option<(usize, Option<usize>)> {
        let (start, end) = self.reading.pass.segment(self.segment)?;
        let begun = self.begun.filter(|(segment, _)| *segment == self.segment);
        Some((begun.map_or(start, |(_, row)| row), end))
    }

    /// Lets the segment of the stretch that was given last begin anew, so many rows behind the first new one of that.
    pub fn begin_again(&mut self, rows: usize) {
        let (segment, first) = self.given;
        (self.segment, self.next) = (segment, first + rows);
        self.begun = Some((segment, self.next));
        self.needed = self.next;
    }

    /// Goes on to the next segment where the present one has no row to begin anew with.
    fn pass_ended(&mut self) {
        while let Some((_, Some(end))) = self.place()
            && self.begun.is_some_and(|(segment, row)| segment == self.segment && row >= end)
        {
            (self.segment, self.next, self.begun) = (self.segment + 1, end, None);
        }
    }

    /// How much of a segment is given at a time from the next stretch on, which begins one.
    pub fn give(&mut self, around: StretchSize) {
        self.around = StretchSize { rows: around.rows.max(1), first: around.first.max(1), ..around };
    }

    /// The next stretch; `None` after the last. `progress` is called now and then with the bytes read and the bytes in all
    /// (0 of a pipe); where it breaks, the reading ends with [`ReadError::Interrupted`].
    pub fn next(&mut self, progress: ReadProgress) -> Result<Option<Stretch>, ReadError> {
        self.next_of_any(true, progress)
    }

    /// The next stretch, of a file that cannot be used as well where `usable` does not ask for more.
    pub(crate) fn next_of_any(
        &mut self,
        usable: bool,
        progress: ReadProgress,
    ) -> Result<Option<Stretch>, ReadError> {
        self.reading.pass.forget(self.needed.min(self.rows()));
        loop {
            self.pass_ended();
            if usable && self.reading.pass.is_fatal() {
                return Err(self.unusable(progress)?);
            }
            if let Some((rows, ends)) = self.ready() {
                return Ok(self.cut(rows, ends));
            }
            if self.ended {
                return Ok(None);
            }
            self.read(progress)?;
        }
    }

    /// What has become known of the columns' values since this was last called, while rows are to come: that a column is clipped, that a value
    /// stays, that a column repeats another. Each kind of a column is told once in a stretch of rows without a gap, by what was read
    /// until then: a higher value may come after one that was the highest.
    pub fn news(&mut self) -> Vec<Finding> {
        self.reading.pass.news()
    }

    /// How many values were found clipped, and how many that stay, as far as that is known: of all columns, and until the rows end.
    pub fn disturbed(&self) -> [usize; 2] {
        self.reading.pass.disturbed()
    }

    /// Gives a stretch back, for its memory to be used again.
    pub fn reuse(&mut self, stretch: Stretch) {
        for segment in stretch.recording.segments {
            if let SegmentTimes::Column(times) = segment.time.times {
                self.spare.push(times);
            }
        }
        self.spare.extend(stretch.recording.columns.into_iter().map(|column| column.values));
        self.spare.truncate(64);
    }

    /// The file and all that was found, once the last stretch is read.
    pub fn finish(self) -> (RecordingSource, Vec<Finding>) {
        (self.reading.source().clone(), self.reading.pass.findings())
    }

    /// The rows so far, those that are not yet given included.
    pub(crate) const fn rows(&self) -> usize {
        self.reading.pass.rows()
    }

    /// Reads a block, or the end.
    fn read(&mut self, progress: ReadProgress) -> Result<(), ReadError> {
        if !self.reading.step(progress)? {
            self.ended = true;
            self.reading.pass.end();
        }
        Ok(())
    }

    /// The new rows of the next stretch, where all that it needs is read, and whether they end their segment.
    fn ready(&self) -> Option<(Range<usize>, bool)> {
        let (start, end) = self.place()?;
        let after = self.around.after.max(self.waits_for);
        let first = self.next == start;
        let mut rows = if first { self.around.first } else { self.around.rows };
        if self.arriving && !first && end.is_none() {
            let there = self.rows().saturating_sub(self.next + after);
            rows = rows.min(there.max(1));
        }
        let until = self.next.saturating_add(rows);
        match end {
            // What comes after a stretch is whole, or there is none after it.
            Some(end) if until.saturating_add(after) > end => Some((self.next..end, true)),
            Some(_) => Some((self.next..until, false)),
            // One row more tells that the segment goes on.
            None if self.rows() >= until.saturating_add(after) => Some((self.next..until, false)),
            None => None,
        }
    }

    /// Makes a stretch of some rows and lets go of what no later one needs.
    fn cut(&mut self, rows: Range<usize>, ends: bool) -> Option<Stretch> {
        let (start, end) = self.place()?;
        let first = rows.start.saturating_sub(self.around.before).max(start);
        let last = rows.end.saturating_add(self.around.after).min(end.unwrap_or(self.rows()));
        let source = self.reading.source();
        let recording = self.reading.pass.part(self.segment, first..last, source, &mut self.spare)?;
        let begins = rows.start == start;
        (self.given, self.next) = ((self.segment, rows.start), rows.end);
        self.segment += usize::from(ends);
        // A segment that begins needs nothing before.
        self.needed = if ends { rows.end } else { rows.end.saturating_sub(self.around.before).max(start) };
        Some(Stretch { recording, fresh: rows.start - first..rows.end - first, begins, ends })
    }

    /// Reads the rest for the diagnosis alone.
    fn unusable(&mut self, progress: ReadProgress) -> Result<ReadError, ReadError> {
        while !self.ended {
            self.reading.pass.forget(self.rows());
            self.read(progress)?;
        }
        Ok(ReadError::Unusable { file: self.file.clone(), findings: self.reading.pass.findings() })
    }
}

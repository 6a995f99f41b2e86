//! Recordings: sampled channels with units, and their diagnosis.
//!
//! A recording is a table of numbers in any format of `kalmems_formats`, with columns named `name_unit`. Numbers become SI as
//! they are read, on a thread of their own. What is wrong with the file is found over its whole length and counted;
//! nothing is repaired or interpolated. Findings that make it unusable are an error with all of them; the others are
//! kept as [`SampledRecording::diagnosis`]. Times are read exactly and count from the first, or from zero where that is near
//! ([`SampledRecording::origin`]). [`Stretches`] gives the same of a file of any length, a part at a time.
//!
//! ```no_run
//! use kalmems_engines::recording::{TimeSource, RecordingLayout, SampledRecording};
//! let layout = RecordingLayout {
//!     clock: TimeSource::Column("time_s".to_owned()),
//!     segment_column: None,
//!     columns: Some(vec!["cap_V".to_owned()]),
//!     declared: Vec::new(),
//!     hints: kalmems_engines::recording::Hints::default(),
//!     nominal_rate_hz: None,
//!     origin: None,
//!     restarts: None,
//! };
//! let recording = SampledRecording::read("recording.csv".as_ref(), &layout)?;
//! let readout = recording.column("cap_V")?;
//! for segment in recording.segments() {
//!     println!("{} rows from {} s on", readout.of(segment).len(), segment.time.start_s());
//! }
//! # Ok::<(), kalmems_engines::recording::ReadError>(())
//! ```

mod beside;
pub(crate) mod blocks;
pub(crate) mod clock_unit;
mod compensation;
mod computed_rows;
mod contribution;
pub(crate) mod counter;
mod dropped_bit;
mod error;
mod finding;
mod findings;
pub(crate) mod label;
mod origin;
mod pass;
mod plan;
mod rails;
pub(crate) mod read;
mod reading;
mod repeats;
pub(crate) mod request;
mod restart;
pub(crate) mod scale;
mod segment;
mod signal_check;
mod sine_fits;
mod stamps;
mod stretches;
mod stuck;
#[cfg(test)]
mod tests;
mod time;
mod window;

pub use computed_rows::RecordingFromRows;
pub use contribution::{OF_RECORD, contribution_column, moved_by};
pub use error::ReadError;
pub use finding::{Finding, FindingKind, Purpose, Severity};
pub use origin::TimeOrigin;
pub(crate) use pass::plural;
pub use rails::{LONG_RUN, SATURATION_CREEP, SATURATION_RUN, SATURATION_SHARE, SATURATION_STEPS, SHORT_RUN};
pub use restart::StretchPlace;
pub use segment::{Segment, TimeBase};
pub use signal_check::unusable_signal;
pub use stretches::{Stretch, StretchSize, Stretches};
pub use stuck::STUCK_RUN;
pub use time::{GAP_TOLERANCE, TIME_TOLERANCE};

use crate::signal::Sine;
use crate::units::{ColumnHeader, Kind, Unit};
pub use kalmems_config::layout::{ColumnReading, DeclaredColumn, RecordingLayout, Restarts, TimeSource};
pub use kalmems_formats::{
    Array, ArrayType, Arrays, CsvHints, Format, Hints, Instant, TimeUnit, panic_is_caught,
};
use request::ReadRequest;
use serde::Serialize;
use sine_fits::SineFits;
use std::ops::{ControlFlow, Range};
use std::path::Path;

/// Whether a file has more rows than `most`, without reading them; see [`kalmems_formats::has_more_rows`].
pub fn has_more_rows(path: &Path, layout: &RecordingLayout, most: u64) -> Result<bool, ReadError> {
    kalmems_formats::has_more_rows(path, &layout.hints, most)
        .map_err(|source| ReadError::of_format(path, source))
}

/// Whether the name of a column says what a clock in it counts, as `time_s` and `time_unix_ns` do.
pub fn names_a_time(column: &str) -> bool {
    {
        let header = ColumnHeader::parse(column);
        clock_unit::ClockUnit::of(&header, scale::ColumnScale::of(header.unit), None).is_some()
    }
}

/// The file that a recording was read from.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct RecordingSource {
    /// Its name without folders.
    pub file: String,
    /// SHA-256 of its bytes, in hexadecimal.
    pub sha256: String,
    /// Its length.
    pub bytes: u64,
    /// Its format and what was recognised of it, in a sentence.
    pub format: String,
    /// Where its times count from, where that is not zero.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub origin: Option<TimeOrigin>,
}

/// A channel of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordingColumn {
    /// Its name and its unit in the file.
    pub header: ColumnHeader,
    /// Its values in SI, one per row; NaN where the file has no finite number.
    pub values: Vec<f64>,
    fits: SineFits,
}

impl RecordingColumn {
    /// A column with these values in SI.
    pub(crate) fn new(header: ColumnHeader, values: Vec<f64>) -> Self {
        Self { header, values, fits: SineFits::default() }
    }

    /// So many sines that `fit` finds in these rows of the recording, nothing where there are none. They are found once for all copies of the
    /// column; `fit` gives `None` where it is stopped.
    pub fn sines(
        &self,
        rows: Range<usize>,
        count: usize,
        fit: impl FnOnce() -> Option<Vec<Sine>>,
    ) -> Vec<Sine> {
        self.fits.get(rows, count, fit)
    }

    /// The values, to be changed: what was fitted to them holds no longer.
    fn values_mut(&mut self) -> &mut Vec<f64> {
        self.fits = SineFits::default();
        &mut self.values
    }

    /// The values of a segment.
    pub fn of(&self, segment: &Segment) -> &[f64] {
        self.values.get(segment.rows.clone()).unwrap_or_default()
    }
}

/// Sampled channels on one time base.
#[derive(Clone, Debug, PartialEq)]
pub struct SampledRecording {
    source: RecordingSource,
    columns: Vec<RecordingColumn>,
    segments: Vec<Segment>,
    diagnosis: Vec<Finding>,
    rows: usize,
    origin: Instant,
}

impl SampledRecording {
    /// Reads a file.
    pub fn read(path: &Path, layout: &RecordingLayout) -> Result<Self, ReadError> {
        Self::read_with(path, layout, &mut |_, _| ControlFlow::Continue(()))
    }

    /// Reads a file and calls `progress` now and then, and at the end, with the bytes read and the bytes in
    /// all; where it breaks, the reading ends with [`ReadError::Interrupted`].
    pub fn read_with(
        path: &Path,
        layout: &RecordingLayout,
        progress: &mut dyn FnMut(u64, u64) -> ControlFlow<()>,
    ) -> Result<Self, ReadError> {
        let request = ReadRequest::of(layout);
        read::read(path, &request, progress)?.usable(&path.display().to_string())
    }

    /// Refuses a recording with a finding that makes it unusable.
    fn usable(self, file: &str) -> Result<Self, ReadError> {
        if self.diagnosis.iter().any(|finding| finding.severity() == Severity::Fatal) {
            return Err(ReadError::Unusable { file: file.to_owned(), findings: self.diagnosis });
        }
        Ok(self)
    }

    /// The file it comes from.
    pub const fn source(&self) -> &RecordingSource {
        &self.source
    }

    /// Where its times count from; what is put beside it is to count from there too.
    pub const fn origin(&self) -> Instant {
        self.origin
    }

    /// What was recognised of the file's format, in a sentence.
    pub fn recognised(&self) -> &str {
        &self.source.format
    }

    /// The number of rows.
    pub const fn rows(&self) -> usize {
        self.rows
    }

    /// The columns that were read, in the order in which they were asked for, else in that of the file.
    pub fn columns(&self) -> &[RecordingColumn] {
        &self.columns
    }

    /// A column by its whole name.
    pub fn column(&self, name: &str) -> Result<&RecordingColumn, ReadError> {
        self.columns.iter().find(|column| column.header.column == name).ok_or_else(|| ReadError::NoColumn {
            file: self.source.file.clone(),
            column: name.to_owned(),
            hint: error::hint(name, self.columns.iter().map(|column| column.header.column.as_str())),
        })
    }

    /// A column by its whole name, if it is of this kind.
    pub fn column_of(&self, name: &str, kind: &Kind) -> Result<&RecordingColumn, ReadError> {
        let column = self.column(name)?;
        let unit = column.header.unit.unwrap_or(Unit::ONE);
        if kind.accepts(unit.dimension()) {
            return Ok(column);
        }
        Err(ReadError::Kind {
            file: self.source.file.clone(),
            column: name.to_owned(),
            unit: column.header.unit_text.clone(),
            expected: kind.to_string(),
            remedy: if column.header.is_stated {
                "correct `unit` or `scale` of its table: `scale` multiplies the numbers, so that a sensitivity of `2 V/gn` is \
                 `scale = \"0.5 gn/V\"`"
            } else {
                "name another column, or correct the unit that its name ends with"
            },
        })
    }

    /// Its segments in the order of the file; one where the file holds one record.
    pub fn segments(&self) -> &[Segment] {
        &self.segments
    }

    /// What was found that does not keep it from being used.
    pub fn diagnosis(&self) -> &[Finding] {
        &self.diagnosis
    }
}

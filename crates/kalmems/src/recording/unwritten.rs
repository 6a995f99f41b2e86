//! A recording that was computed and is read as if from a file, without the file.

use super::findings::Findings;
use super::pass::Pass;
use super::plan::Plan;
use super::request::{Request, Wanted};
use super::{Clock, Layout, ReadError, Recording, Source};
use csv::ByteRecord;

/// Rows that would be a file's: what comes of them is what [`Recording::read`] would make of that file, diagnosis and
/// rounding included, but for the file's digest and length.
///
/// ```
/// use kalmems::recording::{Clock, Layout, UnwrittenRecording};
/// let layout = Layout {
///     clock: Clock::Column("time_s".to_owned()),
///     segment_column: None,
///     columns: Some(vec!["cap_V".to_owned()]),
/// };
/// let mut rows = UnwrittenRecording::new("recording.csv", &["time_s", "cap_V"], &layout)?;
/// for k in 0..100 {
///     rows.push(&[f64::from(k) * 1e-6, f64::from(k).sin()]);
/// }
/// let recording = rows.finish()?;
/// assert_eq!(recording.column("cap_V")?.values[1], 1.0_f64.sin());
/// # Ok::<(), kalmems::recording::ReadError>(())
/// ```
pub struct UnwrittenRecording {
    name: String,
    clock: Clock,
    pass: Pass,
    /// The line on which the next row would stand.
    line: usize,
}

impl UnwrittenRecording {
    /// A file of this name and header, to be read by this layout. One record: it has no column of segments.
    pub fn new(name: &str, header: &[&str], layout: &Layout) -> Result<Self, ReadError> {
        let request = Request {
            clock: &layout.clock,
            segment_column: None,
            columns: layout.columns.as_deref().map_or(Wanted::AllBut(&[]), Wanted::Named),
        };
        let mut findings = Findings::default();
        let plan = Plan::of(&ByteRecord::from(header.to_vec()), 1, &request, &mut findings)
            .map_err(|findings| ReadError::Unusable { file: name.to_owned(), findings })?;
        let pass = Pass::new(plan, findings);
        Ok(Self { name: name.to_owned(), clock: layout.clock.clone(), pass, line: 2 })
    }

    /// One row, in the order of the header.
    pub fn push(&mut self, cells: &[f64]) {
        self.pass.take_numbers(cells, self.line);
        self.line += 1;
    }

    /// The recording.
    pub fn finish(self) -> Result<Recording, ReadError> {
        let source = Source { file: self.name.clone(), sha256: String::new(), bytes: 0 };
        self.pass.finish(source, &self.clock).usable(&self.name)
    }
}

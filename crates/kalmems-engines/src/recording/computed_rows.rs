//! A recording that was computed and is read as if from a file, without the file.

use super::findings::Findings;
use super::pass::Pass;
use super::plan::ReadingPlan;
use super::request::{ColumnSelection, ReadRequest};
use super::{ReadError, RecordingLayout, RecordingSource, SampledRecording};
use kalmems_formats::{
    Block, CellFault, CellFinding, Column, Shift, TableDescription, TableEvidence, TimeReader,
    WantedColumn as Read,
};

/// Rows that would be a file's: what comes of them is what [`SampledRecording::read`] would make of that file, diagnosis and
/// rounding included, but for the file's digest and length.
///
/// ```
/// use kalmems_engines::recording::{TimeSource, RecordingLayout, RecordingFromRows};
/// let layout = RecordingLayout {
///     clock: TimeSource::Column("time_s".to_owned()),
///     segment_column: None,
///     columns: Some(vec!["cap_V".to_owned()]),
///     declared: Vec::new(),
///     hints: kalmems_formats::Hints::default(),
///     nominal_rate_hz: None,
///     origin: None,
///     restarts: None,
/// };
/// let mut rows = RecordingFromRows::new("recording.csv", &["time_s", "cap_V"], &layout)?;
/// for k in 0..100 {
///     rows.push(&[f64::from(k) * 1e-6, f64::from(k).sin()]);
/// }
/// let recording = rows.finish()?;
/// assert_eq!(recording.column("cap_V")?.values[1], 1.0_f64.sin());
/// # Ok::<(), kalmems_engines::recording::ReadError>(())
/// ```
pub struct RecordingFromRows {
    name: String,
    pass: Pass,
    /// For each column of numbers of a block, its position in the header and what reads it.
    columns: Vec<(usize, ColumnReader)>,
    block: Block,
    /// The line on which the next row would stand.
    line: u64,
}

/// Reads the cells of a column.
enum ColumnReader {
    Number(Shift),
    Time(TimeReader),
}

/// Rows that are taken together.
const ROWS: usize = 4096;

impl RecordingFromRows {
    /// A file of this name and header, to be read by this layout. One record: it has no column of segments.
    pub fn new(name: &str, header: &[&str], layout: &RecordingLayout) -> Result<Self, ReadError> {
        let request = ReadRequest {
            clock: &layout.clock,
            segment_column: None,
            columns: layout.columns.as_deref().map_or(ColumnSelection::AllBut(&[]), ColumnSelection::Named),
            declared: &layout.declared,
            hints: &layout.hints,
            nominal_rate_hz: layout.nominal_rate_hz,
            origin: layout.origin,
            restarts: layout.restarts,
        };
        let mut findings = Findings::default();
        let file = TableDescription {
            format: "computed",
            recognised: String::new(),
            columns: header.iter().map(|name| Column::new(name)).collect(),
            rows: None,
            evidence: TableEvidence::Format,
            left_out: Vec::new(),
            protection: String::new(),
        };
        let plan = ReadingPlan::of(&file, &|_| None, 1, &request, &mut findings)
            .map_err(|findings| ReadError::Unusable { file: name.to_owned(), findings })?;
        let number = |wanted: Read| match wanted {
            Read::Number { column, power } => Some((column, ColumnReader::Number(Shift::new(power)))),
            Read::Time { column, unit, origin } => {
                Some((column, ColumnReader::Time(TimeReader::new(unit, origin))))
            }
            Read::Label { .. } => None,
        };
        let columns: Vec<_> = plan.wanted().into_iter().filter_map(number).collect();
        let mut block = Block::with_capacity(ROWS);
        block.clear(columns.len(), 0);
        let pass = Pass::new(plan, findings, &request, usize::MAX);
        Ok(Self { name: name.to_owned(), pass, columns, block, line: 2 })
    }

    /// One row, in the order of the header.
    pub fn push(&mut self, cells: &[f64]) {
        let row = self.block.rows;
        if row == 0 {
            self.block.lines.push((0, self.line));
        }
        for ((column, reader), values) in self.columns.iter_mut().zip(&mut self.block.numbers) {
            let cell = cells.get(*column).copied().unwrap_or(f64::NAN);
            let number = match reader {
                ColumnReader::Number(shift) => shift.float(cell),
                ColumnReader::Time(times) => times.float(cell),
            };
            values.push(if number.is_finite() { number } else { f64::NAN });
            if !number.is_finite() {
                let fault = if cell.is_nan() { CellFinding::Nan } else { CellFinding::Infinite };
                let fault = fault(cell.to_string());
                self.block.faults.push(CellFault { row, line: self.line, column: Some(*column), fault });
            }
        }
        self.block.rows += 1;
        self.line += 1;
        if self.block.rows == ROWS {
            self.flush();
        }
    }

    fn flush(&mut self) {
        for (_, reader) in &self.columns {
            if let ColumnReader::Time(times) = reader {
                self.block.set_times(times);
            }
        }
        self.pass.take(&self.block);
        self.block.clear(self.columns.len(), 0);
    }

    /// The recording.
    pub fn finish(mut self) -> Result<SampledRecording, ReadError> {
        self.flush();
        let source = RecordingSource {
            file: self.name.clone(),
            sha256: String::new(),
            bytes: 0,
            format: "computed".to_owned(),
            origin: self.pass.origin(),
        };
        self.pass.finish(source).usable(&self.name)
    }
}

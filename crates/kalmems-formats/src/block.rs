//! A few rows of a table.

use crate::{Instant, TimeReader};

/// Rows that were read together.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Block {
    /// How many rows at most.
    pub capacity: usize,
    /// How many there are.
    pub rows: usize,
    /// One for each wanted column of numbers, in the order in which they are wanted; NaN where there is no finite number.
    pub numbers: Vec<Vec<f64>>,
    /// One for each wanted column of labels.
    pub labels: Vec<Labels>,
    /// Cells that are no finite numbers, and rows that are none, in the order of the file.
    pub faults: Vec<CellFault>,
    /// Where rows stand in the file, as `(row of this block, line)`: the first, and each that does not follow the one before
    /// by one. Lines count from 1 as an editor does, rows of binary formats from 1 as well.
    pub lines: Vec<(usize, u64)>,
    /// Rows that do not go on from the row before them although no time tells it, and how many are missing between.
    pub breaks: Vec<(usize, u64)>,
    /// Where wanted times count from.
    pub origin: Instant,
    /// To how many seconds the times so far were rounded in the file, as binary numbers are far from zero; 0 where they are exact.
    pub resolution_s: f64,
}

impl Block {
    /// One without rows.
    pub fn with_capacity(capacity: usize) -> Self {
        Self { capacity, ..Self::default() }
    }

    /// Drops what is in it and keeps the memory, for so many columns of numbers and of labels.
    pub fn clear(&mut self, numbers: usize, labels: usize) {
        self.rows = 0;
        self.numbers.resize_with(numbers, Vec::new);
        self.numbers.iter_mut().for_each(Vec::clear);
        self.labels.resize_with(labels, Vec::new);
        self.labels.iter_mut().for_each(Vec::clear);
        self.faults.clear();
        self.lines.clear();
        self.breaks.clear();
    }

    /// Takes over what the reader of the times knows.
    pub fn set_times(&mut self, times: &TimeReader) {
        self.origin = times.origin().unwrap_or_default();
        self.resolution_s = times.resolution_s();
    }

    /// The line of a row from the last entry of `lines` on, or of the row after the last.
    pub fn line_of(&self, row: usize) -> Option<u64> {
        let (first, line) = self.lines.last()?;
        Some(line + row.checked_sub(*first)? as u64)
    }

    /// Whether it says that the table has ended.
    pub fn is_end(&self) -> bool {
        self.rows == 0 && self.faults.is_empty()
    }
}

/// The labels of the rows of a block, as runs: `(row of this block where it begins, label)`.
pub type Labels = Vec<(usize, Vec<u8>)>;

/// Adds a row's label to the runs.
pub(crate) fn push_label(labels: &mut Labels, row: usize, text: &[u8]) {
    if labels.last().is_none_or(|(_, last)| last != text) {
        labels.push((row, text.to_vec()));
    }
}

/// What is wrong at one place of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CellFault {
    /// The row of the block that it is in, or before which it is where it is no row.
    pub row: usize,
    /// Its line, or its row counted from 1.
    pub line: u64,
    /// The column of the description; `None` where it is about the row.
    pub column: Option<usize>,
    /// What it is.
    pub fault: CellFinding,
}

impl CellFault {
    /// Of a row, or before one, in a line.
    pub(crate) fn of_line(row: usize, line: u64, fault: CellFinding) -> Self {
        Self { row, line, column: None, fault }
    }
}

/// What can be wrong.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum CellFinding {
    /// Nothing is there.
    Missing,
    /// It says that it is no number: `nan` in any spelling, `---`, the number that SCPI has for it.
    Nan(String),
    /// It says that the value was beyond the range of the instrument: `OL`, 9.9E37, the end of 16 bits.
    Overload(String),
    /// It is infinite, or beyond the range of f64.
    Infinite(String),
    /// Anything else that is no number, shortened.
    Text(String),
    /// Rows with another number of cells than the header; they are left out.
    CellCount {
        /// As many in the first of them.
        found: usize,
        /// As many as there should be.
        expected: usize,
        /// How many rows.
        rows: u64,
    },
    /// Lines with nothing in them.
    BlankLines {
        /// As many.
        count: u64,
    },
    /// The last line of a text has no line end: its last number is short if the text was cut there.
    NoLineEnd,
}

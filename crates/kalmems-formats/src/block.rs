//! A few rows of a table.

use crate::Wanted;

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
}

impl Block {
    /// Drops what was in it and makes room for what is wanted; `first` rows of the file come before it.
    pub(crate) fn begin(&mut self, wanted: &[Wanted], first: u64, rows: usize) {
        let labels = wanted.iter().filter(|want| matches!(want, Wanted::Label { .. })).count();
        self.rows = rows;
        self.numbers.resize_with(wanted.len() - labels, Vec::new);
        self.numbers.iter_mut().for_each(Vec::clear);
        self.labels.resize_with(labels, Vec::new);
        self.labels.iter_mut().for_each(Vec::clear);
        self.faults.clear();
        self.lines.clear();
        if rows > 0 {
            self.lines.push((0, first + 1));
        }
    }
}

/// The labels of the rows of a block, as runs: `(row of this block where it begins, label)`.
pub type Labels = Vec<(usize, Vec<u8>)>;

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
    pub fault: Fault,
}

/// What can be wrong.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Fault {
    /// Nothing is there.
    Missing,
    /// It says that it is no number: `nan` in any spelling.
    Nan(String),
    /// It is infinite, or beyond the range of f64.
    Infinite(String),
    /// Anything else that is no number, shortened.
    Text(String),
    /// A row with another number of cells than the header; it is left out.
    CellCount {
        /// As many.
        found: usize,
    },
    /// Lines with nothing in them.
    BlankLines {
        /// As many.
        count: u64,
    },
}

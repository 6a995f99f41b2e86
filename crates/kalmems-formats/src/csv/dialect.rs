//! Which dialect a text is written in, told from its beginning.

use super::CsvHints;
use super::input::Input;
use super::split::Split;
use crate::{Column, FormatError, Hints};

/// As many lines are looked at, or as many bytes where lines are long.
const LINES: usize = 128;
const BYTES: usize = 1 << 20;

/// A text with more columns is not read.
const MOST_COLUMNS: usize = 10_000;

/// How a text is written.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Dialect {
    pub(super) separator: u8,
    /// The decimal mark.
    pub(super) point: u8,
    /// The line of the names, and that of the first row.
    pub(super) header_line: u64,
    pub(super) first_row_line: u64,
    /// How many cells a row has.
    pub(super) cells: usize,
    /// Whether a separator may stand at the end of a row, with nothing behind it.
    pub(super) trailing: bool,
    pub(super) columns: Vec<DialectColumn>,
    /// All of this for people.
    pub(super) recognised: String,
}

/// A column and where its values come from.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct DialectColumn {
    pub(super) column: Column,
    pub(super) origin: Origin,
}

/// Where the values of a column come from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Origin {
    /// A cell of the row.
    Cell(usize),
    /// A cell times a step that the header states, after a start.
    Affine { cell: usize, start: f64, step: f64 },
    /// The rows, counted from 0, times a step that the header states, after a start.
    Counted { start: f64, step: f64 },
}

impl Origin {
    /// The cell, where there is one.
    pub(super) const fn cell(self) -> Option<usize> {
        match self {
            Self::Cell(cell) | Self::Affine { cell, .. } => Some(cell),
            Self::Counted { .. } => None,
        }
    }
}

impl Dialect {
    /// Whether a row has as many cells as it should.
    pub(super) fn fits(&self, row: &Split) -> bool {
        row.len() == self.cells
            || self.trailing && row.len() == self.cells + 1 && row.cell(self.cells).is_empty()
    }
}

/// Tells the dialect and takes all that comes before the first row.
pub(super) fn recognise(input: &mut Input, hints: &Hints) -> Result<Dialect, FormatError> {
    let CsvHints { .. } = hints.csv;
    let mut line = 1;
    if !input.more()? {
        return Ok(nothing());
    }
    if input.lines().starts_with(b"\xef\xbb\xbf") {
        input.take(3);
    }
    // Comments and blank lines before the header.
    loop {
        let lines = input.lines();
        let Some(end) = memchr::memchr(b'\n', lines) else {
            if input.more()? {
                continue;
            }
            return Ok(nothing());
        };
        if !lines.starts_with(b"#") && lines.get(..end).is_some_and(|first| !first.trim_ascii().is_empty()) {
            break;
        }
        input.take(end + 1);
        line += 1;
    }
    while input.lines().len() < BYTES
        && memchr::memchr_iter(b'\n', input.lines()).count() < LINES
        && input.more()?
    {}
    let mut header = Split::default();
    let extent = loop {
        if let Some(extent) = header.row(input.lines(), b',', input.ended()) {
            break extent;
        }
        input.more()?;
    };
    if header.len() > MOST_COLUMNS {
        return Err(FormatError::TooLarge {
            format: "CSV",
            what: "the number of columns".to_owned(),
            found: header.len() as u64,
            limit: MOST_COLUMNS as u64,
        });
    }
    let column = |(index, name): (usize, &[u8])| DialectColumn {
        column: Column { name: String::from_utf8_lossy(name).into_owned(), place: None },
        origin: Origin::Cell(index),
    };
    input.take(extent.bytes);
    Ok(Dialect {
        separator: b',',
        point: b'.',
        header_line: line,
        first_row_line: line + 1 + extent.inside,
        cells: header.len(),
        trailing: false,
        columns: header.iter().enumerate().map(column).collect(),
        recognised: "separated by commas".to_owned(),
    })
}

/// The dialect of an empty text.
fn nothing() -> Dialect {
    Dialect {
        separator: b',',
        point: b'.',
        header_line: 1,
        first_row_line: 1,
        cells: 0,
        trailing: false,
        columns: Vec::new(),
        recognised: "nothing".to_owned(),
    }
}

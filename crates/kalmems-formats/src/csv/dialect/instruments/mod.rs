//! The preambles that instruments write before their columns, a file each.

mod keysight;
mod labone;
mod labview;
mod lecroy;
mod rigol;
mod siglent;
mod tektronix;
mod yokogawa;

pub(in crate::csv) use labview::Heading;

use super::head::TextHead;
use super::units::column_name;
use super::{ColumnOrigin, RecognizedText, RecordShape, marks};
use crate::{CsvHints, FormatError};

/// The dialect, where a text is an instrument's, or what is wrong with it.
type DialectSearch = Option<Result<RecognizedText, FormatError>>;

/// What tells a preamble from its first line, and the dialect behind it.
const ALL: [fn(&TextBeginning) -> DialectSearch; 8] = [
    labview::find,
    rigol::find,
    keysight::find,
    lecroy::find,
    siglent::find,
    tektronix::find,
    yokogawa::find,
    labone::find,
];

/// The first lines of a text, and the first of them in cells.
struct TextBeginning<'a> {
    head: &'a TextHead<'a>,
    separator: u8,
    cells: Vec<String>,
}

impl TextBeginning<'_> {
    /// A cell of the first line; empty where there is none.
    fn cell(&self, index: usize) -> &str {
        self.cells.get(index).map_or("", String::as_str)
    }

    /// The cells of a line, without the empty one that a separator at the end leaves, and whether it left one.
    fn filled(&self, line: usize) -> (Vec<String>, bool) {
        let mut cells = self.head.cells(line, self.separator);
        let trailing = cells.len() > 1 && cells.last().is_some_and(String::is_empty);
        if trailing {
            cells.pop();
        }
        (cells, trailing)
    }

    /// What follows a key in its line.
    fn values(&self, key: &str) -> Option<Vec<String>> {
        self.head.values(key, self.separator)
    }

    /// The dialect of rows from the line `first_row` on, with names in the line `header`.
    fn found(
        &self,
        instrument: &'static str,
        header: usize,
        first_row: usize,
        columns: Vec<(String, ColumnOrigin)>,
        units: impl Into<String>,
    ) -> RecognizedText {
        let (cells, trailing) = self.filled(first_row);
        RecognizedText {
            instrument: Some(instrument),
            separator: self.separator,
            point: None,
            header_line: self.head.number(header),
            first_row,
            cells: columns.len().max(cells.len()),
            trailing,
            remarks: false,
            named_cells: false,
            columns,
            units: units.into(),
            records: RecordShape::One,
        }
    }
}

/// How many lines a preamble has beyond the usual.
pub(super) fn lines(head: &TextHead) -> usize {
    if head.line(0).starts_with(b"LECROY") { lecroy::lines(&head.cells(1, b',')) } else { 0 }
}

/// The dialect of a text that begins as an instrument's does.
pub(super) fn find(head: &TextHead, hints: &CsvHints) -> Result<Option<RecognizedText>, FormatError> {
    let first = head.line(0);
    let separator = [b'\t', b';'].into_iter().find(|byte| first.contains(byte)).unwrap_or(b',');
    let beginning = TextBeginning { head, separator, cells: head.cells(0, separator) };
    for find in ALL {
        if let Some(found) = find(&beginning) {
            let mut found = found?;
            if found.point.is_none() {
                found.point = Some(marks::point(head, found.first_row, found.separator, hints)?);
            }
            return Ok(Some(found));
        }
    }
    Ok(None)
}

fn number(cell: Option<&String>) -> Option<f64> {
    fast_float2::parse(cell?.trim()).ok()
}

/// Columns of cells from the first on; the units may be fewer.
fn columns(names: &[String], units: &[String]) -> Vec<(String, ColumnOrigin)> {
    let named = |(index, name): (usize, &String)| {
        (column_name(name, units.get(index).map(String::as_str), index), ColumnOrigin::Cell(index))
    };
    names.iter().enumerate().map(named).collect()
}

/// Names of which none comes twice: a later one gets its number.
fn distinct(names: impl IntoIterator<Item = String>) -> Vec<String> {
    let mut distinct: Vec<String> = Vec::new();
    for name in names {
        let mut candidate = name.clone();
        let mut count = 1;
        while distinct.contains(&candidate) {
            count += 1;
            candidate = format!("{name} {count}");
        }
        distinct.push(candidate);
    }
    distinct
}

//! Rows whose cells begin with their names, as programs print them for a plotter of a serial port: `ax:1.5,ay:-2`.

use super::head::TextHead;
use super::marks::{self, is_number};
use super::units::column_name;
use super::{ColumnOrigin, RecognizedText};
use crate::CsvHints;
use crate::csv::split::BLANKS;

/// Rows that are looked at, and how many there must be.
const ROWS: usize = 64;
const FEWEST: usize = 2;

/// The dialect, where every row that is looked at has the same names before its numbers.
pub(super) fn find(head: &TextHead, hints: &CsvHints) -> Option<RecognizedText> {
    let first_row = head.filled(0);
    let (separator, names) = marks::BYTES.into_iter().chain([BLANKS]).find_map(|separator| {
        let names = names(&head.cells(first_row, separator))?;
        let same = |row: usize| self::names(&head.cells(row, separator)).as_ref() == Some(&names);
        let rows = || head.rows(first_row).take(ROWS);
        (rows().count() >= FEWEST && rows().all(same)).then_some((separator, names))
    })?;
    let column =
        |(index, name): (usize, &String)| (column_name(name, None, index), ColumnOrigin::Cell(index));
    Some(RecognizedText {
        separator,
        point: Some(u8::try_from(hints.decimal.unwrap_or('.')).unwrap_or(b'.')),
        header_line: head.number(first_row),
        first_row,
        cells: names.len(),
        named_cells: true,
        columns: names.iter().enumerate().map(column).collect(),
        units: "names in the cells".to_owned(),
        ..RecognizedText::default()
    })
}

/// The names of cells, where each has one and a number behind it.
fn names(cells: &[String]) -> Option<Vec<String>> {
    let name = |cell: &String| {
        let (name, number) = cell.split_once(':')?;
        let is_name = !name.trim().is_empty() && !is_number(name.trim());
        (is_name && is_number(number.trim())).then(|| name.trim().to_owned())
    };
    cells.iter().map(name).collect()
}

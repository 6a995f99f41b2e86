//! A line of names, perhaps a line of units, and rows: what most programs write.

use super::comments::{Comments, unmarked};
use super::head::{TextHead, text};
use super::marks::is_number;
use super::units::{column_name, unit_cell};
use super::{ColumnOrigin, NamedColumns, RecognizedText, marks, preamble};
use crate::csv::split::{BLANKS, Split};
use crate::name::example_names;
use crate::stated_clock::StatedNumbers;
use crate::time::parse_iso;
use crate::{FormatError, Hints, Result};

/// Rows that are looked at.
const ROWS: usize = 64;

/// The dialect of a text whose names are in a comment before the first line of its head, or else in the line `header`.
pub(super) fn find(
    head: &TextHead,
    header: usize,
    comments: &Comments,
    hints: &Hints,
) -> Result<RecognizedText> {
    if hints.csv.header_line.is_none()
        && let Some(found) = below_comments(head, comments, hints)?
    {
        return Ok(found);
    }
    let below =
        match hints.csv.header_line.map_or_else(|| rows_below(head, header, hints), |_| RowsBelow::First) {
            RowsBelow::First => None,
            // A table may begin with rows without numbers.
            RowsBelow::Some => preamble::find(head).unwrap_or(None),
            RowsBelow::None => preamble::find(head)?,
        };
    let header = below.as_ref().map_or(header, |below| below.names);
    let separator = marks::separator(head, header, &hints.csv)?;
    let (names, header_lines) = names(head, header, separator, hints.columns.as_deref())?;
    let after = header + header_lines;
    let below = below.or_else(|| preamble::below_names(head, after - 1, separator, names.len()));
    let units_index = match hints.csv.units_line {
        Some(line) => Some(line_index(head, line, "units_line")?),
        None => below
            .as_ref()
            .and_then(|below| below.units)
            .or_else(|| Some(head.filled(after)).filter(|index| is_units(head, *index, separator, &names))),
    };
    // A separator may stand behind the last of values in the place of names, and words next to a date.
    let values = || names.iter().rev().skip_while(|name| name.is_empty()).all(|name| marks::is_value(name));
    let values = || values() || names.iter().any(|name| parse_iso(name.as_bytes()).is_some());
    let first_row = match hints.csv.first_row_line {
        Some(line) => line_index(head, line, "first_row_line")?,
        None if hints.columns.is_some() && values() => header,
        None => match &below {
            Some(below) => below.first_row,
            None => units_index.map_or(after, |index| head.filled(index + 1)),
        },
    };
    let units = units_index.map(|index| head.cells(index, separator));
    let (cells, trailing) = width(head, first_row, separator, &names);
    let first = head.cells(first_row, separator);
    // Below the unit of a date, such as TS for a time stamp, stands a date.
    let is_date = |index: usize| first.get(index).is_some_and(|cell| parse_iso(cell.as_bytes()).is_some());
    let unit = |index: usize| {
        units.as_ref().filter(|_| !is_date(index)).and_then(|units| unit_cell(units.get(index)?))
    };
    let (columns, joined) = named_columns(names.get(..cells).unwrap_or(&names), unit);
    let mut clock = preamble::stated_numbers((0..header).map(|line| head.line(line)).chain(comments.lines()));
    let columns = without_settings(columns, &mut clock);
    Ok(RecognizedText {
        instrument: comments.instrument.map(|instrument| instrument.name),
        separator,
        point: Some(marks::point(head, first_row, separator, &hints.csv)?),
        header_line: head.number(header),
        first_row,
        cells,
        trailing,
        columns: comments.with_known_units(columns),
        clock,
        units: match units_index {
            Some(index) => format!("units in line {}", head.number(index)),
            None if joined => "units in the names".to_owned(),
            None => String::new(),
        },
        ..RecognizedText::default()
    })
}

/// The dialect of rows of numbers below comments, one of which holds the names; `None` where the first line is no row,
/// or no comment has as many words.
fn below_comments(head: &TextHead, comments: &Comments, hints: &Hints) -> Result<Option<RecognizedText>> {
    let Some((separator, count)) = marks::separator_of_rows(head, &hints.csv) else { return Ok(None) };
    let first_row = head.filled(0);
    if !head.cells(first_row, separator).iter().any(|cell| is_number(cell)) {
        return Ok(None);
    }
    let Some(said) = comments.names(separator, count) else { return Ok(None) };
    let unit = |index: usize| said.units.as_ref().and_then(|(_, units)| unit_cell(units.get(index)?));
    let (columns, joined) = named_columns(&said.columns, unit);
    Ok(Some(RecognizedText {
        instrument: comments.instrument.map(|instrument| instrument.name),
        separator,
        point: Some(marks::point(head, first_row, separator, &hints.csv)?),
        header_line: said.line,
        first_row,
        cells: count,
        columns: comments.with_known_units(columns),
        clock: preamble::stated_numbers(comments.lines()),
        units: match said.units {
            Some((line, _)) => format!("names and units in comments, units in line {line}"),
            None if joined => "names in a comment, units in the names".to_owned(),
            None => "names in a comment".to_owned(),
        },
        ..RecognizedText::default()
    }))
}

/// Columns with their units, and whether a name was joined with one that stands elsewhere.
fn named_columns(names: &[String], unit: impl Fn(usize) -> Option<String>) -> (NamedColumns, bool) {
    let named = |(index, name): (usize, &String)| {
        (column_name(name, unit(index).as_deref(), index), ColumnOrigin::Cell(index))
    };
    let columns: NamedColumns = names.iter().enumerate().map(named).collect();
    let joined = columns.iter().zip(names).any(|((joined, _), name)| joined != name);
    (columns, joined)
}

/// Columns without names that are settings themselves, such as `tInc = 2.000000e-06`, with which a Rigol ends the line of its names.
fn without_settings(mut columns: NamedColumns, clock: &mut StatedNumbers) -> NamedColumns {
    columns.retain(|(name, _)| !(name.contains('=') && preamble::learn(name.as_bytes(), clock)));
    columns
}

/// The names, and how many lines they take: a quoted name may hold a line end.
fn names(
    head: &TextHead,
    header: usize,
    separator: u8,
    stated: Option<&[String]>,
) -> Result<(Vec<String>, usize)> {
    let line = head.line(header);
    let line = unmarked(line.trim_ascii()).unwrap_or(line);
    if separator == BLANKS
        && let Some(count) = marks::cells_of_rows(head, header + 1, separator)
    {
        let words = head.cells(header, separator);
        // Names of the settings take the place of words of another number.
        let stated = stated.filter(|names| names.len() == count && words.len() != count);
        return match marks::names(line, separator, count).or_else(|| stated.map(<[String]>::to_vec)) {
            Some(names) => Ok((names, 1)),
            // Rows of numbers from the first line on, whose names the experiment file may have.
            None if words.len() == count => Ok((words, 1)),
            None => {
                let (count_of_words, line) = (words.len(), head.number(header));
                let found = format!(
                    "{count_of_words} words in line {line} above rows of {count} numbers between blanks"
                );
                let expected = format!(
                    "a name for each column, in the file or in the settings: `format = {{ kind = \"csv\", columns = {} }}` in the \
                     table that names the file",
                    example_names(count)
                );
                Err(FormatError::not_recognised(found, expected))
            }
        };
    }
    let mut split = Split::default();
    let mut row = line.to_vec();
    let mut lines = 1;
    loop {
        row.push(b'\n');
        let last = header + lines >= head.len();
        if split.row(&row, separator, last).is_some() {
            return Ok((split.iter().map(text).collect(), lines));
        }
        row.extend_from_slice(head.line(header + lines));
        lines += 1;
    }
}

fn line_index(head: &TextHead, line: u64, key: &str) -> Result<usize> {
    (0..head.len()).find(|index| head.number(*index) == line).ok_or_else(|| {
        let expected = "a line of the beginning of the file, the first of which is 1";
        FormatError::not_recognised(format!("`{key} = {line}` in the settings"), expected)
    })
}

/// Whether a line holds units for these names and nothing else.
fn is_units(head: &TextHead, index: usize, separator: u8, names: &[String]) -> bool {
    let cells = head.cells(index, separator);
    let unit = |cell: &String| cell.is_empty() || unit_cell(cell).is_some();
    cells.len() == names.len() && cells.iter().all(unit) && cells.iter().any(|cell| !cell.is_empty())
}

/// How many cells a row has, and whether a separator may stand behind the last.
fn width(head: &TextHead, first_row: usize, separator: u8, names: &[String]) -> (usize, bool) {
    let rows = || head.rows(first_row).take(ROWS).map(|row| head.cells(row, separator));
    let last_empty = |row: &Vec<String>| row.last().is_some_and(String::is_empty);
    let count = names.len();
    if count > 1 && names.last().is_some_and(String::is_empty) {
        let fits = |row: Vec<String>| row.len() + 1 == count || row.len() == count && last_empty(&row);
        if rows().all(fits) {
            return (count - 1, true);
        }
    }
    let one_more = |row: Vec<String>| row.len() == count + 1 && last_empty(&row);
    (count, count > 1 && rows().next().is_some() && rows().all(one_more))
}

/// Which rows below a line, perhaps behind a line of units, have as many cells as it and a number in one of them.
#[derive(Clone, Copy, PartialEq, Eq)]
enum RowsBelow {
    /// The first.
    First,
    /// Others.
    Some,
    None,
}

fn rows_below(head: &TextHead, header: usize, hints: &Hints) -> RowsBelow {
    // What may be separated in two ways is refused where it is separated.
    let Ok(separator) = marks::separator(head, header, &hints.csv) else { return RowsBelow::First };
    let Ok((names, lines)) = names(head, header, separator, hints.columns.as_deref()) else {
        return RowsBelow::First;
    };
    if names.first().is_some_and(|name| preamble::is_key(name)) {
        return RowsBelow::None;
    }
    let fits = |row: usize| {
        let cells = head.cells(row, separator);
        let count = cells.len() == names.len() || cells.len() == names.len() + 1 && names.len() > 1;
        count && cells.iter().any(|cell| is_number(cell))
    };
    let mut rows =
        head.rows(header + lines).take(ROWS).skip_while(|row| is_units(head, *row, separator, &names));
    // A word and a number may be a setting, or a label and its value.
    let is_setting = |row: usize| {
        let cells = head.cells(row, separator);
        let numbers = cells.iter().filter(|cell| is_number(cell)).count();
        2 * numbers <= cells.len() && cells.first().is_some_and(|cell| !is_number(cell))
    };
    match rows.next() {
        Some(first) if fits(first) && !is_setting(first) => RowsBelow::First,
        Some(first) if fits(first) => RowsBelow::Some,
        _ if rows.any(fits) => RowsBelow::Some,
        _ => RowsBelow::None,
    }
}

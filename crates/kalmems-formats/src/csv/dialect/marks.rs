//! What separates cells, and the decimal mark.

use super::head::{TextHead, cells, text};
use crate::csv::grouped::grouped;
use crate::csv::split::{BLANKS, Split};
use crate::time::parse_iso;
use crate::{CsvHints, FormatError, Result};
use std::collections::BTreeSet;

/// What can separate cells, and what it is called.
const SEPARATORS: [(u8, &str); 5] =
    [(b',', "commas"), (b';', "semicolons"), (b'\t', "tabs"), (b'|', "bars"), (BLANKS, "blanks")];

/// Those that are bytes.
pub(super) const BYTES: [u8; 4] = [b',', b';', b'\t', b'|'];

/// Rows that are looked at.
const ROWS: usize = 64;

/// The plural of a separator's name.
pub(super) fn name(separator: u8) -> &'static str {
    SEPARATORS.iter().find(|(byte, _)| *byte == separator).map_or("?", |(_, name)| name)
}

/// The separator that a line for spreadsheets says: `sep=;`.
pub(super) fn declared_separator(line: &[u8]) -> Option<char> {
    let line = line.strip_prefix(b"\"").and_then(|rest| rest.strip_suffix(b"\"")).unwrap_or(line);
    let (key, said) = line.split_at_checked(4)?;
    let said = if key.eq_ignore_ascii_case(b"sep=") { said } else { return None };
    match said {
        // The tab is white space at the end of the line.
        b"" | b"\\t" => Some('\t'),
        [byte] if BYTES.contains(byte) => Some(char::from(*byte)),
        _ => None,
    }
}

/// What stands in a cell behind the name of its column.
pub(in crate::csv) fn behind_name(cell: &[u8]) -> &[u8] {
    let name = cell.iter().position(|byte| *byte == b':').map_or(0, |place| place + 1);
    cell.get(name..).unwrap_or_default().trim_ascii()
}

/// Whether a cell is a number, with whichever decimal mark.
pub(super) fn is_number(cell: &str) -> bool {
    let plain = !cell.ends_with(',') && !cell.is_empty();
    plain && fast_float2::parse::<f64, _>(cell.replace(',', ".").replace('−', "-")).is_ok()
}

/// Whether a cell is a number, a date or a time of day, and no name.
pub fn is_value(cell: &str) -> bool {
    is_number(cell) || parse_iso(cell.as_bytes()).is_some()
}

/// The cells of the rows from a line on whose digits stand in groups that can mean nothing else.
pub(super) fn grouped_cells(head: &TextHead, first_row: usize, separator: u8, point: u8) -> BTreeSet<usize> {
    let is_sure = |text: &str| grouped(text.as_bytes(), point).is_some_and(|number| !number.is_ambiguous);
    let of_row = |row: usize| {
        head.cells(row, separator)
            .into_iter()
            .enumerate()
            .filter(|(_, text)| is_sure(text))
            .map(|(cell, _)| cell)
    };
    head.rows(first_row).take(ROWS).flat_map(of_row).collect()
}

/// How many cells the rows from a line on have, where all have as many and at least half of them are numbers; a line
/// without any number may come first.
pub(super) fn cells_of_rows(head: &TextHead, from: usize, separator: u8) -> Option<usize> {
    let numbers = |row: &Vec<String>| row.iter().filter(|cell| is_number(cell)).count();
    let mut rows = head.rows(from).take(ROWS).map(|row| head.cells(row, separator)).peekable();
    rows.next_if(|row| numbers(row) == 0);
    let count = rows.peek()?.len();
    rows.all(|row| row.len() == count && numbers(&row) * 2 >= count).then_some(count)
}

/// As many names in a line, whichever of several ways it is written in.
pub(super) fn names(line: &[u8], separator: u8, count: usize) -> Option<Vec<String>> {
    let wide = || String::from_utf8_lossy(line).replace("  ", "\t");
    let ways: [&dyn Fn() -> Vec<String>; 4] = [
        &|| cells(line, separator),
        &|| {
            BYTES.iter().map(|byte| cells(line, *byte)).find(|cells| cells.len() == count).unwrap_or_default()
        },
        // `Time (s) Input (V)`
        &|| {
            let mut words: Vec<String> = Vec::new();
            for word in cells(line, BLANKS) {
                match words.last_mut() {
                    Some(last) if word.starts_with(['(', '[']) => *last = format!("{last} {word}"),
                    _ => words.push(word),
                }
            }
            words
        },
        &|| cells(wide().as_bytes(), b'\t').into_iter().filter(|cell| !cell.is_empty()).collect(),
    ];
    let names = ways.iter().map(|way| way()).find(|names| names.len() == count)?;
    (!names.iter().all(|name| is_number(name)) && names.iter().any(|name| !name.is_empty())).then_some(names)
}

/// What separates the cells below the names in a line: what the experiment file says, else the only one of the known ones
/// that occurs in the names, or the only one by which the rows have as many cells. Blanks separate what is numbers by
/// them and by nothing else.
pub(super) fn separator(head: &TextHead, header: usize, hints: &CsvHints) -> Result<u8> {
    if let Some(hint) = hints.separator {
        return u8::try_from(hint)
            .ok()
            .filter(|byte| SEPARATORS.iter().any(|(known, _)| known == byte))
            .ok_or_else(|| {
                let found = format!("`separator = {hint:?}` in the settings");
                FormatError::not_recognised(found, "\",\", \";\", \"|\", \"\\t\" or \" \"")
            });
    }
    let count = |index: usize, separator: u8| head.cells(index, separator).len();
    let found: Vec<u8> = BYTES.into_iter().filter(|byte| count(header, *byte) > 1).collect();
    let blanks = || cells_of_rows(head, header + 1, BLANKS).filter(|cells| *cells > 1);
    let (first, others) = match found.as_slice() {
        [] => return Ok(if blanks().is_some() { BLANKS } else { b',' }),
        [only] => {
            let by_blanks = blanks().is_some_and(|cells| cells == count(header, *only));
            let one_cell = head.rows(header + 1).take(ROWS).all(|row| count(row, *only) == 1);
            return Ok(if by_blanks && one_cell { BLANKS } else { *only });
        }
        [first, others @ ..] => (*first, others),
    };
    let fits = |separator: &u8| {
        let names = count(header, *separator);
        head.rows(header + 1).take(ROWS).all(|row| count(row, *separator) == names)
    };
    let fitting: Vec<u8> = found.iter().copied().filter(fits).collect();
    if let [only] = fitting.as_slice() {
        return Ok(*only);
    }
    let ways: Vec<&str> = std::iter::once(&first).chain(others).map(|byte| name(*byte)).collect();
    let (line, ways) = (head.number(header), ways.join(" or "));
    let expected = "the settings to say which: `format = { kind = \"csv\", separator = \",\" }` in the table that \
                    names the file";
    Err(FormatError::not_recognised(
        format!("the names in line {line} could be separated by {ways}"),
        expected,
    ))
}

/// What separates the cells of rows without names above them, and how many they are.
pub(super) fn separator_of_rows(head: &TextHead, hints: &CsvHints) -> Option<(u8, usize)> {
    let numbers = |separator: &u8| {
        let all =
            head.rows(0).take(ROWS).all(|row| head.cells(row, *separator).iter().all(|cell| is_number(cell)));
        all.then(|| cells_of_rows(head, 0, *separator)).flatten()
    };
    let count = |separator: u8| cells_of_rows(head, 0, separator).map(|cells| (separator, cells));
    if let Some(hint) = hints.separator {
        return count(u8::try_from(hint).ok()?);
    }
    // All numbers first, so that decimal commas between blanks are not taken for separators.
    let several =
        |separator: &u8| numbers(separator).filter(|cells| *cells > 1).map(|cells| (*separator, cells));
    let ways = || BYTES.iter().copied().chain([BLANKS]);
    ways()
        .find_map(|separator| several(&separator))
        .or_else(|| ways().find_map(|separator| count(separator).filter(|(_, cells)| *cells > 1)))
        .or_else(|| count(b','))
}

/// The decimal mark of the rows from a line on.
pub(super) fn point(head: &TextHead, first_row: usize, separator: u8, hints: &CsvHints) -> Result<u8> {
    match (hints.decimal, separator) {
        (Some(','), b',') => {
            let found = "`decimal = \",\"` in the settings, and commas between the cells";
            return Err(FormatError::not_recognised(found, "another separator, or `decimal = \".\"`"));
        }
        (Some(','), _) => return Ok(b','),
        (Some('.'), _) | (None, b',') => return Ok(b'.'),
        (Some(other), _) => {
            let found = format!("`decimal = {other:?}` in the settings");
            return Err(FormatError::not_recognised(found, "\".\" or \",\""));
        }
        (None, _) => {}
    }
    let mut found = [None, None];
    let mut split = Split::default();
    // Of `1.234,50` the last mark is the decimal one.
    let sure = |point: u8| {
        let both =
            |cell: &String| grouped(cell.as_bytes(), point).is_some() && cell.contains(char::from(point));
        head.rows(first_row).take(ROWS).any(|row| head.cells(row, separator).iter().any(both))
    };
    if let (true, false) | (false, true) = (sure(b','), sure(b'.')) {
        return Ok(if sure(b',') { b',' } else { b'.' });
    }
    for row in head.rows(first_row).take(ROWS) {
        split.row(head.line(row), separator, true);
        for cell in split.iter() {
            let comma = usize::from(cell.contains(&b','));
            if (comma == 1) != cell.contains(&b'.') && is_number(&text(cell)) {
                let example = found.get_mut(comma);
                example.map(|e| e.get_or_insert_with(|| (text(cell), head.number(row))));
            }
        }
    }
    match found {
        [Some((point, line)), Some((comma, other))] => {
            let found = format!("`{point}` in line {line} and `{comma}` in line {other}");
            let expected = "one decimal mark, which the settings can say: `format = { kind = \"csv\", decimal = \
                            \",\" }` in the table that names the file";
            Err(FormatError::not_recognised(found, expected))
        }
        [None, Some(_)] => Ok(b','),
        _ => Ok(b'.'),
    }
}

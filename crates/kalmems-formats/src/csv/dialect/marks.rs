//! What separates cells, and the decimal mark.

use super::head::Head;
use crate::csv::split::Split;
use crate::{CsvHints, FormatError};

/// What can separate cells, and what it is called.
const SEPARATORS: [(u8, &str); 4] = [(b',', "commas"), (b';', "semicolons"), (b'\t', "tabs"), (b'|', "bars")];

/// Rows that are looked at.
const ROWS: usize = 64;

/// The plural of a separator's name.
pub(super) fn name(separator: u8) -> &'static str {
    SEPARATORS.iter().find(|(byte, _)| *byte == separator).map_or("?", |(_, name)| name)
}

/// What separates the names in a line: what the experiment file says, else the only one of the known ones that occurs, or
/// the only one by which the rows have as many cells.
pub(super) fn separator(head: &Head, header: usize, hints: &CsvHints) -> Result<u8, FormatError> {
    if let Some(hint) = hints.separator {
        return u8::try_from(hint)
            .ok()
            .filter(|byte| SEPARATORS.iter().any(|(known, _)| known == byte))
            .ok_or_else(|| FormatError::NotRecognised {
                found: format!("`separator = {hint:?}` in the experiment file"),
                expected: "\",\", \";\", \"|\" or \"\\t\"".to_owned(),
            });
    }
    let count = |index: usize, separator: u8| head.cells(index, separator).len();
    let found: Vec<u8> =
        SEPARATORS.iter().map(|(byte, _)| *byte).filter(|byte| count(header, *byte) > 1).collect();
    let (first, others) = match found.as_slice() {
        [] => return Ok(b','),
        [only] => return Ok(*only),
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
    let others: Vec<&str> = others.iter().map(|byte| name(*byte)).collect();
    Err(FormatError::NotRecognised {
        found: format!(
            "the names in line {} could be separated by {} or {}",
            head.number(header),
            name(first),
            others.join(" or ")
        ),
        expected:
            "the experiment file to say which: `format = { kind = \"csv\", separator = \",\" }` in its \
                   [[recording]]"
                .to_owned(),
    })
}

/// The decimal mark of the rows from a line on.
pub(super) fn point(
    head: &Head,
    first_row: usize,
    separator: u8,
    hints: &CsvHints,
) -> Result<u8, FormatError> {
    match (hints.decimal, separator) {
        (Some(','), b',') => {
            return Err(FormatError::NotRecognised {
                found: "`decimal = \",\"` in the experiment file, and commas between the cells".to_owned(),
                expected: "another separator, or `decimal = \".\"`".to_owned(),
            });
        }
        (Some(','), _) => return Ok(b','),
        (Some('.'), _) | (None, b',') => return Ok(b'.'),
        (Some(other), _) => {
            return Err(FormatError::NotRecognised {
                found: format!("`decimal = {other:?}` in the experiment file"),
                expected: "\".\" or \",\"".to_owned(),
            });
        }
        (None, _) => {}
    }
    let mut found = [None, None];
    let mut split = Split::default();
    for row in head.rows(first_row).take(ROWS) {
        split.row(head.line(row), separator, true);
        for cell in split.iter() {
            let comma = usize::from(cell.contains(&b','));
            let number: Vec<u8> = cell.iter().map(|b| if *b == b',' { b'.' } else { *b }).collect();
            if (comma == 1) != cell.contains(&b'.') && fast_float2::parse::<f64, _>(&number).is_ok() {
                let example = found.get_mut(comma);
                example.map(|e| e.get_or_insert_with(|| (super::head::text(cell), head.number(row))));
            }
        }
    }
    match found {
        [Some((point, line)), Some((comma, other))] => Err(FormatError::NotRecognised {
            found: format!("`{point}` in line {line} and `{comma}` in line {other}"),
            expected:
                "one decimal mark, which the experiment file can say: `format = { kind = \"csv\", decimal = \
                       \",\" }` in its [[recording]]"
                    .to_owned(),
        }),
        [None, Some(_)] => Ok(b','),
        _ => Ok(b'.'),
    }
}

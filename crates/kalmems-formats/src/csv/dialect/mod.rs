//! Which dialect a text is written in, told from its beginning.

mod generic;
mod head;
mod instruments;
mod labview;
mod marks;
mod units;

use super::input::Input;
use super::split::Split;
use crate::{Column, FormatError, Hints};
use head::Head;

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

/// What the beginning of a text tells.
struct Found {
    /// The instrument or program, where its preamble is known.
    instrument: Option<&'static str>,
    separator: u8,
    point: u8,
    /// The lines, counted in the head, of the names and of the first row.
    header: usize,
    first_row: usize,
    /// How many cells a row has, and whether a separator may stand behind them.
    cells: usize,
    trailing: bool,
    /// Names, units in them, and where their values come from.
    columns: Vec<(String, Origin)>,
    /// Where the units are from, for people; empty where the names have them as a matter of course.
    units: String,
}

/// Tells the dialect and takes all that comes before the first row.
pub(super) fn recognise(input: &mut Input, hints: &Hints) -> Result<Dialect, FormatError> {
    if !input.more()? {
        return Ok(nothing());
    }
    let start = input.lines();
    if start.starts_with(b"\xff\xfe") || start.starts_with(b"\xfe\xff") {
        return Err(FormatError::Unsupported {
            format: "CSV",
            what: "text in UTF-16".to_owned(),
            remedy: "save it as UTF-8".to_owned(),
        });
    }
    if start.starts_with(b"\xef\xbb\xbf") {
        input.take(3);
    }
    let mut line = 1;
    // Comments and blank lines before the header, whose line may be said.
    while hints.csv.header_line.is_none() {
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
    let wanted = LINES + usize::try_from(hints.csv.header_line.unwrap_or(0)).unwrap_or(LINES).min(1 << 16);
    while input.lines().len() < BYTES
        && memchr::memchr_iter(b'\n', input.lines()).count() < wanted
        && input.more()?
    {}
    if let Some(place) = memchr::memchr(0, input.lines()) {
        return Err(FormatError::NotRecognised {
            found: format!("a byte that is no text, {place} bytes from line {line} on"),
            expected: "text".to_owned(),
        });
    }
    let head = Head::new(input.lines(), line, wanted);
    if head.len() == 0 {
        return Ok(nothing());
    }
    let found = match hints.csv.header_line {
        None => match instruments::find(&head, &hints.csv)? {
            Some(found) => found,
            None => generic::find(&head, 0, hints)?,
        },
        Some(header) => {
            let index = usize::try_from(header.saturating_sub(1)).ok().filter(|index| *index < head.len());
            let index = index.ok_or_else(|| FormatError::NotRecognised {
                found: format!("`header_line = {header}` in the experiment file and {} lines", head.len()),
                expected: "a line of the beginning of the file, the first of which is 1".to_owned(),
            })?;
            generic::find(&head, index, hints)?
        }
    };
    let (dialect, bytes) = finish(found, &head, hints)?;
    input.take(bytes);
    Ok(dialect)
}

/// The dialect in words and numbers, and the bytes before its first row.
fn finish(mut found: Found, head: &Head, hints: &Hints) -> Result<(Dialect, usize), FormatError> {
    if found.columns.len() > MOST_COLUMNS || found.cells > MOST_COLUMNS {
        return Err(FormatError::TooLarge {
            format: "CSV",
            what: "the number of columns".to_owned(),
            found: found.cells as u64,
            limit: MOST_COLUMNS as u64,
        });
    }
    if let Some(names) = &hints.columns {
        if names.len() != found.columns.len() {
            let present: Vec<String> =
                found.columns.iter().take(20).map(|(name, _)| format!("`{name}`")).collect();
            return Err(FormatError::NotRecognised {
                found: format!("{} columns: {}", found.columns.len(), present.join(", ")),
                expected: format!(
                    "as many as `columns` in the experiment file names, which are {}",
                    names.len()
                ),
            });
        }
        for ((name, _), given) in found.columns.iter_mut().zip(names) {
            name.clone_from(given);
        }
    }
    let mut words = Vec::new();
    words.extend(found.instrument.map(|instrument| format!("written by {instrument}")));
    words.push(if found.cells == 1 {
        "one column".to_owned()
    } else {
        format!("separated by {}", marks::name(found.separator))
    });
    if found.point == b',' {
        words.push("decimal commas".to_owned());
    }
    if head.number(found.header) != 1 && found.first_row > found.header {
        words.push(format!("names in line {}", head.number(found.header)));
    }
    if hints.columns.is_some() {
        words.push("names from the experiment file".to_owned());
    } else if !found.units.is_empty() {
        words.push(found.units.clone());
    }
    for (name, origin) in &found.columns {
        match origin {
            Origin::Cell(_) => {}
            Origin::Affine { start, step, .. } | Origin::Counted { start, step } => {
                words.push(format!("`{name}` from {start:?} on in steps of {step:?}, as the header says"));
            }
        }
    }
    let column = |(name, origin): (String, Origin)| DialectColumn { column: Column::new(&name), origin };
    let dialect = Dialect {
        separator: found.separator,
        point: found.point,
        header_line: head.number(found.header),
        first_row_line: head.number(found.first_row),
        cells: found.cells,
        trailing: found.trailing,
        columns: found.columns.into_iter().map(column).collect(),
        recognised: words.join(", "),
    };
    Ok((dialect, head.bytes_before(found.first_row)))
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

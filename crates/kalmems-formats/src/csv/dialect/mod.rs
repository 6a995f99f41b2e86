//! Which dialect a text is written in, told from its beginning.

mod comments;
mod generic;
mod head;
mod instruments;
pub(super) mod marks;
mod named_cells;
mod preamble;
mod units;

use super::input::CsvInput;
use super::split::Split;
use crate::clock::{RegularTimes, rows_between};
use crate::stated_clock::{StatedNumbers, names_a_time};
use crate::time::{IsoTime, TimeKind, parse_iso};
use crate::{Column, FormatError, Hints, Result, TableEvidence, limits};
use comments::Comments;
use head::TextHead;
pub(super) use instruments::Heading;
pub use marks::is_value;
use std::collections::BTreeSet;

/// As many lines are looked at, or as many bytes where lines are long.
const LINES: usize = 128;
/// The same where nothing but settings is in them.
const LONGEST: usize = 1024;
const BYTES: usize = 1 << 20;

/// A text with more columns is not read.
const MOST_COLUMNS: usize = 10_000;

/// How a text is written.
#[derive(Default)]
pub(super) struct Dialect {
    pub(super) text: RecognizedText,
    /// The decimal mark.
    pub(super) point: u8,
    /// The line of the first row.
    pub(super) first_row_line: u64,
    pub(super) columns: Vec<DialectColumn>,
    /// The cells of a row whose digits stand in groups beyond doubt.
    pub(super) grouped: BTreeSet<usize>,
    /// By what it is known to be a table of numbers.
    pub(super) evidence: TableEvidence,
    /// All of this for people.
    pub(super) recognised: String,
}

/// A column and where its values come from.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct DialectColumn {
    pub(super) column: Column,
    pub(super) origin: ColumnOrigin,
    /// Where its cells are dates or times of a day as text.
    pub(super) time: Option<TimeKind>,
}

/// Where the values of a column come from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum ColumnOrigin {
    /// A cell of the row.
    Cell(usize),
    /// A cell whose value belongs to so many rows later, as its waveform begins later than others.
    Later { cell: usize, rows: u64 },
    /// A cell times a step that the header states, after a start.
    Affine { cell: usize, start: f64, step: f64 },
    /// The rows of the record, counted from 0, times a step that the header states, after a start.
    Counted { start: f64, step: f64 },
    /// The number of the record in the file, counted from 1.
    Record,
}

/// Columns with their units in their names, and where their values come from.
pub(super) type NamedColumns = Vec<(String, ColumnOrigin)>;

/// How rows make records, where a file tells.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) enum RecordShape {
    /// All rows are one, or a column tells them apart.
    #[default]
    One,
    /// So many rows each.
    OfRows(u64),
    /// Each begins with a header of its own.
    Headed(Heading),
}

impl ColumnOrigin {
    /// A cell whose value belongs to so many rows later.
    pub(super) const fn later(cell: usize, rows: u64) -> Self {
        if rows == 0 { Self::Cell(cell) } else { Self::Later { cell, rows } }
    }

    /// The cell, where there is one.
    pub(super) const fn cell(self) -> Option<usize> {
        match self {
            Self::Cell(cell) | Self::Later { cell, .. } | Self::Affine { cell, .. } => Some(cell),
            Self::Counted { .. } | Self::Record => None,
        }
    }
}

/// What the beginning of a text tells.
#[derive(Default)]
pub(super) struct RecognizedText {
    /// The instrument or program, where its preamble is known.
    instrument: Option<&'static str>,
    pub(super) separator: u8,
    /// The decimal mark, once it is known.
    point: Option<u8>,
    /// The line of the names in the file, and that of the first row in the head.
    pub(super) header_line: u64,
    first_row: usize,
    /// How many cells a row has, and whether a separator, or one with remarks behind it, may stand behind them.
    pub(super) cells: usize,
    pub(super) trailing: bool,
    remarks: bool,
    /// Whether each cell begins with the name of its column: `ax:1.5`.
    pub(super) named_cells: bool,
    /// Names, units in them, and where their values come from.
    columns: NamedColumns,
    /// Columns of times of their own, each with its waveform's, behind those of the first waveform, which are the first two; once they are
    /// compared all waveforms that stand beside each other, with the first column as the times of the rows.
    pub(super) own_times: Vec<(usize, usize)>,
    /// What the lines before the rows state of a clock.
    clock: StatedNumbers,
    /// Where the units are from, for people; empty where the names have them as a matter of course.
    units: String,
    pub(super) records: RecordShape,
}

impl RecognizedText {
    /// How many rows a record has, where that is stated.
    pub(super) const fn record_rows(&self) -> Option<u64> {
        match self.records {
            RecordShape::OfRows(rows) => Some(rows),
            _ => None,
        }
    }

    /// Whether a row has as many cells as it should.
    pub(super) fn fits(&self, row: &Split) -> bool {
        let last = row.cell(self.cells);
        // LabChart writes comments so.
        let behind = self.trailing && (self.remarks || last.is_empty()) || last.starts_with(b"#*");
        row.len() == self.cells || row.len() == self.cells + 1 && behind
    }
}

/// Tells the dialect and takes all that comes before the first row.
pub(super) fn recognise(input: &mut CsvInput, hints: &Hints) -> Result<Dialect> {
    if !input.more()? {
        return Ok(nothing());
    }
    if input.lines().starts_with(b"\xef\xbb\xbf") {
        input.take(3);
    }
    let mut line = 1;
    let mut comments = Comments::default();
    let mut csv = hints.csv.clone();
    // Comments and blank lines before the header, whose line may be said.
    while hints.csv.header_line.is_none() {
        let lines = input.lines();
        let Some(end) = memchr::memchr(b'\n', lines) else {
            if input.more()? {
                continue;
            }
            return Ok(nothing());
        };
        let first = lines.get(..end).unwrap_or_default().trim_ascii();
        if line == 1
            && let Some(separator) = marks::declared_separator(first)
        {
            csv.separator = csv.separator.or(Some(separator));
        } else if !first.is_empty() && !comments.take(first, line) {
            break;
        }
        input.take(end + 1);
        line += 1;
    }
    let said = hints.csv.header_line.map_or(0, |line| usize::try_from(line).unwrap_or(LINES).min(1 << 16));
    let mut wanted = LINES + said + instruments::lines(&TextHead::new(input.lines(), line, 2));
    loop {
        let count = || memchr::memchr_iter(b'\n', input.lines()).count();
        if count() >= wanted {
            let goes_on = preamble::goes_on(&TextHead::new(input.lines(), line, wanted));
            if !goes_on || wanted >= LONGEST {
                break;
            }
            wanted += LINES;
        } else if input.lines().len() >= BYTES || !input.more()? {
            break;
        }
    }
    if let Some(place) = memchr::memchr(0, input.lines()) {
        let found = format!("a byte that is no text, {place} bytes from line {line} on");
        return Err(FormatError::not_recognised(found, "text"));
    }
    let head = TextHead::new(input.lines(), line, wanted);
    if head.len() == 0 {
        return Ok(nothing());
    }
    if head.line(0).trim_ascii_end().contains(&b'\r') {
        let expected = "lines that end with a line feed: convert the file, such as with `tr '\\r' '\\n'`";
        return Err(FormatError::not_recognised("lines that end with a carriage return alone", expected));
    }
    let hints = &Hints { csv, ..hints.clone() };
    let found = match hints.csv.header_line {
        None => match (instruments::find(&head, &hints.csv)?, named_cells::find(&head, &hints.csv)) {
            (Some(found), _) | (None, Some(found)) => found,
            (None, None) => generic::find(&head, 0, &comments, hints)?,
        },
        Some(header) => {
            let index = usize::try_from(header.saturating_sub(1)).ok().filter(|index| *index < head.len());
            let index = index.ok_or_else(|| {
                let found = format!("`header_line = {header}` in the settings and {} lines", head.len());
                let expected = "a line of the beginning of the file, the first of which is 1";
                FormatError::not_recognised(found, expected)
            })?;
            generic::find(&head, index, &comments, hints)?
        }
    };
    let (mut dialect, bytes) = finish(found, &head, hints)?;
    if input.is_wide() {
        dialect.recognised = format!("UTF-16, {}", dialect.recognised);
    }
    input.take(bytes);
    Ok(dialect)
}

/// The dialect in words and numbers, and the bytes before its first row.
fn finish(mut found: RecognizedText, head: &TextHead, hints: &Hints) -> Result<(Dialect, usize)> {
    let columns = found.columns.len().max(found.cells);
    limits::at_most("CSV", "the number of columns", columns, MOST_COLUMNS)?;
    if let Some(names) = &hints.columns {
        if names.len() != found.columns.len() {
            let mut present = match found.columns.len() {
                1 => "1 column".to_owned(),
                count => format!("{count} columns"),
            };
            if found.columns.len() > 1 && evidence(head, &found) == TableEvidence::Rows {
                let names: Vec<String> =
                    found.columns.iter().take(20).map(|(name, _)| format!("`{name}`")).collect();
                present += &format!(": {}", names.join(", "));
            }
            let expected = format!("as many as `columns` in the settings names, which are {}", names.len());
            return Err(FormatError::not_recognised(present, expected));
        }
        for ((name, _), given) in found.columns.iter_mut().zip(names) {
            name.clone_from(given);
        }
    }
    let apart = align(head, &mut found);
    let mut words = Vec::new();
    words.extend(found.instrument.map(|instrument| format!("written by {instrument}")));
    words.push(if found.cells == 1 {
        "one column".to_owned()
    } else {
        format!("separated by {}", marks::name(found.separator))
    });
    let point = found.point.unwrap_or(b'.');
    if point == b',' {
        words.push("decimal commas".to_owned());
    }
    if found.header_line != 1 && found.header_line < head.number(found.first_row) {
        words.push(format!("names in line {}", found.header_line));
    }
    if hints.columns.is_some() {
        words.push("names from the settings".to_owned());
    } else if !found.units.is_empty() {
        words.push(found.units.clone());
    }
    let (mut times, evidence) = (times(head, &found), evidence(head, &found));
    if let Some(RegularTimes { start_s: start, step, .. }) = found.clock.regular_times()
        && times.iter().all(Option::is_none)
        && !found.columns.iter().any(|(name, _)| may_be_time(name))
    {
        let step = step.interval_s();
        found.columns.insert(0, ("time_s".to_owned(), ColumnOrigin::Counted { start, step }));
        times.insert(0, None);
    }
    for (name, origin) in &found.columns {
        match origin {
            ColumnOrigin::Cell(_) | ColumnOrigin::Record => {}
            ColumnOrigin::Later { rows, .. } => words.push(format!("`{name}` begins {rows} samples later")),
            ColumnOrigin::Affine { start, step, .. } | ColumnOrigin::Counted { start, step } => {
                words.push(format!("`{name}` from {start:?} on in steps of {step:?}, as the header says"));
            }
        }
    }
    let grouped = match hints.csv.decimal {
        // A decimal mark that is stated leaves no doubt.
        Some(_) => (0..found.cells).collect(),
        None => marks::grouped_cells(head, found.first_row, found.separator, point),
    };
    let column = |((name, origin), time): ((String, ColumnOrigin), Option<TimeKind>)| DialectColumn {
        column: Column::new(&name),
        origin,
        time,
    };
    let mut columns: Vec<DialectColumn> =
        std::mem::take(&mut found.columns).into_iter().zip(times).map(column).collect();
    for (number, (column, why)) in apart.into_iter().enumerate() {
        if let Some(DialectColumn { column, .. }) = columns.get_mut(column) {
            // A waveform and its times are two of the columns.
            (column.apart, column.group) = (Some(why), 1 + number / 2);
        }
    }
    let (first_row_line, bytes) = (head.number(found.first_row), head.bytes_before(found.first_row));
    let recognised = words.join(", ");
    Ok((Dialect { text: found, point, first_row_line, columns, grouped, evidence, recognised }, bytes))
}

/// Puts waveforms with times of their own to the rows of their times, as far as the first rows show these; the times of the rows are those
/// of the earliest. Which columns do not stand beside the first waveform, and why.
fn align(head: &TextHead, found: &mut RecognizedText) -> Vec<(usize, String)> {
    let rows: Vec<Vec<String>> =
        head.rows(found.first_row).map(|row| head.cells(row, found.separator)).collect();
    let times = |found: &RecognizedText, column: usize| -> Vec<f64> {
        let cell = found.columns.get(column).and_then(|(_, origin)| origin.cell());
        let number = |row: &Vec<String>| fast_float2::parse(row.get(cell?)?.replace(',', ".")).ok();
        rows.iter().map(|row| number(row).unwrap_or(f64::NAN)).take_while(|time| !time.is_nan()).collect()
    };
    let name = |column: usize| found.columns.get(column).map_or("", |(name, _)| name.as_str());
    let (first, mut apart, mut aligned) = (times(found, 0), Vec::new(), vec![((0, 1), 0)]);
    for (time, waveform) in found.own_times.iter().copied() {
        match rows_between((&first, name(1)), &times(found, time)) {
            Ok(rows) if rows == 0 || found.records == RecordShape::One => {
                aligned.push(((time, waveform), rows));
            }
            Ok(_) => apart.push((waveform, "it begins later in a file of several records".to_owned())),
            Err(why) => apart.push((waveform, why)),
        }
        if let Some((_, why)) = apart.last().filter(|(column, _)| *column == waveform) {
            apart.push((time, why.clone()));
        }
    }
    let Some(((clock, _), earliest)) = aligned.iter().min_by_key(|(_, rows)| *rows).copied() else {
        return apart;
    };
    for ((time, waveform), rows) in &aligned {
        for column in [*time, *waveform] {
            if let Some((_, ColumnOrigin::Cell(cell))) = found.columns.get(column).cloned() {
                found.columns[column].1 = ColumnOrigin::later(cell, rows.abs_diff(earliest));
            }
        }
    }
    if clock != 0 {
        (found.columns[0].1, found.columns[clock].1) = (found.columns[clock].1, found.columns[0].1);
    }
    let other = |((time, waveform), _): ((usize, usize), i64)| match time {
        0 => (clock, waveform),
        time if time == clock => (0, waveform),
        time => (time, waveform),
    };
    if !found.own_times.is_empty() {
        found.own_times = aligned.into_iter().map(other).collect();
    }
    apart
}

/// By what the first lines are known to be those of a table of numbers: below the names there is a row of as many cells, with a
/// number below a name. One column is believed where at least half of the rows hold one, as any text has a line with a number.
fn evidence(head: &TextHead, found: &RecognizedText) -> TableEvidence {
    let numbered = found.columns.iter().filter(|(name, _)| marks::is_number(name));
    // As a program does that has no names.
    let counted = numbered.enumerate().all(|(number, (name, _))| *name == number.to_string());
    let named: Vec<usize> = found
        .columns
        .iter()
        .filter(|(name, _)| counted || !marks::is_number(name))
        .filter_map(|(_, origin)| origin.cell())
        .collect();
    if found.named_cells {
        return TableEvidence::Rows;
    }
    let rows = || head.rows(found.first_row).map(|row| head.cells(row, found.separator));
    let fits = |row: &Vec<String>| row.len() == found.cells || found.trailing && row.len() == found.cells + 1;
    let holds_number = |row: &Vec<String>| {
        fits(row) && named.iter().any(|cell| row.get(*cell).is_some_and(|cell| marks::is_number(cell)))
    };
    let is_table = if found.cells > 1 {
        rows().any(|row| holds_number(&row))
    } else {
        let with_number = rows().filter(holds_number).count();
        with_number > 0 && 2 * with_number >= rows().count()
    };
    if is_table { TableEvidence::Rows } else { TableEvidence::Nothing }
}

/// Whether a column may be the time, by its name or its unit.
fn may_be_time(name: &str) -> bool {
    // What is per second is no time.
    let unit = name.rsplit_once('_').filter(|(before, _)| before.rsplit('_').next() != Some("per"));
    let ending = unit.map_or("", |(_, unit)| unit);
    let words = ["zeit", "temps", "tiempo", "tempo", "tijd", "sec", "clock", "date"];
    let lower = name.to_lowercase();
    names_a_time(name)
        || matches!(ending, "s" | "ms" | "us" | "ns" | "min")
        || words.iter().any(|word| lower.starts_with(word))
}

/// Which columns hold dates and times of a day as text, by the first cell of each that is not empty.
fn times(head: &TextHead, found: &RecognizedText) -> Vec<Option<TimeKind>> {
    /// Rows whose cells may be empty before the first that is not.
    const ROWS: usize = 16;
    let rows: Vec<Vec<String>> =
        head.rows(found.first_row).take(ROWS).map(|row| head.cells(row, found.separator)).collect();
    let kind = |(_, origin): &(String, ColumnOrigin)| {
        let ColumnOrigin::Cell(cell) = *origin else { return None };
        let first = rows.iter().filter_map(|row| row.get(cell)).find(|cell| !cell.is_empty())?;
        Some(match parse_iso(first.as_bytes())? {
            IsoTime::Calendar(_) => TimeKind::Calendar,
            IsoTime::OfDay(_) => TimeKind::Elapsed,
        })
    };
    found.columns.iter().map(kind).collect()
}

/// The dialect of an empty text.
fn nothing() -> Dialect {
    let text = RecognizedText { separator: b',', header_line: 1, ..RecognizedText::default() };
    Dialect { text, point: b'.', first_row_line: 1, recognised: "nothing".to_owned(), ..Dialect::default() }
}

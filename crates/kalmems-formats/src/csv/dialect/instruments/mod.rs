//! Instruments whose texts are known by their first lines: a table of dialects, the layouts that it names, and LabVIEW, whose records have
//! headers of their own.

mod labview;
mod table;
mod titled;
mod waveforms;

pub(in crate::csv) use labview::Heading;
pub(super) use table::InstrumentDialect;

use super::head::TextHead;
use super::units::column_name;
use super::{ColumnOrigin, NamedColumns, RecognizedText, marks};
use crate::{CsvHints, Result};
use table::{Signature, TextLayout};

/// The dialect, where a text is an instrument's, or what is wrong with it.
type DialectSearch = Option<Result<RecognizedText>>;

/// The first lines of a text, and the first of them in cells.
struct TextBeginning<'a> {
    head: &'a TextHead<'a>,
    separator: u8,
    cells: Vec<String>,
}

impl TextBeginning<'_> {
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

    /// Whether the first lines are those of an instrument.
    fn shows(&self, signature: &Signature) -> bool {
        match signature {
            Signature::Comment(_) => false,
            Signature::Line(begin) => (0..2).any(|line| self.head.line(line).starts_with(begin.as_bytes())),
            Signature::Cells(first) => self.cells.get(..first.len()).is_some_and(|cells| cells == *first),
            Signature::Holds(cells) => cells.iter().all(|text| self.cells.iter().any(|cell| cell == text)),
        }
    }

    /// The dialect by a row of the table; `None` where the text lacks what belongs to it.
    fn as_written_by(&self, dialect: &InstrumentDialect) -> DialectSearch {
        match &dialect.layout {
            TextLayout::Plain(_) => None,
            TextLayout::Titled { first_cells, names, units } => {
                titled::find(self, dialect.name, first_cells, (*names, *units))
            }
            TextLayout::Waveforms(keys) => waveforms::find(self, dialect.name, keys).transpose(),
            TextLayout::BesideRows { time, value } => self.beside_rows(dialect.name, *time, *value).map(Ok),
        }
    }

    /// Settings in the first cells of the first rows, times and values behind them in all.
    fn beside_rows(&self, instrument: &'static str, time: usize, value: usize) -> Option<RecognizedText> {
        if [time, value].iter().any(|cell| number(self.cells.get(*cell)).is_none()) {
            return None;
        }
        let stated = |key: &str| self.values(key)?.into_iter().next();
        let source = stated("Source").unwrap_or_else(|| "CH1".to_owned());
        let seconds = stated("Horizontal Units")?.replace('S', "s");
        let columns = vec![
            (column_name("time", Some(&seconds), time), ColumnOrigin::Cell(time)),
            (column_name(&source, stated("Vertical Units").as_deref(), value), ColumnOrigin::Cell(value)),
        ];
        let mut found = self.found(instrument, 0, 0, columns, "settings next to the first rows");
        found.point = Some(b'.');
        Some(found)
    }

    /// The dialect of rows from the line `first_row` on, with names in the line `header`.
    fn found(
        &self,
        instrument: &'static str,
        header: usize,
        first_row: usize,
        columns: NamedColumns,
        units: impl Into<String>,
    ) -> RecognizedText {
        let (cells, trailing) = self.filled(first_row);
        RecognizedText {
            instrument: Some(instrument),
            separator: self.separator,
            header_line: self.head.number(header),
            first_row,
            cells: columns.len().max(cells.len()),
            trailing,
            columns,
            units: units.into(),
            ..RecognizedText::default()
        }
    }
}

/// How many lines a preamble has beyond the usual: one for each segment of a LeCroy.
pub(super) fn lines(head: &TextHead) -> usize {
    /// More are in no file.
    const SEGMENTS: usize = 100_000;
    let stated = head.cells(1, b',').get(1).and_then(|segments| segments.parse::<usize>().ok());
    let segments = stated.filter(|segments| head.line(0).starts_with(b"LECROY") && *segments < SEGMENTS);
    segments.map_or(0, |segments| segments + 8)
}

/// The dialect of a text that begins as an instrument's does.
pub(super) fn find(head: &TextHead, hints: &CsvHints) -> Result<Option<RecognizedText>> {
    let first = head.line(0);
    let separator = [b'\t', b';'].into_iter().find(|byte| first.contains(byte)).unwrap_or(b',');
    let text = TextBeginning { head, separator, cells: head.cells(0, separator) };
    let of_table = || table::ALL.iter().filter(|dialect| text.shows(&dialect.signature));
    let found = labview::find(&text).or_else(|| of_table().find_map(|dialect| text.as_written_by(dialect)));
    let Some(mut found) = found.transpose()? else { return Ok(None) };
    if found.point.is_none() {
        found.point = Some(marks::point(head, found.first_row, found.separator, hints)?);
    }
    Ok(Some(found))
}

/// The instrument whose comments begin like this one.
pub(super) fn of_comment(comment: &[u8]) -> Option<&'static InstrumentDialect> {
    table::ALL.iter().find(|dialect| {
        matches!(dialect.signature, Signature::Comment(begin) if comment.starts_with(begin.as_bytes()))
    })
}

impl InstrumentDialect {
    /// The unit of a column by its name, where the text does not say it; empty where none is known.
    pub(super) fn unit_of(&self, name: &str) -> &'static str {
        match self.layout {
            TextLayout::Plain(units) => unit_of(name, units),
            _ => "",
        }
    }
}

/// The unit of the first name that this one begins with.
fn unit_of(name: &str, units: &[(&str, &'static str)]) -> &'static str {
    units.iter().find(|(begin, _)| name.starts_with(begin)).map_or("", |(_, unit)| unit)
}

fn number(cell: Option<&String>) -> Option<f64> {
    fast_float2::parse(cell?.trim()).ok()
}

/// Names of which none comes twice: a later one gets its number.
fn distinct(names: impl IntoIterator<Item = String>) -> Vec<String> {
    let mut distinct: Vec<String> = Vec::new();
    for name in names {
        let numbered = |count: usize| if count == 1 { name.clone() } else { format!("{name} {count}") };
        let free = (1..=distinct.len() + 1).map(numbered).find(|candidate| !distinct.contains(candidate));
        distinct.extend(free);
    }
    distinct
}

//! Tables whose cells stand at known places of records of one size.

use crate::block::push_label;
use crate::clock::{self, RegularTimes};
use crate::decimal::Shift;
use crate::element::{CellPlaces, Element, shortest};
use crate::limits::{self, BLOCK_BYTES};
use crate::scaling::Scaling;
use crate::sentinels;
use crate::table::{bytes_until, refuse_apart};
use crate::table_parts::TableParts;
use crate::time::TimeCode;
use crate::{
    Arrays, Block, CellFault, CellFinding, Column, Digest, FormatError, Instant, Labels, Result, Table,
    TableDescription, TableEvidence, TimeKind, TimeReader, TimeUnit, WantedColumn,
};
use std::collections::BTreeMap;
use std::ops::Range;

/// Rows that have no value, and what the file has instead.
pub(crate) type AbsentRows = Vec<(usize, CellFinding)>;

/// Records that are read one after the other.
pub(crate) trait RecordLane: Send {
    /// The bytes of one record.
    fn record(&self) -> usize;

    /// The checksum with which the records are compared before they are given, where the format has one.
    fn protection(&self) -> Option<&'static str> {
        None
    }

    /// Reads the next records; `out` holds them and nothing else afterwards.
    fn read(&mut self, rows: usize, out: &mut Vec<u8>) -> Result<()>;

    /// Which of the records that were read last have no value, whatever stands in their place; nothing where all have one.
    fn missing(&self) -> &[bool] {
        &[]
    }

    /// Reads the next texts, where the records are texts of several lengths.
    fn texts(&mut self, _rows: usize, out: &mut Vec<Vec<u8>>) -> Result<()> {
        out.clear();
        Ok(())
    }
}

/// What the cells of a column are.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum CellKind {
    /// At an offset in each record of a lane.
    Stored { lane: usize, offset: usize, cell: StoredCell },
    /// Texts of several lengths, a lane of their own.
    Texts { lane: usize },
    /// Times by regular clocks, the first of which begins with row 0; not in the file.
    Clock(Vec<RegularTimes>),
}

/// What stands at a place of a record.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum StoredCell {
    Number(Element),
    Time(TimeCode),
    /// A text of as many bytes.
    Text {
        bytes: usize,
        code: TextEncoding,
    },
}

impl StoredCell {
    /// How many bytes it takes.
    pub(crate) const fn bytes(self) -> usize {
        match self {
            Self::Number(element) => element.bytes,
            Self::Time(code) => code.bytes(),
            Self::Text { bytes, .. } => bytes,
        }
    }
}

impl CellKind {
    /// The lane that they are in.
    fn lane(&self) -> Option<usize> {
        match self {
            Self::Stored { lane, .. } | Self::Texts { lane } => Some(*lane),
            Self::Clock(_) => None,
        }
    }

    /// Whether they are numbers.
    pub(crate) fn is_numbers(&self) -> bool {
        matches!(self, Self::Stored { cell: StoredCell::Number(_), .. })
    }

    /// Whether they are texts.
    fn is_text(&self) -> bool {
        matches!(self, Self::Stored { cell: StoredCell::Text { .. }, .. } | Self::Texts { .. })
    }

    /// What they are as times, where the file says so.
    pub(crate) fn time(&self) -> Option<TimeCode> {
        match self {
            Self::Stored { cell: StoredCell::Time(code), .. } => Some(*code),
            _ => None,
        }
    }
}

/// How a text of a fixed length is written. It ends with its last character that is neither NUL nor white space.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum TextEncoding {
    /// Bytes as they are.
    Bytes,
    /// UTF-16.
    Utf16 { big_endian: bool },
    /// Four bytes a character.
    Utf32 { big_endian: bool },
}

/// A column and where its cells are.
#[derive(Clone, Debug)]
pub(crate) struct RecordField {
    pub(crate) column: Column,
    pub(crate) cells: CellKind,
    /// As many; a clock has as many as are needed.
    pub(crate) rows: u64,
    /// Its numbers are the stored ones times this power of ten.
    pub(crate) power: i32,
    /// What the file says is to be done to its numbers.
    pub(crate) scaling: Scaling,
}

impl RecordField {
    fn is_clock(&self) -> bool {
        matches!(self.cells, CellKind::Clock(_))
    }

    /// A column whose cells are taken as they are.
    pub(crate) fn new(column: Column, cells: CellKind, rows: u64) -> Self {
        Self { column, cells, rows, power: 0, scaling: Scaling::default() }
    }
}

/// The lengths of the columns, the longest first, and the names of those that have each.
fn lengths(fields: &[RecordField]) -> Vec<(u64, Vec<String>)> {
    let mut lengths = BTreeMap::<u64, Vec<String>>::new();
    for field in fields.iter().filter(|field| !field.is_clock()) {
        lengths.entry(field.rows).or_default().push(format!("`{}`", field.column.name));
    }
    lengths.into_iter().rev().collect()
}

/// A table of records.
pub(crate) struct RecordTable {
    description: TableDescription,
    fields: Vec<RecordField>,
    lanes: Vec<Box<dyn RecordLane>>,
    file_bytes: u64,
    wanted: Vec<WantedColumn>,
    times: TimeReader,
    /// Which lanes are read, and the bytes of their records together.
    used: Vec<bool>,
    row_bytes: usize,
    rows: u64,
    row: u64,
    raw: Vec<Vec<u8>>,
    texts: Vec<Vec<Vec<u8>>>,
    /// Rows of a column that have no value, and what the file has instead.
    absent: AbsentRows,
    /// Rows at which a clock of the file begins anew, and how many are missing before each.
    breaks: Vec<(u64, u64)>,
    /// The arrays that it is made of, if it is no file.
    arrays: Option<Arrays>,
}

impl RecordTable {
    /// Puts a table together. Columns may be of different lengths as long as those that are wanted are not.
    pub(crate) fn new(parts: TableParts, file_bytes: u64) -> Self {
        let TableParts { format, mut recognised, left_out, fields, lanes, .. } = parts;
        let lengths = lengths(&fields);
        let protection = protection(&fields, &lanes);
        let rows = if let [only] = &lengths[..] { Some(only.0) } else { None };
        let own = |field: &RecordField| (lengths.len() > 1 && !field.is_clock()).then_some(field.rows);
        let columns = fields
            .iter()
            .map(|f| Column { text: f.cells.is_text(), rows: own(f), ..f.column.clone() })
            .collect();
        if !left_out.is_empty() {
            recognised.push_str(&format!("; left out: {}", limits::list(&left_out)));
        }
        if lengths.len() > 1 {
            let groups = lengths.iter().map(|(rows, names)| format!("{rows} rows: {}", limits::list(names)));
            let groups: Vec<String> = groups.take(8).collect();
            let (count, groups) = (lengths.len(), groups.join("; "));
            let what = "of which those of one length belong together";
            recognised.push_str(&format!("; columns of {count} lengths, {what} ({groups})"));
        }
        let evidence = TableEvidence::Format;
        let description =
            TableDescription { format, recognised, columns, rows, evidence, left_out, protection };
        let count = lanes.len();
        Self {
            description,
            fields,
            lanes,
            file_bytes,
            wanted: Vec::new(),
            times: TimeReader::new(TimeUnit::SECOND, None),
            used: vec![false; count],
            row_bytes: 0,
            rows: 0,
            row: 0,
            raw: vec![Vec::new(); count],
            texts: vec![Vec::new(); count],
            absent: Vec::new(),
            breaks: Vec::new(),
            arrays: None,
        }
    }

    /// The same of arrays in memory: rows count from 0, as samples, and have no lines.
    pub(crate) fn of_arrays(self, arrays: Arrays) -> Self {
        let (evidence, protection) = (TableEvidence::Arrays, String::new());
        let description = TableDescription { evidence, protection, ..self.description };
        Self { description, arrays: Some(arrays), ..self }
    }

    /// Which of the rows that were read last have no value in a column.
    fn missing(&self, column: usize) -> &[bool] {
        let lane = self.fields[column].cells.lane();
        lane.and_then(|lane| self.lanes.get(lane)).map_or(&[], |lane| lane.missing())
    }

    /// Where the clock of these columns begins anew.
    fn breaks_of(&self, wanted: &[WantedColumn]) -> Vec<(u64, u64)> {
        let in_group =
            wanted.iter().any(|want| self.fields.get(want.column()).is_some_and(|f| f.column.group == 0));
        let clock = self.fields.iter().filter(|_| in_group).find_map(|field| match &field.cells {
            CellKind::Clock(runs) => Some(clock::breaks(runs).collect()),
            _ => None,
        });
        clock.unwrap_or_default()
    }

    fn unsupported(&self, what: String, remedy: &str) -> FormatError {
        FormatError::unsupported(self.description.format, what, remedy)
    }

    /// The rows that all wanted columns have.
    fn common_rows(&self, wanted: &[WantedColumn]) -> Result<u64> {
        let mut common: Option<(u64, &str)> = None;
        for want in wanted {
            let Some(field) = self.fields.get(want.column()) else {
                let column = want.column();
                return Err(self.unsupported(format!("column {column}"), "name one that is there"));
            };
            if field.is_clock() {
                continue;
            }
            match common {
                None => common = Some((field.rows, &field.column.name)),
                Some((rows, _)) if rows == field.rows => {}
                Some((rows, name)) => {
                    let (other, count) = (&field.column.name, field.rows);
                    let what = format!("`{name}` of {rows} rows together with `{other}` of {count}");
                    return Err(self.unsupported(what, "name columns that were recorded together"));
                }
            }
        }
        let longest = || self.fields.iter().map(|f| f.rows).max().unwrap_or(0);
        Ok(common.map_or_else(longest, |(rows, _)| rows))
    }
}

impl Table for RecordTable {
    fn description(&self) -> &TableDescription {
        &self.description
    }

    fn want(&mut self, wanted: &[WantedColumn]) -> Result<()> {
        let columns = wanted.iter().filter_map(|want| self.fields.get(want.column()));
        refuse_apart(self.description.format, columns.map(|field| &field.column))?;
        self.rows = self.common_rows(wanted)?;
        self.used.fill(false);
        for want in wanted {
            let Some(field) = self.fields.get(want.column()) else { continue };
            if field.cells.is_text() && !want.is_label() {
                let what = format!("text where numbers belong, in column `{}`,", field.column.name);
                return Err(self.unsupported(what, "name a column of numbers"));
            }
            field.cells.lane().into_iter().for_each(|lane| self.used[lane] = true);
        }
        self.row_bytes =
            self.lanes.iter().zip(&self.used).filter(|(_, used)| **used).map(|(l, _)| l.record()).sum();
        if let Some((column, unit, origin)) = WantedColumn::time(wanted, self.description.format)? {
            let unit = match self.fields.get(column).map(|field| &field.cells) {
                Some(CellKind::Clock(_)) => TimeUnit::SECOND,
                cells => cells.and_then(CellKind::time).map_or(unit, |code| code.unit),
            };
            self.times = TimeReader::new(unit, origin);
        }
        self.wanted = wanted.to_vec();
        self.breaks = self.breaks_of(wanted);
        Ok(())
    }

    fn read(&mut self, block: &mut Block) -> Result<()> {
        let room = (BLOCK_BYTES / self.row_bytes.max(8)).max(1).min(block.capacity);
        let rows = usize::try_from(self.rows - self.row).unwrap_or(usize::MAX).min(room);
        let labels = self.wanted.iter().filter(|want| want.is_label()).count();
        block.clear(self.wanted.len() - labels, labels);
        if rows == 0 {
            return Ok(());
        }
        block.rows = rows;
        let line = self.row + self.header_line();
        block.lines.push((0, line));
        let end = self.row + rows as u64;
        let first = self.breaks.partition_point(|(row, _)| *row < self.row);
        let within = self.breaks.iter().skip(first).take_while(|(row, _)| *row < end);
        // Less than the rows of a block.
        block
            .breaks
            .extend(within.map(|(row, missing)| (usize::try_from(row - self.row).unwrap_or(rows), *missing)));
        for (number, lane) in self.lanes.iter_mut().enumerate().filter(|(number, _)| self.used[*number]) {
            if self.fields.iter().any(|f| f.cells == CellKind::Texts { lane: number }) {
                lane.texts(rows, &mut self.texts[number])?;
            } else {
                lane.read(rows, &mut self.raw[number])?;
            }
        }
        let (mut number, mut label) = (0, 0);
        for want in self.wanted.clone() {
            let (column, first) = (want.column(), block.faults.len());
            if want.is_label() {
                self.labels(column, rows, &mut block.labels[label]);
                let missing = self.missing(column).iter().enumerate().filter(|(_, missing)| **missing);
                block.faults.extend(missing.map(|(row, _)| CellFault {
                    row,
                    line: line + row as u64,
                    column: Some(column),
                    fault: CellFinding::Missing,
                }));
                label += 1;
                continue;
            }
            let (out, mut absent) = (&mut block.numbers[number], std::mem::take(&mut self.absent));
            absent.clear();
            if let WantedColumn::Number { power, .. } = want {
                self.numbers(column, (power, rows), out, &mut absent);
            } else {
                let mut times = std::mem::replace(&mut self.times, TimeReader::new(TimeUnit::SECOND, None));
                self.times_of(column, rows, &mut times, out, &mut absent);
                self.times = times;
            }
            refuse_infinities(out, column, line, &mut block.faults);
            // They are NaN so far, and were taken for such.
            for fault in &mut block.faults[first..] {
                if let Ok(place) = absent.binary_search_by_key(&fault.row, |(row, _)| *row) {
                    fault.fault = absent[place].1.clone();
                }
            }
            self.absent = absent;
            number += 1;
        }
        block.set_times(&self.times);
        block.faults.sort_by_key(|fault| fault.row);
        self.row += rows as u64;
        Ok(())
    }

    fn time_kind(&self, column: usize) -> Option<TimeKind> {
        self.fields.get(column)?.cells.time().map(|code| code.kind)
    }

    fn header_line(&self) -> u64 {
        u64::from(self.arrays.is_none())
    }

    fn progress(&self) -> (u64, u64) {
        (bytes_until((self.row, self.rows), self.file_bytes), self.file_bytes)
    }

    fn digest(&mut self) -> Option<Digest> {
        self.arrays.as_ref().map(|arrays| arrays.digest().clone())
    }
}

impl RecordTable {
    /// The cells of some rows of the block that stand at an offset in the records of a lane.
    fn places(&self, lane: usize, offset: usize, rows: Range<usize>) -> CellPlaces<'_> {
        let stride = self.lanes[lane].record();
        let raw = self.raw[lane].get(rows.start * stride..).unwrap_or_default();
        CellPlaces { raw, offset, stride, rows: rows.len() }
    }

    fn numbers(
        &self,
        column: usize,
        (power, rows): (i32, usize),
        out: &mut Vec<f64>,
        absent: &mut AbsentRows,
    ) {
        let RecordField { cells, scaling, power: stored, .. } = &self.fields[column];
        match cells {
            &CellKind::Stored { lane, offset, cell: StoredCell::Number(element) } => {
                let places = self.places(lane, offset, 0..rows);
                // What the file says of its numbers comes before a power of ten.
                let before = if scaling.is_none() { power.saturating_add(*stored) } else { 0 };
                element.numbers(places, before, out);
                scaling.mark(element, places.of(element.bytes), out, absent);
                sentinels::take_out(element, before, out, absent);
                if !scaling.is_none() {
                    scaling.apply(out);
                    let mut shift = Shift::new(power);
                    for number in out.iter_mut() {
                        *number = shift.float(*number);
                    }
                }
            }
            CellKind::Clock(clock) => {
                let mut shift = Shift::new(power);
                let times = (0..rows as u64).map(|row| clock::time_at(clock, self.row + row));
                out.extend(times.map(|time| shift.float(time)));
            }
            &CellKind::Stored { lane, offset, cell: StoredCell::Time(code) } => {
                // As seconds since 1970, or of the duration.
                let mut times = TimeReader::new(code.unit, Some(Instant::ZERO));
                code.read(self.places(lane, offset, 0..rows), &mut times, out);
            }
            // Refused by `want`.
            CellKind::Stored { .. } | CellKind::Texts { .. } => {}
        }
        let missing = self.missing(column);
        let is_missing = |row: usize| missing.get(row) == Some(&true);
        // What stands in their places counts for nothing.
        absent.retain(|(row, _)| !is_missing(*row));
        for (row, number) in out.iter_mut().enumerate().filter(|(row, _)| is_missing(*row)) {
            *number = f64::NAN;
            absent.push((row, CellFinding::Missing));
        }
        absent.sort_by_key(|(row, _)| *row);
    }

    fn times_of(
        &self,
        column: usize,
        rows: usize,
        times: &mut TimeReader,
        out: &mut Vec<f64>,
        absent: &mut AbsentRows,
    ) {
        let (field, missing) = (&self.fields[column], self.missing(column));
        let is_missing = |row: usize| missing.get(row) == Some(&true);
        match &field.cells {
            CellKind::Stored { .. } if field.power != 0 || !field.scaling.is_none() => {
                self.numbers(column, (0, rows), out, absent);
                for number in out {
                    *number = times.float(*number);
                }
            }
            CellKind::Stored { .. } if missing.contains(&true) => {
                for row in 0..rows {
                    if is_missing(row) {
                        out.push(f64::NAN);
                        absent.push((row, CellFinding::Missing));
                    } else {
                        self.stored_times(column, row..row + 1, times, out);
                    }
                }
            }
            CellKind::Stored { .. } => {
                self.stored_times(column, 0..rows, times, out);
            }
            CellKind::Clock(clock) => {
                let row = self.row;
                out.extend((0..rows as u64).map(|k| times.computed(clock::time_at(clock, row + k))));
            }
            // Refused by `want`.
            CellKind::Texts { .. } => {}
        }
    }

    /// The times of some rows of the block, as they are stored.
    fn stored_times(&self, column: usize, rows: Range<usize>, times: &mut TimeReader, out: &mut Vec<f64>) {
        let CellKind::Stored { lane, offset, cell } = self.fields[column].cells else { return };
        let places = self.places(lane, offset, rows);
        match cell {
            StoredCell::Number(element) => element.times(places, times, out),
            StoredCell::Time(code) => code.read(places, times, out),
            StoredCell::Text { .. } => {}
        }
    }

    fn labels(&self, column: usize, rows: usize, out: &mut Labels) {
        let RecordField { cells, scaling, power, .. } = &self.fields[column];
        let (mut text, missing, mut numbers) = (Vec::new(), self.missing(column), Vec::new());
        let is_stored = scaling.is_none() && *power == 0;
        if matches!(cells, CellKind::Clock(_)) || cells.is_numbers() && !is_stored {
            self.numbers(column, (0, rows), &mut numbers, &mut Vec::new());
        }
        for row in 0..rows {
            text.clear();
            let cell = |lane: usize, offset: usize, bytes: usize| {
                let start = row * self.lanes[lane].record() + offset;
                self.raw[lane].get(start..start + bytes).unwrap_or_default()
            };
            match cells {
                _ if missing.get(row) == Some(&true) => {}
                _ if !numbers.is_empty() => text.extend_from_slice(shortest(numbers[row]).as_bytes()),
                &CellKind::Stored { lane, offset, cell: StoredCell::Number(element) } => {
                    element.label(cell(lane, offset, element.bytes), &mut text);
                }
                &CellKind::Stored { lane, offset, cell: StoredCell::Time(code) } => {
                    text = code.label(cell(lane, offset, code.bytes())).into_bytes();
                }
                &CellKind::Stored { lane, offset, cell: StoredCell::Text { bytes, code } } => {
                    code.read(cell(lane, offset, bytes), &mut text);
                }
                CellKind::Texts { lane } => {
                    text.extend_from_slice(trimmed(self.texts[*lane].get(row).map_or(&[], Vec::as_slice)));
                }
                // Computed above.
                CellKind::Clock(_) => {}
            }
            push_label(out, row, &text);
        }
    }
}

/// Which of the columns are under a checksum, as a sentence.
fn protection(fields: &[RecordField], lanes: &[Box<dyn RecordLane>]) -> String {
    let lane = |field: &RecordField| lanes.get(field.cells.lane()?);
    let of = |field: &RecordField| Some((field.column.name.clone(), lane(field)?.protection()));
    crate::table::protection(&fields.iter().filter_map(of).collect::<Vec<_>>())
}

/// Puts NaN for what is no finite number, and tells it. `line` is that of the block's first row.
fn refuse_infinities(numbers: &mut [f64], column: usize, line: u64, faults: &mut Vec<CellFault>) {
    // Counted without a branch: in nearly all blocks there is none.
    if numbers.iter().filter(|number| !number.is_finite()).count() == 0 {
        return;
    }
    for (place, number) in numbers.iter_mut().enumerate().filter(|(_, number)| !number.is_finite()) {
        let fault = match std::mem::replace(number, f64::NAN) {
            nan if nan.is_nan() => CellFinding::Nan("NaN".to_owned()),
            infinite => CellFinding::Infinite(infinite.to_string()),
        };
        faults.push(CellFault { row: place, line: line + place as u64, column: Some(column), fault });
    }
}

impl TextEncoding {
    /// Reads a text of this code, without the white space and NULs around it.
    pub(crate) fn read(self, raw: &[u8], out: &mut Vec<u8>) {
        out.clear();
        match self {
            Self::Bytes => out.extend_from_slice(trimmed(raw)),
            Self::Utf16 { big_endian } => out.extend_from_slice(trimmed(utf16(raw, big_endian).as_bytes())),
            Self::Utf32 { big_endian } => {
                let code = |four: &[u8; 4]| {
                    if big_endian { u32::from_be_bytes(*four) } else { u32::from_le_bytes(*four) }
                };
                let letter =
                    |four: &[u8; 4]| char::from_u32(code(four)).unwrap_or(char::REPLACEMENT_CHARACTER);
                let text: String = raw.as_chunks::<4>().0.iter().map(letter).collect();
                out.extend_from_slice(trimmed(text.as_bytes()));
            }
        }
    }
}

/// A text in UTF-16, with a sign for what is no character.
pub(crate) fn utf16(raw: &[u8], big_endian: bool) -> String {
    let unit = |two: &[u8; 2]| if big_endian { u16::from_be_bytes(*two) } else { u16::from_le_bytes(*two) };
    let letters = char::decode_utf16(raw.as_chunks::<2>().0.iter().map(unit));
    letters.map(|letter| letter.unwrap_or(char::REPLACEMENT_CHARACTER)).collect()
}

fn trimmed(text: &[u8]) -> &[u8] {
    let end =
        text.iter().rposition(|byte| *byte != 0 && !byte.is_ascii_whitespace()).map_or(0, |last| last + 1);
    text[..end].trim_ascii_start()
}

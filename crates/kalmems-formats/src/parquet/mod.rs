//! Apache Parquet: columns that hold one value a row.

mod fixed;
mod layout;
mod packing;
mod pages;
mod thrift;

use crate::clock::RegularTimes;
use crate::decimal::Shift;
use crate::element::{Element, ElementKind};
use crate::limits::{self, BLOCK_BYTES};
use crate::panics;
use crate::records::{push_label, refuse_infinities};
use crate::sentinels;
use crate::source::SharedFile;
use crate::stated_clock::{StatedNumbers, names_a_time};
use crate::table::bytes_until;
use crate::{
    Block, CellFault, CellFinding, Column, FormatError, Hints, Instant, Labels, OmittedPart, Table,
    TableDescription, TableEvidence, TimeKind, TimeReader, TimeUnit, WantedColumn, element,
};
use pages::{ColumnPages, PAGE_BYTES};
use parquet::basic::{ConvertedType, LogicalType, Type};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl, get_column_reader};
use parquet::data_type::{ByteArray, DataType};
use parquet::errors::ParquetError;
use parquet::file::metadata::{ColumnChunkMetaData, ParquetMetaData, ParquetMetaDataReader};
use parquet::schema::types::ColumnDescriptor;
use std::sync::Arc;

const FORMAT: &str = "Parquet";
/// Groups of rows.
const GROUPS: usize = 1 << 16;

fn failed(place: &str, error: ParquetError) -> FormatError {
    // What was refused by our own limits says so itself.
    match error {
        ParquetError::External(inner) => match inner.downcast::<FormatError>() {
            Ok(own) => *own,
            Err(other) => damaged(place, other.to_string()),
        },
        error => damaged(place, error.to_string()),
    }
}

fn damaged(place: &str, found: String) -> FormatError {
    FormatError::damaged(FORMAT, place, found, "a Parquet file that is whole")
}

/// What the library says. Some damaged files make it panic, and no list of what to check before is known to be whole.
fn guarded<R>(place: &str, call: impl FnOnce() -> Result<R, ParquetError>) -> Result<R, FormatError> {
    match panics::caught(call) {
        Some(said) => said.map_err(|error| failed(place, error)),
        None => Err(damaged(place, "something that the library does not expect".to_owned())),
    }
}

pub(crate) fn open(source: SharedFile, _hints: &Hints) -> Result<Box<dyn Table>, FormatError> {
    let source = Arc::new(source);
    let file_bytes = source.length();
    let tail = source.bytes(FORMAT, file_bytes.saturating_sub(8), 8)?;
    if !tail.ends_with(b"PAR1") {
        return Err(damaged("its end", format!("`{}` instead of PAR1", tail[4..].escape_ascii())));
    }
    let length = u32::from_le_bytes([tail[0], tail[1], tail[2], tail[3]]);
    limits::at_most(FORMAT, "the length of the metadata", u64::from(length), limits::HEADER_BYTES)?;
    let end = file_bytes - 8;
    let metadata =
        end.checked_sub(u64::from(length)).map(|start| source.bytes(FORMAT, start, length as usize));
    let metadata = metadata.transpose()?.unwrap_or_default();
    if thrift::length_of_struct(&metadata, layout::FILE, &mut |_, _| {}).is_none() {
        let found =
            "metadata that end too early, have lists of more than 65536 elements or fields of another type";
        return Err(damaged("the metadata", found.to_owned()));
    }
    let metadata = guarded("the metadata", || ParquetMetaDataReader::decode_metadata(&metadata))?;
    limits::at_most(FORMAT, "the number of groups of rows", metadata.num_row_groups() as u64, GROUPS as u64)?;
    let mut rows = 0_u64;
    for group in metadata.row_groups() {
        let count = u64::try_from(group.num_rows());
        let count =
            count.map_err(|_| damaged("the metadata", format!("{} rows in a group", group.num_rows())))?;
        rows = rows.saturating_add(count);
        let sound = |chunk: &ColumnChunkMetaData| {
            chunk.num_values() >= 0 && pages::place(chunk).is_some_and(|place| place.end <= file_bytes)
        };
        let columns = metadata.file_metadata().schema_descr().num_columns();
        if group.num_columns() != columns || !group.columns().iter().all(sound) {
            return Err(damaged("the metadata", "columns that are not in the file".to_owned()));
        }
        limits::plausible_rows(FORMAT, rows, file_bytes)?;
    }
    let schema = metadata.file_metadata().schema_descr();
    limits::at_most(FORMAT, "the number of columns", schema.num_columns() as u64, limits::COLUMNS as u64)?;
    let (mut columns, mut kinds, mut left_out) = (Vec::new(), Vec::new(), Vec::new());
    for (leaf, descriptor) in schema.columns().iter().enumerate() {
        let name = descriptor.path().string();
        match kind(descriptor) {
            Ok(kind) => {
                let text = descriptor.physical_type() == Type::BYTE_ARRAY;
                columns.push(Column { text, ..Column::new(&name) });
                kinds.push(SchemaLeaf { number: leaf, kind, levels: descriptor.max_def_level() });
            }
            Err(what) => left_out.push(OmittedPart::new(name, what)),
        }
    }
    let mut recognised = format!("{rows} rows in {} groups", metadata.num_row_groups());
    if !left_out.is_empty() {
        recognised.push_str(&format!("; left out: {}", limits::list(&left_out)));
    }
    if columns.is_empty() {
        return Err(FormatError::unsupported(
            FORMAT,
            format!("a file without a column of numbers or labels ({})", limits::list(&left_out)),
            "write columns of numbers",
        ));
    }
    let clock = stated_clock(&metadata).filter(|_| {
        !columns
            .iter()
            .zip(&kinds)
            .any(|(column, leaf)| matches!(leaf.kind, ValueKind::Time(..)) || names_a_time(&column.name))
    });
    let of = |(column, leaf): (&Column, &SchemaLeaf)| {
        let chunk = metadata.row_groups().first().map(|group| group.column(leaf.number));
        (column.name.clone(), chunk.and_then(|chunk| pages::protection(&source, chunk)))
    };
    let protection = crate::table::protection(&columns.iter().zip(&kinds).map(of).collect::<Vec<_>>());
    if let Some(RegularTimes { start_s, step, .. }) = &clock {
        columns.insert(0, Column::new("time_s"));
        kinds.insert(0, SchemaLeaf { number: 0, kind: ValueKind::Clock, levels: 0 });
        recognised
            .push_str(&format!("; time_s = {start_s} s + {step} for row k from 0 on, as the metadata state"));
    }
    let description = TableDescription {
        format: FORMAT,
        recognised,
        columns,
        rows: Some(rows),
        evidence: TableEvidence::Format,
        left_out,
        protection,
    };
    Ok(Box::new(ParquetTable {
        description,
        source,
        metadata,
        kinds,
        rows,
        row: 0,
        file_bytes,
        wanted: Vec::new(),
        times: TimeReader::new(TimeUnit::SECOND, None),
        clock,
    }))
}

/// The clock that keys of the metadata state.
fn stated_clock(metadata: &ParquetMetaData) -> Option<RegularTimes> {
    let mut stated = StatedNumbers::default();
    for pair in metadata.file_metadata().key_value_metadata().into_iter().flatten() {
        if let Some(number) =
            pair.value.as_ref().and_then(|text| fast_float2::parse::<f64, _>(text.trim()).ok())
        {
            stated.learn(&pair.key, number);
        }
    }
    stated.regular_times()
}

/// A column of the schema.
#[derive(Clone, Copy)]
struct SchemaLeaf {
    number: usize,
    kind: ValueKind,
    /// The level that says that a value is there.
    levels: i16,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum ValueKind {
    Signed,
    Unsigned,
    /// Whole numbers times 10^−scale.
    Decimal {
        scale: i32,
    },
    /// Floating-point numbers of 16 bits.
    Half,
    /// Integers that count a unit of time.
    Time(TimeUnit, TimeKind),
    /// Numbers that f64 holds, and texts.
    Plain,
    /// Times by the clock that the metadata state; not in the file.
    Clock,
}

/// What a column holds, or why it is left out.
fn kind(descriptor: &ColumnDescriptor) -> Result<ValueKind, &'static str> {
    if descriptor.max_rep_level() > 0 {
        return Err("a list in each row");
    }
    if let Some(kind) = fixed::kind(descriptor) {
        return kind;
    }
    if let Some(time) = time(descriptor) {
        return Ok(time);
    }
    let integers = match (descriptor.logical_type_ref(), descriptor.converted_type()) {
        (Some(LogicalType::Integer { .. }), _)
        | (
            None,
            ConvertedType::NONE
            | ConvertedType::INT_8
            | ConvertedType::INT_16
            | ConvertedType::INT_32
            | ConvertedType::INT_64
            | ConvertedType::UINT_8
            | ConvertedType::UINT_16
            | ConvertedType::UINT_32
            | ConvertedType::UINT_64,
        ) => Ok(()),
        _ => Err("dates or times of day"),
    };
    let unsigned = matches!(
        descriptor.converted_type(),
        ConvertedType::UINT_8 | ConvertedType::UINT_16 | ConvertedType::UINT_32 | ConvertedType::UINT_64
    );
    match descriptor.physical_type() {
        Type::BOOLEAN | Type::FLOAT | Type::DOUBLE => Ok(ValueKind::Plain),
        Type::INT32 | Type::INT64 => {
            integers.map(|()| if unsigned { ValueKind::Unsigned } else { ValueKind::Signed })
        }
        Type::BYTE_ARRAY => match (descriptor.logical_type_ref(), descriptor.converted_type()) {
            (Some(LogicalType::String | LogicalType::Enum) | None, _) => Ok(ValueKind::Plain),
            _ => Err("bytes with a meaning of their own"),
        },
        Type::INT96 => Err("dates"),
        Type::FIXED_LEN_BYTE_ARRAY => Err("bytes of a fixed length"),
    }
}

/// The dates and times of a day that are integers.
fn time(descriptor: &ColumnDescriptor) -> Option<ValueKind> {
    use parquet::basic::TimeUnit as Unit;
    let power = |unit: Unit| match unit {
        Unit::MILLIS => -3,
        Unit::MICROS => -6,
        Unit::NANOS => -9,
    };
    let (unit, kind) = match (descriptor.logical_type_ref(), descriptor.converted_type()) {
        (Some(LogicalType::Timestamp(time)), _) => (TimeUnit::decimal(power(time.unit)), TimeKind::Calendar),
        (Some(LogicalType::Time(time)), _) => (TimeUnit::decimal(power(time.unit)), TimeKind::Elapsed),
        (Some(LogicalType::Date), _) | (None, ConvertedType::DATE) => {
            (TimeUnit::seconds(86_400), TimeKind::Calendar)
        }
        (None, ConvertedType::TIMESTAMP_MILLIS) => (TimeUnit::decimal(-3), TimeKind::Calendar),
        (None, ConvertedType::TIMESTAMP_MICROS) => (TimeUnit::decimal(-6), TimeKind::Calendar),
        (None, ConvertedType::TIME_MILLIS) => (TimeUnit::decimal(-3), TimeKind::Elapsed),
        (None, ConvertedType::TIME_MICROS) => (TimeUnit::decimal(-6), TimeKind::Elapsed),
        _ => return None,
    };
    matches!(descriptor.physical_type(), Type::INT32 | Type::INT64).then_some(ValueKind::Time(unit, kind))
}

/// What the numbers of a column are kept in, where ends of it may say that there is none.
fn element_of(descriptor: &ColumnDescriptor) -> Option<Element> {
    let (kind, bytes) = match (descriptor.physical_type(), descriptor.converted_type()) {
        (Type::FLOAT, _) => (ElementKind::Float, 4),
        (Type::DOUBLE, _) => (ElementKind::Float, 8),
        (_, ConvertedType::INT_16) => (ElementKind::Signed, 2),
        (_, ConvertedType::UINT_16) => (ElementKind::Unsigned, 2),
        _ => return None,
    };
    Some(Element::little(kind, bytes))
}

struct ParquetTable {
    description: TableDescription,
    source: Arc<SharedFile>,
    metadata: ParquetMetaData,
    kinds: Vec<SchemaLeaf>,
    rows: u64,
    row: u64,
    file_bytes: u64,
    wanted: Vec<ColumnCursor>,
    times: TimeReader,
    clock: Option<RegularTimes>,
}

/// A wanted column and how far it is read.
struct ColumnCursor {
    want: WantedColumn,
    column: usize,
    leaf: SchemaLeaf,
    element: Option<Element>,
    reader: Option<ColumnReader>,
    group: usize,
    levels: Vec<i16>,
}

/// Where values go.
enum Sink<'a> {
    Numbers { out: &'a mut Vec<f64>, power: i32 },
    Times { out: &'a mut Vec<f64>, times: &'a mut TimeReader },
    Labels { out: &'a mut Labels },
}

impl Table for ParquetTable {
    fn description(&self) -> &TableDescription {
        &self.description
    }

    fn want(&mut self, wanted: &[WantedColumn]) -> Result<(), FormatError> {
        self.wanted.clear();
        for want in wanted {
            let column = want.column();
            let unsupported =
                |what: String| FormatError::unsupported(FORMAT, what, "name a column of numbers");
            let Some(leaf) = self.kinds.get(column).copied() else {
                return Err(unsupported(format!("column {column}, which is not there,")));
            };
            if leaf.kind == ValueKind::Clock && want.is_label() {
                return Err(unsupported("the clock of the metadata as labels".to_owned()));
            }
            let descriptor = self.metadata.file_metadata().schema_descr().column(leaf.number);
            let text = descriptor.physical_type() == Type::BYTE_ARRAY && leaf.kind != ValueKind::Clock;
            let element = element_of(&descriptor);
            if text && !want.is_label() {
                let name = &self.description.columns[column].name;
                return Err(unsupported(format!("text where numbers belong, in column `{name}`,")));
            }
            let cursor = ColumnCursor {
                want: *want,
                column,
                leaf,
                element,
                reader: None,
                group: 0,
                levels: Vec::new(),
            };
            self.wanted.push(cursor);
        }
        if let Some((column, unit, origin)) = WantedColumn::time(wanted, FORMAT)? {
            let unit = match self.kinds.get(column).map(|leaf| leaf.kind) {
                Some(ValueKind::Time(unit, _)) => unit,
                Some(ValueKind::Clock) => TimeUnit::SECOND,
                _ => unit,
            };
            self.times = TimeReader::new(unit, origin);
        }
        Ok(())
    }

    fn read(&mut self, block: &mut Block) -> Result<(), FormatError> {
        let room = (BLOCK_BYTES / 8 / self.wanted.len().max(1)).max(1).min(block.capacity);
        let rows = usize::try_from(self.rows - self.row).unwrap_or(usize::MAX).min(room);
        let labels = self.wanted.iter().filter(|cursor| cursor.want.is_label()).count();
        block.clear(self.wanted.len() - labels, labels);
        if rows == 0 {
            return Ok(());
        }
        block.rows = rows;
        block.lines.push((0, self.row + 1));
        let (mut number, mut label) = (0, 0);
        for cursor in &mut self.wanted {
            let column = cursor.column;
            let name = &self.description.columns[column].name;
            match cursor.want {
                WantedColumn::Number { .. } | WantedColumn::Time { .. } => {
                    let out = &mut block.numbers[number];
                    if let (ValueKind::Clock, Some(clock)) = (cursor.leaf.kind, &self.clock) {
                        let times = (self.row..self.row + rows as u64).map(|row| clock.at(row));
                        if let WantedColumn::Number { power, .. } = cursor.want {
                            let mut shift = Shift::new(power);
                            out.extend(times.map(|time| shift.float(time)));
                        } else {
                            out.extend(times.map(|time| self.times.computed(time)));
                        }
                        number += 1;
                        continue;
                    }
                    let sink = match cursor.want {
                        WantedColumn::Number { power, .. } => Sink::Numbers { out: &mut *out, power },
                        _ => Sink::Times { out: &mut *out, times: &mut self.times },
                    };
                    let missing = cursor.read((&self.source, &self.metadata), name, rows, sink)?;
                    let mut absent = Vec::new();
                    if let (WantedColumn::Number { power, .. }, Some(element)) = (cursor.want, cursor.element)
                    {
                        sentinels::take_out(element, power, out, &mut absent);
                    }
                    refuse_infinities(out, column, self.row, &mut block.faults);
                    // They are NaN so far, and were taken for such.
                    for fault in block.faults.iter_mut().filter(|fault| fault.column == Some(column)) {
                        if missing.get(fault.row).copied().unwrap_or(false) {
                            fault.fault = CellFinding::Missing;
                        } else if let Ok(place) = absent.binary_search_by_key(&fault.row, |(row, _)| *row) {
                            fault.fault = absent[place].1.clone();
                        }
                    }
                    number += 1;
                }
                WantedColumn::Label { .. } => {
                    let out = &mut block.labels[label];
                    let missing =
                        cursor.read((&self.source, &self.metadata), name, rows, Sink::Labels { out })?;
                    for (row, _) in missing.iter().enumerate().filter(|(_, missing)| **missing) {
                        let line = self.row + row as u64 + 1;
                        block.faults.push(CellFault {
                            row,
                            line,
                            column: Some(column),
                            fault: CellFinding::Missing,
                        });
                    }
                    label += 1;
                }
            }
        }
        block.set_times(&self.times);
        block.faults.sort_by_key(|fault| fault.row);
        self.row += rows as u64;
        Ok(())
    }

    fn time_kind(&self, column: usize) -> Option<TimeKind> {
        match self.kinds.get(column)?.kind {
            ValueKind::Time(_, kind) => Some(kind),
            _ => None,
        }
    }

    fn progress(&self) -> (u64, u64) {
        (bytes_until((self.row, self.rows), self.file_bytes), self.file_bytes)
    }
}

impl ColumnCursor {
    /// Reads the next rows; says which of them have no value.
    fn read(
        &mut self,
        (source, metadata): (&Arc<SharedFile>, &ParquetMetaData),
        name: &str,
        rows: usize,
        mut sink: Sink<'_>,
    ) -> Result<Vec<bool>, FormatError> {
        let mut missing = Vec::with_capacity(if self.leaf.levels > 0 { rows } else { 0 });
        let mut done = 0;
        while done < rows {
            let Some(reader) = &mut self.reader else {
                let leaf = self.leaf.number;
                let pages = ColumnPages::of(source, metadata.row_group(self.group).column(leaf))?;
                let descriptor = metadata.file_metadata().schema_descr().column(leaf);
                self.reader = Some(get_column_reader(descriptor, Box::new(pages)));
                continue;
            };
            self.levels.clear();
            let count = guarded(&format!("column `{name}`"), || {
                take(reader, self.leaf, rows - done, done, &mut self.levels, &mut missing, &mut sink)
            })?;
            if count == 0 {
                self.reader = None;
                self.group += 1;
                if self.group >= metadata.num_row_groups() {
                    return Err(damaged(&format!("column `{name}`"), "fewer values than rows".to_owned()));
                }
            }
            done += count;
        }
        Ok(missing)
    }
}

/// Reads values of whichever type.
fn take(
    reader: &mut ColumnReader,
    leaf: SchemaLeaf,
    rows: usize,
    row: usize,
    levels: &mut Vec<i16>,
    missing: &mut Vec<bool>,
    sink: &mut Sink<'_>,
) -> Result<usize, ParquetError> {
    let mut records = RowsToRead { leaf, rows, row, levels, missing };
    let power = if let Sink::Numbers { power, .. } = sink { *power } else { 0 };
    // Dates as numbers are seconds since 1970.
    let mut since_1970;
    let mut shift;
    let (out, mut numbers) = match sink {
        Sink::Times { out, times } => (OutputColumn::Numbers(out), NumberTarget::Times(times)),
        Sink::Numbers { out, .. } if let ValueKind::Time(unit, _) = leaf.kind => {
            since_1970 = TimeReader::new(unit, Some(Instant::ZERO));
            (OutputColumn::Numbers(out), NumberTarget::Times(&mut since_1970))
        }
        Sink::Numbers { out, power } => {
            shift = Shift::new(*power);
            (OutputColumn::Numbers(out), NumberTarget::Shifted(&mut shift))
        }
        Sink::Labels { out } => {
            shift = Shift::new(0);
            (OutputColumn::Labels(out), NumberTarget::Shifted(&mut shift))
        }
    };
    if matches!(leaf.kind, ValueKind::Decimal { .. } | ValueKind::Half) {
        return fixed::take(reader, &mut records, out, power);
    }
    // As signed and unsigned numbers of the same bits.
    #[allow(clippy::cast_sign_loss)]
    let wide = |x: i64| if leaf.kind == ValueKind::Unsigned { i128::from(x as u64) } else { i128::from(x) };
    #[allow(clippy::cast_sign_loss)]
    let narrow = |x: i32| if leaf.kind == ValueKind::Unsigned { i128::from(x as u32) } else { i128::from(x) };
    let integer = |x: i128| leaf.kind.label(x).into_bytes();
    let float = |x: f64| element::shortest(x).into_bytes();
    match reader {
        ColumnReader::BoolColumnReader(r) => {
            records.read(r, out, |x| numbers.integer(i128::from(*x)), |x| integer(i128::from(*x)))
        }
        ColumnReader::Int32ColumnReader(r) => {
            records.read(r, out, |x| numbers.integer(narrow(*x)), |x| integer(narrow(*x)))
        }
        ColumnReader::Int64ColumnReader(r) => {
            records.read(r, out, |x| numbers.integer(wide(*x)), |x| integer(wide(*x)))
        }
        ColumnReader::FloatColumnReader(r) => {
            records.read(r, out, |x| numbers.single(*x), |x| float(f64::from(*x)))
        }
        ColumnReader::DoubleColumnReader(r) => records.read(r, out, |x| numbers.float(*x), |x| float(*x)),
        ColumnReader::ByteArrayColumnReader(r) => {
            records.read(r, out, |_: &ByteArray| f64::NAN, |x| x.data().trim_ascii().to_vec())
        }
        ColumnReader::Int96ColumnReader(_) | ColumnReader::FixedLenByteArrayColumnReader(_) => Ok(0),
    }
}

/// What makes numbers of values.
enum NumberTarget<'a> {
    Shifted(&'a mut Shift),
    Times(&'a mut TimeReader),
}

impl NumberTarget<'_> {
    fn integer(&mut self, number: i128) -> f64 {
        match self {
            Self::Shifted(shift) => shift.integer(number),
            Self::Times(times) => times.integer(number),
        }
    }

    fn float(&mut self, number: f64) -> f64 {
        match self {
            Self::Shifted(shift) => shift.float(number),
            Self::Times(times) => times.float(number),
        }
    }

    fn single(&mut self, number: f32) -> f64 {
        match self {
            Self::Shifted(shift) => shift.float(f64::from(number)),
            Self::Times(times) => times.single(number),
        }
    }
}

impl ValueKind {
    /// An integer as a label: a date, or its digits.
    fn label(self, number: i128) -> String {
        let date = match self {
            Self::Time(unit, TimeKind::Calendar) => {
                Instant::of_integer(number, unit).and_then(Instant::to_utc)
            }
            _ => None,
        };
        date.unwrap_or_else(|| number.to_string())
    }
}

/// What values are appended to.
enum OutputColumn<'a> {
    Numbers(&'a mut Vec<f64>),
    Labels(&'a mut Labels),
}

/// Rows that are to be read.
struct RowsToRead<'a> {
    leaf: SchemaLeaf,
    rows: usize,
    row: usize,
    levels: &'a mut Vec<i16>,
    missing: &'a mut Vec<bool>,
}

impl RowsToRead<'_> {
    fn read<T: DataType>(
        &mut self,
        reader: &mut ColumnReaderImpl<T>,
        mut out: OutputColumn<'_>,
        mut number: impl FnMut(&T::T) -> f64,
        label: impl Fn(&T::T) -> Vec<u8>,
    ) -> Result<usize, ParquetError> {
        let mut values: Vec<T::T> = Vec::new();
        let nullable = self.leaf.levels > 0;
        let (rows, _, _) =
            reader.read_records(self.rows, nullable.then_some(&mut *self.levels), None, &mut values)?;
        let mut values = values.iter();
        for row in 0..rows {
            let there = !nullable || self.levels.get(row) == Some(&self.leaf.levels);
            let value = if there { values.next() } else { None };
            if nullable {
                self.missing.push(value.is_none());
            } else if value.is_none() {
                return Err(ParquetError::General("fewer values than rows".to_owned()));
            }
            match &mut out {
                OutputColumn::Numbers(out) => out.push(value.map_or(f64::NAN, &mut number)),
                OutputColumn::Labels(out) => {
                    push_label(out, self.row + row, &value.map_or_else(Vec::new, &label));
                }
            }
        }
        Ok(rows)
    }
}

//! Apache Parquet: columns that hold one value a row.

mod layout;
mod packing;
mod pages;
mod thrift;
mod values;

use crate::limits;
use crate::panics;
use crate::records::{CellKind, RecordLane, StoredCell};
use crate::source::SharedFile;
use crate::table_parts::TableParts;
use crate::{Column, FormatError, Hints, Result, Table, refuse_if};
use pages::{ColumnPages, PAGE_BYTES};
use parquet::column::reader::{ColumnReader, get_column_reader};
use parquet::errors::ParquetError;
use parquet::file::metadata::{ColumnChunkMetaData, ParquetMetaData, ParquetMetaDataReader};
use std::sync::Arc;
use values::{ReadValues, RowsToRead};

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
fn guarded<R>(place: &str, call: impl FnOnce() -> Result<R, ParquetError>) -> Result<R> {
    match panics::caught(call) {
        Some(said) => said.map_err(|error| failed(place, error)),
        None => Err(damaged(place, "something that the library does not expect".to_owned())),
    }
}

pub(crate) fn open(source: SharedFile, _hints: &Hints) -> Result<Box<dyn Table>> {
    let source = Arc::new(source);
    let file_bytes = source.length();
    let tail = source.bytes(FORMAT, file_bytes.saturating_sub(8), 8)?;
    refuse_if(!tail.ends_with(b"PAR1"), || {
        damaged("its end", format!("`{}` instead of PAR1", tail[4..].escape_ascii()))
    })?;
    let length = u32::from_le_bytes([tail[0], tail[1], tail[2], tail[3]]);
    limits::at_most(FORMAT, "the length of the metadata", u64::from(length), limits::HEADER_BYTES)?;
    let start = (file_bytes - 8).saturating_sub(u64::from(length));
    let metadata = source.bytes(FORMAT, start, u64::from(length))?;
    let read = thrift::length_of_struct(&metadata, layout::FILE, &mut |_, _| {});
    let found =
        "metadata that end too early, have lists of more than 65536 elements or fields of another type";
    read.ok_or_else(|| damaged("the metadata", found.to_owned()))?;
    let metadata = guarded("the metadata", || ParquetMetaDataReader::decode_metadata(&metadata))?;
    limits::at_most(FORMAT, "the number of groups of rows", metadata.num_row_groups(), GROUPS)?;
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
        refuse_if(group.num_columns() != columns || !group.columns().iter().all(sound), || {
            damaged("the metadata", "columns that are not in the file".to_owned())
        })?;
        limits::plausible_rows(FORMAT, rows, file_bytes)?;
    }
    let schema = metadata.file_metadata().schema_descr();
    limits::at_most(FORMAT, "the number of columns", schema.num_columns(), limits::COLUMNS)?;
    let mut table = TableParts::new(FORMAT);
    table.recognised = format!("{rows} rows in {} groups", metadata.num_row_groups());
    for pair in metadata.file_metadata().key_value_metadata().into_iter().flatten() {
        let number = pair.value.as_ref().and_then(|text| fast_float2::parse::<f64, _>(text.trim()).ok());
        if let Some(number) = number {
            table.stated.learn(&pair.key, number);
        }
    }
    let file = Arc::new(OpenParquet { source, metadata });
    for (leaf, descriptor) in file.metadata.file_metadata().schema_descr().columns().iter().enumerate() {
        let name = descriptor.path().string();
        let (cell, power) = match values::stored(descriptor) {
            Ok(stored) => stored,
            Err(what) => {
                table.leave_out(name, what);
                continue;
            }
        };
        let (lane, offset) = (table.lanes.len(), 0);
        let cells = cell.map_or(CellKind::Texts { lane }, |cell| CellKind::Stored { lane, offset, cell });
        table.add(Column::new(&name), cells, rows, Box::new(ColumnLane::new(&file, leaf, &name, cell)));
        table.fields.last_mut().into_iter().for_each(|field| field.power = power);
    }
    table.finish(file_bytes, "keys of the metadata", "write columns of numbers")
}

/// A file whose metadata are read.
struct OpenParquet {
    source: Arc<SharedFile>,
    metadata: ParquetMetaData,
}

/// The values of a column, group of rows by group of rows.
struct ColumnLane {
    file: Arc<OpenParquet>,
    leaf: usize,
    /// What it is, for messages.
    place: String,
    cell: Option<StoredCell>,
    protection: Option<&'static str>,
    reader: Option<ColumnReader>,
    group: usize,
    missing: Vec<bool>,
}

impl ColumnLane {
    fn new(file: &Arc<OpenParquet>, leaf: usize, name: &str, cell: Option<StoredCell>) -> Self {
        let first = file.metadata.row_groups().first().map(|group| group.column(leaf));
        Self {
            file: Arc::clone(file),
            leaf,
            place: format!("column `{name}`"),
            cell,
            protection: first.and_then(|chunk| pages::protection(&file.source, chunk)),
            reader: None,
            group: 0,
            missing: Vec::new(),
        }
    }

    /// Reads the next rows.
    fn next(&mut self, rows: usize, mut out: ReadValues<'_>) -> Result<()> {
        let metadata = &self.file.metadata;
        let descriptor = metadata.file_metadata().schema_descr().column(self.leaf);
        self.missing.clear();
        let mut done = 0;
        while done < rows {
            let Some(reader) = &mut self.reader else {
                let chunk = metadata.row_group(self.group).column(self.leaf);
                let pages = ColumnPages::of(&self.file.source, chunk)?;
                self.reader = Some(get_column_reader(descriptor.clone(), Box::new(pages)));
                continue;
            };
            let levels = descriptor.max_def_level();
            let (cell, missing) = (self.cell, &mut self.missing);
            let count = guarded(&self.place, || {
                values::take(reader, cell, RowsToRead { rows: rows - done, levels, missing }, &mut out)
            })?;
            if count == 0 {
                self.reader = None;
                self.group += 1;
                refuse_if(self.group >= metadata.num_row_groups(), || {
                    damaged(&self.place, "fewer values than rows".to_owned())
                })?;
            }
            done += count;
        }
        Ok(())
    }
}

impl RecordLane for ColumnLane {
    fn record(&self) -> usize {
        self.cell.map_or(0, StoredCell::bytes)
    }

    fn protection(&self) -> Option<&'static str> {
        self.protection
    }

    fn read(&mut self, rows: usize, out: &mut Vec<u8>) -> Result<()> {
        out.clear();
        self.next(rows, ReadValues::Records(out))
    }

    fn texts(&mut self, rows: usize, out: &mut Vec<Vec<u8>>) -> Result<()> {
        out.clear();
        self.next(rows, ReadValues::Texts(out))
    }

    fn missing(&self) -> &[bool] {
        &self.missing
    }
}

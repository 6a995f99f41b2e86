//! The way to the values of a dataset.

use super::chunks::{ChunkGrid, ChunkLane, LaneProgress};
use super::datatype::DatatypeKind;
use super::file::{ADDRESS, MetadataCursor};
use super::filters::{self, DatasetFilter};
use super::header::{MessageKind as Message, ObjectHeader};
use super::heap;
use super::layout::DataLayout;
use super::objects::Object;
use super::{FORMAT, FoundDataset, TEXTS, unsupported};
use crate::element::Element;
use crate::lanes::UnpackedRecords;
use crate::records::{RecordLane, TextEncoding};
use crate::source::SharedFile;
use crate::{FormatError, limits};
use std::sync::Arc;

/// The values of a dataset as records of a table.
pub(super) fn lane(
    found: &FoundDataset,
    rows: u64,
    columns: u64,
    turned: bool,
    file_bytes: u64,
) -> Result<Box<dyn RecordLane>, FormatError> {
    lane_of(found, found.kind.bytes(), (rows, columns), turned, file_bytes)
}

/// The same with elements of so many bytes.
fn lane_of(
    found: &FoundDataset,
    element: usize,
    (rows, columns): (u64, u64),
    turned: bool,
    file_bytes: u64,
) -> Result<Box<dyn RecordLane>, FormatError> {
    let FoundDataset { object: Object { file, .. }, header, path, space, .. } = found;
    let what = format!("the bytes of an element of `{path}`");
    limits::at_most(FORMAT, &what, element as u64, limits::ROW_BYTES as u64)?;
    limits::plausible_rows(FORMAT, rows.saturating_mul(columns), file_bytes.max(file.source.length()))?;
    let bytes = rows.saturating_mul(columns).saturating_mul(element as u64);
    let record = usize::try_from(columns).unwrap_or(0) * element;
    let whole =
        ChunkGrid { rows, columns, element, chunk_rows: rows.max(1), chunk_columns: columns.max(1), turned };
    let never = || unsupported(format!("`{path}`, which was never written,"), "write its values");
    let source = Arc::clone(&file.source);
    match DataLayout::read(file, header)?.ok_or_else(never)? {
        _ if rows == 0 => Ok(Box::new(Memory { bytes: Vec::new(), record, row: 0 })),
        DataLayout::Contiguous(None) => Err(never()),
        DataLayout::Contiguous(Some(offset)) => {
            source.within(FORMAT, offset, bytes)?;
            if !turned || columns == 1 {
                return Ok(Box::new(UnpackedRecords { source, format: FORMAT, offset, record }));
            }
            Ok(Box::new(TransposedColumns { source, offset, rows, columns, element, row: 0 }))
        }
        DataLayout::Compact(raw) => {
            if raw.len() as u64 != bytes {
                return Err(FormatError::damaged(
                    FORMAT,
                    path,
                    format!("{} bytes", raw.len()),
                    format!("{bytes}"),
                ));
            }
            let bytes = if turned && columns > 1 { turn(&raw, element, &whole) } else { raw };
            Ok(Box::new(Memory { bytes, record, row: 0 }))
        }
        DataLayout::Chunked(chunked) => {
            let filters = filters_of(file, header, path)?;
            let (first, second) = match chunked.shape[..] {
                [first] if space.shape.len() == 1 => (first, 1),
                [first, second] if space.shape.len() == 2 => (first, second),
                _ => {
                    return Err(FormatError::damaged(
                        FORMAT,
                        path,
                        format!("chunks of {} axes", chunked.shape.len()),
                        format!("{}, as the dataset has", space.shape.len()),
                    ));
                }
            };
            let (chunk_rows, chunk_columns) = if turned { (second, first) } else { (first, second) };
            let grid = ChunkGrid { chunk_rows, chunk_columns, ..whole };
            grid.check(path)?;
            Ok(Box::new(ChunkLane {
                file: Arc::clone(file),
                chunked,
                space: space.clone(),
                path: path.clone(),
                grid,
                filters,
                progress: LaneProgress::default(),
            }))
        }
        DataLayout::Virtual => Err(unsupported(
            format!("`{path}`, a virtual dataset whose values are in other datasets,"),
            "name those, or copy it with h5repack",
        )),
        DataLayout::External => Err(unsupported(
            format!("`{path}`, whose values are in files that are no HDF5,"),
            "copy them into one with h5repack",
        )),
    }
}

fn filters_of(
    file: &super::file::Hdf5File,
    header: &ObjectHeader,
    path: &str,
) -> Result<Vec<DatasetFilter>, FormatError> {
    let ids = header.first(file, Message::Filters, filters::read)?.unwrap_or_default();
    let known = ids.into_iter().map(|id| {
        DatasetFilter::of(id).ok_or_else(|| {
            unsupported(
                format!("`{path}`, packed by {},", filters::name(id)),
                "pack it with gzip, shuffle, fletcher32 or lzf, for instance with h5repack -f GZIP=4",
            )
        })
    });
    known.collect()
}

/// The texts of a dataset of texts of their own lengths, or of a cell array of MATLAB; none where a cell is something else.
pub(super) fn texts(found: &FoundDataset) -> Result<Option<Vec<Vec<u8>>>, FormatError> {
    let (file, path) = (&found.object.file, &found.path);
    limits::at_most(FORMAT, &format!("the number of texts of `{path}`"), found.space.count(), TEXTS)?;
    let is_text = found.kind == DatatypeKind::Texts;
    let cell = if is_text { 8 + ADDRESS } else { ADDRESS };
    let raw = cells(found, cell)?;
    let mut budget = limits::HEADER_BYTES;
    let mut heap = heap::HeapTexts::new(file);
    let mut texts = Vec::new();
    for bytes in raw.chunks_exact(cell) {
        let mut cursor = MetadataCursor::new(file, bytes, 0);
        let text = if is_text {
            heap.text(&mut cursor)?
        } else {
            let Some(address) = cursor.address()? else { return Ok(None) };
            let Some(text) = characters(found, address)? else { return Ok(None) };
            text
        };
        // What a text takes beside its bytes.
        let taken = text.len() as u64 + 64;
        limits::at_most(FORMAT, &format!("the length of the texts of `{path}`"), taken, budget)?;
        budget -= taken;
        texts.push(text);
    }
    Ok(Some(texts))
}

/// The text that a cell of MATLAB refers to.
fn characters(found: &FoundDataset, address: u64) -> Result<Option<Vec<u8>>, FormatError> {
    let object = Object { file: Arc::clone(&found.object.file), address };
    let header = object.header()?;
    if !header.has(Message::Layout) {
        return Ok(None);
    }
    let text = FoundDataset::look(object, header, &found.path)?;
    let DatatypeKind::Number(element) = text.kind else { return Ok(None) };
    if element.bytes != 2 || !text.is_class("char") {
        return Ok(None);
    }
    if text.attributes.get("MATLAB_empty").is_some() {
        return Ok(Some(Vec::new()));
    }
    let raw = cells(&text, 2)?;
    let mut utf8 = Vec::new();
    TextEncoding::Utf16 { big_endian: element.big_endian }.read(&raw, &mut utf8);
    Ok(Some(utf8))
}

/// The number of a dataset of one element; none where it cannot be read or was never written.
pub(super) fn single(found: &FoundDataset, element: Element) -> Option<f64> {
    let raw = cells(found, element.bytes).ok()?;
    Some(element.exact(raw.get(..element.bytes)?).rounded())
}

/// All elements of a small dataset, in the order in which they are stored.
fn cells(found: &FoundDataset, element: usize) -> Result<Vec<u8>, FormatError> {
    let (path, shape) = (&found.path, &found.space.shape);
    let bytes = found.space.count().saturating_mul(element as u64);
    limits::at_most(FORMAT, &format!("the bytes of `{path}`"), bytes, limits::HEADER_BYTES)?;
    let (rows, columns) = match shape[..] {
        [] => (1, 1),
        [rows] => (rows, 1),
        [rows, columns] => (rows, columns),
        _ => return Err(unsupported(format!("`{path}` of {} axes", shape.len()), "write one axis")),
    };
    let mut raw = Vec::new();
    let mut lane = lane_of(found, element, (rows, columns), false, found.object.file.source.length())?;
    // At most HEADER_BYTES.
    lane.read(usize::try_from(rows).unwrap_or(0), &mut raw)?;
    Ok(raw)
}

/// Records in memory.
struct Memory {
    bytes: Vec<u8>,
    record: usize,
    row: usize,
}

impl RecordLane for Memory {
    fn record(&self) -> usize {
        self.record
    }

    fn read(&mut self, rows: usize, out: &mut Vec<u8>) -> Result<(), FormatError> {
        out.clear();
        out.extend_from_slice(&self.bytes[self.row * self.record..(self.row + rows) * self.record]);
        self.row += rows;
        Ok(())
    }
}

/// Columns one after the other, as records.
struct TransposedColumns {
    source: Arc<SharedFile>,
    offset: u64,
    rows: u64,
    columns: u64,
    element: usize,
    row: u64,
}

impl RecordLane for TransposedColumns {
    fn record(&self) -> usize {
        usize::try_from(self.columns).unwrap_or(0) * self.element
    }

    fn read(&mut self, rows: usize, out: &mut Vec<u8>) -> Result<(), FormatError> {
        let record = self.record();
        out.resize(rows * record, 0);
        let mut column_bytes = vec![0; rows * self.element];
        for column in 0..self.columns {
            let first = column * self.rows + self.row;
            self.source.read_exact(FORMAT, self.offset + first * self.element as u64, &mut column_bytes)?;
            let at = usize::try_from(column).unwrap_or(0) * self.element;
            for (row, cell) in out.chunks_exact_mut(record).zip(column_bytes.chunks_exact(self.element)) {
                row[at..at + self.element].copy_from_slice(cell);
            }
        }
        self.row += rows as u64;
        Ok(())
    }
}

fn turn(raw: &[u8], element: usize, grid: &ChunkGrid) -> Vec<u8> {
    let rows = usize::try_from(grid.rows).unwrap_or(0);
    let mut turned = Vec::with_capacity(raw.len());
    for row in 0..rows {
        for column in raw.chunks_exact(rows * element) {
            turned.extend_from_slice(&column[row * element..(row + 1) * element]);
        }
    }
    turned
}

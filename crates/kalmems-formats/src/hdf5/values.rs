//! The way to the values of a dataset.

use super::chunks::{ChunkGrid, ChunkLane, LaneProgress};
use super::datatype::DatatypeKind;
use super::file::ADDRESS;
use super::filters::{self, DatasetFilter};
use super::header::{MessageKind as Message, ObjectHeader};
use super::heap;
use super::layout::DataLayout;
use super::objects::Object;
use super::{FORMAT, FoundDataset, TEXTS, unsupported};
use crate::element::Element;
use crate::records::{RecordLane, TextEncoding};
use crate::source::SharedFile;
use crate::stream::{FileStretch, StreamLane};
use crate::{FormatError, Result, limits};
use std::sync::Arc;

/// Where the values of a dataset are.
pub(super) enum DatasetValues {
    /// One after the other from a place of a file on, or in memory.
    Stretch(FileStretch, u64),
    /// In chunks, which give records.
    Chunks(Box<ChunkLane>),
}

/// Rows and columns of a dataset, whose elements have so many bytes.
#[derive(Clone, Copy)]
pub(super) struct DataShape {
    pub(super) rows: u64,
    pub(super) columns: u64,
    pub(super) element: usize,
    /// The rows are the last of its axes.
    pub(super) turned: bool,
}

/// The values of a dataset.
pub(super) fn values(found: &FoundDataset, shape: DataShape) -> Result<DatasetValues> {
    let FoundDataset { object: Object { file, .. }, header, path, space, .. } = found;
    let DataShape { rows, columns, element, turned } = shape;
    let what = format!("the bytes of an element of `{path}`");
    limits::at_most(FORMAT, &what, element, limits::ROW_BYTES)?;
    limits::plausible_rows(FORMAT, rows.saturating_mul(columns), file.source.length())?;
    let bytes = rows.saturating_mul(columns).saturating_mul(element as u64);
    let damaged = |found: String, expected: String| FormatError::damaged(FORMAT, path, found, expected);
    let never = || unsupported(format!("`{path}`, which was never written,"), "write its values");
    let whole = |source: &Arc<SharedFile>| FileStretch::stored(Arc::clone(source), FORMAT, "the file");
    match DataLayout::read(file, header)?.ok_or_else(never)? {
        _ if rows == 0 => Ok(DatasetValues::Stretch(whole(&file.source), 0)),
        DataLayout::Contiguous(None) => Err(never()),
        DataLayout::Contiguous(Some(offset)) => {
            file.source.within(FORMAT, offset, bytes)?;
            Ok(DatasetValues::Stretch(whole(&file.source), offset))
        }
        DataLayout::Compact(raw) if raw.len() as u64 == bytes => {
            Ok(DatasetValues::Stretch(whole(&in_memory(raw)?), 0))
        }
        DataLayout::Compact(raw) => Err(damaged(format!("{} bytes", raw.len()), format!("{bytes}"))),
        DataLayout::Chunked(chunked) => {
            let filters = filters_of(file, header, path)?;
            let (first, second) = match chunked.shape[..] {
                [first] if space.shape.len() == 1 => (first, 1),
                [first, second] if space.shape.len() == 2 => (first, second),
                _ => {
                    let found = format!("chunks of {} axes", chunked.shape.len());
                    return Err(damaged(found, format!("{}, as the dataset has", space.shape.len())));
                }
            };
            let (chunk_rows, chunk_columns) = if turned { (second, first) } else { (first, second) };
            let grid = ChunkGrid { rows, columns, element, chunk_rows, chunk_columns, turned };
            grid.check(path)?;
            Ok(DatasetValues::Chunks(Box::new(ChunkLane {
                file: Arc::clone(file),
                chunked,
                space: space.clone(),
                path: path.clone(),
                grid,
                filters,
                progress: LaneProgress::default(),
            })))
        }
        DataLayout::Virtual => {
            let what = format!("`{path}`, a virtual dataset whose values are in other datasets,");
            Err(unsupported(what, "name those, or copy it with h5repack"))
        }
        DataLayout::External => {
            let what = format!("`{path}`, whose values are in files that are no HDF5,");
            Err(unsupported(what, "copy them into one with h5repack"))
        }
    }
}

/// The values of a dataset as records, each of a row.
pub(super) fn lane(found: &FoundDataset, shape: DataShape) -> Result<Box<dyn RecordLane>> {
    let DataShape { rows, columns, element, turned } = shape;
    let record = usize::try_from(columns).unwrap_or(0) * element;
    let (stretch, offset) = match values(found, shape)? {
        DatasetValues::Chunks(lane) => return Ok(lane),
        DatasetValues::Stretch(stretch, offset) if turned && columns > 1 => {
            let bytes = rows.saturating_mul(record as u64);
            limits::at_most(FORMAT, &format!("the bytes of `{}`", found.path), bytes, limits::HEADER_BYTES)?;
            let raw = stretch.source.bytes(FORMAT, offset, bytes)?;
            let turned = in_memory(turn(&raw, element, usize::try_from(rows).unwrap_or(0)))?;
            (FileStretch::stored(turned, FORMAT, "the file"), 0)
        }
        DatasetValues::Stretch(stretch, offset) => (stretch, offset),
    };
    Ok(Box::new(StreamLane::new(stretch, offset, record)))
}

/// Bytes in memory as a file.
fn in_memory(bytes: Vec<u8>) -> Result<Arc<SharedFile>> {
    SharedFile::new(Box::new(std::io::Cursor::new(bytes))).map(Arc::new)
}

fn filters_of(file: &super::file::Hdf5File, header: &ObjectHeader, path: &str) -> Result<Vec<DatasetFilter>> {
    let ids = header.first(file, Message::Filters, filters::read)?.unwrap_or_default();
    let known = ids.into_iter().map(|id| {
        DatasetFilter::of(id).ok_or_else(|| {
            let remedy =
                "pack it with gzip, shuffle, fletcher32 or lzf, for instance with h5repack -f GZIP=4";
            unsupported(format!("`{path}`, packed by {},", filters::name(id)), remedy)
        })
    });
    known.collect()
}

/// The texts of a dataset of texts of their own lengths, or of a cell array of MATLAB; none where a cell is something else.
pub(super) fn texts(found: &FoundDataset) -> Result<Option<Vec<Vec<u8>>>> {
    let (file, path) = (&found.object.file, &found.path);
    limits::at_most(FORMAT, &format!("the number of texts of `{path}`"), found.space.count(), TEXTS)?;
    let is_text = found.kind == DatatypeKind::Texts;
    let cell = if is_text { 8 + ADDRESS } else { ADDRESS };
    let raw = cells(found, cell)?;
    let mut budget = limits::HEADER_BYTES;
    let mut heap = heap::HeapTexts::new(file);
    let mut texts = Vec::new();
    for bytes in raw.chunks_exact(cell) {
        let mut cursor = file.cursor(bytes, 0);
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
fn characters(found: &FoundDataset, address: u64) -> Result<Option<Vec<u8>>> {
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
fn cells(found: &FoundDataset, element: usize) -> Result<Vec<u8>> {
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
    let mut lane = lane(found, DataShape { rows, columns, element, turned: false })?;
    // At most HEADER_BYTES.
    lane.read(usize::try_from(rows).unwrap_or(0), &mut raw)?;
    Ok(raw)
}

/// Columns one after the other as rows one after the other.
fn turn(raw: &[u8], element: usize, rows: usize) -> Vec<u8> {
    let mut turned = Vec::with_capacity(raw.len());
    for row in 0..rows {
        for column in raw.chunks_exact(rows * element) {
            turned.extend_from_slice(&column[row * element..(row + 1) * element]);
        }
    }
    turned
}

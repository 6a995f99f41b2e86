//! The values of a chunked dataset, a band of chunks at a time.

use super::FORMAT;
use super::attributes::Dataspace;
use super::file::Hdf5File;
use super::filters::{self, DatasetFilter};
use super::layout::{Chunk, Chunked};
use crate::records::RecordLane;
use crate::{FormatError, Result, limits, refuse_if};
use std::sync::Arc;

/// Bytes of a chunk, and of the chunks side by side that are held together.
const BAND_BYTES: u64 = 16 << 20;
/// Chunks of a dataset.
const CHUNKS: u64 = 1 << 18;

/// How the rows of a table lie in a dataset.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ChunkGrid {
    pub(super) rows: u64,
    /// Elements of a row.
    pub(super) columns: u64,
    pub(super) element: usize,
    /// Rows and columns of a chunk.
    pub(super) chunk_rows: u64,
    pub(super) chunk_columns: u64,
    /// The rows are the second axis of the dataset, as MATLAB writes matrices.
    pub(super) turned: bool,
}

impl ChunkGrid {
    /// Refuses chunks that are too large, too many, or none.
    pub(super) fn check(&self, place: &str) -> Result<()> {
        refuse_if(self.chunk_rows == 0 || self.chunk_columns == 0 || self.element == 0, || {
            FormatError::damaged(FORMAT, place, "chunks without an element", "at least one in each")
        })?;
        let element = self.element as u64;
        let chunk = self.chunk_rows.saturating_mul(self.chunk_columns).saturating_mul(element);
        let repack = "repack it, for instance with h5repack -l CHUNK=16384";
        limits::at_most(FORMAT, &format!("the bytes of a chunk of `{place}` ({repack})"), chunk, BAND_BYTES)?;
        let band = self.chunk_rows.saturating_mul(self.columns).saturating_mul(element);
        let what = format!("the bytes of neighbouring chunks of `{place}` ({repack})");
        limits::at_most(FORMAT, &what, band, BAND_BYTES)?;
        let chunks =
            self.rows.div_ceil(self.chunk_rows).saturating_mul(self.columns.div_ceil(self.chunk_columns));
        limits::at_most(FORMAT, &format!("the number of chunks of `{place}` ({repack})"), chunks, CHUNKS)
    }

    fn chunk_bytes(&self) -> usize {
        // At most BAND_BYTES.
        usize::try_from(self.chunk_rows * self.chunk_columns).unwrap_or(0) * self.element
    }
}

/// Rows of a chunked dataset.
pub(super) struct ChunkLane {
    pub(super) file: Arc<Hdf5File>,
    pub(super) chunked: Chunked,
    pub(super) space: Dataspace,
    pub(super) path: String,
    pub(super) grid: ChunkGrid,
    pub(super) filters: Vec<DatasetFilter>,
    pub(super) progress: LaneProgress,
}

/// How far a lane is.
#[derive(Default)]
pub(super) struct LaneProgress {
    /// Where the chunks are, band after band; looked up when the first row is read.
    chunks: Vec<Option<Chunk>>,
    row: u64,
    /// The rows that are unpacked, and which band of chunks they are.
    band: Vec<u8>,
    band_number: Option<u64>,
}

impl ChunkLane {
    fn damaged(&self, found: String, expected: &str) -> FormatError {
        FormatError::damaged(FORMAT, self.path.clone(), found, expected)
    }

    /// Looks up where the chunks are.
    fn locate(&mut self) -> Result<()> {
        let grid = &self.grid;
        let across = grid.columns.div_ceil(grid.chunk_columns);
        let count = grid.rows.div_ceil(grid.chunk_rows) * across;
        // `check` bounds their number.
        let mut chunks = vec![None; usize::try_from(count).unwrap_or(0)];
        self.chunked.visit(&self.file, &self.space, grid.chunk_bytes() as u64, &mut |chunk| {
            let [first, second] = chunk.first;
            let (row, column) = if grid.turned { (second, first) } else { (first, second) };
            refuse_if(row % grid.chunk_rows != 0 || column % grid.chunk_columns != 0, || {
                self.damaged(format!("a chunk at ({first}, {second})"), "one at a multiple of its lengths")
            })?;
            // Chunks beyond the extent are left over from a larger one.
            if column >= grid.columns || row >= grid.rows {
                return Ok(());
            }
            let number = (row / grid.chunk_rows).checked_mul(across);
            let number = number.and_then(|number| number.checked_add(column / grid.chunk_columns));
            let number = number.and_then(|number| usize::try_from(number).ok());
            if let Some(place) = number.and_then(|number| chunks.get_mut(number)) {
                *place = Some(chunk);
            }
            Ok(())
        })?;
        self.progress.chunks = chunks;
        Ok(())
    }

    /// Unpacks the chunks side by side that hold a row.
    fn unpack(&mut self, number: u64) -> Result<()> {
        let grid = self.grid.clone();
        if self.progress.chunks.is_empty() {
            self.locate()?;
        }
        let across = grid.columns.div_ceil(grid.chunk_columns);
        // All of these are bounded by `check`.
        let small = |length: u64| usize::try_from(length).unwrap_or(0);
        let (element, columns) = (grid.element, small(grid.columns));
        let (chunk_rows, chunk_columns) = (small(grid.chunk_rows), small(grid.chunk_columns));
        self.progress.band.resize(chunk_rows * columns * element, 0);
        for beside in 0..across {
            let place = self.progress.chunks.get(small(number * across + beside)).copied().flatten();
            let place = place.ok_or_else(|| {
                let first = number * grid.chunk_rows + 1;
                let what = format!("`{}`, whose rows from {first} on were never written,", self.path);
                FormatError::unsupported(FORMAT, what, "write all of its values")
            })?;
            let chunk = self.chunk(place)?;
            let first = small(beside) * chunk_columns;
            let width = chunk_columns.min(columns - first);
            if !grid.turned && width == columns && width == chunk_columns {
                self.progress.band.copy_from_slice(&chunk);
                continue;
            }
            for row in 0..chunk_rows {
                let target = &mut self.progress.band[(row * columns + first) * element..][..width * element];
                if grid.turned {
                    for (column, cell) in target.chunks_exact_mut(element).enumerate() {
                        cell.copy_from_slice(&chunk[(column * chunk_rows + row) * element..][..element]);
                    }
                } else {
                    target.copy_from_slice(&chunk[row * chunk_columns * element..][..width * element]);
                }
            }
        }
        self.progress.band_number = Some(number);
        Ok(())
    }

    fn chunk(&self, place: Chunk) -> Result<Vec<u8>> {
        let bytes = self.grid.chunk_bytes();
        // What does not pack is a little longer than it was.
        limits::at_most(FORMAT, "the bytes of a packed chunk", place.bytes, bytes + bytes / 8 + 4096)?;
        let packed = self.file.source.bytes(FORMAT, place.address, place.bytes)?;
        filters::undo(&self.filters, place.mask, self.grid.element, bytes, packed).map_err(|found| {
            let found = format!("in its chunk at byte {} {found}", place.address);
            self.damaged(found, "a chunk as it was written")
        })
    }
}

impl RecordLane for ChunkLane {
    fn record(&self) -> usize {
        usize::try_from(self.grid.columns).unwrap_or(0) * self.grid.element
    }

    fn protection(&self) -> Option<&'static str> {
        self.filters.iter().find_map(|filter| filter.protection())
    }

    fn read(&mut self, rows: usize, out: &mut Vec<u8>) -> Result<()> {
        out.clear();
        let record = self.record();
        let mut missing = rows;
        while missing > 0 {
            let (band, within) =
                (self.progress.row / self.grid.chunk_rows, self.progress.row % self.grid.chunk_rows);
            if self.progress.band_number != Some(band) {
                self.unpack(band)?;
            }
            let left = self.grid.chunk_rows - within;
            let count = usize::try_from(left).unwrap_or(missing).min(missing);
            let start = usize::try_from(within).unwrap_or(0) * record;
            out.extend_from_slice(&self.progress.band[start..start + count * record]);
            self.progress.row += count as u64;
            missing -= count;
        }
        Ok(())
    }
}

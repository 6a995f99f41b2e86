//! How the values of a dataset are laid out, and where its chunks are (HDF5 File Format Specification, sections IV.A.2.i and
//! VII). Version 5, of HDF5 2.0, differs from 4 in the width of the lengths of packed chunks alone, which the indexes state
//! themselves.

use super::attributes::Dataspace;
use super::file::{Hdf5File, MetadataCursor};
use super::header::{MessageKind, ObjectHeader};
use super::index::{self, ArrayGrowth};
use super::{NEW_FILE, tree, unsupported};
use crate::{FormatError, Result, refuse_if};

/// The kinds of trees of chunks: of the first version, and of the second without and with filters.
const CHUNKS_OLDER: u8 = 1;
const CHUNKS: u8 = 10;
const PACKED_CHUNKS: u8 = 11;

/// Where the values of a dataset are.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum DataLayout {
    /// In the header itself.
    Compact(Vec<u8>),
    /// In one stretch; none where it was never written.
    Contiguous(Option<u64>),
    Chunked(Chunked),
    /// In other datasets.
    Virtual,
    /// In files that are no HDF5.
    External,
}

/// Chunks of one shape.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Chunked {
    /// The lengths of a chunk along the axes of the dataset.
    pub(super) shape: Vec<u64>,
    index: ChunkIndex,
}

/// How chunks are found.
#[derive(Clone, Copy, Debug, PartialEq)]
enum ChunkIndex {
    /// Nothing was written.
    None,
    OlderTree(u64),
    /// Only one, with its packed length and the filters that were left out.
    Single(u64, Option<(u64, u32)>),
    Array(u64, ArrayGrowth),
    Tree(u64),
}

/// A chunk that is in the file.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Chunk {
    /// Its first element along the first two axes.
    pub(super) first: [u64; 2],
    pub(super) address: u64,
    pub(super) bytes: u64,
    /// The filters that were left out.
    pub(super) mask: u32,
}

impl DataLayout {
    pub(super) fn read(file: &Hdf5File, header: &ObjectHeader) -> Result<Option<Self>> {
        if header.has(MessageKind::ExternalFiles) {
            return Ok(Some(Self::External));
        }
        header.first(file, MessageKind::Layout, layout)
    }
}

fn layout(cursor: &mut MetadataCursor<'_>) -> Result<DataLayout> {
    let version = cursor.u8()?;
    match version {
        1 | 2 => return Err(unsupported("a layout of HDF5 before 1.6.3", NEW_FILE)),
        3..=5 => {}
        _ => return Err(cursor.damaged(format!("version {version} of a layout"), "3 to 5")),
    }
    match cursor.u8()? {
        0 => {
            let bytes = usize::from(cursor.u16()?);
            Ok(DataLayout::Compact(cursor.take(bytes)?.to_vec()))
        }
        1 => Ok(DataLayout::Contiguous(cursor.address()?)),
        2 if version == 3 => {
            let axes = usize::from(cursor.u8()?);
            let tree = cursor.address()?;
            let index = tree.map_or(ChunkIndex::None, ChunkIndex::OlderTree);
            Ok(DataLayout::Chunked(Chunked { shape: lengths(cursor, axes, 4)?, index }))
        }
        2 => newest(cursor),
        3 => Ok(DataLayout::Virtual),
        class => Err(cursor.damaged(format!("a layout of class {class}"), "0 to 3")),
    }
}

/// The lengths of a chunk along each axis; behind them is the length of an element.
fn lengths(cursor: &mut MetadataCursor<'_>, axes: usize, width: usize) -> Result<Vec<u64>> {
    refuse_if(!(2..=33).contains(&axes) || !(1..=8).contains(&width), || {
        cursor.damaged(format!("chunks of {axes} axes with lengths of {width} bytes"), "1 to 32, and 1 to 8")
    })?;
    let mut shape = (0..axes).map(|_| cursor.number(width)).collect::<Result<Vec<_>, _>>()?;
    shape.pop();
    Ok(shape)
}

fn newest(cursor: &mut MetadataCursor<'_>) -> Result<DataLayout> {
    let flags = cursor.u8()?;
    let (axes, width) = (usize::from(cursor.u8()?), usize::from(cursor.u8()?));
    let shape = lengths(cursor, axes, width)?;
    refuse_if(flags & 1 != 0, || {
        unsupported("chunks that are not packed where they reach beyond the dataset", NEW_FILE)
    })?;
    let kind = cursor.u8()?;
    let index = match kind {
        1 => {
            let packed = if flags & 2 != 0 { Some((cursor.u64()?, cursor.u32()?)) } else { None };
            cursor.address()?.map(|address| ChunkIndex::Single(address, packed))
        }
        2 => {
            return Err(unsupported("chunks that are all allocated before they are written", NEW_FILE));
        }
        3 => cursor.skip(1)?.address()?.map(|address| ChunkIndex::Array(address, ArrayGrowth::Fixed)),
        4 => cursor.skip(5)?.address()?.map(|address| ChunkIndex::Array(address, ArrayGrowth::Extensible)),
        5 => cursor.skip(6)?.address()?.map(ChunkIndex::Tree),
        _ => return Err(cursor.damaged(format!("an index of kind {kind}"), "1 to 5")),
    };
    Ok(DataLayout::Chunked(Chunked { shape, index: index.unwrap_or(ChunkIndex::None) }))
}

impl Chunked {
    /// Visits the chunks that are in the file. `bytes` is the length of an unpacked chunk; the dataset has one or two axes.
    pub(super) fn visit(
        &self,
        file: &Hdf5File,
        space: &Dataspace,
        bytes: u64,
        each: &mut dyn FnMut(Chunk) -> Result<()>,
    ) -> Result<()> {
        let axes = self.shape.len();
        let first = |cursor: &mut MetadataCursor<'_>, scale: &dyn Fn(usize, u64) -> u64| {
            let mut first = [0; 2];
            for axis in 0..axes {
                let number = cursor.number(8)?;
                if let Some(place) = first.get_mut(axis) {
                    *place = scale(axis, number);
                }
            }
            Ok::<_, FormatError>(first)
        };
        let scaled = |axis: usize, number: u64| number.saturating_mul(self.shape[axis]);
        match self.index {
            ChunkIndex::None => Ok(()),
            ChunkIndex::OlderTree(tree) => {
                tree::older(file, tree, (CHUNKS_OLDER, 16 + 8 * axes, None), &mut |key, address| {
                    let (bytes, mask) = (u64::from(key.u32()?), key.u32()?);
                    each(Chunk { first: first(key, &|_, number| number)?, address, bytes, mask })
                })
            }
            ChunkIndex::Single(address, packed) => {
                let (bytes, mask) = packed.unwrap_or((bytes, 0));
                each(Chunk { first: [0; 2], address, bytes, mask })
            }
            ChunkIndex::Array(address, growth) => {
                index::visit(file, (address, growth), bytes, &mut |number, address, bytes, mask| {
                    each(Chunk { first: self.place(space, number), address, bytes, mask })
                })
            }
            ChunkIndex::Tree(address) => tree::newer(file, address, &mut |kind, record| {
                let packed = match kind {
                    CHUNKS => false,
                    PACKED_CHUNKS => true,
                    _ => return Err(record.damaged(format!("a tree of kind {kind}"), "10 or 11, of chunks")),
                };
                let address = record.known_address()?;
                let width = record.left().checked_sub(4 + 8 * axes).filter(|width| *width <= 8);
                let (bytes, mask) = match (packed, width) {
                    (false, _) => (bytes, 0),
                    (true, Some(width)) => (record.number(width)?, record.u32()?),
                    (true, None) => {
                        return Err(record.damaged("a record of another length", "that of a chunk"));
                    }
                };
                each(Chunk { first: first(record, &scaled)?, address, bytes, mask })
            }),
        }
    }

    /// How many chunks an axis has room for at most; 0 where it has no end.
    fn grid(&self, space: &Dataspace) -> Vec<u64> {
        let lengths = space.most.iter().zip(&self.shape);
        lengths.map(|(most, chunk)| most.map_or(0, |most| most.div_ceil((*chunk).max(1)))).collect()
    }

    /// The first element of a chunk by its number. Chunks are counted along the last axis first; an axis without an end
    /// counts as the first.
    fn place(&self, space: &Dataspace, number: u64) -> [u64; 2] {
        let grid = self.grid(space);
        let (rows, columns) = (self.shape[0], self.shape.get(1).copied().unwrap_or(1));
        let across = |axis: usize| grid.get(axis).copied().unwrap_or(1).max(1);
        let (row, column) = if grid.len() > 1 && grid[1] == 0 {
            (number % across(0), number / across(0))
        } else {
            (number / across(1), number % across(1))
        };
        [row.saturating_mul(rows), column.saturating_mul(columns)]
    }
}

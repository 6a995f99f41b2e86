//! How the values of a dataset are laid out, and where its chunks are (HDF5 File Format Specification, sections IV.A.2.i and
//! VII). Version 5, of HDF5 2.0, differs from 4 in the width of the lengths of packed chunks alone, which the indexes state
//! themselves.

use super::attributes::Dataspace;
use super::file::{Hdf5File, MetadataCursor};
use super::header::{MessageKind, ObjectHeader};
use super::{FORMAT, tree};
use crate::{FormatError, limits};

/// The kinds of trees of chunks: of the first version, and of the second without and with filters.
const CHUNKS_OLDER: u8 = 1;
const CHUNKS: u8 = 10;
const PACKED_CHUNKS: u8 = 11;
/// Entries of an index that are looked at, there or not.
const ENTRIES: u64 = 1 << 20;
/// Levels of an extensible array.
const LEVELS: u32 = 64;

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
    /// Chunks that reach beyond the dataset are not packed.
    pub(super) plain_edges: bool,
}

/// How chunks are found.
#[derive(Clone, Copy, Debug, PartialEq)]
enum ChunkIndex {
    /// Nothing was written.
    None,
    OlderTree(u64),
    /// Only one, with its packed length and the filters that were left out.
    Single(u64, Option<(u64, u32)>),
    /// One after the other.
    Implicit(u64),
    FixedArray(u64),
    ExtensibleArray(u64),
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
    pub(super) fn read(file: &Hdf5File, header: &ObjectHeader) -> Result<Option<Self>, FormatError> {
        if header.has(MessageKind::ExternalFiles) {
            return Ok(Some(Self::External));
        }
        header.first(file, MessageKind::Layout, layout)
    }
}

fn layout(cursor: &mut MetadataCursor<'_>) -> Result<DataLayout, FormatError> {
    let version = cursor.u8()?;
    match version {
        1 | 2 => oldest(cursor),
        3 => {
            let class = cursor.u8()?;
            if class != 2 {
                return plain(cursor, class);
            }
            let axes = usize::from(cursor.u8()?);
            let tree = cursor.address()?;
            let shape = lengths(cursor, axes, 4)?;
            Ok(DataLayout::Chunked(Chunked {
                shape,
                index: tree.map_or(ChunkIndex::None, ChunkIndex::OlderTree),
                plain_edges: false,
            }))
        }
        4 | 5 => {
            let class = cursor.u8()?;
            if class == 2 { newest(cursor) } else { plain(cursor, class) }
        }
        _ => Err(cursor.damaged(format!("version {version} of a layout"), "1 to 5")),
    }
}

/// Values that are not in chunks.
fn plain(cursor: &mut MetadataCursor<'_>, class: u8) -> Result<DataLayout, FormatError> {
    match class {
        0 => {
            let bytes = usize::from(cursor.u16()?);
            Ok(DataLayout::Compact(cursor.take(bytes)?.to_vec()))
        }
        1 => Ok(DataLayout::Contiguous(cursor.address()?)),
        3 => Ok(DataLayout::Virtual),
        _ => Err(cursor.damaged(format!("a layout of class {class}"), "0 to 3")),
    }
}

fn oldest(cursor: &mut MetadataCursor<'_>) -> Result<DataLayout, FormatError> {
    let (axes, class) = (usize::from(cursor.u8()?), cursor.u8()?);
    cursor.skip(5)?;
    match class {
        0 => {
            let bytes = cursor.skip(4 * axes)?.u32()? as usize;
            Ok(DataLayout::Compact(cursor.take(bytes)?.to_vec()))
        }
        1 => Ok(DataLayout::Contiguous(cursor.address()?)),
        2 => {
            let tree = cursor.address()?;
            let index = tree.map_or(ChunkIndex::None, ChunkIndex::OlderTree);
            // The last is the element's length.
            let shape = lengths(cursor, axes, 4)?;
            Ok(DataLayout::Chunked(Chunked { shape, index, plain_edges: false }))
        }
        _ => Err(cursor.damaged(format!("a layout of class {class}"), "0 to 2")),
    }
}

/// The lengths of a chunk along each axis; behind them is the length of an element.
fn lengths(cursor: &mut MetadataCursor<'_>, axes: usize, width: usize) -> Result<Vec<u64>, FormatError> {
    if !(2..=33).contains(&axes) || !(1..=8).contains(&width) {
        return Err(cursor
            .damaged(format!("chunks of {axes} axes with lengths of {width} bytes"), "1 to 32, and 1 to 8"));
    }
    let mut shape = (0..axes).map(|_| cursor.number(width)).collect::<Result<Vec<_>, _>>()?;
    shape.pop();
    Ok(shape)
}

fn newest(cursor: &mut MetadataCursor<'_>) -> Result<DataLayout, FormatError> {
    let flags = cursor.u8()?;
    let (axes, width) = (usize::from(cursor.u8()?), usize::from(cursor.u8()?));
    let shape = lengths(cursor, axes, width)?;
    let kind = cursor.u8()?;
    let index = match kind {
        1 => {
            let packed = if flags & 2 != 0 { Some((cursor.length()?, cursor.u32()?)) } else { None };
            cursor.address()?.map(|address| ChunkIndex::Single(address, packed))
        }
        2 => cursor.address()?.map(ChunkIndex::Implicit),
        3 => cursor.skip(1)?.address()?.map(ChunkIndex::FixedArray),
        4 => cursor.skip(5)?.address()?.map(ChunkIndex::ExtensibleArray),
        5 => cursor.skip(6)?.address()?.map(ChunkIndex::Tree),
        _ => return Err(cursor.damaged(format!("an index of kind {kind}"), "1 to 5")),
    };
    Ok(DataLayout::Chunked(Chunked {
        shape,
        index: index.unwrap_or(ChunkIndex::None),
        plain_edges: flags & 1 != 0,
    }))
}

impl Chunked {
    /// Visits the chunks that are in the file. `bytes` is the length of an unpacked chunk; the dataset has one or two axes.
    pub(super) fn visit(
        &self,
        file: &Hdf5File,
        space: &Dataspace,
        bytes: u64,
        each: &mut dyn FnMut(Chunk) -> Result<(), FormatError>,
    ) -> Result<(), FormatError> {
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
                tree::older(file, tree, CHUNKS_OLDER, 16 + 8 * axes, &mut |key, address| {
                    let (bytes, mask) = (u64::from(key.u32()?), key.u32()?);
                    each(Chunk { first: first(key, &|_, number| number)?, address, bytes, mask })
                })
            }
            ChunkIndex::Single(address, packed) => {
                let (bytes, mask) = packed.unwrap_or((bytes, 0));
                each(Chunk { first: [0; 2], address, bytes, mask })
            }
            ChunkIndex::Implicit(start) => {
                let count =
                    self.grid(space).iter().fold(1_u64, |count, length| count.saturating_mul(*length));
                limits::at_most(FORMAT, "the number of chunks", count, ENTRIES)?;
                for number in 0..count {
                    let address = start.saturating_add(number.saturating_mul(bytes));
                    each(Chunk { first: self.place(space, number), address, bytes, mask: 0 })?;
                }
                Ok(())
            }
            ChunkIndex::FixedArray(address) => self.fixed(file, space, address, bytes, each),
            ChunkIndex::ExtensibleArray(address) => self.extensible(file, space, address, bytes, each),
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

    /// An entry of an array of chunks.
    fn entry(
        &self,
        space: &Dataspace,
        entries: &mut IndexEntries<'_, '_>,
        number: u64,
        bytes: u64,
        each: &mut dyn FnMut(Chunk) -> Result<(), FormatError>,
    ) -> Result<(), FormatError> {
        let cursor = &mut *entries.cursor;
        let address = cursor.address()?;
        let (bytes, mask) = match entries.packed {
            None => (bytes, 0),
            Some(width) => (cursor.number(width)?, cursor.u32()?),
        };
        match address {
            Some(address) => each(Chunk { first: self.place(space, number), address, bytes, mask }),
            None => Ok(()),
        }
    }

    fn fixed(
        &self,
        file: &Hdf5File,
        space: &Dataspace,
        address: u64,
        bytes: u64,
        each: &mut dyn FnMut(Chunk) -> Result<(), FormatError>,
    ) -> Result<(), FormatError> {
        let head = file.block(address, (12 + file.length_bytes + file.offset_bytes) as u64)?;
        let mut cursor = MetadataCursor::new(file, &head, address);
        cursor.mark("FAHD")?;
        let kind = ArrayKind::read(cursor.skip(1)?)?;
        let page_bits = u32::from(cursor.u8()?);
        let count = cursor.length()?;
        let block = cursor.address()?;
        cursor.check_sum()?;
        limits::at_most(FORMAT, "the number of chunks", count, ENTRIES)?;
        let Some(block) = block else { return Ok(()) };
        let page = 1_u64.checked_shl(page_bits).unwrap_or(u64::MAX);
        let pages = if count > page { count.div_ceil(page) } else { 0 };
        let prefix = 6 + file.offset_bytes as u64 + pages.div_ceil(8);
        let own = if pages == 0 { count * kind.bytes as u64 } else { 0 };
        let raw = file.block(block, prefix + own + 4)?;
        let mut cursor = MetadataCursor::new(file, &raw, block);
        cursor.mark("FADB")?;
        #[allow(clippy::cast_possible_truncation)] // at most ENTRIES/8
        let written = cursor.skip(2 + file.offset_bytes)?.take(pages.div_ceil(8) as usize)?;
        if pages == 0 {
            let mut entries = kind.entries(&mut cursor);
            for number in 0..count {
                self.entry(space, &mut entries, number, bytes, each)?;
            }
            return cursor.check_sum();
        }
        cursor.check_sum()?;
        let mut place = block + raw.len() as u64;
        for number in 0..pages {
            let (first, last) = (number * page, ((number + 1) * page).min(count));
            let length = (last - first) * kind.bytes as u64 + 4;
            if bit(written, number) {
                self.page(file, space, (place, length, first..last), kind, bytes, each)?;
            }
            // The last is as long as it needs to be.
            place = place.saturating_add(length);
        }
        Ok(())
    }

    /// A page of entries with its checksum.
    fn page(
        &self,
        file: &Hdf5File,
        space: &Dataspace,
        (place, length, numbers): (u64, u64, std::ops::Range<u64>),
        kind: ArrayKind,
        bytes: u64,
        each: &mut dyn FnMut(Chunk) -> Result<(), FormatError>,
    ) -> Result<(), FormatError> {
        let raw = file.block(place, length)?;
        let mut cursor = MetadataCursor::new(file, &raw, place);
        let mut entries = kind.entries(&mut cursor);
        for number in numbers {
            self.entry(space, &mut entries, number, bytes, each)?;
        }
        cursor.check_sum()
    }

    fn extensible(
        &self,
        file: &Hdf5File,
        space: &Dataspace,
        address: u64,
        bytes: u64,
        each: &mut dyn FnMut(Chunk) -> Result<(), FormatError>,
    ) -> Result<(), FormatError> {
        let head = file.block(address, (16 + 6 * file.length_bytes + file.offset_bytes) as u64)?;
        let mut cursor = MetadataCursor::new(file, &head, address);
        cursor.mark("EAHD")?;
        let kind = ArrayKind::read(cursor.skip(1)?)?;
        let count_bits = u32::from(cursor.u8()?);
        let in_index = u64::from(cursor.u8()?);
        let (smallest, pointers) = (u64::from(cursor.u8()?), u64::from(cursor.u8()?));
        let page_bits = u32::from(cursor.u8()?);
        let used = cursor.skip(4 * file.length_bytes)?.length()?;
        let index = cursor.skip(file.length_bytes)?.address()?;
        cursor.check_sum()?;
        if !smallest.is_power_of_two() || !pointers.is_power_of_two() || count_bits > LEVELS || page_bits > 32
        {
            return Err(
                cursor.damaged("an array whose blocks do not double", "lengths that are powers of two")
            );
        }
        limits::at_most(FORMAT, "the number of chunks", used, ENTRIES)?;
        let Some(index) = index else { return Ok(()) };
        let array = ExtensibleArray {
            chunks: self,
            file,
            space,
            kind,
            bytes,
            used,
            in_index,
            smallest,
            page: 1 << page_bits,
            number_bytes: count_bits.div_ceil(8) as usize,
            levels: (1 + count_bits).saturating_sub(smallest.ilog2()),
            direct_levels: 2 * pointers.ilog2(),
        };
        array.read(index, each)
    }
}

/// What the entries of an array are.
#[derive(Clone, Copy)]
struct ArrayKind {
    bytes: usize,
    /// The width of a packed length.
    packed: Option<usize>,
}

/// Entries that are being read.
struct IndexEntries<'a, 'b> {
    cursor: &'a mut MetadataCursor<'b>,
    packed: Option<usize>,
}

impl ArrayKind {
    fn read(cursor: &mut MetadataCursor<'_>) -> Result<Self, FormatError> {
        let (client, bytes) = (cursor.u8()?, usize::from(cursor.u8()?));
        let offset = cursor.file.offset_bytes;
        let packed = match client {
            0 if bytes == offset => None,
            1 => Some(bytes.wrapping_sub(offset + 4)),
            _ => Some(0),
        };
        match packed {
            Some(width) if !(1..=8).contains(&width) => Err(cursor.damaged(
                format!("entries of kind {client} in {bytes} bytes"),
                "an address, or what is packed",
            )),
            packed => Ok(Self { bytes, packed }),
        }
    }

    fn entries<'a, 'b>(self, cursor: &'a mut MetadataCursor<'b>) -> IndexEntries<'a, 'b> {
        IndexEntries { cursor, packed: self.packed }
    }
}

/// An array that grows: an index, and blocks of entries whose lengths double level by level.
struct ExtensibleArray<'a> {
    chunks: &'a Chunked,
    file: &'a Hdf5File,
    space: &'a Dataspace,
    kind: ArrayKind,
    /// Of a chunk that is not packed.
    bytes: u64,
    /// Entries that are there.
    used: u64,
    in_index: u64,
    smallest: u64,
    /// Entries of a page.
    page: u64,
    number_bytes: usize,
    levels: u32,
    /// Levels whose blocks the index refers to itself.
    direct_levels: u32,
}

impl ExtensibleArray<'_> {
    /// The blocks of a level and the entries of each.
    fn level(&self, level: u32) -> (u64, u64) {
        (1 << (level / 2), self.smallest.saturating_mul(1 << level.div_ceil(2)))
    }

    fn read(
        &self,
        index: u64,
        each: &mut dyn FnMut(Chunk) -> Result<(), FormatError>,
    ) -> Result<(), FormatError> {
        let offset = self.file.offset_bytes;
        let direct: u64 = (0..self.direct_levels.min(self.levels)).map(|level| self.level(level).0).sum();
        let indirect = u64::from(self.levels.saturating_sub(self.direct_levels));
        let own = self.in_index * self.kind.bytes as u64;
        let length = 6 + offset as u64 + own + (direct + indirect) * offset as u64 + 4;
        let raw = self.file.block(index, length)?;
        let mut cursor = MetadataCursor::new(self.file, &raw, index);
        cursor.mark("EAIB")?;
        cursor.skip(2 + offset)?;
        let mut number = 0;
        let mut entries = self.kind.entries(&mut cursor);
        for _ in 0..self.in_index {
            if number < self.used {
                self.chunks.entry(self.space, &mut entries, number, self.bytes, each)?;
            } else {
                entries.cursor.skip(self.kind.bytes)?;
            }
            number += 1;
        }
        for level in 0..self.levels {
            let (blocks, count) = self.level(level);
            if number >= self.used {
                break;
            }
            if level < self.direct_levels {
                for _ in 0..blocks {
                    let block = cursor.address()?;
                    if let Some(block) = block.filter(|_| number < self.used) {
                        self.block(block, number, count, None, each)?;
                    }
                    number = number.saturating_add(count);
                }
            } else {
                if let Some(block) = cursor.address()? {
                    self.blocks(block, number, (blocks, count), each)?;
                }
                number = number.saturating_add(blocks.saturating_mul(count));
            }
        }
        Ok(())
    }

    /// The blocks of a level that has a list of its own.
    fn blocks(
        &self,
        place: u64,
        mut number: u64,
        (blocks, count): (u64, u64),
        each: &mut dyn FnMut(Chunk) -> Result<(), FormatError>,
    ) -> Result<(), FormatError> {
        let offset = self.file.offset_bytes;
        let pages = if count > self.page { count / self.page } else { 0 };
        let bits = pages.div_ceil(8);
        let prefix = 6 + offset + self.number_bytes;
        let length =
            blocks.saturating_mul(bits.saturating_add(offset as u64)).saturating_add(prefix as u64 + 4);
        let raw = self.file.block(place, length)?;
        let mut cursor = MetadataCursor::new(self.file, &raw, place);
        cursor.mark("EASB")?;
        // Bounded by the length of the block.
        let small = |length: u64| usize::try_from(length).unwrap_or(usize::MAX);
        let written = cursor.skip(prefix - 4)?.take(small(blocks * bits))?;
        for block in 0..blocks {
            let address = cursor.address()?;
            if let Some(address) = address.filter(|_| number < self.used) {
                let written = &written[small(block * bits)..small((block + 1) * bits)];
                self.block(address, number, count, (pages > 0).then_some(written), each)?;
            }
            number = number.saturating_add(count);
        }
        cursor.check_sum()
    }

    /// A block of entries, all at once or in pages, of which some may never have been written.
    fn block(
        &self,
        place: u64,
        number: u64,
        count: u64,
        pages: Option<&[u8]>,
        each: &mut dyn FnMut(Chunk) -> Result<(), FormatError>,
    ) -> Result<(), FormatError> {
        let prefix = 6 + self.file.offset_bytes + self.number_bytes;
        let bytes = self.kind.bytes as u64;
        let last = number.saturating_add(count).min(self.used);
        let Some(written) = pages else {
            let raw = self.file.block(
                place,
                (prefix as u64).saturating_add(count.saturating_mul(bytes)).saturating_add(4),
            )?;
            let mut cursor = MetadataCursor::new(self.file, &raw, place);
            cursor.mark("EADB")?;
            cursor.skip(prefix - 4)?;
            let mut entries = self.kind.entries(&mut cursor);
            for number in number..last {
                self.chunks.entry(self.space, &mut entries, number, self.bytes, each)?;
            }
            let unused = usize::try_from(count - (last - number)).unwrap_or(usize::MAX);
            return cursor.skip(unused.saturating_mul(self.kind.bytes))?.check_sum();
        };
        let raw = self.file.block(place, prefix as u64 + 4)?;
        let mut cursor = MetadataCursor::new(self.file, &raw, place);
        cursor.mark("EADB")?;
        cursor.skip(prefix - 4)?.check_sum()?;
        let length = self.page * bytes + 4;
        for page in 0..count / self.page {
            let first = number + page * self.page;
            if first >= last {
                break;
            }
            if bit(written, page) {
                let place =
                    place.saturating_add(raw.len() as u64).saturating_add(page.saturating_mul(length));
                let numbers = first..(first + self.page).min(last);
                let length = self.page * bytes + 4;
                self.page(place, length, numbers, each)?;
            }
        }
        Ok(())
    }

    fn page(
        &self,
        place: u64,
        length: u64,
        numbers: std::ops::Range<u64>,
        each: &mut dyn FnMut(Chunk) -> Result<(), FormatError>,
    ) -> Result<(), FormatError> {
        let raw = self.file.block(place, length)?;
        let mut cursor = MetadataCursor::new(self.file, &raw, place);
        let unused = self.page - (numbers.end - numbers.start);
        let mut entries = self.kind.entries(&mut cursor);
        for number in numbers {
            self.chunks.entry(self.space, &mut entries, number, self.bytes, each)?;
        }
        let unused = usize::try_from(unused).unwrap_or(usize::MAX);
        cursor.skip(unused.saturating_mul(self.kind.bytes))?.check_sum()
    }
}

/// A bit of many, the highest of each byte first.
fn bit(bits: &[u8], number: u64) -> bool {
    let byte = usize::try_from(number / 8).ok().and_then(|byte| bits.get(byte));
    byte.is_some_and(|byte| byte & (0x80 >> (number % 8)) != 0)
}

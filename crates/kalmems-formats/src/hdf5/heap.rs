//! Where HDF5 keeps what has a length of its own: local heaps (names of old groups), global heaps (texts) and fractal
//! heaps (links and attributes of large objects); HDF5 File Format Specification, sections III.D, E and G.

use super::file::{ADDRESS, Hdf5File, LENGTH, MetadataCursor, check_sum};
use super::header::{MessageKind, ObjectHeader};
use super::{FORMAT, NEW_FILE, tree, unsupported};
use crate::{FormatError, Result, limits, refuse_if};

/// The names of an old group.
pub(super) struct LocalHeap {
    bytes: Vec<u8>,
    place: u64,
}

impl LocalHeap {
    pub(super) fn read(file: &Hdf5File, address: u64) -> Result<Self> {
        let head = file.block(address, 8 + 2 * LENGTH as u64 + ADDRESS as u64)?;
        let mut cursor = file.cursor(&head, address);
        cursor.mark(b"HEAP")?;
        let bytes = cursor.skip(4)?.u64()?;
        cursor.u64()?;
        let place = cursor.known_address()?;
        Ok(Self { bytes: file.block(place, bytes)?, place })
    }

    pub(super) fn text(&self, file: &Hdf5File, offset: u64) -> Result<String> {
        let mut cursor = file.cursor(&self.bytes, self.place);
        cursor.skip(usize::try_from(offset).unwrap_or(usize::MAX))?.name()
    }
}

/// Reads texts of their own length, which refer to collections; the last collection is kept.
pub(super) struct HeapTexts<'a> {
    file: &'a Hdf5File,
    collection: Option<(u64, Vec<u8>)>,
}

impl<'a> HeapTexts<'a> {
    pub(super) fn new(file: &'a Hdf5File) -> Self {
        Self { file, collection: None }
    }

    /// Reads the text that a cell of 4 bytes, an address and 4 bytes refers to.
    pub(super) fn text(&mut self, cell: &mut MetadataCursor<'_>) -> Result<Vec<u8>> {
        let length = cell.u32()? as usize;
        let (address, number) = (cell.address()?, cell.u32()?);
        let Some(address) = address.filter(|_| length > 0 && number > 0) else { return Ok(Vec::new()) };
        let (place, bytes) = match self.collection.take() {
            Some(kept) if kept.0 == address => kept,
            _ => {
                let file = self.file;
                let head = file.block(address, 8 + LENGTH as u64)?;
                let mut cursor = file.cursor(&head, address);
                cursor.mark(b"GCOL")?;
                let bytes = cursor.skip(4)?.u64()?;
                (address, file.block(address, bytes)?)
            }
        };
        let text = find(&mut self.file.cursor(&bytes, place), number, length)?;
        self.collection = Some((place, bytes));
        Ok(text)
    }
}

/// An object of a collection.
fn find(cursor: &mut MetadataCursor<'_>, number: u32, length: usize) -> Result<Vec<u8>> {
    cursor.skip(8 + LENGTH)?;
    while cursor.left() >= 8 + LENGTH {
        let found = cursor.u16()?;
        let bytes = cursor.skip(6)?.u64()?;
        // The rest is free.
        if found == 0 {
            break;
        }
        let bytes = usize::try_from(bytes).unwrap_or(usize::MAX);
        if u32::from(found) == number {
            let text = cursor.take(bytes)?;
            return match text.get(..length) {
                Some(text) => Ok(text.to_vec()),
                None => Err(cursor.damaged(format!("a text of {bytes} bytes"), &format!("{length} of them"))),
            };
        }
        cursor.skip(bytes)?;
        let padding = (bytes.next_multiple_of(8) - bytes).min(cursor.left());
        cursor.skip(padding)?;
    }
    Err(cursor.damaged(format!("no object {number} in a collection"), "it there"))
}

/// A heap of objects in blocks that double in size.
struct FractalHeap<'a> {
    file: &'a Hdf5File,
    id_bytes: usize,
    /// Width of an offset in the heap, and of a length.
    offset_bytes: usize,
    size_bytes: usize,
    width: u64,
    start_bytes: u64,
    direct_rows: u32,
    root: Option<u64>,
    root_rows: u32,
    /// The last block, as most objects are in it.
    block: Option<(u64, Vec<u8>, u64)>,
}

impl<'a> FractalHeap<'a> {
    fn read(file: &'a Hdf5File, address: u64) -> Result<Self> {
        let head = file.block(address, (26 + 12 * LENGTH + 3 * ADDRESS) as u64)?;
        let mut cursor = file.cursor(&head, address);
        cursor.mark(b"FRHP")?;
        let id_bytes = usize::from(cursor.skip(1)?.u16()?);
        refuse_if(cursor.u16()? > 0, || unsupported("links or attributes that are packed", NEW_FILE))?;
        let largest = u64::from(cursor.skip(1)?.u32()?);
        cursor.skip(10 * LENGTH + 2 * ADDRESS)?;
        let width = u64::from(cursor.u16()?);
        let (start_bytes, direct_bytes) = (cursor.u64()?, cursor.u64()?);
        let offset_bits = u32::from(cursor.u16()?);
        cursor.skip(2)?;
        let (root, root_rows) = (cursor.address()?, u32::from(cursor.u16()?));
        check_sum(&mut cursor)?;
        let powers = [width, start_bytes, direct_bytes].iter().all(|length| length.is_power_of_two());
        refuse_if(
            !powers || direct_bytes < start_bytes || offset_bits > 64 || !(1..=64).contains(&id_bytes),
            || cursor.damaged("a heap whose blocks do not double", "lengths that are powers of two"),
        )?;
        limits::at_most(FORMAT, "the bytes of a block of a heap", direct_bytes, limits::HEADER_BYTES)?;
        // What the lengths of the objects take: the smaller of the two bounds.
        let size_bytes = (direct_bytes.ilog2().div_ceil(8)).min(largest.max(1).ilog2() / 8 + 1);
        Ok(Self {
            file,
            id_bytes,
            offset_bytes: offset_bits.div_ceil(8) as usize,
            size_bytes: size_bytes as usize,
            width,
            start_bytes,
            direct_rows: direct_bytes.ilog2() - start_bytes.ilog2() + 2,
            root,
            root_rows,
            block: None,
        })
    }

    /// Reads an object; none where it is kept in a way that small objects are not.
    fn object(&mut self, id: &[u8]) -> Result<Option<Vec<u8>>> {
        let mut cursor = self.file.cursor(id, 0);
        let kind = cursor.u8()?;
        match (kind >> 4) & 3 {
            0 => {}
            // In the identifier itself.
            2 => return Ok(Some(cursor.take(usize::from(kind & 15) + 1)?.to_vec())),
            _ => return Ok(None),
        }
        let offset = cursor.number(self.offset_bytes)?;
        let bytes = usize::try_from(cursor.number(self.size_bytes)?).unwrap_or(usize::MAX);
        let kept = self.block.take().filter(|(start, block, _)| {
            offset.checked_sub(*start).is_some_and(|within| within < block.len() as u64)
        });
        let (start, block, place) = match kept {
            Some(kept) => kept,
            None => self.find(offset)?,
        };
        let mut cursor = self.file.cursor(&block, place);
        #[allow(clippy::cast_possible_truncation)] // within a block
        let object = cursor.skip((offset - start) as usize)?.take(bytes)?.to_vec();
        self.block = Some((start, block, place));
        Ok(Some(object))
    }

    /// The block that an offset is in: where it begins in the heap, its bytes and its place.
    fn find(&self, offset: u64) -> Result<(u64, Vec<u8>, u64)> {
        let lost = || {
            FormatError::damaged(FORMAT, "a heap", format!("an object at its byte {offset}"), "a block there")
        };
        let mut place = self.root.ok_or_else(lost)?;
        let (mut start, mut rows) = (0_u64, self.root_rows);
        if rows == 0 {
            refuse_if(offset >= self.start_bytes, lost)?;
            return Ok((0, self.file.block(place, self.start_bytes)?, place));
        }
        // Each is smaller than the one that it is in.
        loop {
            let within = offset - start;
            let first = self.width.checked_mul(self.start_bytes).ok_or_else(lost)?;
            let (row, row_start, bytes) = if within < first {
                (0, 0, self.start_bytes)
            } else {
                let double = (within / first).ilog2();
                (double + 1, first << double, self.start_bytes << double)
            };
            refuse_if(row >= rows, lost)?;
            let column = (within - row_start) / bytes;
            start += row_start + column * bytes;
            let child = self.child(place, u64::from(row) * self.width + column, rows)?;
            place = child.ok_or_else(lost)?;
            if row < self.direct_rows {
                return Ok((start, self.file.block(place, bytes)?, place));
            }
            rows = bytes.ilog2().checked_sub(first.ilog2()).map_or(0, |double| double + 1);
        }
    }

    /// The address of a block within an indirect one.
    fn child(&self, place: u64, number: u64, rows: u32) -> Result<Option<u64>> {
        let prefix = 5 + ADDRESS as u64 + self.offset_bytes as u64;
        let all = u64::from(rows).saturating_mul(self.width).saturating_mul(ADDRESS as u64);
        let block = self.file.block(place, prefix.saturating_add(all).saturating_add(4))?;
        let mut cursor = self.file.cursor(&block, place);
        cursor.mark(b"FHIB")?;
        let before = usize::try_from(prefix + number * ADDRESS as u64).unwrap_or(usize::MAX);
        cursor.skip(before.saturating_sub(4))?.address()
    }
}

/// Reads the messages of an object that do not fit into its header: those that the tree of their names refers to, in the heap that keeps them. `kind` is
/// the message that says where both are; `order_bytes` are those of the largest order of creation therein, and `skip` those before the place of a message in
/// the records of the tree by its kind.
pub(super) fn each_dense(
    file: &Hdf5File,
    header: &ObjectHeader,
    kind: MessageKind,
    (order_bytes, skip): (usize, &dyn Fn(u8) -> Option<usize>),
    each: &mut dyn FnMut(&mut MetadataCursor<'_>) -> Result<()>,
) -> Result<()> {
    let places = header.first(file, kind, |cursor| {
        let flags = cursor.skip(1)?.u8()?;
        cursor.skip(if flags & 1 != 0 { order_bytes } else { 0 })?;
        Ok((cursor.address()?, cursor.address()?))
    })?;
    let Some((heap, names)) = places.and_then(|(heap, names)| heap.zip(names)) else { return Ok(()) };
    let mut heap = FractalHeap::read(file, heap)?;
    tree::newer(file, names, &mut |kind, record| {
        let before = skip(kind);
        let before = before
            .ok_or_else(|| record.damaged(format!("a tree of kind {kind}"), "one of links or attributes"))?;
        let place = record.skip(before)?.place();
        let id = record.take(heap.id_bytes)?;
        heap.object(id)?.map_or(Ok(()), |body| each(&mut file.cursor(&body, place)))
    })
}

//! Arrays of chunks: of a fixed number, and extensible ones, whose blocks double (HDF5 File Format Specification, sections VII.C and D).

use super::FORMAT;
use super::file::{ADDRESS, Hdf5File, LENGTH, MetadataCursor, check_sum};
use crate::{FormatError, limits, refuse_if};

/// Entries of an index that are looked at, there or not.
const ENTRIES: u64 = 1 << 20;
/// Levels of an extensible array.
const LEVELS: u32 = 64;
/// What every block of an array begins with: a mark, a version and a kind, and the address of the array's header.
const PREFIX: usize = 6 + ADDRESS;

/// How an array grows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ArrayGrowth {
    Fixed,
    Extensible,
}

/// Hears of a chunk: its number, its address, its bytes and the filters that were left out.
type Visit<'a> = &'a mut dyn FnMut(u64, u64, u64, u32) -> Result<(), FormatError>;

/// The chunks of a dataset, one entry each.
pub(super) struct ChunkArray<'a> {
    pub(super) file: &'a Hdf5File,
    /// Bytes of a chunk that is not packed.
    pub(super) unpacked: u64,
}

/// The entries of an array.
struct ArrayEntries<'a> {
    array: &'a ChunkArray<'a>,
    /// Bytes of an entry, and the width of its packed length, where it has one.
    bytes: usize,
    packed: Option<usize>,
    /// As many are there.
    used: u64,
    /// Entries of a page.
    page: u64,
}

/// The blocks of an array that grows: their lengths double level by level.
struct DoublingBlocks {
    in_index: u64,
    smallest: u64,
    /// Bytes of the number of its first entry, which a block begins with.
    number_bytes: usize,
    levels: u32,
    /// Levels whose blocks the index refers to itself.
    direct_levels: u32,
}

impl<'a> ChunkArray<'a> {
    pub(super) fn visit(
        &'a self,
        address: u64,
        growth: ArrayGrowth,
        each: Visit<'_>,
    ) -> Result<(), FormatError> {
        match growth {
            ArrayGrowth::Fixed => self.fixed(address, each),
            ArrayGrowth::Extensible => self.extensible(address, each),
        }
    }

    fn fixed(&'a self, address: u64, each: Visit<'_>) -> Result<(), FormatError> {
        let head = self.file.block(address, (12 + LENGTH + ADDRESS) as u64)?;
        let mut cursor = self.file.cursor(&head, address);
        cursor.mark(b"FAHD")?;
        let mut entries = self.entries(cursor.skip(1)?)?;
        entries.page = 1_u64.checked_shl(u32::from(cursor.u8()?)).unwrap_or(u64::MAX);
        let (count, block) = (cursor.u64()?, cursor.address()?);
        check_sum(&mut cursor)?;
        limits::at_most(FORMAT, "the number of chunks", count, ENTRIES)?;
        entries.used = count;
        let Some(block) = block else { return Ok(()) };
        if count <= entries.page {
            return entries.block(block, "FADB", PREFIX, (0, count), each);
        }
        let bits = count.div_ceil(entries.page).div_ceil(8);
        let raw = self.file.block(block, PREFIX as u64 + bits + 4)?;
        let mut cursor = self.file.cursor(&raw, block);
        cursor.mark(b"FADB")?;
        let written = cursor.skip(PREFIX - 4)?.take(small(bits))?;
        check_sum(&mut cursor)?;
        entries.pages(block + raw.len() as u64, (0, count), written, each)
    }

    fn extensible(&'a self, address: u64, each: Visit<'_>) -> Result<(), FormatError> {
        let head = self.file.block(address, (16 + 6 * LENGTH + ADDRESS) as u64)?;
        let mut cursor = self.file.cursor(&head, address);
        cursor.mark(b"EAHD")?;
        let mut entries = self.entries(cursor.skip(1)?)?;
        let count_bits = u32::from(cursor.u8()?);
        let in_index = u64::from(cursor.u8()?);
        let (smallest, pointers) = (u64::from(cursor.u8()?), u64::from(cursor.u8()?));
        let page_bits = u32::from(cursor.u8()?);
        entries.used = cursor.skip(4 * LENGTH)?.u64()?;
        let index = cursor.skip(LENGTH)?.address()?;
        check_sum(&mut cursor)?;
        let powers = smallest.is_power_of_two() && pointers.is_power_of_two();
        refuse_if(!powers || count_bits > LEVELS || page_bits > 32, || {
            cursor.damaged("an array whose blocks do not double", "lengths that are powers of two")
        })?;
        limits::at_most(FORMAT, "the number of chunks", entries.used, ENTRIES)?;
        entries.page = 1 << page_bits;
        let blocks = DoublingBlocks {
            in_index,
            smallest,
            number_bytes: count_bits.div_ceil(8) as usize,
            levels: (1 + count_bits).saturating_sub(smallest.ilog2()),
            direct_levels: 2 * pointers.ilog2(),
        };
        index.map_or(Ok(()), |index| blocks.visit(&entries, index, each))
    }

    /// What a header says of the entries.
    fn entries(&'a self, cursor: &mut MetadataCursor<'_>) -> Result<ArrayEntries<'a>, FormatError> {
        let (client, bytes) = (cursor.u8()?, usize::from(cursor.u8()?));
        let width = bytes.checked_sub(ADDRESS + 4).filter(|width| (1..=8).contains(width));
        let packed = match (client, width) {
            (0, _) if bytes == ADDRESS => None,
            (1, Some(width)) => Some(width),
            _ => {
                let found = format!("entries of kind {client} in {bytes} bytes");
                return Err(cursor.damaged(found, "an address, or what is packed"));
            }
        };
        Ok(ArrayEntries { array: self, bytes, packed, used: 0, page: 0 })
    }
}

impl ArrayEntries<'_> {
    fn entry(
        &self,
        cursor: &mut MetadataCursor<'_>,
        number: u64,
        each: Visit<'_>,
    ) -> Result<(), FormatError> {
        let address = cursor.address()?;
        let (bytes, mask) = match self.packed {
            None => (self.array.unpacked, 0),
            Some(width) => (cursor.number(width)?, cursor.u32()?),
        };
        match address {
            Some(address) if number < self.used => each(number, address, bytes, mask),
            _ => Ok(()),
        }
    }

    /// So many entries from a number on, behind a prefix that begins with a mark.
    fn block(
        &self,
        place: u64,
        mark: &str,
        prefix: usize,
        (first, count): (u64, u64),
        each: Visit<'_>,
    ) -> Result<(), FormatError> {
        let file = self.array.file;
        let length = count.saturating_mul(self.bytes as u64).saturating_add(prefix as u64 + 4);
        let raw = file.block(place, length)?;
        let mut cursor = file.cursor(&raw, place);
        cursor.mark(mark.as_bytes())?;
        cursor.skip(prefix - mark.len())?;
        for number in first..first + count {
            self.entry(&mut cursor, number, each)?;
        }
        check_sum(&mut cursor)
    }

    /// The same in pages with a checksum each, of which some may never have been written; the last is as long as it needs to be.
    fn pages(
        &self,
        mut place: u64,
        (first, count): (u64, u64),
        written: &[u8],
        each: Visit<'_>,
    ) -> Result<(), FormatError> {
        let last = first.saturating_add(count);
        for number in 0..count.div_ceil(self.page) {
            let begin = first + number * self.page;
            if begin >= self.used {
                break;
            }
            let entries = self.page.min(last - begin);
            if bit(written, number) {
                self.block(place, "", 0, (begin, entries), each)?;
            }
            place = place.saturating_add(entries.saturating_mul(self.bytes as u64).saturating_add(4));
        }
        Ok(())
    }
}

impl DoublingBlocks {
    /// The blocks of a level and the entries of each.
    fn level(&self, level: u32) -> (u64, u64) {
        (1 << (level / 2), self.smallest.saturating_mul(1 << level.div_ceil(2)))
    }

    fn visit(&self, entries: &ArrayEntries<'_>, index: u64, each: Visit<'_>) -> Result<(), FormatError> {
        let file = entries.array.file;
        let direct: u64 = (0..self.direct_levels.min(self.levels)).map(|level| self.level(level).0).sum();
        let addresses = direct + u64::from(self.levels.saturating_sub(self.direct_levels));
        let own = self.in_index * entries.bytes as u64;
        let raw = file.block(index, PREFIX as u64 + own + addresses * ADDRESS as u64 + 4)?;
        let mut cursor = file.cursor(&raw, index);
        cursor.mark(b"EAIB")?;
        cursor.skip(PREFIX - 4)?;
        for number in 0..self.in_index {
            entries.entry(&mut cursor, number, each)?;
        }
        let mut number = self.in_index;
        for level in 0..self.levels {
            let (blocks, count) = self.level(level);
            if level >= self.direct_levels {
                if let Some(place) = cursor.address()?.filter(|_| number < entries.used) {
                    self.listed(entries, place, number, (blocks, count), each)?;
                }
                number = number.saturating_add(blocks.saturating_mul(count));
                continue;
            }
            for _ in 0..blocks {
                if let Some(place) = cursor.address()?.filter(|_| number < entries.used) {
                    entries.block(place, "EADB", PREFIX + self.number_bytes, (number, count), each)?;
                }
                number = number.saturating_add(count);
            }
        }
        check_sum(&mut cursor)
    }

    /// The blocks of a level that has a list of its own.
    fn listed(
        &self,
        entries: &ArrayEntries<'_>,
        place: u64,
        mut number: u64,
        (blocks, count): (u64, u64),
        each: Visit<'_>,
    ) -> Result<(), FormatError> {
        let (file, prefix) = (entries.array.file, PREFIX + self.number_bytes);
        let pages = if count > entries.page { count / entries.page } else { 0 };
        let bits = pages.div_ceil(8);
        let length = blocks.saturating_mul(bits + ADDRESS as u64).saturating_add(prefix as u64 + 4);
        let raw = file.block(place, length)?;
        let mut cursor = file.cursor(&raw, place);
        cursor.mark(b"EASB")?;
        // Bounded by the length of the block.
        let written = cursor.skip(prefix - 4)?.take(small(blocks * bits))?;
        for block in 0..blocks {
            let address = cursor.address()?.filter(|_| number < entries.used);
            match address {
                Some(address) if pages == 0 => {
                    entries.block(address, "EADB", prefix, (number, count), each)?;
                }
                Some(address) => {
                    let raw = file.block(address, prefix as u64 + 4)?;
                    let mut own = file.cursor(&raw, address);
                    own.mark(b"EADB")?;
                    check_sum(own.skip(prefix - 4)?)?;
                    let written =
                        written.get(small(block * bits)..small((block + 1) * bits)).unwrap_or_default();
                    entries.pages(address + raw.len() as u64, (number, count), written, each)?;
                }
                None => {}
            }
            number = number.saturating_add(count);
        }
        check_sum(&mut cursor)
    }
}

fn small(length: u64) -> usize {
    usize::try_from(length).unwrap_or(usize::MAX)
}

/// A bit of many, the highest of each byte first.
fn bit(bits: &[u8], number: u64) -> bool {
    bits.get(small(number / 8)).is_some_and(|byte| byte & (0x80 >> (number % 8)) != 0)
}

//! Arrays of chunks: of a fixed number, and extensible ones, whose blocks double (HDF5 File Format Specification, sections VII.C and D).

use super::FORMAT;
use super::file::{ADDRESS, Hdf5File, LENGTH, MetadataCursor, check_sum};
use crate::{Result, limits, refuse_if};

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
pub(super) type VisitChunk<'a> = &'a mut dyn FnMut(u64, u64, u64, u32) -> Result<()>;

/// The entries of an array of chunks, one for each chunk of a dataset.
struct ArrayEntries<'a> {
    file: &'a Hdf5File,
    /// Bytes of a chunk that is not packed.
    unpacked: u64,
    each: VisitChunk<'a>,
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

/// Visits the chunks of an array whose header stands at an address. A chunk that is not packed has so many bytes.
pub(super) fn visit(
    file: &Hdf5File,
    (address, growth): (u64, ArrayGrowth),
    unpacked: u64,
    each: VisitChunk<'_>,
) -> Result<()> {
    let mut entries = ArrayEntries { file, unpacked, each, bytes: 0, packed: None, used: 0, page: 0 };
    match growth {
        ArrayGrowth::Fixed => entries.fixed(address),
        ArrayGrowth::Extensible => entries.extensible(address),
    }
}

impl ArrayEntries<'_> {
    fn fixed(&mut self, address: u64) -> Result<()> {
        let head = self.file.block(address, (12 + LENGTH + ADDRESS) as u64)?;
        let mut cursor = self.file.cursor(&head, address);
        self.learn(cursor.mark(b"FAHD")?.skip(1)?)?;
        self.page = 1_u64.checked_shl(u32::from(cursor.u8()?)).unwrap_or(u64::MAX);
        let (count, block) = (cursor.u64()?, cursor.address()?);
        check_sum(&mut cursor)?;
        limits::at_most(FORMAT, "the number of chunks", count, ENTRIES)?;
        self.used = count;
        let Some(block) = block else { return Ok(()) };
        if count <= self.page {
            return self.block(block, (b"FADB", PREFIX), (0, count));
        }
        let bits = count.div_ceil(self.page).div_ceil(8);
        let raw = self.file.block(block, PREFIX as u64 + bits + 4)?;
        let mut cursor = self.file.cursor(&raw, block);
        let written = cursor.mark(b"FADB")?.skip(PREFIX - 4)?.take(small(bits))?;
        check_sum(&mut cursor)?;
        self.pages(block + raw.len() as u64, (0, count), written)
    }

    fn extensible(&mut self, address: u64) -> Result<()> {
        let head = self.file.block(address, (16 + 6 * LENGTH + ADDRESS) as u64)?;
        let mut cursor = self.file.cursor(&head, address);
        self.learn(cursor.mark(b"EAHD")?.skip(1)?)?;
        let (count_bits, in_index) = (u32::from(cursor.u8()?), u64::from(cursor.u8()?));
        let (smallest, pointers) = (u64::from(cursor.u8()?), u64::from(cursor.u8()?));
        let page_bits = u32::from(cursor.u8()?);
        self.used = cursor.skip(4 * LENGTH)?.u64()?;
        let index = cursor.skip(LENGTH)?.address()?;
        check_sum(&mut cursor)?;
        let powers = smallest.is_power_of_two() && pointers.is_power_of_two();
        refuse_if(!powers || count_bits > LEVELS || page_bits > 32, || {
            cursor.damaged("an array whose blocks do not double", "lengths that are powers of two")
        })?;
        limits::at_most(FORMAT, "the number of chunks", self.used, ENTRIES)?;
        self.page = 1 << page_bits;
        let blocks = DoublingBlocks {
            in_index,
            smallest,
            number_bytes: count_bits.div_ceil(8) as usize,
            levels: (1 + count_bits).saturating_sub(smallest.ilog2()),
            direct_levels: 2 * pointers.ilog2(),
        };
        index.map_or(Ok(()), |index| blocks.visit(self, index))
    }

    /// Learns what a header says of the entries.
    fn learn(&mut self, cursor: &mut MetadataCursor<'_>) -> Result<()> {
        let (client, bytes) = (cursor.u8()?, usize::from(cursor.u8()?));
        let width = bytes.checked_sub(ADDRESS + 4).filter(|width| (1..=8).contains(width));
        self.packed = width.filter(|_| client == 1);
        self.bytes = bytes;
        refuse_if(self.packed.is_none() && (client, bytes) != (0, ADDRESS), || {
            let found = format!("entries of kind {client} in {bytes} bytes");
            cursor.damaged(found, "an address, or what is packed")
        })
    }

    fn entry(&mut self, cursor: &mut MetadataCursor<'_>, number: u64) -> Result<()> {
        let address = cursor.address()?;
        let (bytes, mask) = match self.packed {
            None => (self.unpacked, 0),
            Some(width) => (cursor.number(width)?, cursor.u32()?),
        };
        match address {
            Some(address) if number < self.used => (self.each)(number, address, bytes, mask),
            _ => Ok(()),
        }
    }

    /// So many entries from a number on, behind a prefix of as many bytes that begins with a mark.
    fn block(
        &mut self,
        place: u64,
        (mark, prefix): (&[u8], usize),
        (first, count): (u64, u64),
    ) -> Result<()> {
        let file = self.file;
        let length = count.saturating_mul(self.bytes as u64).saturating_add(prefix as u64 + 4);
        let raw = file.block(place, length)?;
        let mut cursor = file.cursor(&raw, place);
        cursor.mark(mark)?.skip(prefix - mark.len())?;
        for number in first..first + count {
            self.entry(&mut cursor, number)?;
        }
        check_sum(&mut cursor)
    }

    /// The same in pages with a checksum each, of which some may never have been written; the last is as long as it needs to be.
    fn pages(&mut self, mut place: u64, (first, count): (u64, u64), written: &[u8]) -> Result<()> {
        let last = first.saturating_add(count);
        for number in 0..count.div_ceil(self.page) {
            let begin = first + number * self.page;
            if begin >= self.used {
                break;
            }
            let entries = self.page.min(last - begin);
            if bit(written, number) {
                self.block(place, (b"", 0), (begin, entries))?;
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

    fn visit(&self, entries: &mut ArrayEntries<'_>, index: u64) -> Result<()> {
        let file = entries.file;
        let direct: u64 = (0..self.direct_levels.min(self.levels)).map(|level| self.level(level).0).sum();
        let addresses = direct + u64::from(self.levels.saturating_sub(self.direct_levels));
        let own = self.in_index * entries.bytes as u64;
        let raw = file.block(index, PREFIX as u64 + own + addresses * ADDRESS as u64 + 4)?;
        let mut cursor = file.cursor(&raw, index);
        cursor.mark(b"EAIB")?.skip(PREFIX - 4)?;
        for number in 0..self.in_index {
            entries.entry(&mut cursor, number)?;
        }
        let mut number = self.in_index;
        for level in 0..self.levels {
            let (blocks, count) = self.level(level);
            if level >= self.direct_levels {
                if let Some(place) = cursor.address()?.filter(|_| number < entries.used) {
                    self.listed(entries, place, number, (blocks, count))?;
                }
                number = number.saturating_add(blocks.saturating_mul(count));
                continue;
            }
            for _ in 0..blocks {
                if let Some(place) = cursor.address()?.filter(|_| number < entries.used) {
                    entries.block(place, (b"EADB", PREFIX + self.number_bytes), (number, count))?;
                }
                number = number.saturating_add(count);
            }
        }
        check_sum(&mut cursor)
    }

    /// The blocks of a level that has a list of its own.
    fn listed(
        &self,
        entries: &mut ArrayEntries<'_>,
        place: u64,
        mut number: u64,
        (blocks, count): (u64, u64),
    ) -> Result<()> {
        let (file, prefix) = (entries.file, PREFIX + self.number_bytes);
        let pages = if count > entries.page { count / entries.page } else { 0 };
        let bits = pages.div_ceil(8);
        let length = blocks.saturating_mul(bits + ADDRESS as u64).saturating_add(prefix as u64 + 4);
        let raw = file.block(place, length)?;
        let mut cursor = file.cursor(&raw, place);
        // Bounded by the length of the block.
        let written = cursor.mark(b"EASB")?.skip(prefix - 4)?.take(small(blocks * bits))?;
        for block in 0..blocks {
            match cursor.address()?.filter(|_| number < entries.used) {
                Some(address) if pages == 0 => entries.block(address, (b"EADB", prefix), (number, count))?,
                Some(address) => {
                    let raw = file.block(address, prefix as u64 + 4)?;
                    check_sum(file.cursor(&raw, address).mark(b"EADB")?.skip(prefix - 4)?)?;
                    let own = written.get(small(block * bits)..small((block + 1) * bits));
                    let after = address + raw.len() as u64;
                    entries.pages(after, (number, count), own.unwrap_or_default())?;
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

//! An HDF5 file as such: where it begins, how wide its addresses are, and its metadata block by block (HDF5 File Format
//! Specification, version 4).

use super::checksum::checksum;
use super::{FORMAT, NEW_FILE, unsupported};
use crate::source::SharedFile;
use crate::{FormatError, limits};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Bytes of metadata that are read of a small file, all objects together, and of a larger one for each of its bytes: what
/// bounds the time that a file can take which refers to the same places again and again.
const METADATA_BYTES: u64 = 16 * limits::HEADER_BYTES;
const METADATA_PER_BYTE: u64 = 4;
/// Bytes of an address and of a length. Others can be asked for in C alone.
pub(super) const ADDRESS: usize = 8;
pub(super) const LENGTH: usize = 8;
/// What the file begins with.
const MAGIC: [u8; 8] = *b"\x89HDF\r\n\x1a\n";

/// A file whose beginning is read.
pub(super) struct Hdf5File {
    pub(super) source: Arc<SharedFile>,
    /// Its name, where it is another than the one that was opened.
    pub(super) name: Option<PathBuf>,
    /// The place that its addresses count from.
    base: u64,
    /// Where the object header of the root group is.
    pub(super) root: u64,
    /// Bytes of metadata that may be read in all, and from now on.
    most: u64,
    left: AtomicU64,
}

impl Hdf5File {
    pub(super) fn open(source: Arc<SharedFile>, name: Option<PathBuf>) -> Result<Self, FormatError> {
        let base = superblock(&source)?;
        let most = METADATA_BYTES.max(source.length().saturating_mul(METADATA_PER_BYTE));
        let mut file = Self { source, name, base, root: 0, most, left: AtomicU64::new(most) };
        let head = file.block(base, 48.min(file.source.length().saturating_sub(base)))?;
        let mut cursor = MetadataCursor::new(&file, &head, base);
        cursor.take(8)?;
        let version = cursor.u8()?;
        let is_old = match version {
            0 => true,
            2 | 3 => false,
            1 => return Err(unsupported("a beginning of version 1", NEW_FILE)),
            _ => return Err(cursor.damaged(format!("version {version} of its beginning"), "0, 2 or 3")),
        };
        let widths = cursor.skip(if is_old { 4 } else { 0 })?.take(2)?;
        if widths.iter().any(|width| usize::from(*width) != ADDRESS) {
            let what = format!("a file with addresses of {} and lengths of {} bytes", widths[0], widths[1]);
            return Err(unsupported(what, NEW_FILE));
        }
        // Behind the four addresses of the old version is the entry of the root group: a name, and the address.
        let (start, skipped) = if is_old { (24, 2 * ADDRESS) } else { (12, 0) };
        let head = file.block(base, (start + 4 * ADDRESS + skipped + 4) as u64)?;
        let mut cursor = MetadataCursor::new(&file, &head, base);
        let stored_base = cursor.skip(start)?.number(ADDRESS)?;
        let end = cursor.skip(ADDRESS)?.number(ADDRESS)?;
        let root = cursor.skip(skipped)?.address()?;
        if !is_old {
            cursor.check_sum()?;
        }
        let Some(root) = root else {
            return Err(cursor.damaged("no address of the root group", "one"));
        };
        let (length, end) = (file.source.length(), end.saturating_sub(stored_base).saturating_add(base));
        if length < end {
            return Err(FormatError::damaged(
                FORMAT,
                "the end of the file",
                format!("{length} bytes"),
                format!("{end}, as its beginning says: it was cut, or not closed"),
            ));
        }
        file.root = root;
        Ok(file)
    }

    /// Reads a block of metadata.
    pub(super) fn block(&self, place: u64, bytes: u64) -> Result<Vec<u8>, FormatError> {
        limits::at_most(
            FORMAT,
            &format!("the bytes of metadata at byte {place}"),
            bytes,
            limits::HEADER_BYTES,
        )?;
        let taken =
            self.left.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |left| left.checked_sub(bytes));
        if taken.is_err() {
            return Err(FormatError::TooLarge {
                format: FORMAT,
                what: "the metadata that have to be read, in bytes,".to_owned(),
                found: self.most.saturating_add(bytes),
                limit: self.most,
            });
        }
        #[allow(clippy::cast_possible_truncation)] // at most HEADER_BYTES
        self.source.bytes(FORMAT, place, bytes as usize)
    }
}

/// Where the file begins: anything of 512, 1024, 2048, … bytes may stand before it.
fn superblock(source: &SharedFile) -> Result<u64, FormatError> {
    let mut place = 0;
    while place < source.length() {
        let mut magic = [0; 8];
        if source.read_some(place, &mut magic)? == 8 && magic == MAGIC {
            return Ok(place);
        }
        place = if place == 0 { 512 } else { place * 2 };
    }
    Err(FormatError::damaged(FORMAT, "the file", "no beginning", "\\x89HDF at byte 0, 512, 1024, …"))
}

/// A block of metadata that is being read.
#[derive(Clone)]
pub(super) struct MetadataCursor<'a> {
    pub(super) file: &'a Hdf5File,
    bytes: &'a [u8],
    at: usize,
    /// Where the block is in the file.
    place: u64,
}

impl<'a> MetadataCursor<'a> {
    pub(super) fn new(file: &'a Hdf5File, bytes: &'a [u8], place: u64) -> Self {
        Self { file, bytes, at: 0, place }
    }

    pub(super) fn damaged(&self, found: impl Into<String>, expected: &str) -> FormatError {
        FormatError::damaged(
            FORMAT,
            format!("byte {}", self.place.saturating_add(self.at as u64)),
            found.into(),
            expected,
        )
    }

    pub(super) fn take(&mut self, count: usize) -> Result<&'a [u8], FormatError> {
        let taken = self.at.checked_add(count).and_then(|end| self.bytes.get(self.at..end));
        let taken = taken.ok_or_else(|| {
            self.damaged("the end of what is described there", &format!("{count} more bytes"))
        })?;
        self.at += count;
        Ok(taken)
    }

    /// Passes over bytes.
    pub(super) fn skip(&mut self, count: usize) -> Result<&mut Self, FormatError> {
        self.take(count)?;
        Ok(self)
    }

    /// Bytes that are not read yet.
    pub(super) fn left(&self) -> usize {
        self.bytes.len() - self.at
    }

    /// Where the next byte is in the file.
    pub(super) fn place(&self) -> u64 {
        self.place + self.at as u64
    }

    /// The part of the block from here on, as a cursor of its own.
    pub(super) fn part(&mut self, count: usize) -> Result<MetadataCursor<'a>, FormatError> {
        let place = self.place + self.at as u64;
        Ok(MetadataCursor { file: self.file, bytes: self.take(count)?, at: 0, place })
    }

    /// A number of up to eight bytes, the lowest first.
    pub(super) fn number(&mut self, bytes: usize) -> Result<u64, FormatError> {
        Ok(self.take(bytes)?.iter().rev().fold(0, |number, byte| number << 8 | u64::from(*byte)))
    }

    pub(super) fn u8(&mut self) -> Result<u8, FormatError> {
        Ok(self.take(1)?[0])
    }

    pub(super) fn u16(&mut self) -> Result<u16, FormatError> {
        let two = self.take(2)?;
        Ok(u16::from_le_bytes([two[0], two[1]]))
    }

    pub(super) fn u32(&mut self) -> Result<u32, FormatError> {
        let four = self.take(4)?;
        Ok(u32::from_le_bytes([four[0], four[1], four[2], four[3]]))
    }

    /// A length of the width of this file.
    pub(super) fn length(&mut self) -> Result<u64, FormatError> {
        self.number(LENGTH)
    }

    /// A place in the file; none where the address is undefined.
    pub(super) fn address(&mut self) -> Result<Option<u64>, FormatError> {
        let stored = self.number(ADDRESS)?;
        if stored == u64::MAX {
            return Ok(None);
        }
        let place = stored.checked_add(self.file.base);
        place.map(Some).ok_or_else(|| self.damaged(format!("the address {stored}"), "one in the file"))
    }

    /// An address that must be there.
    pub(super) fn known_address(&mut self) -> Result<u64, FormatError> {
        self.address()?.ok_or_else(|| self.damaged("an undefined address", "one in the file"))
    }

    /// A name up to a zero byte.
    pub(super) fn name(&mut self) -> Result<String, FormatError> {
        let rest = &self.bytes[self.at..];
        let end = rest.iter().position(|byte| *byte == 0);
        let end = end.ok_or_else(|| self.damaged("a name without an end", "a zero byte behind it"))?;
        let name = String::from_utf8_lossy(&rest[..end]).into_owned();
        self.at += end + 1;
        Ok(name)
    }

    /// Refuses what is not marked as what it should be.
    pub(super) fn mark(&mut self, expected: &str) -> Result<(), FormatError> {
        let found = self.take(expected.len())?;
        if found == expected.as_bytes() {
            return Ok(());
        }
        self.at -= expected.len();
        Err(self.damaged(format!("`{}`", found.escape_ascii()), &format!("`{expected}`")))
    }

    /// Compares the checksum that stands here with that of everything in the block before it.
    pub(super) fn check_sum(&mut self) -> Result<(), FormatError> {
        let end = self.at;
        let stored = self.u32()?;
        let found = checksum(&self.bytes[..end]);
        // The fuzzer alters what is behind the checksum too.
        if found == stored || cfg!(fuzzing) {
            return Ok(());
        }
        Err(self.damaged(format!("a checksum of {found:08x}"), &format!("{stored:08x}, as it is stored")))
    }
}

//! An HDF5 file as such: where it begins, how wide its addresses are, and its metadata block by block (HDF5 File Format
//! Specification, version 4).

use super::checksum::checksum;
use super::{FORMAT, NEW_FILE, unsupported};
pub(super) use crate::cursor::ByteCursor as MetadataCursor;
use crate::source::SharedFile;
use crate::{FormatError, Result, limits, refuse_if};
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
    pub(super) fn open(source: Arc<SharedFile>, name: Option<PathBuf>) -> Result<Self> {
        let base = crate::open::hdf5_begin(&source)?.ok_or_else(|| {
            FormatError::damaged(FORMAT, "the file", "no beginning", "\\x89HDF at byte 0, 512, 1024, …")
        })?;
        let most = METADATA_BYTES.max(source.length().saturating_mul(METADATA_PER_BYTE));
        let mut file = Self { source, name, base, root: 0, most, left: AtomicU64::new(most) };
        let head = file.block(base, 48.min(file.source.length().saturating_sub(base)))?;
        let mut cursor = file.cursor(&head, base);
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
        let mut cursor = file.cursor(&head, base);
        let stored_base = cursor.skip(start)?.number(ADDRESS)?;
        let end = cursor.skip(ADDRESS)?.number(ADDRESS)?;
        let root = cursor.skip(skipped)?.address()?;
        if !is_old {
            check_sum(&mut cursor)?;
        }
        let root = root.ok_or_else(|| cursor.damaged("no address of the root group", "one"))?;
        let (length, end) = (file.source.length(), end.saturating_sub(stored_base).saturating_add(base));
        refuse_if(length < end, || {
            let expected = format!("{end}, as its beginning says: it was cut, or not closed");
            FormatError::damaged(FORMAT, "the end of the file", format!("{length} bytes"), expected)
        })?;
        file.root = root;
        Ok(file)
    }

    /// What reads a block that stands at a place.
    pub(super) fn cursor<'a>(&self, bytes: &'a [u8], place: u64) -> MetadataCursor<'a> {
        MetadataCursor::new(FORMAT, bytes, place).with(self.base, false)
    }

    /// Reads a block of metadata.
    pub(super) fn block(&self, place: u64, bytes: u64) -> Result<Vec<u8>> {
        let what = format!("the bytes of metadata at byte {place}");
        limits::at_most(FORMAT, &what, bytes, limits::HEADER_BYTES)?;
        let taken =
            self.left.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |left| left.checked_sub(bytes));
        refuse_if(taken.is_err(), || FormatError::TooLarge {
            format: FORMAT,
            what: "the metadata that have to be read, in bytes,".to_owned(),
            found: self.most.saturating_add(bytes),
            limit: self.most,
        })?;
        self.source.bytes(FORMAT, place, bytes)
    }
}

/// Compares the checksum that stands behind what was read of a block with that of it.
pub(super) fn check_sum(cursor: &mut MetadataCursor<'_>) -> Result<()> {
    let found = checksum(cursor.behind());
    let stored = cursor.u32()?;
    // The fuzzer alters what is behind the checksum too.
    if found == stored || cfg!(fuzzing) {
        return Ok(());
    }
    Err(cursor.damaged(format!("a checksum of {found:08x}"), &format!("{stored:08x}, as it is stored")))
}

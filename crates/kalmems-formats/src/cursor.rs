//! Bytes of a file that are read one after the other, each with its place for messages.

use crate::{FormatError, Result};

/// A block of a file that is being read.
#[derive(Clone)]
pub(crate) struct ByteCursor<'a> {
    format: &'static str,
    bytes: &'a [u8],
    at: usize,
    /// Where the block is in the file, and the place that its addresses count from.
    start: u64,
    base: u64,
    pub(crate) big_endian: bool,
}

impl<'a> ByteCursor<'a> {
    /// One at the beginning of a block, whose numbers have their lowest byte first.
    pub(crate) fn new(format: &'static str, bytes: &'a [u8], start: u64) -> Self {
        Self { format, bytes, at: 0, start, base: 0, big_endian: false }
    }

    /// The same whose addresses count from a place, and with the other order of bytes.
    pub(crate) fn with(self, base: u64, big_endian: bool) -> Self {
        Self { base, big_endian, ..self }
    }

    /// What is wrong here.
    pub(crate) fn damaged(&self, found: impl Into<String>, expected: &str) -> FormatError {
        FormatError::damaged_at(self.format, self.place(), found, expected)
    }

    /// Where the next byte is in the file.
    pub(crate) fn place(&self) -> u64 {
        self.start.saturating_add(self.at as u64)
    }

    /// Bytes that are not read yet.
    pub(crate) fn left(&self) -> usize {
        self.bytes.len() - self.at
    }

    /// The next bytes.
    pub(crate) fn take(&mut self, count: usize) -> Result<&'a [u8]> {
        let taken = self.at.checked_add(count).and_then(|end| self.bytes.get(self.at..end));
        let taken = taken.ok_or_else(|| {
            self.damaged("the end of what is described there", &format!("{count} more bytes"))
        })?;
        self.at += count;
        Ok(taken)
    }

    /// Passes over bytes.
    pub(crate) fn skip(&mut self, count: usize) -> Result<&mut Self> {
        self.take(count)?;
        Ok(self)
    }

    /// The part of the block from here on, as a cursor of its own.
    pub(crate) fn part(&mut self, count: usize) -> Result<Self> {
        let (start, bytes) = (self.place(), self.take(count)?);
        Ok(Self { bytes, at: 0, start, ..*self })
    }

    /// A number of up to eight bytes.
    pub(crate) fn number(&mut self, bytes: usize) -> Result<u64> {
        let append = |number: u64, byte: &u8| number << 8 | u64::from(*byte);
        let bytes = self.take(bytes)?.iter();
        Ok(if self.big_endian { bytes.fold(0, append) } else { bytes.rev().fold(0, append) })
    }

    pub(crate) fn u8(&mut self) -> Result<u8> {
        Ok(self.take(1)?[0])
    }

    #[allow(clippy::cast_possible_truncation)] // two bytes
    pub(crate) fn u16(&mut self) -> Result<u16> {
        Ok(self.number(2)? as u16)
    }

    #[allow(clippy::cast_possible_truncation)] // four bytes
    pub(crate) fn u32(&mut self) -> Result<u32> {
        Ok(self.number(4)? as u32)
    }

    pub(crate) fn u64(&mut self) -> Result<u64> {
        self.number(8)
    }

    /// A text of so many bytes.
    pub(crate) fn text(&mut self, bytes: usize) -> Result<String> {
        Ok(String::from_utf8_lossy(self.take(bytes)?).into_owned())
    }

    /// A text up to a zero byte.
    pub(crate) fn name(&mut self) -> Result<String> {
        let end = self.bytes[self.at..].iter().position(|byte| *byte == 0);
        let end = end.ok_or_else(|| self.damaged("a name without an end", "a zero byte after it"))?;
        let name = self.text(end)?;
        self.skip(1)?;
        Ok(name)
    }

    /// A place in the file, which are eight bytes; none where the address is undefined.
    pub(crate) fn address(&mut self) -> Result<Option<u64>> {
        let stored = self.u64()?;
        if stored == u64::MAX {
            return Ok(None);
        }
        let place = stored.checked_add(self.base);
        place.map(Some).ok_or_else(|| self.damaged(format!("the address {stored}"), "one in the file"))
    }

    /// An address that must be there.
    pub(crate) fn known_address(&mut self) -> Result<u64> {
        self.address()?.ok_or_else(|| self.damaged("an undefined address", "one in the file"))
    }

    /// Refuses what is not marked as what it should be.
    pub(crate) fn mark(&mut self, expected: &[u8]) -> Result<&mut Self> {
        let at = self.at;
        let found = self.take(expected.len())?;
        if found == expected {
            return Ok(self);
        }
        self.at = at;
        Err(self.damaged(format!("`{}`", found.escape_ascii()), &format!("`{}`", expected.escape_ascii())))
    }

    /// What was read so far of the block.
    pub(crate) fn behind(&self) -> &'a [u8] {
        &self.bytes[..self.at]
    }
}

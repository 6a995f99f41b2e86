//! The bytes of a text file in large pieces, hashed as they are read.

use crate::{Digest, FormatError};
use sha2::{Digest as _, Sha256};
use std::fmt::Write as _;
use std::io::{ErrorKind, Read};

/// As much as is read at once.
const PIECE: usize = 1 << 18;

/// A row, quoted line ends included, can be this long.
const LONGEST_ROW: usize = 4 << 20;

/// A file, a pipe or bytes, from front to back.
pub(super) struct Input {
    reader: Box<dyn Read + Send>,
    hash: Sha256,
    /// Bytes read so far, and in all where that is known.
    bytes: u64,
    total: u64,
    ended: bool,
    buffer: Vec<u8>,
    /// What is read and not yet taken is `start..end`; whole lines are `start..whole`.
    start: usize,
    whole: usize,
    end: usize,
}

impl Input {
    pub(super) fn new(reader: Box<dyn Read + Send>, total: u64) -> Self {
        Self {
            reader,
            hash: Sha256::new(),
            bytes: 0,
            total,
            ended: false,
            buffer: vec![0; 2 * PIECE],
            start: 0,
            whole: 0,
            end: 0,
        }
    }

    /// The whole lines that are read and not taken.
    pub(super) fn lines(&self) -> &[u8] {
        self.buffer.get(self.start..self.whole).unwrap_or_default()
    }

    /// Whether the last byte is read.
    pub(super) const fn ended(&self) -> bool {
        self.ended
    }

    /// Takes some bytes of the lines.
    pub(super) fn take(&mut self, bytes: usize) {
        self.start = (self.start + bytes).min(self.whole);
    }

    /// Reads on until there is another whole line; whether there was anything more. What is not taken stays.
    pub(super) fn more(&mut self) -> Result<bool, FormatError> {
        if self.ended {
            return Ok(false);
        }
        self.buffer.copy_within(self.start..self.end, 0);
        self.end -= self.start;
        self.whole -= self.start;
        self.start = 0;
        loop {
            if self.end > LONGEST_ROW {
                return Err(FormatError::TooLarge {
                    format: "CSV",
                    what: "the length of a row in bytes".to_owned(),
                    found: self.end as u64,
                    limit: LONGEST_ROW as u64,
                });
            }
            if self.buffer.len() < self.end + PIECE + 1 {
                self.buffer.resize(2 * (self.end + PIECE), 0);
            }
            let free = self.buffer.get_mut(self.end..self.end + PIECE).unwrap_or_default();
            let count = match self.reader.read(free) {
                Ok(count) => count,
                Err(error) if error.kind() == ErrorKind::Interrupted => continue,
                Err(error) => return Err(error.into()),
            };
            let read = free.get(..count).unwrap_or_default();
            self.hash.update(read);
            self.bytes += count as u64;
            let line_end = memchr::memrchr(b'\n', read);
            let before = self.end;
            self.end += count;
            if count == 0 {
                self.ended = true;
                // A last line without an end has one from here on.
                if self.whole < self.end
                    && let Some(free) = self.buffer.get_mut(self.end)
                {
                    *free = b'\n';
                    self.end += 1;
                }
                let more = self.whole < self.end;
                self.whole = self.end;
                return Ok(more);
            }
            if let Some(line_end) = line_end {
                self.whole = before + line_end + 1;
                return Ok(true);
            }
        }
    }

    /// Bytes taken, and in all; 0 where that is not known.
    pub(super) fn progress(&self) -> (u64, u64) {
        (self.bytes.saturating_sub((self.end - self.start) as u64), self.total)
    }

    /// The digest of all bytes, once they are read.
    pub(super) fn digest(&self) -> Option<Digest> {
        if !self.ended {
            return None;
        }
        let mut sha256 = String::new();
        for byte in self.hash.clone().finalize() {
            // Writing to a string cannot fail.
            let _ = write!(sha256, "{byte:02x}");
        }
        Some(Digest { sha256, bytes: self.bytes })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Gives a few bytes at a time, as pipes do.
    struct Drops(Vec<u8>, usize, usize);

    impl Read for Drops {
        fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
            let rest = &self.0[self.1..];
            let count = rest.len().min(self.2).min(buffer.len());
            buffer[..count].copy_from_slice(&rest[..count]);
            self.1 += count;
            Ok(count)
        }
    }

    #[test]
    fn lines_come_whole_however_they_are_read() {
        let text = b"ab\nc\n\ndefgh\nlast".to_vec();
        for size in 1..20 {
            let mut input = Input::new(Box::new(Drops(text.clone(), 0, size)), 0);
            let mut found = Vec::new();
            while input.more().unwrap() {
                let lines = input.lines().to_vec();
                assert_eq!(lines.last(), Some(&b'\n'));
                found.extend_from_slice(&lines);
                input.take(lines.len());
            }
            assert_eq!(found, b"ab\nc\n\ndefgh\nlast\n");
            assert_eq!(input.progress().0, 16);
            // printf 'ab\nc\n\ndefgh\nlast' | sha256sum
            let digest = input.digest().unwrap();
            assert_eq!(digest.bytes, 16);
            assert!(digest.sha256.starts_with("2e73a61762d73959"), "{}", digest.sha256);
        }
    }

    #[test]
    fn a_line_without_end_is_refused_in_bounded_memory() {
        let mut input = Input::new(Box::new(std::io::repeat(b'x')), 0);
        assert!(matches!(input.more(), Err(FormatError::TooLarge { .. })));
        assert!(input.buffer.len() < 4 * LONGEST_ROW);
    }
}

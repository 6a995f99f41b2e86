//! The bytes of a text file in large pieces, hashed as they are read.

use super::utf16::Utf16;
use crate::{Digest, Result, limits};
use sha2::{Digest as _, Sha256};
use std::io::{ErrorKind, Read};

/// As much as is read at once.
const PIECE: usize = 1 << 18;

/// A row, quoted line ends included, can be this long.
const LONGEST_ROW: usize = 4 << 20;

/// A file, a pipe or bytes, from front to back.
pub(super) struct CsvInput {
    reader: Box<dyn Read + Send>,
    hash: Sha256,
    /// Bytes read so far, and in all where that is known.
    bytes: u64,
    total: u64,
    ended: bool,
    /// Whether the last line came without an end.
    open_end: bool,
    /// How text in UTF-16 is read, once its first two bytes say that it is, and its bytes.
    wide: Option<(Utf16, Vec<u8>)>,
    buffer: Vec<u8>,
    /// What is read and not yet taken is `start..end`; whole lines are `start..whole`.
    start: usize,
    whole: usize,
    end: usize,
}

impl CsvInput {
    pub(super) fn new(reader: Box<dyn Read + Send>, total: u64) -> Self {
        Self {
            reader,
            hash: Sha256::new(),
            bytes: 0,
            total,
            ended: false,
            open_end: false,
            wide: None,
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

    /// Whether the text is in UTF-16.
    pub(super) const fn is_wide(&self) -> bool {
        self.wide.is_some()
    }

    /// Whether the last byte is read and the last line came without an end, as a line does that is cut.
    pub(super) const fn open_end(&self) -> bool {
        self.open_end
    }

    /// Takes some bytes of the lines.
    pub(super) fn take(&mut self, bytes: usize) {
        self.start = (self.start + bytes).min(self.whole);
    }

    /// Reads on until there is another whole line; whether there was anything more. What is not taken stays.
    pub(super) fn more(&mut self) -> Result<bool> {
        if self.ended {
            return Ok(false);
        }
        self.buffer.copy_within(self.start..self.end, 0);
        self.end -= self.start;
        self.whole -= self.start;
        self.start = 0;
        loop {
            limits::at_most("CSV", "the length of a row in bytes", self.end, LONGEST_ROW)?;
            if self.buffer.len() < self.end + PIECE + 1 {
                self.buffer.resize(2 * (self.end + PIECE), 0);
            }
            let before = self.end;
            if self.fill()? == 0 {
                self.ended = true;
                // A last line without an end has one from here on.
                if self.whole < self.end
                    && let Some(free) = self.buffer.get_mut(self.end)
                {
                    *free = b'\n';
                    self.end += 1;
                    self.open_end = true;
                }
                let more = self.whole < self.end;
                self.whole = self.end;
                return Ok(more);
            }
            let read = self.buffer.get(before..self.end).unwrap_or_default();
            if let Some(line_end) = memchr::memrchr(b'\n', read) {
                self.whole = before + line_end + 1;
                return Ok(true);
            }
        }
    }

    /// Reads some bytes behind those that are read; how many came from the reader, none at the end.
    fn fill(&mut self) -> Result<usize> {
        if let Some((decoder, raw)) = &mut self.wide {
            let (count, mut text) = (read(&mut self.reader, raw, &mut self.hash)?, Vec::new());
            decoder.decode(raw.get(..count).unwrap_or_default(), &mut text);
            self.bytes += count as u64;
            self.append(&text);
            return Ok(count);
        }
        let first = self.bytes == 0;
        let mut count = 0;
        loop {
            let free = self.buffer.get_mut(self.end + count..self.end + PIECE).unwrap_or_default();
            let more = read(&mut self.reader, free, &mut self.hash)?;
            count += more;
            // A pipe may give the mark at the beginning byte by byte.
            if !first || more == 0 || count > 1 {
                break;
            }
        }
        self.bytes += count as u64;
        let beginning = self.buffer.get(..count).unwrap_or_default();
        if let Some(mut decoder) = Utf16::of_mark(beginning).filter(|_| first) {
            let mut text = Vec::new();
            decoder.decode(beginning.get(2..).unwrap_or_default(), &mut text);
            // Two bytes become three at most, so that what is read in one go has its place.
            self.wide = Some((decoder, vec![0; PIECE / 2]));
            self.append(&text);
        } else {
            self.end += count;
        }
        Ok(count)
    }

    /// Puts text behind what is read.
    fn append(&mut self, text: &[u8]) {
        let end = self.end + text.len();
        if self.buffer.len() < end + PIECE {
            self.buffer.resize(end + PIECE, 0);
        }
        if let Some(free) = self.buffer.get_mut(self.end..end) {
            free.copy_from_slice(text);
            self.end = end;
        }
    }

    /// Bytes taken, and in all; 0 where that is not known.
    pub(super) fn progress(&self) -> (u64, u64) {
        (self.bytes.saturating_sub((self.end - self.start) as u64), self.total)
    }

    /// The digest of all bytes, once they are read.
    pub(super) fn digest(&self) -> Option<Digest> {
        self.ended.then(|| Digest::new(self.hash.clone(), self.bytes))
    }
}

/// Reads some bytes and hashes them; none at the end.
fn read(reader: &mut Box<dyn Read + Send>, buffer: &mut [u8], hash: &mut Sha256) -> Result<usize> {
    loop {
        match reader.read(buffer) {
            Ok(count) => {
                hash.update(buffer.get(..count).unwrap_or_default());
                return Ok(count);
            }
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) => return Err(error.into()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::FormatError;

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
            let mut input = CsvInput::new(Box::new(Drops(text.clone(), 0, size)), 0);
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
    fn a_last_line_without_end_is_reported_and_utf_16_is_read_as_text() {
        for (text, open) in [("a\nb", true), ("a\nb\n", false), ("", false), ("a", true)] {
            let wide = std::iter::once(0xfeff).chain(text.encode_utf16());
            for bytes in [text.as_bytes().to_vec(), wide.flat_map(u16::to_le_bytes).collect()] {
                for size in 1..6 {
                    let mut input = CsvInput::new(Box::new(Drops(bytes.clone(), 0, size)), 0);
                    let mut found = Vec::new();
                    while input.more().unwrap() {
                        found.extend_from_slice(input.lines());
                        input.take(input.lines().len());
                    }
                    let expected = if open { format!("{text}\n") } else { text.to_owned() };
                    assert_eq!((found, input.open_end()), (expected.into_bytes(), open), "{text:?}");
                    assert_eq!(input.digest().unwrap().bytes, bytes.len() as u64);
                }
            }
        }
    }

    #[test]
    fn a_line_without_end_is_refused_in_bounded_memory() {
        let mut input = CsvInput::new(Box::new(std::io::repeat(b'x')), 0);
        assert!(matches!(input.more(), Err(FormatError::TooLarge { .. })));
        assert!(input.buffer.len() < 4 * LONGEST_ROW);
    }
}

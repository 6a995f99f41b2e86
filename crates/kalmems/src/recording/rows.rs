//! The rows of a CSV file with their line numbers, hashed as they are read.

use super::Source;
use csv::{ByteRecord, ReaderBuilder, Terminator};
use sha2::{Digest, Sha256};
use std::fmt::Write as _;
use std::fs::File;
use std::io::{self, BufRead as _, BufReader, Read};
use std::path::Path;

/// Passes bytes on and keeps their hash, their number and the last of them.
struct Hashing {
    file: File,
    hash: Sha256,
    bytes: u64,
    last: u8,
}

impl Read for Hashing {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.file.read(buffer)?;
        if let Some(read) = buffer.get(..count) {
            self.hash.update(read);
            self.last = read.last().copied().unwrap_or(self.last);
        }
        self.bytes += count as u64;
        Ok(count)
    }
}

/// The rows of a file, one after the other; the first is the header.
pub(crate) struct Rows {
    csv: csv::Reader<BufReader<Hashing>>,
    record: ByteRecord,
    /// Bytes and lines of the byte order mark and of the comments before the header.
    before_header: (u64, usize),
    name: String,
    total: u64,
}

/// One row.
pub(crate) struct Row<'a> {
    /// The line where it begins, counted from 1.
    pub(crate) line: usize,
    /// Blank lines between the row before and this one.
    pub(crate) blank_lines: usize,
    /// Its cells.
    pub(crate) cells: &'a ByteRecord,
}

impl Rows {
    pub(crate) fn open(path: &Path) -> io::Result<Self> {
        let file = File::open(path)?;
        let total = file.metadata()?.len();
        let hashing = Hashing { file, hash: Sha256::new(), bytes: 0, last: 0 };
        let mut reader = BufReader::with_capacity(1 << 12, hashing);
        let before_header = skip_to_header(&mut reader)?;
        let csv = ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            // With `\n` alone the lines are counted as an editor does; a `\r` falls to the trimming of cells.
            .terminator(Terminator::Any(b'\n'))
            .buffer_capacity(1 << 16)
            .from_reader(reader);
        let name =
            path.file_name().map_or_else(|| path.display().to_string(), |n| n.to_string_lossy().into_owned());
        Ok(Self { csv, record: ByteRecord::new(), before_header, name, total })
    }

    /// The next row; `None` at the end of the file.
    pub(crate) fn next(&mut self) -> io::Result<Option<Row<'_>>> {
        let mut blank_lines = 0;
        loop {
            let before = self.csv.position().line();
            if !self.csv.read_byte_record(&mut self.record)? {
                return Ok(None);
            }
            let after = self.csv.position().line();
            let hashing = self.csv.get_ref().get_ref();
            let at_end = self.csv.position().byte() + self.before_header.0 == hashing.bytes;
            let terminated = u64::from(!(at_end && hashing.last != b'\n'));
            // Quoted cells can hold line ends; a row of one line, the usual case, is not searched.
            let inside = if after == before + 1 {
                0
            } else {
                self.record.as_slice().iter().map(|b| u64::from(*b == b'\n')).sum()
            };
            let line = after.saturating_sub(terminated + inside);
            blank_lines += line.saturating_sub(before);
            if self.record.len() == 1 && self.record.iter().all(|cell| cell.trim_ascii().is_empty()) {
                blank_lines += inside + 1;
                continue;
            }
            return Ok(Some(Row {
                line: to_usize(line).saturating_add(self.before_header.1),
                blank_lines: to_usize(blank_lines),
                cells: &self.record,
            }));
        }
    }

    /// How far the file is read, and its length.
    pub(crate) fn progress(&self) -> (u64, u64) {
        (self.csv.position().byte() + self.before_header.0, self.total)
    }

    /// What was read; right after the last row.
    pub(crate) fn into_source(self) -> Source {
        let hashing = self.csv.into_inner().into_inner();
        let mut sha256 = String::new();
        for byte in hashing.hash.finalize() {
            // Writing to a string cannot fail.
            let _ = write!(sha256, "{byte:02x}");
        }
        Source { file: self.name, sha256, bytes: hashing.bytes }
    }
}

fn to_usize(count: u64) -> usize {
    usize::try_from(count).unwrap_or(usize::MAX)
}

/// Skips a byte order mark, comments and blank lines; the bytes and lines that were skipped.
fn skip_to_header(reader: &mut BufReader<Hashing>) -> io::Result<(u64, usize)> {
    const MARK: &[u8] = b"\xef\xbb\xbf";
    let mut bytes = 0;
    let mut lines = 0;
    if reader.fill_buf()?.starts_with(MARK) {
        reader.consume(MARK.len());
        bytes += MARK.len();
    }
    loop {
        let start = reader.fill_buf()?;
        if !(start.starts_with(b"#") || start.starts_with(b"\n") || start.starts_with(b"\r\n")) {
            return Ok((bytes as u64, lines));
        }
        bytes += reader.skip_until(b'\n')?;
        lines += 1;
    }
}

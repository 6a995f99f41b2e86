//! A stretch of a file that is read from front to back, packed or not.

use crate::element::Element;
use crate::records::RecordLane;
use crate::source::SharedFile;
use crate::{FormatError, Result, refuse_if};
use flate2::{Crc, Decompress, FlushDecompress, Status};
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Write};
use std::sync::{Arc, OnceLock};

/// Packed bytes that are read together.
const INPUT: usize = 64 << 10;

/// Bytes of a stretch that is compared with its checksum when it is found, and not only when it is read.
pub(crate) const VERIFIED_AT_ONCE: u64 = 1 << 20;

/// How a stretch is packed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Compression {
    /// Not at all.
    Stored,
    /// Deflate (RFC 1951), as in zip files.
    Deflate,
    /// Zlib (RFC 1950), as in MAT files.
    Zlib,
}

/// A stretch of a file.
#[derive(Clone)]
pub(crate) struct FileStretch {
    pub(crate) source: Arc<SharedFile>,
    pub(crate) format: &'static str,
    /// What it is, for messages.
    pub(crate) name: String,
    pub(crate) packing: Compression,
    /// Where the packed bytes begin and end.
    pub(crate) start: u64,
    pub(crate) end: u64,
    /// The bytes that it unpacks to.
    pub(crate) unpacked: u64,
    /// The CRC-32 of the unpacked bytes, where there is one.
    pub(crate) crc: Option<u32>,
    /// Filled once the whole stretch agrees with its lengths and its checksum: with the file of its unpacked bytes, if there is one.
    pub(crate) verified: Arc<OnceLock<Option<Arc<SharedFile>>>>,
}

impl FileStretch {
    /// A whole file as it is.
    pub(crate) fn stored(source: Arc<SharedFile>, format: &'static str, name: &str) -> Self {
        let (end, name) = (source.length(), name.to_owned());
        let (packing, verified) = (Compression::Stored, Arc::default());
        Self { source, format, name, packing, start: 0, end, unpacked: end, crc: None, verified }
    }

    /// Begins at its front.
    pub(crate) fn stream(&self) -> StretchReader {
        let (packing, source, range) = match self.verified.get() {
            Some(Some(copy)) => (Compression::Stored, copy, (0, self.unpacked)),
            _ => (self.packing, &self.source, (self.start, self.end)),
        };
        let (engine, buffer) = match packing {
            Compression::Stored => (None, 0),
            packed => (Some(Decompress::new(packed == Compression::Zlib)), INPUT),
        };
        let bytes = FileRange { source: Arc::clone(source), at: range.0, end: range.1 };
        let bytes = BufReader::with_capacity(buffer, bytes);
        StretchReader { stretch: self.clone(), bytes, engine, ended: false, position: 0 }
    }

    /// Which checksum its bytes have.
    pub(crate) fn protection(&self) -> Option<&'static str> {
        match self.packing {
            Compression::Zlib => Some("Adler-32"),
            _ => self.crc.map(|_| "CRC-32"),
        }
    }

    /// Reads it to its end, once for all columns in it, and compares lengths and checksum with what is stated. A damaged bit changes
    /// what is unpacked long before the checksum, so that no number may be used before. What it unpacks to is kept, unless it is short.
    pub(crate) fn verify(&self) -> Result<()> {
        if self.verified.get().is_some() || self.protection().is_none() {
            return Ok(());
        }
        let is_kept = self.packing != Compression::Stored && self.unpacked > VERIFIED_AT_ONCE;
        let mut copy = if is_kept { self.source.room_for_a_copy(self.unpacked) } else { None };
        let (mut stream, mut sum) = (self.stream(), Crc::new());
        let mut piece = vec![0; INPUT];
        let mut left = self.unpacked;
        while left > 0 {
            let some = usize::try_from(left).unwrap_or(INPUT).min(INPUT);
            stream.read_all(&mut piece[..some])?;
            if self.crc.is_some() {
                sum.update(&piece[..some]);
            }
            // Where the disk is full it is unpacked once more when it is read.
            copy = copy.filter(|mut copy: &File| copy.write_all(&piece[..some]).is_ok());
            left -= some as u64;
        }
        stream.expect_end()?;
        if let Some(expected) = self.crc.filter(|expected| *expected != sum.sum()) {
            let found = format!("a checksum of {:08x} over all of it", sum.sum());
            return Err(stream.damaged(found, format!("{expected:08x}, as it is stored")));
        }
        let copy = copy.map(|copy| SharedFile::new(Box::new(copy))).transpose()?;
        let _ = self.verified.set(copy.map(Arc::new));
        Ok(())
    }

    /// A single number at a place of it.
    pub(crate) fn number(&self, place: u64, element: Element) -> Result<f64> {
        self.verify()?;
        let mut stream = self.stream();
        stream.skip(place)?;
        Ok(element.exact(&stream.next_bytes(element.bytes)?).rounded())
    }
}

/// Bytes of a file from a place on.
struct FileRange {
    source: Arc<SharedFile>,
    at: u64,
    end: u64,
}

impl Read for FileRange {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let most = usize::try_from(self.end - self.at).unwrap_or(usize::MAX).min(buffer.len());
        let count = self.source.read_some(self.at, &mut buffer[..most])?;
        self.at += count as u64;
        Ok(count)
    }
}

/// A stretch that is being read.
pub(crate) struct StretchReader {
    stretch: FileStretch,
    /// The bytes, as they are in the file or unpacked.
    bytes: BufReader<FileRange>,
    /// What unpacks them, and whether it came to their end.
    engine: Option<Decompress>,
    ended: bool,
    /// Unpacked bytes so far.
    position: u64,
}

impl Read for StretchReader {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let Some(engine) = &mut self.engine else { return self.bytes.read(buffer) };
        while !self.ended && !buffer.is_empty() {
            let packed = self.bytes.fill_buf()?;
            let (before, is_last) = ((engine.total_in(), engine.total_out()), packed.is_empty());
            let status = engine.decompress(packed, buffer, FlushDecompress::None)?;
            let (taken, given) = (engine.total_in() - before.0, engine.total_out() - before.1);
            // Both are no more than the lengths of the slices.
            #[allow(clippy::cast_possible_truncation)]
            let (taken, given) = (taken as usize, given as usize);
            self.bytes.consume(taken);
            self.ended = status == Status::StreamEnd;
            if given > 0 {
                return Ok(given);
            }
            refuse_if(is_last && !self.ended, || io::Error::from(io::ErrorKind::UnexpectedEof))?;
        }
        Ok(0)
    }
}

impl StretchReader {
    /// Bytes of the whole stretch in the file.
    pub(crate) fn packed(&self) -> u64 {
        self.stretch.end - self.stretch.start
    }

    /// Unpacked bytes before the next.
    pub(crate) fn position(&self) -> u64 {
        self.position
    }

    /// What is wrong at this place.
    pub(crate) fn damaged(&self, found: impl Into<String>, expected: impl Into<String>) -> FormatError {
        let place = format!("byte {} of {}", self.position, self.stretch.name);
        FormatError::damaged(self.stretch.format, place, found, expected)
    }

    /// Reads all of `buffer`.
    pub(crate) fn read_all(&mut self, buffer: &mut [u8]) -> Result<()> {
        let read = self.read_exact(buffer);
        self.passed(read, buffer.len() as u64)
    }

    /// Goes on behind so many bytes, if they could be read.
    fn passed(&mut self, read: io::Result<()>, count: u64) -> Result<()> {
        let found = match read {
            Ok(()) => {
                self.position += count;
                return Ok(());
            }
            Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => "its end before".to_owned(),
            Err(error) if self.engine.is_some() => {
                format!("packed bytes that are damaged, or whose checksum is another one ({error}), before")
            }
            Err(error) => return Err(error.into()),
        };
        Err(self.damaged(found, format!("{count} bytes")))
    }

    /// Reads a few bytes, whose number the caller bounds.
    pub(crate) fn next_bytes(&mut self, count: usize) -> Result<Vec<u8>> {
        let mut buffer = vec![0; count];
        self.read_all(&mut buffer)?;
        Ok(buffer)
    }

    /// Passes over bytes.
    pub(crate) fn skip(&mut self, count: u64) -> Result<()> {
        let skipped = if self.engine.is_some() {
            io::copy(&mut self.by_ref().take(count), &mut io::sink()).map(|skipped| skipped == count)
        } else {
            let range = self.bytes.get_mut();
            let is_there = range.end - range.at >= count;
            range.at += if is_there { count } else { 0 };
            Ok(is_there)
        };
        let ended = || io::Error::from(io::ErrorKind::UnexpectedEof);
        self.passed(skipped.and_then(|all| all.then_some(()).ok_or_else(ended)), count)
    }

    /// Refuses what goes on: more packed bytes, or packed bytes whose checksum is another one, which is the last of them.
    fn expect_end(&mut self) -> Result<()> {
        let more = self.read(&mut [0]);
        let packed = self.engine.as_ref().map_or(self.packed(), Decompress::total_in);
        let (found, expected) = match more {
            Ok(0) if packed == self.packed() => return Ok(()),
            Ok(0) => (format!("{} bytes after it", self.packed() - packed), "none"),
            Ok(_) => ("more bytes".to_owned(), "its end, as its length is stated"),
            Err(error) => (
                format!("packed bytes that do not end, or whose checksum is another one ({error})"),
                "the end of what is packed, with its checksum",
            ),
        };
        Err(self.damaged(found, expected))
    }
}

/// Records in a stretch of a file.
pub(crate) struct StreamLane {
    stretch: FileStretch,
    /// Bytes before the first record.
    skip: u64,
    record: usize,
    stream: Option<StretchReader>,
}

impl StreamLane {
    pub(crate) fn new(stretch: FileStretch, skip: u64, record: usize) -> Self {
        Self { stretch, skip, record, stream: None }
    }
}

impl RecordLane for StreamLane {
    fn record(&self) -> usize {
        self.record
    }

    fn protection(&self) -> Option<&'static str> {
        self.stretch.protection()
    }

    fn read(&mut self, rows: usize, out: &mut Vec<u8>) -> Result<()> {
        let stream = match &mut self.stream {
            Some(stream) => stream,
            // Unpacking takes memory, which a column that is not read does not need.
            empty => {
                self.stretch.verify()?;
                let mut stream = self.stretch.stream();
                stream.skip(self.skip)?;
                empty.insert(stream)
            }
        };
        out.resize(rows * self.record, 0);
        stream.read_all(out)
    }
}

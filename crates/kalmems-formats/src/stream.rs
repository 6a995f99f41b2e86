//! A stretch of a file that is read from front to back, packed or not.

use crate::FormatError;
use crate::element::Element;
use crate::records::RecordLane;
use crate::source::SharedFile;
use flate2::{Crc, Decompress, FlushDecompress, Status};
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
    /// Filled once the whole stretch agrees with its lengths and its checksum: where it stands unpacked, if it does.
    pub(crate) verified: Arc<OnceLock<Option<UnpackedPlace>>>,
}

/// A file of unpacked bytes and a place in it.
type UnpackedPlace = (Arc<SharedFile>, u64);

impl FileStretch {
    /// A whole file as it is.
    pub(crate) fn stored(source: Arc<SharedFile>, format: &'static str, name: &str) -> Self {
        let (end, name) = (source.length(), name.to_owned());
        let (packing, verified) = (Compression::Stored, Arc::default());
        Self { source, format, name, packing, start: 0, end, unpacked: end, crc: None, verified }
    }

    /// Begins at its front.
    pub(crate) fn stream(&self) -> StretchReader {
        if let Some(Some((source, at))) = self.verified.get() {
            let (source, at, end) = (Arc::clone(source), *at, at + self.unpacked);
            return StretchReader { stretch: self.clone(), source, at, end, inflate: None, position: 0 };
        }
        let inflate = match self.packing {
            Compression::Stored => None,
            Compression::Deflate => Some(Inflate::new(false)),
            Compression::Zlib => Some(Inflate::new(true)),
        };
        let (source, at, end) = (Arc::clone(&self.source), self.start, self.end);
        StretchReader { stretch: self.clone(), source, at, end, inflate, position: 0 }
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
    pub(crate) fn verify(&self) -> Result<(), FormatError> {
        let mut copies = self.source.copies();
        if self.verified.get().is_some() || self.protection().is_none() {
            return Ok(());
        }
        let is_kept = self.packing != Compression::Stored && self.unpacked > VERIFIED_AT_ONCE;
        let mut copy = if is_kept { copies.begin(self.unpacked) } else { None };
        let (mut stream, mut sum) = (self.stream(), Crc::new());
        let mut piece = vec![0; INPUT];
        let mut left = self.unpacked;
        while left > 0 {
            let some = usize::try_from(left).unwrap_or(INPUT).min(INPUT);
            stream.read(&mut piece[..some])?;
            if self.crc.is_some() {
                sum.update(&piece[..some]);
            }
            copy = copy.filter(|start| copies.append(*start, &piece[..some]).is_some());
            left -= some as u64;
        }
        stream.expect_end()?;
        if let Some(expected) = self.crc.filter(|expected| *expected != sum.sum()) {
            return Err(stream.damaged(
                format!("a checksum of {:08x} over all of it", sum.sum()),
                format!("{expected:08x}, as it is stored"),
            ));
        }
        let _ = self.verified.set(copies.reader().zip(copy));
        Ok(())
    }

    /// A single number at a place of it.
    pub(crate) fn number(&self, place: u64, element: Element) -> Result<f64, FormatError> {
        self.verify()?;
        let mut stream = self.stream();
        stream.skip(place)?;
        Ok(element.exact(&stream.bytes(element.bytes)?).rounded())
    }
}

/// A stretch that is being read.
pub(crate) struct StretchReader {
    stretch: FileStretch,
    /// The bytes, as they are in the file or unpacked.
    source: Arc<SharedFile>,
    /// The next of them that is not in memory, and their end.
    at: u64,
    end: u64,
    inflate: Option<Inflate>,
    /// Unpacked bytes so far.
    position: u64,
}

struct Inflate {
    engine: Decompress,
    input: Vec<u8>,
    next: usize,
    ended: bool,
}

impl Inflate {
    fn new(zlib: bool) -> Self {
        Self { engine: Decompress::new(zlib), input: Vec::new(), next: 0, ended: false }
    }

    /// Packed bytes in memory that are not unpacked.
    fn left(&self) -> u64 {
        (self.input.len() - self.next) as u64
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
        FormatError::damaged(
            self.stretch.format,
            format!("byte {} of {}", self.position, self.stretch.name),
            found.into(),
            expected.into(),
        )
    }

    /// Reads all of `buffer`.
    pub(crate) fn read(&mut self, buffer: &mut [u8]) -> Result<(), FormatError> {
        if self.inflate.is_some() {
            self.unpack(buffer)?;
        } else {
            let count = buffer.len() as u64;
            if self.end - self.at < count {
                return Err(self.damaged(
                    format!("its end after {} more bytes", self.end - self.at),
                    format!("{count} bytes"),
                ));
            }
            self.source.read_exact(self.stretch.format, self.at, buffer)?;
            self.at += count;
        }
        self.position += buffer.len() as u64;
        Ok(())
    }

    /// Reads a few bytes, whose number the caller bounds.
    pub(crate) fn bytes(&mut self, count: usize) -> Result<Vec<u8>, FormatError> {
        let mut buffer = vec![0; count];
        self.read(&mut buffer)?;
        Ok(buffer)
    }

    /// Passes over bytes.
    pub(crate) fn skip(&mut self, mut count: u64) -> Result<(), FormatError> {
        if self.inflate.is_none() {
            if self.end - self.at < count {
                return Err(self.damaged(
                    format!("its end after {} more bytes", self.end - self.at),
                    format!("{count} bytes"),
                ));
            }
            self.at += count;
            self.position += count;
            return Ok(());
        }
        let mut waste = vec![0; usize::try_from(count).unwrap_or(INPUT).min(INPUT)];
        while count > 0 {
            let some = usize::try_from(count).unwrap_or(INPUT).min(waste.len());
            self.read(&mut waste[..some])?;
            count -= some as u64;
        }
        Ok(())
    }

    /// Refuses what goes on: more packed bytes, or packed bytes whose checksum is another one, which is the last of them.
    fn expect_end(&mut self) -> Result<(), FormatError> {
        let mut more = [0];
        let unpacked = self.inflate.is_some() && self.unpack(&mut more).is_ok();
        let left = self.end - self.at + self.inflate.as_ref().map_or(0, Inflate::left);
        match &self.inflate {
            _ if unpacked => Err(self.damaged("more bytes", "its end, as its length is stated")),
            Some(inflate) if !inflate.ended => {
                let found =
                    "packed bytes that do not end, or whose checksum is not that of what they unpack to";
                Err(self.damaged(found, "the end of what is packed, with its checksum"))
            }
            _ if left > 0 => Err(self.damaged(format!("{left} bytes behind it"), "none")),
            _ => Ok(()),
        }
    }

    fn unpack(&mut self, buffer: &mut [u8]) -> Result<(), FormatError> {
        let mut filled = 0;
        while filled < buffer.len() {
            let Some(inflate) = &mut self.inflate else { break };
            if inflate.next == inflate.input.len() && self.at < self.end {
                let count = usize::try_from(self.end - self.at).unwrap_or(INPUT).min(INPUT);
                inflate.input.resize(count, 0);
                self.source.read_exact(self.stretch.format, self.at, &mut inflate.input)?;
                inflate.next = 0;
                self.at += count as u64;
            }
            let (taken, given) = (inflate.engine.total_in(), inflate.engine.total_out());
            let status = if inflate.ended {
                Ok(Status::StreamEnd)
            } else {
                inflate.engine.decompress(
                    &inflate.input[inflate.next..],
                    &mut buffer[filled..],
                    FlushDecompress::None,
                )
            };
            let taken = inflate.engine.total_in() - taken;
            let given = inflate.engine.total_out() - given;
            // Both are no more than the lengths of the slices.
            #[allow(clippy::cast_possible_truncation)]
            {
                inflate.next += taken as usize;
                filled += given as usize;
            }
            inflate.ended |= matches!(status, Ok(Status::StreamEnd));
            let stuck = taken == 0 && given == 0;
            if filled < buffer.len() && (status.is_err() || inflate.ended || stuck) {
                let found = match status {
                    Err(error) => {
                        format!("packed bytes that are damaged, or whose checksum is another one ({error})")
                    }
                    Ok(_) => format!("the end of what is packed {filled} bytes on"),
                };
                return Err(self.damaged(found, format!("{} bytes", buffer.len())));
            }
        }
        Ok(())
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

    fn read(&mut self, rows: usize, out: &mut Vec<u8>) -> Result<(), FormatError> {
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
        stream.read(out)
    }
}

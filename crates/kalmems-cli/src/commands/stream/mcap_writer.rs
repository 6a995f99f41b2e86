//! MCAP files (version 0 of the format): chunks of messages, compressed by LZ4, and behind them an index by which a reader finds its way.
//!
//! <https://mcap.dev/spec>

use lz4_flex::frame::FrameEncoder;
use std::io::{self, Write};

/// What a file begins and ends with.
pub const MAGIC: [u8; 8] = *b"\x89MCAP0\r\n";

/// Bytes of messages that are kept together, so that a reader finds its way: about a second of a thousand estimates.
const CHUNK: usize = 1 << 18;

/// How chunks are compressed, by the name that the format has for it.
const COMPRESSION: &str = "lz4";

mod kinds {
    pub const HEADER: u8 = 1;
    pub const FOOTER: u8 = 2;
    pub const SCHEMA: u8 = 3;
    pub const CHANNEL: u8 = 4;
    pub const MESSAGE: u8 = 5;
    pub const CHUNK: u8 = 6;
    pub const MESSAGE_INDEX: u8 = 7;
    pub const CHUNK_INDEX: u8 = 8;
    pub const STATISTICS: u8 = 11;
    pub const DATA_END: u8 = 15;
}

/// Writes records to a file.
pub struct McapWriter<W: Write> {
    file: W,
    /// Bytes that were written.
    written: u64,
    /// Schemas and channels, which stand in the first chunk and are repeated behind the last one; how many channels there are.
    announced: Vec<u8>,
    channels: u16,
    /// The chunk that is being filled.
    chunk: McapChunk,
    /// What leads to each chunk that is written.
    index: Vec<u8>,
    chunks: u32,
    /// Messages of each channel, and the first and the last time.
    counts: Vec<u64>,
    span: Option<[u64; 2]>,
}

#[derive(Default)]
struct McapChunk {
    records: Vec<u8>,
    span: Option<[u64; 2]>,
    /// The time and the place of each message, of each channel.
    places: Vec<Vec<(u64, u64)>>,
}

impl<W: Write> McapWriter<W> {
    /// Begins a file that says what it was written by.
    pub fn begin(file: W, library: &str) -> io::Result<Self> {
        let mut writer = Self {
            file,
            written: 0,
            announced: Vec::new(),
            channels: 0,
            chunk: McapChunk::default(),
            index: Vec::new(),
            chunks: 0,
            counts: Vec::new(),
            span: None,
        };
        writer.put(&MAGIC)?;
        let header = [text(""), text(library)].concat();
        writer.put(&record(kinds::HEADER, &[&header]))?;
        writer.file.flush()?;
        Ok(writer)
    }

    /// Bytes of the file so far.
    pub const fn bytes(&self) -> u64 {
        self.written
    }

    /// Announces a channel of JSON with its schema, and gives its number.
    pub fn announce(&mut self, topic: &str, name: &str, schema: &[u8]) -> u16 {
        let channel = self.channels;
        self.channels += 1;
        // A schema has no number 0.
        let number = (channel + 1).to_le_bytes();
        let schema = [&number[..], &text(name), &text("jsonschema"), &counted(schema)].concat();
        let announced =
            [&channel.to_le_bytes()[..], &number, &text(topic), &text("json"), &counted(&[])].concat();
        let records = [record(kinds::SCHEMA, &[&schema]), record(kinds::CHANNEL, &[&announced])].concat();
        self.announced.extend_from_slice(&records);
        self.chunk.records.extend_from_slice(&records);
        self.counts.push(0);
        channel
    }

    /// Writes a message at a time in ns.
    pub fn message(&mut self, channel: u16, time: u64, content: &[u8]) -> io::Result<()> {
        let place = usize::from(channel);
        let count = &mut self.counts[place];
        #[allow(clippy::cast_possible_truncation)] // it begins again
        let sequence = (*count as u32).to_le_bytes();
        *count += 1;
        self.chunk.places.resize(self.counts.len(), Vec::new());
        self.chunk.places[place].push((time, self.chunk.records.len() as u64));
        let time_bytes = time.to_le_bytes();
        let head = [&channel.to_le_bytes()[..], &sequence, &time_bytes, &time_bytes].concat();
        self.chunk.records.extend_from_slice(&record(kinds::MESSAGE, &[&head, content]));
        for span in [&mut self.chunk.span, &mut self.span] {
            let [first, last] = span.unwrap_or([time; 2]);
            *span = Some([first.min(time), last.max(time)]);
        }
        if self.chunk.records.len() >= CHUNK { self.end_chunk() } else { Ok(()) }
    }

    /// Writes the messages that wait.
    pub fn end_chunk(&mut self) -> io::Result<()> {
        let McapChunk { records, span, places } = std::mem::take(&mut self.chunk);
        if records.is_empty() {
            return Ok(());
        }
        let span: Vec<u8> = span.unwrap_or_default().iter().flat_map(|time| time.to_le_bytes()).collect();
        let mut packed = FrameEncoder::new(Vec::new());
        packed.write_all(&records)?;
        let packed = packed.finish().map_err(io::Error::other)?;
        let (length, compression) = ((records.len() as u64).to_le_bytes(), text(COMPRESSION));
        let packed_length = (packed.len() as u64).to_le_bytes();
        let sum = crc32fast::hash(&records).to_le_bytes();
        let begin = self.written;
        self.put(&record(kinds::CHUNK, &[&span, &length, &sum, &compression, &packed_length, &packed]))?;
        let end = self.written;
        let mut offsets = Vec::new();
        for (channel, places) in (0_u16..).zip(&places).filter(|(_, places)| !places.is_empty()) {
            offsets.extend_from_slice(&channel.to_le_bytes());
            offsets.extend_from_slice(&self.written.to_le_bytes());
            let pairs: Vec<u8> = places
                .iter()
                .flat_map(|(time, place)| [time.to_le_bytes(), place.to_le_bytes()].concat())
                .collect();
            self.put(&record(kinds::MESSAGE_INDEX, &[&channel.to_le_bytes(), &counted(&pairs)]))?;
        }
        let [begin_bytes, chunk, indexes] = [begin, end - begin, self.written - end].map(u64::to_le_bytes);
        let parts: [&[u8]; 8] = [
            &span,
            &begin_bytes,
            &chunk,
            &counted(&offsets),
            &indexes,
            &compression,
            &packed_length,
            &length,
        ];
        self.index.extend_from_slice(&record(kinds::CHUNK_INDEX, &parts));
        self.chunks += 1;
        self.file.flush()
    }

    /// Completes the file.
    pub fn finish(&mut self) -> io::Result<()> {
        self.end_chunk()?;
        self.put(&record(kinds::DATA_END, &[&[0; 4]]))?;
        let begin = self.written;
        let messages: u64 = self.counts.iter().sum();
        let span: Vec<u8> =
            self.span.unwrap_or_default().iter().flat_map(|time| time.to_le_bytes()).collect();
        let counts: Vec<u8> = (0_u16..)
            .zip(&self.counts)
            .flat_map(|(channel, count)| [&channel.to_le_bytes()[..], &count.to_le_bytes()].concat())
            .collect();
        // No attachments and no metadata.
        let (channels, none) = (u32::from(self.channels).to_le_bytes(), [0; 8]);
        let parts: [&[u8]; 7] = [
            &messages.to_le_bytes(),
            &self.channels.to_le_bytes(),
            &channels,
            &none,
            &self.chunks.to_le_bytes(),
            &span,
            &counted(&counts),
        ];
        let summary = [&self.announced[..], &record(kinds::STATISTICS, &parts), &self.index].concat();
        // The footer's own beginning is under the checksum as well, and no offsets of groups are given.
        let footer = record(kinds::FOOTER, &[&begin.to_le_bytes(), &[0; 8], &[0; 4]]);
        let checked = [&summary[..], &footer[..footer.len() - 4]].concat();
        let sum = crc32fast::hash(&checked).to_le_bytes();
        self.put(&[&checked[..], &sum, &MAGIC].concat())?;
        self.file.flush()
    }

    fn put(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.written += bytes.len() as u64;
        self.file.write_all(bytes)
    }
}

fn record(kind: u8, parts: &[&[u8]]) -> Vec<u8> {
    let length: usize = parts.iter().map(|part| part.len()).sum();
    let mut record = Vec::with_capacity(9 + length);
    record.push(kind);
    record.extend_from_slice(&(length as u64).to_le_bytes());
    for part in parts {
        record.extend_from_slice(part);
    }
    record
}

/// Bytes behind their number.
fn counted(bytes: &[u8]) -> Vec<u8> {
    let count = u32::try_from(bytes.len()).unwrap_or(u32::MAX);
    [&count.to_le_bytes()[..], bytes].concat()
}

fn text(text: &str) -> Vec<u8> {
    counted(text.as_bytes())
}

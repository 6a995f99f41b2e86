//! Estimates and events as an MCAP file, which Foxglove and other programs open: a channel of JSON with its schema for each answer, and one for events.

use super::mcap_writer::{MAGIC, McapWriter};
use super::messages::{MessageReader, REASON, StreamMessage};
use super::rotation::{FileRotation, FileSeries};
use crate::CommandEnding;
use serde_json::{Map, Value, json};
use std::cell::RefCell;
use std::collections::HashMap;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;
use std::rc::Rc;
use std::time::{Duration, Instant};

/// What such files say that they were written by.
const LIBRARY: &str = concat!("kalmems ", env!("CARGO_PKG_VERSION"));

/// How long messages wait until their chunk is written.
const WAIT: Duration = Duration::from_secs(5);

/// The topic of events.
const EVENTS: &str = "events";

/// Whether a file that begins with these bytes was written here.
pub fn is_own(beginning: &[u8]) -> bool {
    beginning.starts_with(&MAGIC) && beginning.windows(8).any(|bytes| bytes == b"kalmems ")
}

/// Takes the lines of a stream; clones write to the same file.
#[derive(Clone)]
pub struct McapFile(Rc<RefCell<Open>>);

struct Open {
    reader: MessageReader,
    series: FileSeries,
    writer: McapWriter<BufWriter<File>>,
    /// When a chunk was written last.
    written: Instant,
    channels: HashMap<String, u16>,
    /// Where times count from, in whole nanoseconds.
    origin_ns: u64,
    /// The time of the last message: an event without a time has that, and waits where there is none yet.
    last_ns: Option<u64>,
    waiting: Vec<Value>,
    /// Messages of times before 1970, which the format does not have.
    left_out: u64,
}

impl McapFile {
    /// Begins a file.
    pub fn begin(path: &Path, with: (bool, FileRotation)) -> Result<Self, CommandEnding> {
        let (series, file) = FileSeries::begin(path, is_own, with)?;
        let writer = McapWriter::begin(BufWriter::new(file), LIBRARY);
        let writer = writer.map_err(|e| CommandEnding::Wrong(format!("{}: {e}", path.display())))?;
        Ok(Self(Rc::new(RefCell::new(Open {
            reader: MessageReader::default(),
            series,
            writer,
            written: Instant::now(),
            channels: HashMap::new(),
            origin_ns: 0,
            last_ns: None,
            waiting: Vec::new(),
            left_out: 0,
        }))))
    }

    /// Completes the file: how many messages were left out because they were of times before 1970.
    pub fn finish(&self) -> io::Result<u64> {
        let open = &mut *self.0.borrow_mut();
        open.begin_at(open.origin_ns)?;
        open.writer.finish()?;
        Ok(open.left_out)
    }
}

impl Write for McapFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let open = &mut *self.0.borrow_mut();
        let mut messages = Vec::new();
        open.reader.take(bytes, |message| messages.push(message));
        for message in messages {
            open.message(message)?;
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Open {
    fn message(&mut self, message: StreamMessage) -> io::Result<()> {
        match message {
            StreamMessage::Origin(seconds) => self.origin_ns = nanoseconds(seconds, 0).unwrap_or(0),
            StreamMessage::Estimate { key, time_s, values } => {
                let mut content: Map<_, _> = [("time_s".to_owned(), json!(time_s))].into_iter().collect();
                content.extend(values);
                self.write(&key, Some(time_s), &Value::Object(content))?;
            }
            StreamMessage::Event { time_s, event } => self.write(EVENTS, time_s, &event)?,
        }
        Ok(())
    }

    /// Writes the events that have waited for the first time there is, as this is it.
    fn begin_at(&mut self, time: u64) -> io::Result<()> {
        self.last_ns.get_or_insert(time);
        for event in std::mem::take(&mut self.waiting) {
            self.write(EVENTS, None, &event)?;
        }
        Ok(())
    }

    fn write(&mut self, topic: &str, time_s: Option<f64>, content: &Value) -> io::Result<()> {
        let time = match time_s {
            Some(time_s) => nanoseconds(time_s, self.origin_ns),
            None if self.last_ns.is_none() => {
                self.waiting.push(content.clone());
                return Ok(());
            }
            None => self.last_ns,
        };
        let Some(time) = time else {
            self.left_out += 1;
            return Ok(());
        };
        self.begin_at(time)?;
        self.last_ns = Some(time);
        if self.series.is_due(self.writer.bytes()) {
            self.writer.finish()?;
            self.writer = McapWriter::begin(BufWriter::new(self.series.next()?), LIBRARY)?;
            self.channels.clear();
        }
        let channel = if let Some(channel) = self.channels.get(topic) {
            *channel
        } else {
            let schema = serde_json::to_vec(&schema(topic, self.reader.columns(topic)))?;
            let channel = self.writer.announce(&format!("/{topic}"), &format!("kalmems.{topic}"), &schema);
            self.channels.insert(topic.to_owned(), channel);
            channel
        };
        self.writer.message(channel, time, &serde_json::to_vec(content)?)?;
        if self.written.elapsed() >= WAIT {
            self.written = Instant::now();
            self.writer.end_chunk()?;
        }
        Ok(())
    }
}

/// The schema of a channel. A value that is no number in a message is left out there, so that all but the time may be missing.
fn schema(topic: &str, columns: &[String]) -> Value {
    if topic == EVENTS {
        return json!({ "title": "event", "type": "object" });
    }
    let property = |name: &str, kind: &str| (name.to_owned(), json!({ "type": kind }));
    let columns = columns.iter().map(|name| property(name, "number"));
    let properties: Map<String, Value> = std::iter::once(property("time_s", "number"))
        .chain(columns)
        .chain([property(REASON, "string")])
        .collect();
    json!({ "title": topic, "type": "object", "properties": properties, "required": ["time_s"] })
}

/// A time in whole nanoseconds behind an origin; none where it is before 1970 or in the far future.
fn nanoseconds(time_s: f64, origin_ns: u64) -> Option<u64> {
    let (whole, part) = (time_s.floor(), time_s - time_s.floor());
    if !whole.is_finite() || whole.abs() > 1e10 {
        return None;
    }
    #[allow(clippy::cast_possible_truncation)] // at most 1e10
    let (whole, part) = (whole as i64, (part * 1e9).round() as i64);
    let own = whole.checked_mul(1_000_000_000)?.checked_add(part)?;
    origin_ns.checked_add_signed(own)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use mcap::read::Summary;
    use mcap::sans_io::decompressor::{DecompressResult, Decompressor};
    use mcap::sans_io::{
        IndexedReadEvent, IndexedReader, LinearReadEvent, LinearReader, LinearReaderOptions,
    };

    /// The crate `mcap` has LZ4 by a library of C alone.
    struct Lz4;

    impl Decompressor for Lz4 {
        fn next_read_size(&self) -> usize {
            0
        }

        fn decompress(&mut self, src: &[u8], dst: &mut [u8]) -> mcap::McapResult<DecompressResult> {
            io::Read::read_exact(&mut lz4_flex::frame::FrameDecoder::new(src), dst)?;
            Ok(DecompressResult { consumed: src.len(), wrote: dst.len() })
        }

        fn reset(&mut self) -> mcap::McapResult<()> {
            Ok(())
        }

        fn name(&self) -> &'static str {
            "lz4"
        }
    }

    /// The messages that an independent reader finds by the index of a file, whose checksums it has compared.
    pub(crate) fn messages(bytes: &[u8]) -> Vec<(String, u64, Value)> {
        let options =
            LinearReaderOptions::default().with_emit_chunks(true).with_validate_summary_section_crc(true);
        let (mut checked, mut rest) = (LinearReader::new_with_options(options), bytes);
        while let Some(event) = checked.next_event() {
            if let LinearReadEvent::ReadRequest(count) = event.unwrap() {
                let count = io::Read::read(&mut rest, checked.insert(count)).unwrap();
                checked.notify_read(count);
            }
        }
        let summary = Summary::read(bytes).unwrap().unwrap();
        let mut reader = IndexedReader::new(&summary).unwrap();
        reader.add_decompressor(Lz4).unwrap();
        let mut found = Vec::new();
        while let Some(event) = reader.next_event() {
            match event.unwrap() {
                IndexedReadEvent::ReadChunkRequest { offset, length } => {
                    let from = usize::try_from(offset).unwrap();
                    reader.insert_chunk_record_data(offset, &bytes[from..from + length]).unwrap();
                }
                IndexedReadEvent::Message { header, data } => {
                    let channel = &summary.channels[&header.channel_id];
                    let schema = channel.schema.as_ref().unwrap();
                    assert_eq!((&*schema.encoding, &*channel.message_encoding), ("jsonschema", "json"));
                    let schema: Value = serde_json::from_slice(&schema.data).unwrap();
                    assert_eq!(schema["type"], "object");
                    let property = |name: &str| &schema["properties"][name]["type"];
                    assert!(*channel.topic == *"/events" || property("reason") == "string", "{schema}");
                    assert!(*channel.topic == *"/events" || property("angle_rad") == "number", "{schema}");
                    let content = serde_json::from_slice(data).unwrap();
                    found.push((channel.topic.clone(), header.log_time, content));
                }
            }
        }
        let told = summary.stats.unwrap();
        assert_eq!(told.message_count, found.len() as u64);
        assert_eq!(told.message_start_time, found.iter().map(|(_, time, _)| *time).min().unwrap());
        found
    }

    #[test]
    fn what_was_written_is_read_back_with_times_schemas_and_values() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.mcap");
        let file = McapFile::begin(&path, (false, FileRotation::default())).unwrap();
        let text = "# ekf,time_s,angle_rad,angle_sd_rad\norigin,1700000000.25\nekf,-0.5,,,not_known\nekf,-0.25,1e-1,\nekf,0.5,2e-1,3e-3\n\
                    event,{\"event\":\"zero_phase\",\"time_s\":0.625}\nevent,{\"event\":\"ended\"}\nekf,-1800000000,1,1\n";
        for piece in text.as_bytes().chunks(11) {
            file.clone().write_all(piece).unwrap();
        }
        assert_eq!(file.finish().unwrap(), 1);
        let bytes = std::fs::read(&path).unwrap();
        assert!(is_own(&bytes[..100]) && !is_own(b"\x89MCAP0\r\n of others"));
        let start = 1_699_999_999_750_000_000;
        let own = |topic: &str, ns: u64, value| (topic.to_owned(), start + ns, value);
        assert_eq!(
            messages(&bytes),
            [
                own("/ekf", 0, json!({ "time_s": -0.5, "reason": "not_known" })),
                own("/ekf", 250_000_000, json!({ "time_s": -0.25, "angle_rad": 0.1 })),
                own("/ekf", 1_000_000_000, json!({ "time_s": 0.5, "angle_rad": 0.2, "angle_sd_rad": 0.003 })),
                own("/events", 1_125_000_000, json!({ "event": "zero_phase", "time_s": 0.625 })),
                own("/events", 1_125_000_000, json!({ "event": "ended" })),
            ]
        );
    }

    #[test]
    fn files_that_follow_each_other_are_complete_and_hold_every_message_once() {
        let folder = tempfile::tempdir().unwrap();
        let rotation = FileRotation { bytes: Some(200_000), every: None };
        let file = McapFile::begin(&folder.path().join("a.mcap"), (false, rotation)).unwrap();
        file.clone().write_all(b"# ekf,time_s,angle_rad\norigin,1700000000\n").unwrap();
        for k in 0..40_000 {
            file.clone().write_all(format!("ekf,{k},{:e}\n", f64::from(k).sqrt()).as_bytes()).unwrap();
        }
        assert_eq!(file.finish().unwrap(), 0);
        let mut times = Vec::new();
        let files: Vec<_> =
            std::fs::read_dir(folder.path()).unwrap().map(|file| file.unwrap().path()).collect();
        assert!((3..20).contains(&files.len()), "{files:?}");
        for path in &files {
            assert!(path.extension().is_some_and(|ending| ending == "mcap"), "{files:?}");
            let found = messages(&std::fs::read(path).unwrap());
            // Half the size and less of what they hold.
            let text: usize = found.iter().map(|(_, _, content)| content.to_string().len() + 31).sum();
            assert!(std::fs::metadata(path).unwrap().len() < text as u64, "{path:?}");
            times.extend(found.into_iter().map(|(_, time, _)| time / 1_000_000_000 - 1_700_000_000));
        }
        times.sort_unstable();
        assert!(times.into_iter().eq(0..40_000));
    }
}

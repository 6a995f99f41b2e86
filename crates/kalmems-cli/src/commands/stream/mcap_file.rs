//! Estimates and events as an MCAP file, which Foxglove and other programs open: a channel of JSON with its schema for each answer, and one for events.

use super::messages::{MessageReader, StreamMessage};
use mcap::records::MessageHeader;
use mcap::{McapError, WriteOptions};
use serde_json::{Map, Value, json};
use std::cell::RefCell;
use std::collections::{BTreeMap, HashMap};
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::rc::Rc;

/// What such files say that they were written by.
const LIBRARY: &str = concat!("kalmems ", env!("CARGO_PKG_VERSION"));

/// Bytes of messages that are kept together, so that a reader finds its way: about a second of a thousand estimates.
const CHUNK: u64 = 1 << 18;

/// The topic of events.
const EVENTS: &str = "events";

/// Whether a file that begins with these bytes was written here.
pub fn is_own(beginning: &[u8]) -> bool {
    beginning.starts_with(mcap::MAGIC) && beginning.windows(8).any(|bytes| bytes == b"kalmems ")
}

/// Takes the lines of a stream; clones write to the same file.
#[derive(Clone)]
pub struct McapFile(Rc<RefCell<Open>>);

struct Open {
    reader: MessageReader,
    writer: mcap::Writer<BufWriter<File>>,
    channels: HashMap<String, Channel>,
    /// Where times count from, in whole nanoseconds.
    origin_ns: u64,
    /// The time of the last message: an event without a time has that, and waits where there is none yet.
    last_ns: Option<u64>,
    waiting: Vec<Value>,
    /// Messages of times before 1970, which the format does not have.
    left_out: u64,
}

/// A channel that has been announced.
struct Channel {
    id: u16,
    /// Messages so far.
    count: u32,
}

impl McapFile {
    /// Begins a file.
    pub fn begin(file: File) -> io::Result<Self> {
        let options =
            WriteOptions::new().library(LIBRARY).profile("").compression(None).chunk_size(Some(CHUNK));
        let writer = options.create(BufWriter::new(file)).map_err(io::Error::other)?;
        let (reader, channels) = (MessageReader::default(), HashMap::new());
        let open =
            Open { reader, writer, channels, origin_ns: 0, last_ns: None, waiting: Vec::new(), left_out: 0 };
        Ok(Self(Rc::new(RefCell::new(open))))
    }

    /// Completes the file: how many messages were left out because they were of times before 1970.
    pub fn finish(&self) -> io::Result<u64> {
        let open = &mut *self.0.borrow_mut();
        open.begin_at(open.origin_ns).map_err(io::Error::other)?;
        open.writer.finish().map_err(io::Error::other)?;
        Ok(open.left_out)
    }
}

impl Write for McapFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let open = &mut *self.0.borrow_mut();
        let mut messages = Vec::new();
        open.reader.take(bytes, |message| messages.push(message));
        for message in messages {
            open.message(message).map_err(io::Error::other)?;
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Open {
    fn message(&mut self, message: StreamMessage) -> Result<(), McapError> {
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
    fn begin_at(&mut self, time: u64) -> Result<(), McapError> {
        self.last_ns.get_or_insert(time);
        for event in std::mem::take(&mut self.waiting) {
            self.write(EVENTS, None, &event)?;
        }
        Ok(())
    }

    fn write(&mut self, topic: &str, time_s: Option<f64>, content: &Value) -> Result<(), McapError> {
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
        if !self.channels.contains_key(topic) {
            let schema = serde_json::to_vec(&schema(topic, content)).map_err(io::Error::from)?;
            let name = format!("kalmems.{topic}");
            let schema = self.writer.add_schema(&name, "jsonschema", &schema)?;
            let id = self.writer.add_channel(schema, &format!("/{topic}"), "json", &BTreeMap::new())?;
            self.channels.insert(topic.to_owned(), Channel { id, count: 0 });
        }
        let Some(channel) = self.channels.get_mut(topic) else { return Ok(()) };
        let header = MessageHeader {
            channel_id: channel.id,
            sequence: channel.count,
            log_time: time,
            publish_time: time,
        };
        channel.count = channel.count.wrapping_add(1);
        let content = serde_json::to_vec(content).map_err(io::Error::from)?;
        self.writer.write_to_known_channel(&header, &content)
    }
}

/// The schema of a channel by its first message. A value that is no number in a later message is left out there, so that all but the time may be missing.
fn schema(topic: &str, content: &Value) -> Value {
    if topic == EVENTS {
        return json!({ "title": "event", "type": "object" });
    }
    let properties: Map<String, Value> = (content.as_object().into_iter().flatten())
        .map(|(name, _)| (name.clone(), json!({ "type": "number" })))
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
mod tests {
    use super::*;

    #[test]
    fn what_was_written_is_read_back_with_times_schemas_and_values() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.mcap");
        let file = McapFile::begin(File::create(&path).unwrap()).unwrap();
        let text = "# ekf,time_s,angle_rad,angle_sd_rad\norigin,1700000000.25\nekf,-0.25,1e-1,\nekf,0.5,2e-1,3e-3\n\
                    event,{\"event\":\"zero_phase\",\"time_s\":0.625}\nevent,{\"event\":\"ended\"}\nekf,-1800000000,1,1\n";
        for piece in text.as_bytes().chunks(11) {
            file.clone().write_all(piece).unwrap();
        }
        assert_eq!(file.finish().unwrap(), 1);
        let bytes = std::fs::read(&path).unwrap();
        assert!(is_own(&bytes[..100]) && !is_own(b"\x89MCAP0\r\n of others"));
        let found: Vec<(String, u64, Value)> = mcap::MessageStream::new(&bytes)
            .unwrap()
            .map(|message| {
                let message = message.unwrap();
                let schema = message.channel.schema.as_ref().unwrap();
                assert_eq!(
                    (schema.encoding.as_str(), &*message.channel.message_encoding),
                    ("jsonschema", "json")
                );
                let schema: Value = serde_json::from_slice(&schema.data).unwrap();
                assert_eq!(schema["type"], "object");
                (
                    message.channel.topic.clone(),
                    message.log_time,
                    serde_json::from_slice(&message.data).unwrap(),
                )
            })
            .collect();
        let start = 1_700_000_000_000_000_000;
        let own = |topic: &str, ns: u64, value| (topic.to_owned(), start + ns, value);
        assert_eq!(
            found,
            [
                own("/ekf", 0, json!({ "time_s": -0.25, "angle_rad": 0.1 })),
                own("/ekf", 750_000_000, json!({ "time_s": 0.5, "angle_rad": 0.2, "angle_sd_rad": 0.003 })),
                own("/events", 875_000_000, json!({ "event": "zero_phase", "time_s": 0.625 })),
                own("/events", 875_000_000, json!({ "event": "ended" })),
            ]
        );
    }
}

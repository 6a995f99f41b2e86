//! The lines of a stream as messages, for what draws or keeps them.

use serde_json::{Map, Value, json};
use std::collections::HashMap;

/// What a line says.
#[derive(Debug, PartialEq)]
pub enum StreamMessage {
    /// Where times count from, in seconds since 1970 or of whatever clock the samples have.
    Origin(f64),
    /// An answer at a time, with the values that are numbers by the names of their columns; without any, with the reason as [`REASON`].
    Estimate {
        /// The answer's key.
        key: String,
        time_s: f64,
        values: Map<String, Value>,
    },
    /// What happened, and when, where it has a time.
    Event { time_s: Option<f64>, event: Value },
}

/// The name of the reason why an answer has no number at a time, among the names of its columns.
pub const REASON: &str = "reason";

/// Makes messages of lines, however they are cut.
#[derive(Default)]
pub struct MessageReader {
    /// The columns of each answer behind its time.
    columns: HashMap<String, Vec<String>>,
    /// What of a line has come.
    rest: Vec<u8>,
}

impl MessageReader {
    /// Takes the next bytes, and gives each message that they complete.
    pub fn take(&mut self, bytes: &[u8], mut given: impl FnMut(StreamMessage)) {
        self.rest.extend_from_slice(bytes);
        let whole = self.rest.iter().rposition(|byte| *byte == b'\n').map_or(0, |end| end + 1);
        let lines: Vec<u8> = self.rest.drain(..whole).collect();
        for line in String::from_utf8_lossy(&lines).lines() {
            if let Some(message) = self.message(line) {
                given(message);
            }
        }
    }

    /// The columns of an answer after its time.
    pub fn columns(&self, key: &str) -> &[String] {
        self.columns.get(key).map_or(&[], Vec::as_slice)
    }

    fn message(&mut self, line: &str) -> Option<StreamMessage> {
        if let Some(header) = line.strip_prefix("# ") {
            let mut names = header.split(',');
            if let (Some(key), Some("time_s")) = (names.next(), names.next()) {
                self.columns.insert(key.to_owned(), names.map(str::to_owned).collect());
            }
            return None;
        }
        let (key, rest) = line.split_once(',')?;
        match key {
            "event" => event(rest),
            "origin" => rest.split(',').next()?.parse().ok().map(StreamMessage::Origin),
            key => self.estimate(key, rest),
        }
    }

    fn estimate(&self, key: &str, rest: &str) -> Option<StreamMessage> {
        let columns = self.columns.get(key)?;
        let mut cells = rest.split(',');
        let time_s = cells.next()?.parse().ok()?;
        let mut values: Map<_, _> = (columns.iter().zip(cells.by_ref()))
            .filter_map(|(name, cell)| Some((name.clone(), json!(cell.parse::<f64>().ok()?))))
            .collect();
        if let Some(reason) = cells.next() {
            values.insert(REASON.to_owned(), json!(reason));
        }
        Some(StreamMessage::Estimate { key: key.to_owned(), time_s, values })
    }
}

fn event(text: &str) -> Option<StreamMessage> {
    let event: Value = serde_json::from_str(text).ok()?;
    Some(StreamMessage::Event { time_s: event.get("time_s").and_then(Value::as_f64), event })
}

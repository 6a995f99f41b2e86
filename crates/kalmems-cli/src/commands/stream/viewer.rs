//! Estimates and events for a program that draws them while they come, such as PlotJuggler: a datagram of JSON for each line.

use serde_json::{Map, Value, json};
use std::collections::HashMap;
use std::io::{self, ErrorKind, Write};
use std::net::UdpSocket;

/// What the address of such a program begins with.
const SCHEME: &str = "udp-json://";

/// Where PlotJuggler listens if it is not told otherwise, on this machine.
const USUAL: &str = "127.0.0.1:9870";

/// Takes the lines of a stream and sends a datagram for each estimate and event.
///
/// An estimate is `{"timestamp": seconds, "<answer>": {"<column>": number, …}}` with the columns that its header names; what is
/// not a number is left out. An event is `{"timestamp": …, "event": {…}}`, with the time where it has one.
pub struct Viewer {
    socket: UdpSocket,
    /// The columns of each answer behind its time.
    columns: HashMap<String, Vec<String>>,
    /// What of a line has come.
    rest: Vec<u8>,
}

/// The viewer at an address `udp-json://HOST:PORT`; `udp-json://` alone is the usual port of this machine.
pub fn open(to: &str) -> io::Result<Viewer> {
    let Some(address) = to.strip_prefix(SCHEME) else {
        let why = format!("found `{to}`; expected an address such as `{SCHEME}{USUAL}`");
        return Err(io::Error::new(ErrorKind::InvalidInput, why));
    };
    let address = if address.is_empty() { USUAL } else { address };
    let socket = UdpSocket::bind("0.0.0.0:0").or_else(|_| UdpSocket::bind("[::]:0"))?;
    socket.connect(address)?;
    Ok(Viewer { socket, columns: HashMap::new(), rest: Vec::new() })
}

impl Viewer {
    fn line(&mut self, line: &str) {
        if let Some(header) = line.strip_prefix("# ") {
            let mut names = header.split(',');
            if let (Some(key), Some("time_s")) = (names.next(), names.next()) {
                self.columns.insert(key.to_owned(), names.map(str::to_owned).collect());
            }
            return;
        }
        let Some((key, rest)) = line.split_once(',') else { return };
        let message = if key == "event" { event(rest) } else { self.estimate(key, rest) };
        if let Some(message) = message {
            // Nobody has to listen, and a datagram may be lost.
            let _ = self.socket.send(message.to_string().as_bytes());
        }
    }

    fn estimate(&self, key: &str, rest: &str) -> Option<Value> {
        let columns = self.columns.get(key)?;
        let mut cells = rest.split(',');
        let time_s: f64 = cells.next()?.parse().ok()?;
        let values: Map<String, Value> = (columns.iter().zip(cells))
            .filter_map(|(name, cell)| Some((name.clone(), json!(cell.parse::<f64>().ok()?))))
            .collect();
        Some(json!({ "timestamp": time_s, key: values }))
    }
}

fn event(text: &str) -> Option<Value> {
    let event: Value = serde_json::from_str(text).ok()?;
    let mut message = Map::new();
    if let Some(time_s) = event.get("time_s").filter(|time| time.is_number()) {
        message.insert("timestamp".to_owned(), time_s.clone());
    }
    message.insert("event".to_owned(), event);
    Some(Value::Object(message))
}

impl Write for Viewer {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.rest.extend_from_slice(bytes);
        let whole = self.rest.iter().rposition(|byte| *byte == b'\n').map_or(0, |end| end + 1);
        let lines: Vec<u8> = self.rest.drain(..whole).collect();
        String::from_utf8_lossy(&lines).lines().for_each(|line| self.line(line));
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Writes to two places.
pub struct TwoWriters(pub Box<dyn Write>, pub Viewer);

impl Write for TwoWriters {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.write_all(bytes)?;
        self.1.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn lines_become_datagrams_with_the_names_of_their_header_however_they_are_cut() {
        let listener = UdpSocket::bind("127.0.0.1:0").unwrap();
        listener.set_read_timeout(Some(Duration::from_secs(5))).unwrap();
        let mut viewer = open(&format!("udp-json://{}", listener.local_addr().unwrap())).unwrap();
        let text = "# ekf,time_s,angle_rad,angle_sd_rad\n# event,what happened, as JSON\norigin,5\nekf,0.25,1e-1,\n\
                    event,{\"kind\":\"zero_phase\",\"time_s\":0.5}\nacknowledged,1\nekf,0.5,2e-1,3e-3\n";
        for piece in text.as_bytes().chunks(7) {
            viewer.write_all(piece).unwrap();
        }
        let received = || {
            let mut bytes = [0; 2000];
            let count = listener.recv(&mut bytes).unwrap();
            serde_json::from_slice::<Value>(&bytes[..count]).unwrap()
        };
        assert_eq!(received(), json!({ "timestamp": 0.25, "ekf": { "angle_rad": 0.1 } }));
        assert_eq!(received(), json!({ "timestamp": 0.5, "event": { "kind": "zero_phase", "time_s": 0.5 } }));
        assert_eq!(
            received(),
            json!({ "timestamp": 0.5, "ekf": { "angle_rad": 0.2, "angle_sd_rad": 0.003 } })
        );
    }

    #[test]
    fn another_address_is_refused_with_what_is_expected() {
        let why = open("tcp://127.0.0.1:9").err().unwrap().to_string();
        assert!(why.contains("expected an address such as `udp-json://127.0.0.1:9870`"), "{why}");
    }
}

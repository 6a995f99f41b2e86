//! Estimates and events for a program that draws them while they come, such as PlotJuggler: a datagram of JSON for each line.

use super::messages::{MessageReader, StreamMessage};
use serde_json::{Map, Value, json};
use std::io::{self, Write};
use std::net::UdpSocket;

/// What the address of such a program begins with.
pub const SCHEME: &str = "udp-json://";

/// Where PlotJuggler listens if it is not told otherwise, on this machine.
pub const USUAL: &str = "127.0.0.1:9870";

/// Takes the lines of a stream and sends a datagram for each estimate and event.
///
/// An estimate is `{"timestamp": seconds, "<answer>": {"<column>": number, …}}` with the columns that its header names; what is
/// not a number is left out, and where there is none, `reason` says why. Where the times do not count from zero, `{"timestamp": 0.0, "origin_s": …}` comes first. An event is `{"timestamp": …, "event": {…}}`, with the time where it has one.
pub struct Viewer {
    socket: UdpSocket,
    reader: MessageReader,
}

/// The viewer at an address `HOST:PORT`; an empty one is the usual port of this machine.
pub fn open(address: &str) -> io::Result<Viewer> {
    let address = if address.is_empty() { USUAL } else { address };
    let socket = UdpSocket::bind("0.0.0.0:0").or_else(|_| UdpSocket::bind("[::]:0"))?;
    socket.connect(address)?;
    Ok(Viewer { socket, reader: MessageReader::default() })
}

fn datagram(message: StreamMessage) -> Value {
    match message {
        StreamMessage::Origin(seconds) => json!({ "timestamp": 0.0, "origin_s": seconds }),
        StreamMessage::Estimate { key, time_s, values } => json!({ "timestamp": time_s, key: values }),
        StreamMessage::Event { time_s, event } => {
            let time = time_s.map(|time_s| ("timestamp".to_owned(), json!(time_s)));
            let message: Map<_, _> = time.into_iter().chain([("event".to_owned(), event)]).collect();
            Value::Object(message)
        }
    }
}

impl Write for Viewer {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let socket = &self.socket;
        self.reader.take(bytes, |message| {
            // Nobody has to listen, and a datagram may be lost.
            let _ = socket.send(datagram(message).to_string().as_bytes());
        });
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
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
        let mut viewer = open(&listener.local_addr().unwrap().to_string()).unwrap();
        let text = "# ekf,time_s,angle_rad,angle_sd_rad\n# event,what happened, as JSON\norigin,5\nekf,0.25,1e-1,\n\
                    event,{\"kind\":\"zero_phase\",\"time_s\":0.5}\nacknowledged,1\nekf,0.5,2e-1,3e-3\n\
                    ekf,0.75,,,no_signal\nekf,1,,,not_known\n";
        for piece in text.as_bytes().chunks(7) {
            viewer.write_all(piece).unwrap();
        }
        let received = || {
            let mut bytes = [0; 2000];
            let count = listener.recv(&mut bytes).unwrap();
            serde_json::from_slice::<Value>(&bytes[..count]).unwrap()
        };
        assert_eq!(received(), json!({ "timestamp": 0.0, "origin_s": 5.0 }));
        assert_eq!(received(), json!({ "timestamp": 0.25, "ekf": { "angle_rad": 0.1 } }));
        assert_eq!(received(), json!({ "timestamp": 0.5, "event": { "kind": "zero_phase", "time_s": 0.5 } }));
        assert_eq!(
            received(),
            json!({ "timestamp": 0.5, "ekf": { "angle_rad": 0.2, "angle_sd_rad": 0.003 } })
        );
        for (time_s, reason) in [(0.75, "no_signal"), (1.0, "not_known")] {
            assert_eq!(received(), json!({ "timestamp": time_s, "ekf": { "reason": reason } }));
        }
    }
}

//! Where `--to` sends the lines of a stream beside what they are written to.

use super::NamedOutput;
use super::mcap_file::McapFile;
use super::rotation::FileRotation;
use super::viewer::{self, SCHEME as UDP, USUAL};
use crate::CommandEnding;
use crate::tell::tell;
use std::io::{self, Write};
use std::path::Path;

/// What the address of a file begins with.
const MCAP: &str = "mcap://";

/// What takes the lines of a stream beside where they are written to.
pub enum Watch {
    /// A program that draws them while they come.
    Viewer,
    /// A file for programs that draw them later.
    File(McapFile),
}

impl Watch {
    /// Opens what an address names; what takes the lines is put in the place of `written`, which takes them as well.
    pub fn open(
        to: &str,
        written: &mut Option<Box<dyn Write>>,
        with: (bool, FileRotation),
    ) -> Result<Self, CommandEnding> {
        let wrong = |e: &dyn std::fmt::Display| CommandEnding::Wrong(format!("`--to`: {e}"));
        let (watch, taker): (Self, Box<dyn Write>) = if let Some(address) = to.strip_prefix(UDP) {
            (Self::Viewer, Box::new(viewer::open(address).map_err(|e| wrong(&e))?))
        } else if let Some(path) = to.strip_prefix(MCAP) {
            let file = McapFile::begin(Path::new(path), with)?;
            (Self::File(file.clone()), Box::new(file))
        } else {
            return Err(wrong(&format!(
                "found `{to}`; expected an address such as `{UDP}{USUAL}` or a file such as `{MCAP}stream.mcap`"
            )));
        };
        *written = Some(match written.take() {
            Some(written) => {
                Box::new(TwoWriters(written, NamedOutput { name: to.to_owned(), output: taker }))
            }
            None => Box::new(NamedOutput { name: to.to_owned(), output: taker }),
        });
        Ok(watch)
    }

    /// Completes what was sent.
    pub fn finish(&self) -> Result<(), CommandEnding> {
        match self {
            Self::Viewer => {}
            Self::File(file) => {
                let left_out = file.finish();
                let left_out = left_out.map_err(|e| CommandEnding::Wrong(format!("the MCAP file: {e}")))?;
                if left_out > 0 {
                    tell!(
                        "note: {left_out} messages are not in the MCAP file, which has no times before 1970"
                    );
                }
            }
        }
        Ok(())
    }
}

/// Writes to two places.
struct TwoWriters(Box<dyn Write>, NamedOutput<Box<dyn Write>>);

impl Write for TwoWriters {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.write_all(bytes)?;
        self.1.write_all(bytes)?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.flush()?;
        self.1.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What happens in the first 9.3 ms of the example, in one run: in a file, and as datagrams, so few that the usual buffer of a
    /// socket (208 KiB) holds them all while nobody reads.
    #[test]
    fn two_places_of_one_stream_get_the_same_events() {
        let folder = tempfile::tempdir().unwrap();
        let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/shared_scanner");
        let recording = std::fs::read_to_string(example.join("recording.csv")).unwrap();
        let samples = folder.path().join("samples.csv");
        let rows: Vec<&str> = recording.lines().take(9_301).collect();
        std::fs::write(&samples, rows.join("\n") + "\n").unwrap();
        let settings = std::fs::read_to_string(example.join("stream.toml")).unwrap();
        let experiment = folder.path().join("stream.toml");
        std::fs::write(&experiment, settings.replacen("every = 10 ", "every = 1000 ", 1)).unwrap();
        let socket = std::net::UdpSocket::bind("127.0.0.1:0").unwrap();
        let (address, own) = (socket.local_addr().unwrap(), socket.try_clone().unwrap());
        let viewer = std::thread::spawn(move || {
            // Nothing else between two of them: what waits for too long is lost.
            let (mut datagram, mut datagrams) = (vec![0; 1 << 16], Vec::new());
            loop {
                let count = socket.recv(&mut datagram).unwrap();
                if &datagram[..count] == b"end" {
                    break;
                }
                datagrams.push(datagram[..count].to_vec());
            }
            let read = |bytes: &Vec<u8>| serde_json::from_slice::<serde_json::Value>(bytes).unwrap();
            datagrams.iter().filter_map(|bytes| read(bytes).get("event").cloned()).collect::<Vec<_>>()
        });
        let file = folder.path().join("m.mcap");
        let arguments = [
            "kalmems",
            "stream",
            experiment.to_str().unwrap(),
            "--from",
            samples.to_str().unwrap(),
            "--to",
            &format!("mcap://{}", file.display()),
            "--to",
            &format!("{UDP}{address}"),
        ]
        .map(std::ffi::OsString::from);
        assert_eq!(crate::run_within(kalmems::rigs::published(), arguments), 0);
        own.send_to(b"end", address).unwrap();
        let sent = viewer.join().unwrap();
        let messages = super::super::mcap_file::tests::messages(&std::fs::read(file).unwrap());
        let events = messages.into_iter().filter(|(topic, ..)| topic == "/events");
        let kept: Vec<serde_json::Value> = events.map(|(.., event)| event).collect();
        // The reader of the file gives messages by their times, and an event that is ahead has a later one than those that follow it.
        let [kept, sent] = [kept, sent].map(|mut events| {
            events.sort_by_key(serde_json::Value::to_string);
            events
        });
        let ahead = kept.iter().filter(|event| event["event"] == "zero_phase_ahead").count();
        assert!(ahead > 30, "{ahead} of {}", kept.len());
        assert!(kept == sent, "{} in the file, {} were sent", kept.len(), sent.len());
    }

    #[test]
    fn another_address_is_refused_with_what_is_expected() {
        let Err(CommandEnding::Wrong(why)) =
            Watch::open("tcp://127.0.0.1:9", &mut None, (false, FileRotation::default()))
        else {
            panic!("accepted")
        };
        assert!(
            why.contains("expected an address such as `udp-json://127.0.0.1:9870` or a file such as"),
            "{why}"
        );
    }
}

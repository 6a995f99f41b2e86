//! Connections that samples come over: TCP, to and from the other end, and serial devices.

use crate::tell::tell;
use kalmems::stream::Connection;
use serial2::SerialPort;
use socket2::{SockRef, TcpKeepalive};
use std::io::{self, ErrorKind, Read};
use std::net::{TcpListener, TcpStream, ToSocketAddrs};
use std::time::{Duration, Instant};

/// How long a read or the acceptance of a connection waits at once, so that the stream can be stopped in between.
const PATIENCE: Duration = Duration::from_millis(100);

/// How long an address that does not answer is waited for.
const CONNECTING: Duration = Duration::from_secs(2);

/// A peer that says nothing is asked after so long whether it is there, and then this often; after some five questions without
/// an answer the connection is broken.
const ASKED_AFTER: Duration = Duration::from_secs(10);
const ASKED_EVERY: Duration = Duration::from_secs(2);

/// A connection that can be opened again where it breaks.
enum Wire {
    Connect(String),
    Listen(TcpListener),
    Serial { device: String, baud: u32 },
}

/// The connection that the user names; `None` where that is a file.
pub fn open(from: &str, baud: Option<u32>) -> io::Result<Option<Box<dyn Connection>>> {
    let wire = if let Some(baud) = baud {
        Wire::Serial { device: from.to_owned(), baud }
    } else if let Some(address) = from.strip_prefix("tcp://") {
        Wire::Connect(address.to_owned())
    } else if let Some(address) = from.strip_prefix("listen://") {
        let listener = TcpListener::bind(address)?;
        listener.set_nonblocking(true)?;
        tell!("waiting for samples at {}", listener.local_addr()?);
        Wire::Listen(listener)
    } else {
        return Ok(None);
    };
    Ok(Some(Box::new(wire)))
}

impl Connection for Wire {
    fn open(&mut self) -> io::Result<Option<Box<dyn Read + Send>>> {
        Ok(match self {
            Self::Connect(address) => Some(Box::new(connected(connect(address)?)?)),
            Self::Listen(listener) => match accept(listener)? {
                Some(stream) => Some(Box::new(connected(stream)?)),
                None => None,
            },
            Self::Serial { device, baud } => {
                let mut port = SerialPort::open(device.as_str(), *baud)?;
                port.set_read_timeout(PATIENCE)?;
                Some(Box::new(SerialDevice(port)))
            }
        })
    }

    fn reopens(&self) -> bool {
        true
    }

    fn is_listener(&self) -> bool {
        matches!(self, Self::Listen(_))
    }
}

fn connect(address: &str) -> io::Result<TcpStream> {
    let mut failed = io::Error::new(ErrorKind::NotFound, "the name has no address");
    for address in address.to_socket_addrs()? {
        match TcpStream::connect_timeout(&address, CONNECTING) {
            Ok(stream) => return Ok(stream),
            Err(e) => failed = e,
        }
    }
    Err(failed)
}

/// A connection that somebody made, if that happens soon.
fn accept(listener: &TcpListener) -> io::Result<Option<TcpStream>> {
    let begun = Instant::now();
    loop {
        match listener.accept() {
            Ok((stream, _)) => {
                // Some systems hand down that the listener does not wait.
                stream.set_nonblocking(false)?;
                return Ok(Some(stream));
            }
            Err(e) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => {
                if begun.elapsed() >= PATIENCE {
                    return Ok(None);
                }
                std::thread::sleep(PATIENCE / 10);
            }
            // Who wanted to connect has gone already.
            Err(e) if e.kind() == ErrorKind::ConnectionAborted => {}
            Err(e) => return Err(e),
        }
    }
}

/// A connection whose reads return in between, and which notices that its other end has died.
fn connected(stream: TcpStream) -> io::Result<Peer> {
    stream.set_read_timeout(Some(PATIENCE))?;
    let asked = TcpKeepalive::new().with_time(ASKED_AFTER).with_interval(ASKED_EVERY);
    SockRef::from(&stream).set_tcp_keepalive(&asked)?;
    Ok(Peer(stream))
}

/// The other end of a connection.
struct Peer(TcpStream);

impl Read for Peer {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        match self.0.read(bytes) {
            // On Windows a read that returns in between says so; elsewhere it means that the other end does not answer.
            Err(e) if cfg!(windows) && e.kind() == ErrorKind::TimedOut => Err(ErrorKind::WouldBlock.into()),
            read => read,
        }
    }
}

/// A serial device; one that is unplugged is a connection that broke.
struct SerialDevice(SerialPort);

impl Read for SerialDevice {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        match self.0.read(bytes) {
            Ok(0) => Err(io::Error::new(ErrorKind::NotConnected, "the device is not connected any more")),
            Err(e) if e.kind() == ErrorKind::TimedOut => Err(ErrorKind::WouldBlock.into()),
            read => read,
        }
    }
}

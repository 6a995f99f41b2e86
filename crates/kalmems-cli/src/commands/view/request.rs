//! A request of HTTP/1.1 without a body, read strictly: what is not as RFC 9112 has it is refused, and nothing is guessed.

use super::answer::Status;
use std::ffi::OsString;
use std::io::{self, ErrorKind, Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

/// Bytes of a request at most.
pub const MOST: usize = 8192;
/// How long a request may take to come, in however many pieces.
pub const PATIENCE: Duration = Duration::from_secs(10);

/// What a connection gives or takes until a time is over, however slowly.
pub struct Deadline<'a> {
    connection: &'a TcpStream,
    ends: Instant,
}

impl<'a> Deadline<'a> {
    /// After so long from now on.
    pub fn after(connection: &'a TcpStream, patience: Duration) -> Self {
        Self { connection, ends: Instant::now() + patience }
    }

    /// What is left of it.
    fn left(&self) -> io::Result<Duration> {
        let left = self.ends.saturating_duration_since(Instant::now());
        if left.is_zero() { Err(ErrorKind::TimedOut.into()) } else { Ok(left) }
    }
}

impl Read for Deadline<'_> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        self.connection.set_read_timeout(Some(self.left()?))?;
        self.connection.read(bytes)
    }
}

impl Write for Deadline<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.connection.set_write_timeout(Some(self.left()?))?;
        self.connection.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// What is asked for.
#[derive(Debug, PartialEq, Eq)]
pub struct Request {
    /// Whether the answer's head is enough.
    pub is_head: bool,
    /// The steps of the path, decoded; the last one is empty where the path ends with `/`.
    pub path: Vec<OsString>,
    /// The server that the request is for, as the client calls it.
    pub host: String,
    pub range: RequestedRange,
    /// Whether a browser says that it shows the answer by itself, and not in a frame.
    pub is_page: bool,
}

/// Which bytes are wanted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RequestedRange {
    All,
    /// From a byte on, up to and with another one.
    From(u64, Option<u64>),
    /// So many at the end.
    Last(u64),
}

/// Why there is no request.
#[derive(Debug)]
pub enum RequestError {
    /// It is refused.
    Refused(Status),
    /// The client has gone, or says nothing.
    Gone,
}

impl From<Status> for RequestError {
    fn from(status: Status) -> Self {
        Self::Refused(status)
    }
}

impl Request {
    /// Reads a request, and nothing behind its head.
    pub fn read(from: impl Read) -> Result<Self, RequestError> {
        Self::parse(&read_head(from)?)
    }

    fn parse(head: &[u8]) -> Result<Self, RequestError> {
        let head = std::str::from_utf8(head).map_err(|_| Status::Malformed)?;
        let mut lines = head.split("\r\n");
        let first = lines.next().unwrap_or_default();
        let [method, target, version] = first.split(' ').collect::<Vec<_>>()[..] else {
            return Err(Status::Malformed.into());
        };
        if version != "HTTP/1.1" {
            return Err(Status::Version.into());
        }
        let is_head = match method {
            "GET" => false,
            "HEAD" => true,
            _ => return Err(Status::Method.into()),
        };
        let (mut host, mut range, mut is_page) = (None, None, false);
        for line in lines {
            let (name, value) = line.split_once(':').ok_or(Status::Malformed)?;
            let is_token = |c: u8| c.is_ascii_alphanumeric() || b"!#$%&'*+-.^_`|~".contains(&c);
            if name.is_empty() || !name.bytes().all(is_token) || value.contains(char::is_control) {
                return Err(Status::Malformed.into());
            }
            let value = value.trim_matches(' ');
            match name.to_ascii_lowercase().as_str() {
                "host" if host.is_none() => host = Some(value.to_owned()),
                "range" if range.is_none() => range = Some(RequestedRange::parse(value)?),
                "sec-fetch-dest" => is_page |= value == "document",
                // Which one counts could be understood in two ways.
                "host" | "range" => return Err(Status::Malformed.into()),
                "content-length" if value == "0" => {}
                "content-length" | "transfer-encoding" | "expect" => return Err(Status::Body.into()),
                _ => {}
            }
        }
        let host = host.ok_or(Status::WrongHost)?;
        Ok(Self { is_head, path: steps(target)?, host, range: range.unwrap_or(RequestedRange::All), is_page })
    }
}

/// The bytes up to the empty line that ends the head, without both.
fn read_head(mut from: impl Read) -> Result<Vec<u8>, RequestError> {
    let (mut head, mut piece) = (Vec::new(), [0; 1024]);
    loop {
        let count = match from.read(&mut piece) {
            Ok(0) => return Err(RequestError::Gone),
            Ok(count) => count,
            Err(e) if e.kind() == ErrorKind::Interrupted => continue,
            Err(e) => return Err(of_reading(&e)),
        };
        let before = head.len().saturating_sub(3);
        head.extend_from_slice(&piece[..count]);
        if head.len() > MOST {
            return Err(Status::TooLarge.into());
        }
        if let Some(end) = head[before..].windows(4).position(|bytes| bytes == b"\r\n\r\n") {
            let end = before + end;
            // A body, or another request that nobody has waited for.
            if head.len() > end + 4 {
                return Err(Status::Body.into());
            }
            head.truncate(end);
            return Ok(head);
        }
    }
}

fn of_reading(error: &io::Error) -> RequestError {
    match error.kind() {
        ErrorKind::WouldBlock | ErrorKind::TimedOut => Status::TooSlow.into(),
        _ => RequestError::Gone,
    }
}

/// The steps of an absolute path. A step that leads anywhere but one folder down is refused, however it is written.
fn steps(target: &str) -> Result<Vec<OsString>, Status> {
    let path = target.strip_prefix('/').ok_or(Status::Malformed)?;
    let steps: Vec<OsString> = path.split('/').map(decoded).collect::<Result<_, _>>()?;
    let last = steps.len() - 1;
    let is_place = |(place, step): (usize, &OsString)| match step.as_encoded_bytes() {
        b"" => place == last,
        b"." | b".." => false,
        // `\` and `:` mean something on Windows.
        name => !name.iter().any(|byte| b"/\\:".contains(byte) || byte.is_ascii_control()),
    };
    if steps.iter().enumerate().all(is_place) { Ok(steps) } else { Err(Status::NotFound) }
}

/// Text in which `%2f` and its like stand for bytes.
fn decoded(text: &str) -> Result<OsString, Status> {
    let (mut bytes, mut rest) = (Vec::with_capacity(text.len()), text.as_bytes());
    while let [first, others @ ..] = rest {
        match (first, others) {
            (b'%', [high, low, others @ ..]) => {
                let digit = |c: &u8| char::from(*c).to_digit(16).ok_or(Status::Malformed);
                bytes.push(u8::try_from(16 * digit(high)? + digit(low)?).map_err(|_| Status::Malformed)?);
                rest = others;
            }
            // No query is known here, and a fragment is no part of a request.
            (b'%' | b'?' | b'#', _) => return Err(Status::Malformed),
            (byte, others) => {
                bytes.push(*byte);
                rest = others;
            }
        }
    }
    named(bytes)
}

/// A name of a file, which need not be text.
#[cfg(unix)]
#[allow(clippy::unnecessary_wraps)] // where names are not bytes, this can fail
fn named(bytes: Vec<u8>) -> Result<OsString, Status> {
    use std::os::unix::ffi::OsStringExt;
    Ok(OsString::from_vec(bytes))
}

#[cfg(not(unix))]
fn named(bytes: Vec<u8>) -> Result<OsString, Status> {
    String::from_utf8(bytes).map(OsString::from).map_err(|_| Status::Malformed)
}

impl RequestedRange {
    /// One range of bytes; several at once are refused.
    fn parse(text: &str) -> Result<Self, Status> {
        let (from, to) =
            text.strip_prefix("bytes=").and_then(|range| range.split_once('-')).ok_or(Status::Range)?;
        let number = |text: &str| {
            let is_number = text.bytes().all(|c| c.is_ascii_digit());
            text.parse().ok().filter(|_| is_number).ok_or(Status::Range)
        };
        Ok(match (from, to) {
            ("", to) => Self::Last(number(to)?),
            (from, "") => Self::From(number(from)?, None),
            (from, to) => Self::From(number(from)?, Some(number(to)?)),
        })
    }

    /// The first of these bytes of a file of this length, and how many they are.
    pub fn of(self, length: u64) -> Result<(u64, u64), Status> {
        match self {
            Self::All => Ok((0, length)),
            Self::From(first, last) => {
                let end = last.map_or(length, |last| last.saturating_add(1).min(length));
                if first < end { Ok((first, end - first)) } else { Err(Status::Range) }
            }
            // Of nothing there is no last byte.
            Self::Last(count) if count == 0 || length == 0 => Err(Status::Range),
            Self::Last(count) => Ok((length.saturating_sub(count), count.min(length))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Request, Status> {
        Request::read(text.as_bytes()).map_err(|e| match e {
            RequestError::Refused(status) => status,
            RequestError::Gone => panic!("gone: {text:?}"),
        })
    }

    #[test]
    fn a_request_is_read_whole_and_what_is_odd_in_it_is_refused() {
        let request =
            read("GET /token/a%20b/report.html HTTP/1.1\r\nhost: localhost:80\r\nRange: bytes=3-9\r\n\r\n");
        let path = ["token", "a b", "report.html"].map(OsString::from).to_vec();
        let host = "localhost:80".to_owned();
        assert_eq!(
            request,
            Ok(Request {
                is_head: false,
                path,
                host,
                range: RequestedRange::From(3, Some(9)),
                is_page: false
            })
        );
        for (text, status) in [
            ("GET / HTTP/1.0\r\nHost: a\r\n\r\n", Status::Version),
            ("GET / HTTP/1.1\r\n\r\n", Status::WrongHost),
            ("GET / HTTP/1.1\r\nHost: a\r\nHost: a\r\n\r\n", Status::Malformed),
            ("GET /  HTTP/1.1\r\nHost: a\r\n\r\n", Status::Malformed),
            ("GET / HTTP/1.1\r\nHost : a\r\n\r\n", Status::Malformed),
            ("GET / HTTP/1.1\r\nHost: a\r\n more\r\n\r\n", Status::Malformed),
            ("GET / HTTP/1.1\r\nHost: a\nX: b\r\n\r\n", Status::Malformed),
            ("GET http://a/ HTTP/1.1\r\nHost: a\r\n\r\n", Status::Malformed),
            ("GET /?a HTTP/1.1\r\nHost: a\r\n\r\n", Status::Malformed),
            ("GET /%zz HTTP/1.1\r\nHost: a\r\n\r\n", Status::Malformed),
            ("POST / HTTP/1.1\r\nHost: a\r\n\r\n", Status::Method),
            ("get / HTTP/1.1\r\nHost: a\r\n\r\n", Status::Method),
            ("GET / HTTP/1.1\r\nHost: a\r\nContent-Length: 3\r\n\r\n", Status::Body),
            ("GET / HTTP/1.1\r\nHost: a\r\nTransfer-Encoding: chunked\r\n\r\n", Status::Body),
            ("GET / HTTP/1.1\r\nHost: a\r\n\r\nGET / HTTP/1.1\r\n", Status::Body),
            ("GET / HTTP/1.1\r\nHost: a\r\nRange: bytes=0-1,3-4\r\n\r\n", Status::Range),
            ("GET / HTTP/1.1\r\nHost: a\r\nRange: bytes=+1-4\r\n\r\n", Status::Range),
            ("GET / HTTP/1.1\r\nHost: a\r\nRange: lines=1-4\r\n\r\n", Status::Range),
        ] {
            assert_eq!(read(text), Err(status), "{text:?}");
        }
        let long = format!("GET /{} HTTP/1.1\r\nHost: a\r\n\r\n", "a".repeat(2 * MOST));
        assert_eq!(read(&long), Err(Status::TooLarge));
    }

    #[test]
    fn no_path_leads_upwards() {
        for path in
            ["..", "a/..", "../a", "%2e%2e/a", ".", "a//b", "a%2fb", "a%5c..%5cb", "c:", "a%00", "//a"]
        {
            let text = format!("GET /{path} HTTP/1.1\r\nHost: a\r\n\r\n");
            assert_eq!(read(&text), Err(Status::NotFound), "{path}");
        }
        assert_eq!(read("GET /a..b/... HTTP/1.1\r\nHost: a\r\n\r\n").unwrap().path, ["a..b", "..."]);
    }

    #[test]
    fn ranges_are_those_of_a_file() {
        let of = |range: RequestedRange| range.of(10);
        assert_eq!(of(RequestedRange::All), Ok((0, 10)));
        assert_eq!(of(RequestedRange::From(2, Some(4))), Ok((2, 3)));
        assert_eq!(of(RequestedRange::From(2, Some(u64::MAX))), Ok((2, 8)));
        assert_eq!(of(RequestedRange::From(9, None)), Ok((9, 1)));
        assert_eq!(of(RequestedRange::Last(4)), Ok((6, 4)));
        assert_eq!(of(RequestedRange::Last(40)), Ok((0, 10)));
        for range in
            [RequestedRange::From(10, None), RequestedRange::From(5, Some(4)), RequestedRange::Last(0)]
        {
            assert_eq!(of(range), Err(Status::Range));
        }
    }
}

//! Answers: pages and files of results, or why there is none.

use super::policy::{COMMON, PagePolicy};
use super::request::RequestedRange;
use kalmems::figures::escaped;
use kalmems::results::StoredResult;
use std::ffi::OsString;
use std::fs::File;
use std::io::{self, BufWriter, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// How a request ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    Ok,
    Part,
    Malformed,
    WrongToken,
    WrongHost,
    NotFound,
    Method,
    TooSlow,
    Body,
    Range,
    TooLarge,
    TooManyConnections,
    Version,
}

impl Status {
    /// The code and its phrase, and what a reader is told.
    fn words(self) -> (&'static str, &'static str) {
        match self {
            Self::Ok => ("200 OK", ""),
            Self::Part => ("206 Partial Content", ""),
            Self::Malformed => ("400 Bad Request", "The request is malformed."),
            Self::WrongToken => (
                "403 Forbidden",
                "The address is not whole: copy all of it from where `kalmems view` printed it.",
            ),
            Self::WrongHost => {
                ("421 Misdirected Request", "Results are served to 127.0.0.1 and localhost alone.")
            }
            Self::NotFound => ("404 Not Found", "No result has this file."),
            Self::Method => ("405 Method Not Allowed", "Results can be read, and nothing else."),
            Self::TooSlow => ("408 Request Timeout", "The request did not come in time."),
            Self::Body => ("413 Content Too Large", "A request has no body here."),
            Self::Range => ("416 Range Not Satisfiable", "The file has no such range of bytes."),
            Self::TooLarge => ("431 Request Header Fields Too Large", "The request is too long."),
            Self::TooManyConnections => ("503 Service Unavailable", "There are too many connections."),
            Self::Version => ("505 HTTP Version Not Supported", "HTTP/1.1 is expected."),
        }
    }
}

/// What is sent back.
pub struct HttpAnswer {
    status: Status,
    /// The type of the content.
    media: &'static str,
    length: u64,
    /// Where it is a part of a file: the first byte, and the length of the file.
    part: Option<(u64, u64)>,
    content: Box<dyn Read>,
    policy: PagePolicy,
}

impl HttpAnswer {
    /// Why there is none.
    pub fn refusal(status: Status) -> Self {
        Self::text(status, "text/plain; charset=utf-8", format!("{}\n", status.words().1))
    }

    /// A page with a frame for a file of the result of this token.
    pub fn frame(host: &str, token: &str, file: &str, title: &str) -> Self {
        let html = format!(
            "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><link rel=\"icon\" href=\"data:,\"><title>{}</title>\
             <style>html, body {{ height: 100%; margin: 0 }} iframe {{ border: 0; display: block; width: 100%; height: 100% }}</style></head>\n\
             <body><iframe sandbox=\"allow-scripts allow-downloads\" src=\"/{token}/{}\" title=\"{}\"></iframe></body></html>\n",
            escaped(title),
            escaped(file),
            escaped(title)
        );
        let policy = PagePolicy::Frame { host: host.to_owned(), token: token.to_owned() };
        Self { policy, ..Self::page(html) }
    }

    /// The same for a frame that shows files of the result of this token alone.
    #[must_use]
    pub fn for_result(self, host: &str, token: &str) -> Self {
        let (host, token) = (host.to_owned(), token.to_owned());
        Self { policy: PagePolicy::OfResult { host, token }, ..self }
    }

    /// A page.
    pub fn page(html: String) -> Self {
        Self::text(Status::Ok, "text/html; charset=utf-8", html)
    }

    fn text(status: Status, media: &'static str, text: String) -> Self {
        let length = text.len() as u64;
        let content = Box::new(io::Cursor::new(text));
        Self { status, media, length, part: None, content, policy: PagePolicy::Alone }
    }

    /// A file of a result below a folder, which has no link in it, or the bytes of it that are wanted. A file that no result lists, one that a link leads to, and one
    /// that is none are not found.
    pub fn file(folder: &Path, names: &[OsString], range: RequestedRange) -> Self {
        Self::of_file(folder, names, range).unwrap_or_else(Self::refusal)
    }

    fn of_file(folder: &Path, names: &[OsString], range: RequestedRange) -> Result<Self, Status> {
        let media = names.last().map(|name| media_of(&name.to_string_lossy())).ok_or(Status::NotFound)?;
        let (path, _) = Self::find(folder, names)?;
        let mut file = File::open(&path).map_err(|_| Status::NotFound)?;
        let length = file.metadata().map_err(|_| Status::NotFound)?.len();
        let (first, count) = range.of(length)?;
        file.seek(SeekFrom::Start(first)).map_err(|_| Status::NotFound)?;
        let is_part = range != RequestedRange::All;
        let status = if is_part { Status::Part } else { Status::Ok };
        let part = is_part.then_some((first, length));
        let content = Box::new(file.take(count));
        Ok(Self { status, media, length: count, part, content, policy: PagePolicy::Alone })
    }

    /// How many of these steps lead to the result that has the file.
    pub fn depth_of(folder: &Path, names: &[OsString]) -> Result<usize, Status> {
        Ok(Self::find(folder, names)?.1)
    }

    /// A file of a result, and how many of these steps lead to the result.
    fn find(folder: &Path, names: &[OsString]) -> Result<(PathBuf, usize), Status> {
        let mut path = folder.to_owned();
        let mut result = StoredResult::read(&path).map(|result| (0, result));
        for (depth, name) in (1..).zip(names) {
            path.push(name);
            let there = path.symlink_metadata().map_err(|_| Status::NotFound)?;
            // What is neither, such as a pipe, would be waited for.
            let is_expected = if depth == names.len() { there.is_file() } else { there.is_dir() };
            if !is_expected {
                return Err(Status::NotFound);
            }
            if there.is_dir() && result.is_none() {
                result = StoredResult::read(&path).map(|result| (depth, result));
            }
        }
        let (depth, result) = result.ok_or(Status::NotFound)?;
        let within: Option<Vec<&str>> = names[depth..].iter().map(|name| name.to_str()).collect();
        let is_own = within.is_some_and(|within| result.files.contains(&within.join("/")));
        // Whatever the system makes of names, it is within the folder.
        let is_within = path.canonicalize().is_ok_and(|path| path.starts_with(folder));
        if !is_own || !is_within {
            return Err(Status::NotFound);
        }
        Ok((path, depth))
    }

    /// Bytes of its content.
    pub const fn length(&self) -> u64 {
        self.length
    }

    /// Sends it; of a request that asks for the head alone without the content.
    pub fn send(mut self, to: impl Write, is_head: bool) -> io::Result<()> {
        let mut to = BufWriter::with_capacity(1 << 16, to);
        let (status, _) = self.status.words();
        write!(
            to,
            "HTTP/1.1 {status}\r\nContent-Type: {}\r\nContent-Length: {}\r\n",
            self.media, self.length
        )?;
        if let Some((first, length)) = self.part {
            write!(
                to,
                "Content-Range: bytes {first}-{}/{length}\r\n",
                first + self.length.saturating_sub(1)
            )?;
        }
        if self.status == Status::Method {
            write!(to, "Allow: GET, HEAD\r\n")?;
        }
        write!(to, "Accept-Ranges: bytes\r\n")?;
        for line in COMMON {
            write!(to, "{line}\r\n")?;
        }
        for line in self.policy.lines() {
            write!(to, "{line}\r\n")?;
        }
        write!(to, "\r\n")?;
        if !is_head {
            io::copy(&mut self.content, &mut to)?;
        }
        to.flush()
    }
}

/// The type of a file's content by its name.
fn media_of(name: &str) -> &'static str {
    match name.rsplit_once('.').map(|(_, ending)| ending) {
        Some("html") => "text/html; charset=utf-8",
        Some("json") => "application/json",
        Some("png") => "image/png",
        Some("svg") => "image/svg+xml",
        Some("csv" | "toml" | "txt") => "text/plain; charset=utf-8",
        _ => "application/octet-stream",
    }
}

//! Files of a stream that are completed while it goes on, and are followed by the next.

use super::{NamedOutput, named_error};
use crate::CommandEnding;
use crate::interrupt::hangups;
use kalmems::recording;
use kalmems::results::create_file;
use std::fs::{self, File};
use std::io::{self, BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// When a file is completed: at so many bytes, after so long, and at each hang-up signal.
#[derive(Clone, Copy, Default)]
pub struct FileRotation {
    pub bytes: Option<u64>,
    pub every: Option<Duration>,
}

/// The files that have a path one after the other. One that is completed has the time of its beginning in its name.
pub struct FileSeries {
    path: PathBuf,
    rotation: FileRotation,
    begun: SystemTime,
    since: Instant,
    hangups: u64,
}

impl FileSeries {
    /// Begins the first file.
    pub fn begin(
        path: &Path,
        is_own: fn(&[u8]) -> bool,
        (force, rotation): (bool, FileRotation),
    ) -> Result<(Self, File), CommandEnding> {
        let file = create_file(path, is_own, force).map_err(|e| CommandEnding::Wrong(e.to_string()))?;
        let (begun, since) = (SystemTime::now(), Instant::now());
        Ok((Self { path: path.to_owned(), rotation, begun, since, hangups: hangups() }, file))
    }

    /// Whether the present file, of so many bytes, is to be completed.
    pub fn is_due(&self, bytes: u64) -> bool {
        self.rotation.bytes.is_some_and(|most| bytes >= most)
            || self.rotation.every.is_some_and(|every| self.since.elapsed() >= every)
            || self.hangups != hangups()
    }

    /// Renames the present file, which was completed, unless somebody has done so already, and begins the next.
    pub fn next(&mut self) -> io::Result<File> {
        let named = |e| named_error(&self.path.display().to_string(), &e);
        let is_there = fs::metadata(&self.path).is_ok_and(|there| there.len() > 0);
        if is_there {
            fs::rename(&self.path, self.completed_path()).map_err(named)?;
        }
        let opened = File::options().write(true).create_new(true).open(&self.path);
        let file = match opened {
            // Who moved the file away, such as logrotate, has put an empty one in its place.
            Err(e) if e.kind() == ErrorKind::AlreadyExists => File::options().write(true).open(&self.path),
            opened => opened,
        };
        let file = file.map_err(named)?;
        (self.begun, self.since, self.hangups) = (SystemTime::now(), Instant::now(), hangups());
        Ok(file)
    }

    /// `stream-20261128T103201Z.mcap` for `stream.mcap`; behind it `-2` and so on where that is there.
    fn completed_path(&self) -> PathBuf {
        let seconds = self.begun.duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs());
        let utc =
            i64::try_from(seconds).ok().and_then(|seconds| recording::Instant::of_seconds(seconds).to_utc());
        let time = utc.unwrap_or_default().replace(['-', ':'], "");
        let text = |part: Option<&std::ffi::OsStr>| part.unwrap_or_default().to_string_lossy().into_owned();
        let (stem, ending) = (text(self.path.file_stem()), text(self.path.extension()));
        let dot = if ending.is_empty() { "" } else { "." };
        let mut names = (1..).map(|number| {
            let again = if number == 1 { String::new() } else { format!("-{number}") };
            self.path.with_file_name(format!("{stem}-{time}{again}{dot}{ending}"))
        });
        names.find(|path| fs::symlink_metadata(path).is_err()).unwrap_or_default()
    }
}

/// Writes lines or frames to the files of a series, none of them divided between two.
pub struct SeriesWriter {
    series: FileSeries,
    file: BufWriter<NamedOutput<File>>,
    bytes: u64,
    /// What each file begins with: the lines that tell how to read the others.
    head: Vec<u8>,
    is_head: fn(&[u8]) -> bool,
}

impl SeriesWriter {
    pub fn new((series, file): (FileSeries, File), is_head: fn(&[u8]) -> bool) -> Self {
        let name = series.path.display().to_string();
        let file = BufWriter::new(NamedOutput { name, output: file });
        Self { series, file, bytes: 0, head: Vec::new(), is_head }
    }
}

impl Write for SeriesWriter {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.series.is_due(self.bytes) {
            self.file.flush()?;
            let (name, output) = (self.file.get_ref().name.clone(), self.series.next()?);
            self.file = BufWriter::new(NamedOutput { name, output });
            self.file.write_all(&self.head)?;
            self.bytes = 0;
        }
        if (self.is_head)(bytes) {
            self.head.extend_from_slice(bytes);
        }
        self.file.write_all(bytes)?;
        self.bytes += bytes.len() as u64;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

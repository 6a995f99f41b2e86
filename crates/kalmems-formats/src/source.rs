//! The bytes of a file, wherever they are.

use crate::{FormatError, Result};
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

/// Bytes of a file's packed parts that are kept unpacked on the disk; what is beyond them is unpacked once more when it is read.
const COPIED_BYTES: u64 = 4 << 30;

/// What a table can be read from: a file, or bytes in memory.
pub trait ReadSeek: Read + Seek + Send {}

impl<T: Read + Seek + Send> ReadSeek for T {}

/// A file whose length is known, and which several columns read from in turn.
pub(crate) struct SharedFile {
    file: Mutex<Box<dyn ReadSeek>>,
    length: u64,
    /// Where other files are that it refers to.
    folder: Option<PathBuf>,
    /// Bytes of its packed parts that were unpacked to files.
    copied: AtomicU64,
}

impl SharedFile {
    /// Takes a file from its first byte, wherever it stands.
    pub(crate) fn new(mut file: Box<dyn ReadSeek>) -> Result<Self> {
        let length = file.seek(SeekFrom::End(0))?;
        Ok(Self { file: Mutex::new(file), length, folder: None, copied: AtomicU64::new(0) })
    }

    /// A file without a name for a part that unpacks to as many bytes. `None` where there is no room or no disk, as in a browser.
    pub(crate) fn room_for_a_copy(&self, bytes: u64) -> Option<File> {
        let all = |copied: u64| copied.checked_add(bytes).filter(|all| *all <= COPIED_BYTES);
        self.copied.fetch_update(Ordering::Relaxed, Ordering::Relaxed, all).ok()?;
        if cfg!(target_family = "wasm") { None } else { tempfile::tempfile().ok() }
    }

    /// A file on a disk.
    pub(crate) fn open(path: &Path) -> Result<Self> {
        let source = Self::new(Box::new(File::open(path)?))?;
        Ok(Self { folder: path.parent().map(Path::to_owned), ..source })
    }

    /// The folder of a file on a disk.
    pub(crate) fn folder(&self) -> Option<&Path> {
        self.folder.as_deref()
    }

    /// As many bytes as there are.
    pub(crate) fn length(&self) -> u64 {
        self.length
    }

    /// Gives the file back.
    pub(crate) fn into_file(self) -> Result<Box<dyn ReadSeek>> {
        let mut file = self.file.into_inner().unwrap_or_else(PoisonError::into_inner);
        file.seek(SeekFrom::Start(0))?;
        Ok(file)
    }

    /// Reads as many bytes as there are from a place on, at most `buffer`.
    pub(crate) fn read_some(&self, offset: u64, buffer: &mut [u8]) -> io::Result<usize> {
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        file.seek(SeekFrom::Start(offset))?;
        let mut filled = 0;
        while filled < buffer.len() {
            match file.read(&mut buffer[filled..]) {
                Ok(0) => break,
                Ok(count) => filled += count,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
        Ok(filled)
    }

    /// Reads all of `buffer`; fewer bytes are a damaged file.
    pub(crate) fn read_exact(&self, format: &'static str, offset: u64, buffer: &mut [u8]) -> Result<()> {
        let filled = self.read_some(offset, buffer)?;
        if filled == buffer.len() {
            return Ok(());
        }
        let found = format!("{filled} bytes and the end of the file");
        Err(FormatError::damaged_at(format, offset, found, format!("{} bytes", buffer.len())))
    }

    /// Reads a few bytes, such as a header. The caller bounds their number.
    pub(crate) fn bytes(&self, format: &'static str, offset: u64, count: u64) -> Result<Vec<u8>> {
        self.within(format, offset, count)?;
        // No more than the file has.
        let mut buffer = vec![0; usize::try_from(count).unwrap_or(usize::MAX)];
        self.read_exact(format, offset, &mut buffer)?;
        Ok(buffer)
    }

    /// Refuses a stretch that is not in the file; gives its end.
    pub(crate) fn within(&self, format: &'static str, offset: u64, count: u64) -> Result<u64> {
        offset.checked_add(count).filter(|end| *end <= self.length).ok_or_else(|| {
            let found = format!("the end of the file after {} bytes", self.length);
            FormatError::damaged_at(format, offset, found, format!("{count} bytes from there on"))
        })
    }
}

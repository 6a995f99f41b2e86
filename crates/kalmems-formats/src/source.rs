//! The bytes of a file, wherever they are.

use crate::FormatError;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// What a table can be read from: a file, or bytes in memory.
pub trait ReadSeek: Read + Seek + Send {}

impl<T: Read + Seek + Send> ReadSeek for T {}

/// A file whose length is known, and which several columns read from in turn.
pub(crate) struct SharedFile {
    file: Mutex<Box<dyn ReadSeek>>,
    length: u64,
    /// Where other files are that it refers to.
    folder: Option<PathBuf>,
}

impl SharedFile {
    /// Takes a file from its first byte, wherever it stands.
    pub(crate) fn new(mut file: Box<dyn ReadSeek>) -> Result<Self, FormatError> {
        let length = file.seek(SeekFrom::End(0))?;
        Ok(Self { file: Mutex::new(file), length, folder: None })
    }

    /// A file on a disk.
    pub(crate) fn open(path: &Path) -> Result<Self, FormatError> {
        let source = Self::new(Box::new(File::open(path)?))?;
        Ok(Self { folder: path.parent().map(Path::to_owned), ..source })
    }

    /// The folder of a file on a disk.
    #[cfg(feature = "hdf5")]
    pub(crate) fn folder(&self) -> Option<&Path> {
        self.folder.as_deref()
    }

    /// As many bytes as there are.
    pub(crate) fn length(&self) -> u64 {
        self.length
    }

    /// Gives the file back.
    pub(crate) fn into_file(self) -> Result<Box<dyn ReadSeek>, FormatError> {
        let mut file = self.file.into_inner().unwrap_or_else(PoisonError::into_inner);
        file.seek(SeekFrom::Start(0))?;
        Ok(file)
    }

    /// Reads as many bytes as there are from a place on, at most `buffer`.
    pub(crate) fn read_some(&self, offset: u64, buffer: &mut [u8]) -> Result<usize, FormatError> {
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        file.seek(SeekFrom::Start(offset))?;
        let mut filled = 0;
        while filled < buffer.len() {
            match file.read(&mut buffer[filled..]) {
                Ok(0) => break,
                Ok(count) => filled += count,
                Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
                Err(error) => return Err(error.into()),
            }
        }
        Ok(filled)
    }

    /// Reads all of `buffer`; fewer bytes are a damaged file.
    pub(crate) fn read_exact(
        &self,
        format: &'static str,
        offset: u64,
        buffer: &mut [u8],
    ) -> Result<(), FormatError> {
        let filled = self.read_some(offset, buffer)?;
        if filled == buffer.len() {
            return Ok(());
        }
        Err(FormatError::damaged(
            format,
            format!("byte {offset}"),
            format!("{filled} bytes and the end of the file"),
            format!("{} bytes", buffer.len()),
        ))
    }

    /// Reads a few bytes, such as a header. The caller bounds their number.
    pub(crate) fn bytes(
        &self,
        format: &'static str,
        offset: u64,
        count: usize,
    ) -> Result<Vec<u8>, FormatError> {
        self.within(format, offset, count as u64)?;
        let mut buffer = vec![0; count];
        self.read_exact(format, offset, &mut buffer)?;
        Ok(buffer)
    }

    /// Refuses a stretch that is not in the file; gives its end.
    pub(crate) fn within(&self, format: &'static str, offset: u64, count: u64) -> Result<u64, FormatError> {
        match offset.checked_add(count) {
            Some(end) if end <= self.length => Ok(end),
            _ => Err(FormatError::damaged(
                format,
                format!("byte {offset}"),
                format!("the end of the file after {} bytes", self.length),
                format!("{count} bytes from there on"),
            )),
        }
    }
}

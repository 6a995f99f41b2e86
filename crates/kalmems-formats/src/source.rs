//! The bytes of a file, wherever they are.

use crate::FormatError;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

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
    copies: Mutex<UnpackedCopies>,
}

/// Parts of a file as they unpack, in a temporary file without a name: they are unpacked once, and read after their checksum was compared.
#[derive(Default)]
pub(crate) struct UnpackedCopies {
    /// Where they are written, and where they are read from.
    file: Option<(File, Arc<SharedFile>)>,
    length: u64,
}

impl UnpackedCopies {
    /// Makes room for as many bytes; where they begin. `None` where there is no room or no disk.
    pub(crate) fn begin(&mut self, bytes: u64) -> Option<u64> {
        let length = self.length.checked_add(bytes).filter(|length| *length <= COPIED_BYTES)?;
        if self.file.is_none() {
            // A browser has no folder for temporary files.
            if cfg!(target_family = "wasm") {
                return None;
            }
            let named = tempfile::NamedTempFile::new().ok()?;
            let reader = SharedFile::new(Box::new(named.reopen().ok()?)).ok()?;
            // Nameless from here on, so that nothing of it is left however the program ends.
            self.file = Some((named.into_file(), Arc::new(reader)));
        }
        self.file.as_mut()?.0.seek(SeekFrom::Start(self.length)).ok()?;
        Some(std::mem::replace(&mut self.length, length))
    }

    /// Writes the next bytes of the part that begins at `start`; `None` where the disk is full, which gives back what the part took.
    pub(crate) fn append(&mut self, start: u64, bytes: &[u8]) -> Option<()> {
        let (file, _) = self.file.as_mut()?;
        let written = file.write_all(bytes).ok();
        if written.is_none() {
            file.set_len(start).ok();
        }
        written
    }

    /// What reads them.
    pub(crate) fn reader(&self) -> Option<Arc<SharedFile>> {
        self.file.as_ref().map(|(_, reader)| Arc::clone(reader))
    }
}

impl SharedFile {
    /// Takes a file from its first byte, wherever it stands.
    pub(crate) fn new(mut file: Box<dyn ReadSeek>) -> Result<Self, FormatError> {
        let length = file.seek(SeekFrom::End(0))?;
        Ok(Self { file: Mutex::new(file), length, folder: None, copies: Mutex::default() })
    }

    /// What was unpacked of it.
    pub(crate) fn copies(&self) -> MutexGuard<'_, UnpackedCopies> {
        self.copies.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A file on a disk.
    pub(crate) fn open(path: &Path) -> Result<Self, FormatError> {
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

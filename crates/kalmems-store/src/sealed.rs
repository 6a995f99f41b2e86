//! Files whose checksum is known when they are complete.

use crate::RUN_FILE;
use sha2::{Digest, Sha256};
use std::fmt::Write as _;
use std::fs::File;
use std::io::{self, BufWriter, Read, Write};
use std::path::Path;

/// Bytes that are gathered before they are written.
const BUFFER: usize = 1 << 18;

/// A file of a result that is being written.
#[derive(Debug)]
pub struct ResultFile {
    name: String,
    sealing: Sealing,
}

impl ResultFile {
    pub(crate) fn new(name: &str, sealing: Sealing) -> Self {
        Self { name: name.to_owned(), sealing }
    }

    pub(crate) fn into_parts(self) -> (String, Sealing) {
        (self.name, self.sealing)
    }
}

impl Write for ResultFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.sealing.0.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.sealing.0.flush()
    }
}

/// A file on its way to its checksum.
#[derive(Debug)]
pub(crate) struct Sealing(BufWriter<Hashed>);

#[derive(Debug)]
struct Hashed {
    file: File,
    hash: Sha256,
}

impl Write for Hashed {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let count = self.file.write(bytes)?;
        self.hash.update(&bytes[..count]);
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Sealing {
    #[allow(clippy::unnecessary_wraps)] // the end of a chain of what can fail
    pub(crate) fn new(file: File) -> io::Result<Self> {
        Ok(Self(BufWriter::with_capacity(BUFFER, Hashed { file, hash: Sha256::new() })))
    }

    /// Waits until all of it is on the disk; its checksum.
    pub(crate) fn finish(self) -> io::Result<String> {
        let Hashed { file, hash } = self.0.into_inner().map_err(io::IntoInnerError::into_error)?;
        file.sync_all()?;
        Ok(hexadecimal(&hash.finalize()))
    }
}

/// The checksum of a file.
pub(crate) fn checksum(path: &Path) -> io::Result<String> {
    let (mut file, mut hash) = (File::open(path)?, Sha256::new());
    let mut piece = vec![0; BUFFER];
    loop {
        match file.read(&mut piece) {
            Ok(0) => return Ok(hexadecimal(&hash.finalize())),
            Ok(count) => hash.update(&piece[..count]),
            Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
            Err(e) => return Err(e),
        }
    }
}

/// The checksum of a file of a result, from which the timing of its run is left out: two runs of the same input have the same.
pub(crate) fn checksum_within(folder: &Path, name: &str) -> io::Result<String> {
    let path = folder.join(name);
    if name != RUN_FILE {
        return checksum(&path);
    }
    Ok(checksum_of(&without_timing(&std::fs::read(path)?)))
}

/// The record of a run without the numbers of its tables of timing.
fn without_timing(run: &[u8]) -> Vec<u8> {
    let mut timing = false;
    let is_kept = |line: &&[u8]| {
        if line.starts_with(b"[") {
            timing = line.starts_with(b"[timing");
        }
        let number = line.iter().position(|byte| *byte == b'=').map(|equals| line[equals + 1..].trim_ascii());
        let number = number.and_then(|number| std::str::from_utf8(number).ok()?.parse::<f64>().ok());
        !timing || number.is_none()
    };
    run.split_inclusive(|byte| *byte == b'\n').filter(is_kept).flatten().copied().collect()
}

/// The checksum of bytes.
pub(crate) fn checksum_of(bytes: &[u8]) -> String {
    hexadecimal(&Sha256::digest(bytes))
}

fn hexadecimal(digest: &[u8]) -> String {
    digest.iter().fold(String::new(), |mut text, byte| {
        // Writing to a string cannot fail.
        let _ = write!(text, "{byte:02x}");
        text
    })
}

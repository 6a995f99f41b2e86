//! The blocks of a file, read and parsed on a thread of their own, so that reading and computing overlap; where there are no
//! threads, when they are asked for.

use super::ReadError;
use super::read::ReadProgress;
use crate::progress::HAS_THREADS;
use kalmems_formats::{Block, Digest, FormatError, Table, WantedColumn};
use sha2::{Digest as _, Sha256};
use std::fmt::Write as _;
use std::fs::File;
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, SyncSender, channel, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Blocks that wait to be taken.
const AHEAD: usize = 4;

/// Rows of a block, where there are few columns, and the numbers that one holds at most.
const ROWS: usize = 8192;
const NUMBERS: usize = 1 << 20;

/// How long the caller is not asked whether to go on, whether blocks come or not.
const PATIENCE: Duration = Duration::from_millis(100);

type BytesRead = (u64, u64);

enum ReaderMessage {
    Block(Block, BytesRead),
    End(Digest, BytesRead),
    Failed(FormatError),
}

/// The blocks of a table, one after the other.
pub(crate) struct Blocks {
    path: PathBuf,
    /// `None` after the end.
    reader: Option<BlockReader>,
    /// Rows of a block.
    capacity: usize,
    /// What has been read of how much, when it was last heard.
    extent: BytesRead,
    /// When the caller was asked last.
    asked: Instant,
    digest: Option<Digest>,
}

impl Blocks {
    /// Begins to read the wanted columns of a table that was opened at `path`.
    pub(crate) fn start(
        table: Box<dyn Table>,
        path: &Path,
        wanted: &[WantedColumn],
    ) -> Result<Self, ReadError> {
        Self::start_on(table, path, wanted, HAS_THREADS)
    }

    fn start_on(
        mut table: Box<dyn Table>,
        path: &Path,
        wanted: &[WantedColumn],
        thread: bool,
    ) -> Result<Self, ReadError> {
        table.want(wanted).map_err(|source| ReadError::of_format(path, source))?;
        let capacity = (NUMBERS / wanted.len().max(1)).clamp(64, ROWS);
        let reader = if thread {
            BlockReader::on_thread(table, path, capacity)
                .map_err(|source| ReadError::Io { file: path.display().to_string(), source })?
        } else {
            BlockReader::Here { table, free: None }
        };
        Ok(Self {
            path: path.to_owned(),
            reader: Some(reader),
            capacity,
            extent: (0, 0),
            asked: Instant::now(),
            digest: None,
        })
    }

    /// The next block; `None` after the last.
    pub(crate) fn next(&mut self, progress: ReadProgress) -> Result<Option<Block>, ReadError> {
        loop {
            if self.asked.elapsed() >= PATIENCE {
                self.asked = Instant::now();
                self.report(progress)?;
            }
            let message = match &mut self.reader {
                None => return Ok(None),
                Some(BlockReader::Thread { filled, .. }) => match filled.recv_timeout(PATIENCE) {
                    Ok(message) => message,
                    Err(RecvTimeoutError::Timeout) => continue,
                    // The thread always says how it ended.
                    Err(RecvTimeoutError::Disconnected) => return Ok(None),
                },
                Some(BlockReader::Here { table, free }) => {
                    let block = free.take().unwrap_or_else(|| Block::with_capacity(self.capacity));
                    read(table.as_mut(), &self.path, block)
                }
            };
            match message {
                ReaderMessage::Block(block, extent) => {
                    self.extent = extent;
                    return Ok(Some(block));
                }
                ReaderMessage::End(digest, extent) => {
                    self.extent = extent;
                    self.digest = Some(digest);
                    self.close();
                    return Ok(None);
                }
                ReaderMessage::Failed(source) => return Err(ReadError::of_format(&self.path, source)),
            }
        }
    }

    /// Gives a block back, for its memory to be used again.
    pub(crate) fn reuse(&mut self, block: Block) {
        match &mut self.reader {
            // Where the thread has ended it needs none.
            Some(BlockReader::Thread { emptied, .. }) => drop(emptied.send(block)),
            Some(BlockReader::Here { free, .. }) => *free = Some(block),
            None => {}
        }
    }

    /// Ends the thread, which hears of it when it has read its block. One that waits for a pipe ends when the pipe does: it is
    /// not waited for.
    fn close(&mut self) {
        let Some(BlockReader::Thread { filled, thread, .. }) = self.reader.take() else { return };
        drop(filled);
        let file = std::fs::metadata(&self.path).is_ok_and(|metadata| metadata.is_file());
        if file || thread.is_finished() {
            // It has said what went wrong; it does not panic.
            let _ = thread.join();
        }
    }

    /// Tells how far the reading is, and asks whether to go on.
    pub(crate) fn report(&self, progress: ReadProgress) -> Result<(), ReadError> {
        let (done, total) = self.extent;
        if progress(done, total).is_break() {
            return Err(ReadError::Interrupted { file: self.path.display().to_string() });
        }
        Ok(())
    }

    /// What was read, after the last block.
    pub(crate) fn digest(&self) -> Option<&Digest> {
        self.digest.as_ref()
    }
}

/// Where the table is read.
enum BlockReader {
    /// On a thread of its own, some blocks ahead.
    Thread { filled: Receiver<ReaderMessage>, emptied: Sender<Block>, thread: JoinHandle<()> },
    /// Where the blocks are taken, when they are.
    Here { table: Box<dyn Table>, free: Option<Block> },
}

impl BlockReader {
    fn on_thread(mut table: Box<dyn Table>, path: &Path, capacity: usize) -> std::io::Result<Self> {
        let (filled_in, filled) = sync_channel(AHEAD);
        let (emptied, emptied_in) = channel();
        for _ in 0..AHEAD + 2 {
            // The other end is in this function.
            let _ = emptied.send(Block::with_capacity(capacity));
        }
        let of = path.to_owned();
        let thread = std::thread::Builder::new()
            .name("reading".to_owned())
            .spawn(move || work(table.as_mut(), &of, &filled_in, &emptied_in))
            .map_err(|e| {
                let why = format!("no thread can be started that reads it ({e}); allow this program more memory, or more processes");
                std::io::Error::new(e.kind(), why)
            })?;
        Ok(Self::Thread { filled, emptied, thread })
    }
}

impl Drop for Blocks {
    fn drop(&mut self) {
        self.close();
    }
}

/// Reads until the end or until nobody listens.
fn work(table: &mut dyn Table, path: &Path, filled: &SyncSender<ReaderMessage>, emptied: &Receiver<Block>) {
    while let Ok(block) = emptied.recv() {
        let message = read(table, path, block);
        let last = !matches!(message, ReaderMessage::Block(..));
        if filled.send(message).is_err() || last {
            return;
        }
    }
}

/// Fills a block, or says how the table ended.
fn read(table: &mut dyn Table, path: &Path, mut block: Block) -> ReaderMessage {
    match table.read(&mut block) {
        Err(error) => ReaderMessage::Failed(error),
        Ok(()) if block.is_end() => match table.digest().map_or_else(|| digest(path), Ok) {
            Ok(digest) => ReaderMessage::End(digest, table.progress()),
            Err(error) => ReaderMessage::Failed(error.into()),
        },
        Ok(()) => ReaderMessage::Block(block, table.progress()),
    }
}

/// The digest of a file that was not read from its first byte to its last.
fn digest(path: &Path) -> std::io::Result<Digest> {
    let mut file = File::open(path)?;
    let mut hash = Sha256::new();
    let mut bytes = 0;
    let mut piece = vec![0; 1 << 18];
    loop {
        match file.read(&mut piece)? {
            0 => break,
            count => {
                hash.update(piece.get(..count).unwrap_or_default());
                bytes += count as u64;
            }
        }
    }
    let mut sha256 = String::new();
    for byte in hash.finalize() {
        // Writing to a string cannot fail.
        let _ = write!(sha256, "{byte:02x}");
    }
    Ok(Digest { sha256, bytes })
}

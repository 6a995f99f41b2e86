//! Journals: a line for each finished piece of long work, in the order in which they were finished.
//!
//! The first line says which work it is. Each line ends with a checksum of itself; a last line without its end was
//! being written when the program was stopped, and is dropped.

use crate::sealed_line::{checked, sealed_line};
use serde::{Serialize, de::DeserializeOwned};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::marker::PhantomData;
use std::path::{Path, PathBuf};

/// What a journal is of.
pub(crate) trait JournalWork: Clone + Serialize + DeserializeOwned {
    /// A finished piece of it.
    type Piece: Serialize + DeserializeOwned;
    /// What tells the pieces apart.
    type Key: Ord;
    /// What it is, for people and for the first entry of the first line, such as `study`.
    const NAME: &'static str;

    /// What its first entry, `kalmems`, says.
    fn kind(&self) -> &str;

    /// In what it is other work than this; `None` where it is the same.
    fn differs(&self, from: &Self) -> Option<String>;

    /// Which piece it is; in an error is why it can be none of this work.
    fn key(&self, piece: &Self::Piece) -> Result<Self::Key, String>;

    /// A piece for people, such as `run 3`.
    fn name(key: &Self::Key) -> String;
}

/// The first entry of the first line of a journal of this work.
pub(crate) fn kind<W: JournalWork>() -> String {
    format!("journal of a {}", W::NAME)
}

/// Finished pieces by what tells them apart.
pub(crate) type JournalPieces<W> = BTreeMap<<W as JournalWork>::Key, <W as JournalWork>::Piece>;

/// Why a journal cannot be read or written.
#[derive(Debug, thiserror::Error)]
pub enum JournalError {
    /// A file cannot be read or written.
    #[error("cannot read or write {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// A file is no journal.
    #[error(
        "{} is no journal of a {work}: {why}; name the journals that `kalmems {work}` writes, or remove the file",
        path.display()
    )]
    NoJournal {
        /// The file.
        path: PathBuf,
        /// Of what it was to be one.
        work: &'static str,
        /// What was found.
        why: String,
    },
    /// A line of a journal is not what was written.
    #[error(
        "{}:{line}: this line is damaged ({why}); remove it, and its point will be computed again",
        path.display()
    )]
    Damaged {
        /// The journal.
        path: PathBuf,
        /// The line, counted from 1.
        line: usize,
        /// What was found.
        why: String,
    },
    /// The journal is that of other work.
    #[error(
        "{} belongs to another {work}: {why}; give another folder with --out, or --force to begin anew and \
         keep it beside the new one",
        path.display()
    )]
    Other {
        /// The journal.
        path: PathBuf,
        /// What both are.
        work: &'static str,
        /// In what it differs.
        why: String,
    },
    /// Another process writes the journal.
    #[error("{} is being written by another process; let it end, or give another folder with --out", path.display())]
    Busy {
        /// The journal.
        path: PathBuf,
    },
}

/// A journal open for writing, which no other process writes.
#[derive(Debug)]
pub(crate) struct Journal<W> {
    file: File,
    path: PathBuf,
    of: PhantomData<W>,
}

impl<W: JournalWork> Journal<W> {
    /// Goes on with a journal, or begins one; what is finished already, and whether a half-written line was dropped.
    pub(crate) fn open(
        path: &Path,
        work: &W,
        anew: bool,
    ) -> Result<(Self, JournalPieces<W>, bool), JournalError> {
        let failed = |source| JournalError::Io { path: path.to_owned(), source };
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        std::fs::create_dir_all(folder).map_err(failed)?;
        // A pipe would be waited for, and a link would hide whose file it is.
        if std::fs::symlink_metadata(path).is_ok_and(|there| !there.is_file()) {
            return Err(no_journal::<W>(path, "it is no regular file"));
        }
        let mut options = OpenOptions::new();
        let mut file =
            options.read(true).write(true).create(true).truncate(false).open(path).map_err(failed)?;
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => return Err(JournalError::Busy { path: path.to_owned() }),
            // A browser's sandbox has no locks, and nobody else in it.
            Err(TryLockError::Error(source)) if source.kind() != io::ErrorKind::Unsupported => {
                return Err(failed(source));
            }
            _ => {}
        }
        let mut text = Vec::new();
        file.read_to_end(&mut text).map_err(failed)?;
        let read = match read::<W>(path, &text) {
            Ok(read) => read,
            // What is no journal is never overwritten; a damaged one only if it shall be made anew.
            Err(e @ JournalError::NoJournal { .. }) => return Err(e),
            Err(e) if !anew => return Err(e),
            Err(_) => {
                kalmems_store::keep_aside(path).map_err(failed)?;
                return Self::open(path, work, anew);
            }
        };
        let mut journal = Self { file, path: path.to_owned(), of: PhantomData };
        let differs = match &read.work {
            None => Some(String::new()),
            Some(found) => found.differs(work),
        };
        if let Some(why) = differs {
            if read.work.is_some() && !anew {
                return Err(JournalError::Other { path: path.to_owned(), work: W::NAME, why });
            }
            if read.work.is_some() {
                // What is finished is never lost: the journal of the other work is kept beside this one.
                kalmems_store::keep_aside(path).map_err(failed)?;
                let mut options = OpenOptions::new();
                journal.file = options.read(true).write(true).create_new(true).open(path).map_err(failed)?;
                if let Err(TryLockError::WouldBlock) = journal.file.try_lock() {
                    return Err(JournalError::Busy { path: path.to_owned() });
                }
            }
            journal.cut(0).map_err(failed)?;
            journal.write(work).map_err(failed)?;
            kalmems_store::sync_folder(folder).map_err(failed)?;
            return Ok((journal, JournalPieces::<W>::new(), false));
        }
        let torn = read.whole < text.len();
        journal.cut(read.whole as u64).map_err(failed)?;
        Ok((journal, read.pieces, torn))
    }

    /// Adds a finished piece.
    pub(crate) fn add(&mut self, piece: &W::Piece) -> Result<(), JournalError> {
        let path = self.path.clone();
        self.write(piece).map_err(|source| JournalError::Io { path, source })
    }

    fn cut(&mut self, length: u64) -> io::Result<()> {
        self.file.set_len(length)?;
        self.file.seek(SeekFrom::Start(length)).map(|_| ())
    }

    fn write<T: Serialize>(&mut self, content: &T) -> io::Result<()> {
        self.file.write_all(sealed_line(content)?.as_bytes())?;
        // A piece counts as finished when its line is on the disk.
        self.file.sync_data()
    }
}

/// What a journal holds.
struct Content<W: JournalWork> {
    work: Option<W>,
    pieces: JournalPieces<W>,
    /// How many bytes its whole lines have.
    whole: usize,
}

/// Reads a journal that nobody writes.
pub(crate) fn load<W: JournalWork>(path: &Path) -> Result<(W, JournalPieces<W>), JournalError> {
    let text = std::fs::read(path).map_err(|source| JournalError::Io { path: path.to_owned(), source })?;
    let content = read::<W>(path, &text)?;
    let work = content.work.ok_or_else(|| no_journal::<W>(path, "it is empty"))?;
    Ok((work, content.pieces))
}

fn no_journal<W: JournalWork>(path: &Path, why: &str) -> JournalError {
    JournalError::NoJournal { path: path.to_owned(), work: W::NAME, why: why.to_owned() }
}

fn read<W: JournalWork>(path: &Path, text: &[u8]) -> Result<Content<W>, JournalError> {
    let mut content = Content::<W> { work: None, pieces: JournalPieces::<W>::new(), whole: 0 };
    let not_that_of_one = || no_journal::<W>(path, "its first line is not that of one");
    for (i, line) in text.split_inclusive(|byte| *byte == b'\n').enumerate() {
        let Some(whole) = line.strip_suffix(b"\n") else {
            // A first line that was being written begins like one, as far as it goes.
            let begin = format!("{{\"kalmems\":\"{}\"", kind::<W>());
            if i == 0 && line.iter().zip(begin.as_bytes()).any(|(found, expected)| found != expected) {
                return Err(not_that_of_one());
            }
            break;
        };
        if let Some(work) = &content.work {
            let damaged = |why: String| JournalError::Damaged { path: path.to_owned(), line: i + 1, why };
            let piece: W::Piece = checked(whole).map_err(damaged)?;
            let key = work.key(&piece).map_err(damaged)?;
            let name = W::name(&key);
            if content.pieces.insert(key, piece).is_some() {
                return Err(damaged(format!("{name} a second time")));
            }
        } else {
            let work: W = checked(whole).map_err(|_| not_that_of_one())?;
            if work.kind() != kind::<W>() {
                return Err(not_that_of_one());
            }
            content.work = Some(work);
        }
        content.whole += line.len();
    }
    Ok(content)
}

/// The SHA-256 of a file, read piece by piece; `None` where `stop` says so in between.
pub(crate) fn digest_of(path: &Path, stop: &dyn Fn() -> bool) -> io::Result<Option<[u8; 32]>> {
    let mut hash = Sha256::new();
    let mut file = File::open(path)?;
    let mut buffer = vec![0; 1 << 18];
    loop {
        let count = file.read(&mut buffer)?;
        if count == 0 {
            return Ok(Some(hash.finalize().into()));
        }
        hash.update(buffer.get(..count).unwrap_or_default());
        if stop() {
            return Ok(None);
        }
    }
}

//! The journal of a study: a line for each finished run, in the order in which they were finished.
//!
//! The first line says which study it is. Each line ends with a checksum of itself; a last line without its end was
//! being written when the program was stopped, and is dropped.

use super::calibration::RunClaims;
use super::rows::StudyRow;
use super::{Shard, StudyError, StudyPlan, plan::hex};
use serde::{Deserialize, Serialize, de::DeserializeOwned};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// The first line.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct JournalHeader {
    /// What kind of file it is.
    kalmems: String,
    /// The version of the program.
    pub(super) version: String,
    /// What tells the study from others.
    pub(super) digest: String,
    /// How many runs the whole study has.
    pub(super) runs: u64,
    /// Which part of them this journal is for, such as `1/3`.
    pub(super) shard: String,
    /// The study file.
    pub(super) study: String,
    /// The experiment file.
    pub(super) experiment: String,
    /// Runs at each point of a calibration; `None` of a study.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) calibration: Option<u64>,
}

const KIND: &str = "journal of a study";

/// A finished run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct FinishedRun {
    pub(super) run: u64,
    /// Why it has no rows.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) error: Option<String>,
    pub(super) rows: Vec<StudyRow>,
    /// What it says of the claims of its filters, in a calibration.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) judged: Vec<RunClaims>,
}

/// Finished runs by their index.
pub(super) type FinishedRuns = BTreeMap<u64, FinishedRun>;

impl JournalHeader {
    pub(super) fn of(plan: &StudyPlan, digest: String, shard: Shard) -> Self {
        Self {
            kalmems: KIND.to_owned(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            digest,
            runs: plan.runs(),
            shard: shard.to_string(),
            study: plan.source.text.clone(),
            experiment: plan.experiment.text.clone(),
            calibration: plan.calibration.as_ref().map(|_| plan.description.repeats),
        }
    }

    /// In what it is another study than this one; `None` where it is the same.
    pub(super) fn differs(&self, from: &Self) -> Option<String> {
        if self.version != from.version {
            Some(format!("it was made by version {}, and this is {}", self.version, from.version))
        } else if self.digest != from.digest {
            Some("the study, its experiment or its recordings have changed".to_owned())
        } else {
            None
        }
    }
}

/// A journal open for writing, which no other process writes.
#[derive(Debug)]
pub(super) struct Journal {
    file: File,
    path: PathBuf,
}

impl Journal {
    /// Goes on with a journal, or begins one; what is finished already, and whether a half-written line was dropped.
    pub(super) fn open(
        path: &Path,
        header: &JournalHeader,
        anew: bool,
    ) -> Result<(Self, FinishedRuns, bool), StudyError> {
        let failed = |source| StudyError::Io { path: path.to_owned(), source };
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        std::fs::create_dir_all(folder).map_err(failed)?;
        // A pipe would be waited for, and a link would hide whose file it is.
        if std::fs::symlink_metadata(path).is_ok_and(|there| !there.is_file()) {
            let why = "it is no regular file".to_owned();
            return Err(StudyError::NoJournal { path: path.to_owned(), why });
        }
        let mut options = OpenOptions::new();
        let mut file =
            options.read(true).write(true).create(true).truncate(false).open(path).map_err(failed)?;
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => return Err(StudyError::Busy { path: path.to_owned() }),
            // A browser's sandbox has no locks, and nobody else in it.
            Err(TryLockError::Error(source)) if source.kind() != io::ErrorKind::Unsupported => {
                return Err(failed(source));
            }
            _ => {}
        }
        let mut text = Vec::new();
        file.read_to_end(&mut text).map_err(failed)?;
        let read = match read(path, &text) {
            Ok(read) => read,
            // What is no journal is never overwritten; a damaged one only if it shall be made anew.
            Err(e @ StudyError::NoJournal { .. }) => return Err(e),
            Err(e) if !anew => return Err(e),
            Err(_) => {
                kalmems_store::keep_aside(path).map_err(failed)?;
                return Self::open(path, header, anew);
            }
        };
        let mut journal = Self { file, path: path.to_owned() };
        let differs = match &read.header {
            None => Some(String::new()),
            Some(found) => found.differs(header).or_else(|| {
                (found.shard != header.shard)
                    .then(|| format!("it is shard {}, not {}", found.shard, header.shard))
            }),
        };
        if let Some(why) = differs {
            if read.header.is_some() && !anew {
                return Err(StudyError::OtherStudy { path: path.to_owned(), why });
            }
            if read.header.is_some() {
                // Finished runs are never lost: the journal of the other study is kept beside this one.
                kalmems_store::keep_aside(path).map_err(failed)?;
                let mut options = OpenOptions::new();
                journal.file = options.read(true).write(true).create_new(true).open(path).map_err(failed)?;
                if let Err(TryLockError::WouldBlock) = journal.file.try_lock() {
                    return Err(StudyError::Busy { path: path.to_owned() });
                }
            }
            journal.cut(0).map_err(failed)?;
            journal.write(header).map_err(failed)?;
            kalmems_store::sync_folder(folder).map_err(failed)?;
            return Ok((journal, FinishedRuns::new(), false));
        }
        let torn = read.whole < text.len();
        journal.cut(read.whole as u64).map_err(failed)?;
        Ok((journal, read.runs, torn))
    }

    /// Adds a finished run.
    pub(super) fn add(&mut self, finished: &FinishedRun) -> Result<(), StudyError> {
        let path = self.path.clone();
        self.write(finished).map_err(|source| StudyError::Io { path, source })
    }

    fn cut(&mut self, length: u64) -> io::Result<()> {
        self.file.set_len(length)?;
        self.file.seek(SeekFrom::Start(length)).map(|_| ())
    }

    fn write<T: Serialize>(&mut self, content: &T) -> io::Result<()> {
        self.file.write_all(line(content)?.as_bytes())?;
        // A run counts as finished when its line is on the disk.
        self.file.sync_data()
    }
}

/// What a journal holds.
#[derive(Debug, Default)]
pub(super) struct JournalContent {
    pub(super) header: Option<JournalHeader>,
    pub(super) runs: FinishedRuns,
    /// How many bytes its whole lines have.
    whole: usize,
}

/// Reads a journal that nobody writes.
pub(super) fn load(path: &Path) -> Result<(JournalHeader, FinishedRuns), StudyError> {
    let text = std::fs::read(path).map_err(|source| StudyError::Io { path: path.to_owned(), source })?;
    let content = read(path, &text)?;
    let header = content
        .header
        .ok_or_else(|| StudyError::NoJournal { path: path.to_owned(), why: "it is empty".to_owned() })?;
    Ok((header, content.runs))
}

fn read(path: &Path, text: &[u8]) -> Result<JournalContent, StudyError> {
    let mut content = JournalContent::default();
    let no_journal = |why: &str| StudyError::NoJournal { path: path.to_owned(), why: why.to_owned() };
    for (i, line) in text.split_inclusive(|byte| *byte == b'\n').enumerate() {
        let Some(whole) = line.strip_suffix(b"\n") else {
            // A first line that was being written begins like one, as far as it goes.
            let begin = format!("{{\"kalmems\":\"{KIND}\"");
            if i == 0 && line.iter().zip(begin.as_bytes()).any(|(found, expected)| found != expected) {
                return Err(no_journal("its first line is not that of one"));
            }
            break;
        };
        if i == 0 {
            let header: JournalHeader =
                checked(whole).map_err(|_| no_journal("its first line is not that of one"))?;
            if header.kalmems != KIND {
                return Err(no_journal("its first line is not that of one"));
            }
            content.header = Some(header);
        } else {
            let damaged = |why: String| StudyError::Damaged { path: path.to_owned(), line: i + 1, why };
            let finished: FinishedRun = checked(whole).map_err(damaged)?;
            let (run, runs) = (finished.run, content.header.as_ref().map_or(0, |header| header.runs));
            if run >= runs {
                return Err(damaged(format!("run {run} of {runs}")));
            }
            if content.runs.insert(run, finished).is_some() {
                return Err(damaged(format!("run {run} a second time")));
            }
        }
        content.whole += line.len();
    }
    Ok(content)
}

const CHECKSUM: &str = ",\"checksum\":\"";

/// A JSON object on a line of its own, with its checksum as the last entry.
fn line<T: Serialize>(content: &T) -> io::Result<String> {
    let json = serde_json::to_string(content)?;
    let body = json.strip_suffix('}').unwrap_or(&json);
    Ok(format!("{body}{CHECKSUM}{}\"}}\n", checksum(body)))
}

fn checked<T: DeserializeOwned>(line: &[u8]) -> Result<T, String> {
    let text = std::str::from_utf8(line).map_err(|_| "it is no text".to_owned())?;
    let (body, rest) = text.rsplit_once(CHECKSUM).ok_or("it has no checksum")?;
    if rest.strip_suffix("\"}") != Some(&checksum(body)) {
        return Err("its checksum is another one".to_owned());
    }
    serde_json::from_str(&format!("{body}}}")).map_err(|_| "it is not what this version writes".to_owned())
}

fn checksum(body: &str) -> String {
    let digest = Sha256::digest(body);
    hex(digest.get(..8).unwrap_or_default())
}

//! The folder in which a result is made, and the step by which it gets to its place.
//!
//! Beside a target `scan` it is `.kalmems-scan.staging`, with
//!
//! - `lock`, which is locked as long as the run lives,
//! - `files`, the names of the files that the run has begun, before each is there,
//! - `result`, the new result,
//! - `marker`, from when the new result is complete until the earlier one is settled: how to go on from there,
//! - `old`, the earlier result, between the two steps that stand in where the system has no exchange of folders.
//!
//! So whatever the moment at which a run is killed, the next one beside it knows what there is, finishes the exchange or
//! clears the beginnings, and touches nothing that is not listed.

use crate::OutputError;
use crate::exchange::{exchange, sync_folder};
use crate::manifest::{MANIFEST, Manifest};
use crate::sealed::{checksum, checksum_of, checksum_within};
use crate::target_state::{FileStamp, TargetState, look, remove_empty_folders, remove_owned};
use serde::{Deserialize, Serialize};
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::thread::sleep;
use std::time::Duration;

const PREFIX: &str = ".kalmems-";
const SUFFIX: &str = ".staging";

/// How often, and how long apart, a lock is asked for: another run may look at a dead one's folder just now.
const ASKS: u32 = 20;
const BETWEEN_ASKS: Duration = Duration::from_millis(10);

/// A result being made.
#[derive(Debug)]
pub(crate) struct Staging {
    root: PathBuf,
    /// Locked until it is dropped.
    _lock: File,
    list: RefCell<File>,
    /// The folders on the way to the target that were not there, the outermost first.
    made: Vec<PathBuf>,
    published: bool,
}

/// What is to become of the earlier result.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum EarlierResultFate {
    /// It says what the new one says.
    Remove,
    /// It is kept beside the new one.
    Keep,
}

/// How to go on from a complete result.
#[derive(Serialize, Deserialize)]
struct CompleteResultStep {
    /// The checksum of the new result's list of files, by which it is known whether it is in its place.
    result: String,
    earlier: EarlierResultFate,
}

impl Staging {
    /// Begins one, after clearing what dead runs left in the same folder.
    pub(crate) fn begin(target: &Path, place: &Path) -> Result<Self, OutputError> {
        let error = |source| OutputError::Io { path: target.to_owned(), source };
        let parent = parent(place);
        let mut made: Vec<PathBuf> =
            parent.ancestors().take_while(|folder| !folder.exists()).map(Path::to_owned).collect();
        made.reverse();
        fs::create_dir_all(parent).map_err(error)?;
        Self::in_folder(target, place, made.clone()).inspect_err(|_| remove_made(&made))
    }

    /// Begins one in a folder that is there.
    fn in_folder(target: &Path, place: &Path, made: Vec<PathBuf>) -> Result<Self, OutputError> {
        let error = |source| OutputError::Io { path: target.to_owned(), source };
        let root = root_of(place);
        clear_dead(parent(place), &root).map_err(error)?;
        let mut asks = 0;
        let lock = loop {
            match fs::create_dir(&root) {
                Err(e) if e.kind() != ErrorKind::AlreadyExists => return Err(error(e)),
                _ => {}
            }
            match lock(&root, true).map_err(error)? {
                LockAttempt::Held(lock) => break lock,
                LockAttempt::None => {
                    let (what, remedy) = ("there and was not made by kalmems", "move it away");
                    return Err(OutputError::File { path: root, what, remedy });
                }
                LockAttempt::Busy if asks == ASKS => {
                    return Err(OutputError::Busy { path: target.to_owned() });
                }
                LockAttempt::Busy | LockAttempt::Gone => {
                    asks += 1;
                    sleep(BETWEEN_ASKS);
                }
            }
        };
        recover(&root, place).map_err(error)?;
        let list = File::create(root.join("files")).map_err(error)?;
        fs::create_dir(root.join("result")).map_err(error)?;
        Ok(Self { root, _lock: lock, list: RefCell::new(list), made, published: false })
    }

    fn result(&self) -> PathBuf {
        self.root.join("result")
    }

    /// Begins a file of the result.
    pub(crate) fn create(&self, name: &str) -> io::Result<File> {
        let path = self.result().join(name);
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder)?;
        }
        writeln!(self.list.borrow_mut(), "{name}")?;
        OpenOptions::new().write(true).create_new(true).open(path)
    }

    /// Takes a complete file into the result.
    pub(crate) fn adopt(&self, name: &str, complete: &Path) -> io::Result<()> {
        let path = self.result().join(name);
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder)?;
        }
        writeln!(self.list.borrow_mut(), "{name}")?;
        if fs::hard_link(complete, &path).is_err() {
            let mut copy = OpenOptions::new().write(true).create_new(true).open(&path)?;
            io::copy(&mut File::open(complete)?, &mut copy)?;
            copy.sync_all()?;
        }
        Ok(())
    }

    /// The checksum of a file of the result that is complete.
    pub(crate) fn checksum(&self, name: &str) -> io::Result<String> {
        checksum_within(&self.result(), name)
    }

    /// Writes the list of files, after which the result is complete.
    pub(crate) fn write_manifest(&self, manifest: &Manifest) -> io::Result<()> {
        let text = manifest.to_text().map_err(io::Error::other)?;
        let mut file = self.create(MANIFEST)?;
        file.write_all(text.as_bytes())?;
        file.sync_all()?;
        let result = self.result();
        for folder in manifest.files.keys().filter_map(|name| Path::new(name).parent()) {
            sync_folder(&result.join(folder))?;
        }
        sync_folder(&result)
    }

    /// Puts the complete result in its place; where the earlier one is kept, if it is.
    pub(crate) fn publish(
        mut self,
        place: &Path,
        manifest: &Manifest,
        earlier: Option<(EarlierResultFate, &BTreeMap<String, FileStamp>)>,
    ) -> io::Result<Option<PathBuf>> {
        let (result, parent) = (self.result(), parent(place));
        let Some((earlier, seen)) = earlier else {
            // Some systems rename nothing to where an empty folder is.
            let _ = fs::remove_dir(place);
            fs::rename(&result, place)?;
            self.published = true;
            sync_folder(parent)?;
            return self.end().map(|()| None);
        };
        // Who may see the earlier result may see this one.
        fs::set_permissions(&result, fs::metadata(place)?.permissions())?;
        let complete = CompleteResultStep {
            result: checksum_of(manifest.to_text().map_err(io::Error::other)?.as_bytes()),
            earlier,
        };
        write_synced(&self.root.join("marker"), &serde_json::to_vec(&complete)?)?;
        sync_folder(&self.root)?;
        let mut displaced = result.clone();
        if !exchange(&result, place)? {
            displaced = self.root.join("old");
            fs::rename(place, &displaced)?;
            if let Err(e) = fs::rename(&result, place) {
                fs::rename(&displaced, place)?;
                return Err(e);
            }
        }
        self.published = true;
        sync_folder(parent)?;
        let kept = settle(&displaced, place, earlier, seen)?;
        sync_folder(parent)?;
        self.end()?;
        Ok(kept)
    }

    /// Puts the complete result beside a place that something else has taken.
    pub(crate) fn publish_beside(mut self, place: &Path) -> io::Result<PathBuf> {
        let beside = free(place, ".new");
        fs::rename(self.result(), &beside)?;
        self.published = true;
        sync_folder(parent(place))?;
        self.end()?;
        Ok(beside)
    }

    /// Removes the folder when its result is out of it.
    fn end(&mut self) -> io::Result<()> {
        remove(&self.root)
    }

    /// Leaves all as it is, as a process does that is killed.
    #[cfg(test)]
    pub(crate) fn die(mut self) {
        self.published = true;
    }
}

impl Drop for Staging {
    fn drop(&mut self) {
        if !self.published {
            // What cannot be removed now is cleared by the next run.
            let _ = clear_unfinished(&self.root).and_then(|()| remove(&self.root));
            remove_made(&self.made);
        }
    }
}

/// Removes folders that were made for a result that did not come, as far as they are empty.
fn remove_made(made: &[PathBuf]) {
    for folder in made.iter().rev() {
        let _ = fs::remove_dir(folder);
    }
}

/// A lock that was asked for.
enum LockAttempt {
    Held(File),
    /// Another run has it.
    Busy,
    /// It was removed at the same moment.
    Gone,
    /// There is no lock in a folder that has other things in it.
    None,
}

/// Asks for the lock of a staging folder, and makes it if that is asked for.
fn lock(root: &Path, make: bool) -> io::Result<LockAttempt> {
    let path = root.join("lock");
    match fs::symlink_metadata(&path) {
        Ok(there) if !there.is_file() => return Ok(LockAttempt::None),
        Ok(_) => {}
        Err(e) if e.kind() == ErrorKind::NotFound && make => {
            let Ok(mut content) = fs::read_dir(root) else { return Ok(LockAttempt::Gone) };
            if content.next().is_some() {
                // It may have been made since.
                return Ok(if path.exists() { LockAttempt::Busy } else { LockAttempt::None });
            }
        }
        Err(e) if e.kind() == ErrorKind::NotFound => return Ok(LockAttempt::None),
        Err(e) => return Err(e),
    }
    let file = match OpenOptions::new().read(true).write(true).create(make).truncate(false).open(&path) {
        Err(e) if e.kind() == ErrorKind::NotFound => return Ok(LockAttempt::Gone),
        file => file?,
    };
    match file.try_lock() {
        Err(TryLockError::WouldBlock) => Ok(LockAttempt::Busy),
        // A browser's sandbox has no locks, and nobody else in it.
        Err(TryLockError::Error(e)) if e.kind() != ErrorKind::Unsupported => Err(e),
        // Whoever held it may have removed it before it was let go of.
        _ if !is_there(&file, &path) => Ok(LockAttempt::Gone),
        _ => Ok(LockAttempt::Held(file)),
    }
}

/// Whether an open file is the one that has this path.
fn is_there(file: &File, path: &Path) -> bool {
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt;
        let of = |there: fs::Metadata| (there.dev(), there.ino());
        matches!((file.metadata(), fs::metadata(path)), (Ok(a), Ok(b)) if of(a.clone()) == of(b.clone()))
    }
    #[cfg(not(unix))]
    {
        let _ = file;
        path.exists()
    }
}

/// Clears what dead runs left in a folder, but for the one whose staging is about to be taken over.
fn clear_dead(folder: &Path, own: &Path) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let root = entry?.path();
        let name = root.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        let target = name.strip_prefix(PREFIX).and_then(|name| name.strip_suffix(SUFFIX));
        let Some(target) = target.filter(|_| root != own && root.is_dir() && !root.is_symlink()) else {
            continue;
        };
        // What cannot be cleared is somebody else's trouble, not this run's.
        match lock(&root, false) {
            Ok(LockAttempt::Held(_held)) => {
                let _ = recover(&root, &folder.join(target)).and_then(|()| remove(&root));
            }
            // A run that died before its lock was made, or after it was removed, leaves an empty folder; one that lives
            // makes it again. A folder with anything in it stays.
            Ok(LockAttempt::None) => {
                let _ = fs::remove_dir(&root);
            }
            _ => {}
        }
    }
    Ok(())
}

/// Finishes what a dead run had complete, and clears what it had not.
fn recover(root: &Path, place: &Path) -> io::Result<()> {
    let (marker, result, old) = (root.join("marker"), root.join("result"), root.join("old"));
    if let Ok(complete) = fs::read(&marker)
        && let Ok(complete) = serde_json::from_slice::<CompleteResultStep>(&complete)
    {
        let mut published = checksum(&place.join(MANIFEST)).is_ok_and(|there| there == complete.result);
        if !published && old.exists() && !place.exists() {
            // Between the two steps: the result is whole.
            fs::rename(&result, place)?;
            published = true;
        }
        if published {
            for displaced in [&result, &old].into_iter().filter(|displaced| displaced.exists()) {
                settle(displaced, place, complete.earlier, &BTreeMap::new())?;
            }
        }
        sync_folder(parent(place))?;
    }
    if marker.exists() {
        fs::remove_file(marker)?;
    }
    clear_unfinished(root)
}

/// Does with the earlier result what is to be done with it; where it is kept, if it is.
fn settle(
    displaced: &Path,
    place: &Path,
    what: EarlierResultFate,
    seen: &BTreeMap<String, FileStamp>,
) -> io::Result<Option<PathBuf>> {
    if what == EarlierResultFate::Remove {
        if let Ok(Some(manifest)) = Manifest::read(displaced) {
            remove_owned(displaced, &manifest, seen)?;
        }
        // Of a removal that was not finished an empty folder may be left; it is no result.
        if !displaced.exists() || fs::remove_dir(displaced).is_ok() {
            return Ok(None);
        }
        // Something was put there while it was replaced.
    }
    let kept = previous(place);
    remove_older(&kept, displaced)?;
    let kept = match Manifest::read(&kept) {
        _ if !kept.exists() => kept,
        // One of another experiment, or one that was changed since, gets a number, the newest the largest.
        Ok(Some(_)) => {
            fs::rename(&kept, free(&kept, "-"))?;
            kept
        }
        // It is not ours to move.
        _ => free(&kept, "-"),
    };
    fs::rename(displaced, &kept)?;
    Ok(Some(kept))
}

/// Removes an earlier result of the same work that is as it was written: of these one is kept.
fn remove_older(kept: &Path, displaced: &Path) -> io::Result<()> {
    let Ok(TargetState::Result { manifest, changed, seen }) = look(kept, kept, &TargetState::Nothing) else {
        return Ok(());
    };
    let is_of_the_same = Manifest::read(displaced)
        .is_ok_and(|own| own.is_some_and(|own| (&own.command, &own.of) == (&manifest.command, &manifest.of)));
    if is_of_the_same && changed.is_empty() { remove_owned(kept, &manifest, &seen) } else { Ok(()) }
}

/// Removes what a run has begun, and nothing else.
fn clear_unfinished(root: &Path) -> io::Result<()> {
    let result = root.join("result");
    let list = match fs::read_to_string(root.join("files")) {
        Err(e) if e.kind() == ErrorKind::NotFound => String::new(),
        list => list?,
    };
    let names: Vec<String> = list.lines().map(str::to_owned).collect();
    for name in &names {
        match fs::remove_file(result.join(name)) {
            Err(e) if e.kind() != ErrorKind::NotFound => return Err(e),
            _ => {}
        }
    }
    remove_empty_folders(&result, names.iter());
    match fs::remove_dir(&result) {
        Err(e) if e.kind() != ErrorKind::NotFound => Err(e),
        _ => Ok(()),
    }
}

/// Removes a staging folder whose result is gone from it.
fn remove(root: &Path) -> io::Result<()> {
    for name in ["marker", "files", "lock"] {
        match fs::remove_file(root.join(name)) {
            Err(e) if e.kind() != ErrorKind::NotFound => return Err(e),
            _ => {}
        }
    }
    fs::remove_dir(root)
}

fn write_synced(path: &Path, content: &[u8]) -> io::Result<()> {
    let mut file = File::create(path)?;
    file.write_all(content)?;
    file.sync_all()
}

/// The staging folder of a target.
fn root_of(place: &Path) -> PathBuf {
    let mut name = OsString::from(PREFIX);
    name.push(place.file_name().unwrap_or_default());
    name.push(SUFFIX);
    place.with_file_name(name)
}

/// Where the earlier result of a target is kept.
pub(crate) fn previous(place: &Path) -> PathBuf {
    with_ending(place, ".previous")
}

/// The first name with this ending that is free: `scan.new`, `scan.new-2`, or, for an ending `-`, `scan-2`.
pub(crate) fn free(place: &Path, ending: &str) -> PathBuf {
    let base = if ending == "-" { place.to_owned() } else { with_ending(place, ending) };
    let numbered = (2_u64..).map(|n| with_ending(&base, &format!("-{n}")));
    let mut candidates = std::iter::once(base.clone()).chain(numbered);
    // There is always one: there are more names than files.
    candidates.find(|path| fs::symlink_metadata(path).is_err()).unwrap_or(base)
}

fn with_ending(path: &Path, ending: &str) -> PathBuf {
    let mut name = path.file_name().unwrap_or_default().to_owned();
    name.push(ending);
    path.with_file_name(name)
}

fn parent(place: &Path) -> &Path {
    place.parent().unwrap_or(Path::new("/"))
}

//! What stands at the target of a result.

use crate::manifest::{MANIFEST, Manifest};
use crate::sealed::checksum_within;
use crate::{OutputError, RUN_FILE};
use std::collections::BTreeMap;
use std::fs::{self, Metadata};
use std::io;
use std::path::Path;
use std::time::SystemTime;

/// What stands at the target of a result, where a result may be put there.
#[derive(Debug)]
pub(crate) enum TargetState {
    /// Nothing, or an empty folder.
    Nothing,
    /// A result.
    Result {
        manifest: Manifest,
        /// Its files that are not as they were written.
        changed: Vec<String>,
        /// Its files that are, as they were when that was found.
        seen: BTreeMap<String, FileStamp>,
    },
}

/// By what it is known that a file was not touched, without reading it again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct FileStamp {
    bytes: u64,
    modified: Option<SystemTime>,
}

impl FileStamp {
    fn of(there: &Metadata) -> Self {
        Self { bytes: there.len(), modified: there.modified().ok() }
    }
}

/// Looks at a target; what may not be replaced is an error. What an earlier look has seen is not read again.
pub(crate) fn look(target: &Path, place: &Path, before: &TargetState) -> Result<TargetState, OutputError> {
    let error = |source| OutputError::Io { path: target.to_owned(), source };
    let names = match names(place) {
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(TargetState::Nothing),
        names => names.map_err(error)?,
    };
    let Some(first) = names.first() else { return Ok(TargetState::Nothing) };
    let wrong = |why| OutputError::Manifest { path: target.join(MANIFEST), why };
    let Some(manifest) = Manifest::read(place).map_err(wrong)? else {
        let path = target.to_owned();
        // So that what an earlier version left is not called somebody's own.
        return Err(if names.iter().any(|name| name == RUN_FILE) {
            OutputError::Unlisted { path }
        } else {
            OutputError::Foreign { path, file: first.clone() }
        });
    };
    if let Some(file) = stranger(place, &manifest).map_err(error)? {
        return Err(OutputError::Stranger { path: target.to_owned(), file });
    }
    let known = match before {
        TargetState::Result { seen, .. } => Some(seen),
        TargetState::Nothing => None,
    };
    let (mut changed, mut seen) = (Vec::new(), BTreeMap::new());
    for (name, written) in &manifest.files {
        let path = place.join(name);
        let there = match fs::symlink_metadata(&path) {
            // What the user removed is no loss.
            Err(e) if e.kind() == io::ErrorKind::NotFound => continue,
            there => there.map_err(error)?,
        };
        let now = FileStamp::of(&there);
        let untouched = known.and_then(|known| known.get(name)).is_some_and(|seen| *seen == now);
        if there.is_file() && (untouched || checksum_within(place, name).map_err(error)? == *written) {
            seen.insert(name.clone(), now);
        } else {
            changed.push(name.clone());
        }
    }
    Ok(TargetState::Result { manifest, changed, seen })
}

/// The first thing in a result's folder that is not the result's, as seen from the folder.
fn stranger(place: &Path, manifest: &Manifest) -> io::Result<Option<String>> {
    let mut folders = vec![String::new()];
    while let Some(folder) = folders.pop() {
        for name in names(&place.join(&folder))? {
            let name = if folder.is_empty() { name } else { format!("{folder}/{name}") };
            if manifest.files.contains_key(&name) || name == MANIFEST {
                continue;
            }
            if !manifest.has_folder(&name) || !fs::symlink_metadata(place.join(&name))?.is_dir() {
                return Ok(Some(name));
            }
            folders.push(name);
        }
    }
    Ok(None)
}

/// What is in a folder, in the order of the names.
fn names(folder: &Path) -> io::Result<Vec<String>> {
    let names = fs::read_dir(folder)?.map(|entry| Ok(entry?.file_name().to_string_lossy().into_owned()));
    let mut names = names.collect::<io::Result<Vec<String>>>()?;
    names.sort();
    Ok(names)
}

/// Removes the files that a result owns and that are as they were written, and the folders that are empty then.
pub(crate) fn remove_owned(
    folder: &Path,
    manifest: &Manifest,
    seen: &BTreeMap<String, FileStamp>,
) -> io::Result<()> {
    for (name, written) in &manifest.files {
        let path = folder.join(name);
        let Ok(there) = fs::symlink_metadata(&path) else { continue };
        let untouched = seen.get(name).is_some_and(|seen| *seen == FileStamp::of(&there));
        if there.is_file() && (untouched || checksum_within(folder, name)? == *written) {
            fs::remove_file(&path)?;
        }
    }
    remove_empty_folders(folder, manifest.files.keys());
    // Without the list, what is left would be nobody's: it goes last, and only from a folder that is empty otherwise.
    if names(folder)? == [MANIFEST] {
        fs::remove_file(folder.join(MANIFEST))?;
        fs::remove_dir(folder)?;
    }
    Ok(())
}

/// Removes the folders of these files, as far as they are empty.
pub(crate) fn remove_empty_folders<'a>(root: &Path, files: impl Iterator<Item = &'a String>) {
    let mut folders: Vec<&Path> = files.flat_map(|name| Path::new(name).ancestors().skip(1)).collect();
    folders.retain(|folder| !folder.as_os_str().is_empty());
    // The inner ones first.
    folders.sort_by_key(|folder| std::cmp::Reverse(folder.components().count()));
    folders.dedup();
    for folder in folders {
        // One that is not empty stays.
        let _ = fs::remove_dir(root.join(folder));
    }
}

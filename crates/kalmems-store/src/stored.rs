//! Results that stand in their places, for who looks at them.

use crate::manifest::Manifest;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// Folders below folders that are looked into.
const DEPTH: usize = 12;

/// A result by the list of its files.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StoredResult {
    /// The command that made it.
    pub command: String,
    /// The file that describes the work, seen from the result, or the name of the work.
    pub of: String,
    /// Its files by their names as seen from the folder, with `/` between folders.
    pub files: BTreeSet<String>,
}

impl StoredResult {
    /// Reads the list of a folder; `None` where there is none, or none that this version knows.
    pub fn read(folder: &Path) -> Option<Self> {
        let Manifest { command, of, files, .. } = Manifest::read(folder).ok().flatten()?;
        Some(Self { command, of, files: files.into_keys().collect() })
    }

    /// The results in a folder and below it, at most so many, by their places as seen from it; the folder itself is `""`. Links are not
    /// followed, and folders whose names begin with a point are passed over.
    pub fn within(folder: &Path, most: usize) -> Vec<(PathBuf, Self)> {
        let mut found = Vec::new();
        let mut folders = vec![(PathBuf::new(), 0)];
        while let Some((next, depth)) = folders.pop() {
            if found.len() == most {
                break;
            }
            if let Some(result) = Self::read(&folder.join(&next)) {
                found.push((next, result));
                continue;
            }
            let entries = fs::read_dir(folder.join(&next)).into_iter().flatten().flatten();
            // The type of an entry is that of a link, where it is one.
            let below = entries.filter(|entry| {
                entry.file_type().is_ok_and(|kind| kind.is_dir())
                    && !entry.file_name().as_encoded_bytes().starts_with(b".")
            });
            if depth < DEPTH {
                folders.extend(below.map(|entry| (next.join(entry.file_name()), depth + 1)));
            }
        }
        found.sort_by(|(a, _), (b, _)| a.cmp(b));
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Output, Work};

    #[test]
    fn results_are_found_below_a_folder_and_not_beyond_a_link() {
        let folder = tempfile::tempdir().unwrap();
        let elsewhere = tempfile::tempdir().unwrap();
        let make = |place: PathBuf| {
            let output = Output::begin(&place, &Work::named("estimate", "a")).unwrap();
            output.write("figures/a.svg", |w| w.write_all(b"<svg/>")).unwrap();
            output.commit().unwrap();
        };
        make(folder.path().join("one"));
        make(folder.path().join("deep/two"));
        make(folder.path().join(".hidden/three"));
        make(elsewhere.path().join("four"));
        #[cfg(unix)]
        std::os::unix::fs::symlink(elsewhere.path(), folder.path().join("link")).unwrap();
        let found = StoredResult::within(folder.path(), 10);
        let places: Vec<&str> = found.iter().map(|(place, _)| place.to_str().unwrap()).collect();
        assert_eq!(places, [Path::new("deep").join("two").to_str().unwrap(), "one"]);
        assert_eq!(found[0].1.command, "estimate");
        assert!(found[0].1.files.contains("figures/a.svg"));
        assert_eq!(StoredResult::within(&folder.path().join("one"), 10)[0].0, Path::new(""));
        assert_eq!(StoredResult::within(folder.path(), 1).len(), 1);
    }
}

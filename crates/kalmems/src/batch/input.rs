//! The recordings of a batch, and their names.

use super::BatchError;
use crate::array_experiment::ArrayRecording;
use std::collections::BTreeSet;
use std::path::{Component, Path, PathBuf};

/// A recording of a batch.
#[derive(Clone, Debug)]
pub struct BatchRecording {
    /// What it is called in the results.
    pub name: String,
    /// Where its samples are.
    pub content: BatchContent,
}

/// Where the samples of a recording of a batch are.
#[derive(Clone, Debug)]
pub enum BatchContent {
    /// In a file.
    File(PathBuf),
    /// In memory.
    Arrays(Box<ArrayRecording>),
}

impl BatchRecording {
    /// The files that these paths and patterns name, each once. They are called as the files are, without folder and ending; where two were called
    /// the same, with the folder in which they differ, and then with the ending.
    ///
    /// A pattern is one of the crate [`glob`]: `*` within a name, `**` over folders, `?`, `[a-z]`. Its files are in the order of their names.
    ///
    /// # Errors
    /// A pattern that is wrong, or that no file matches. A file that is named without a pattern is not looked for: a batch says of it that it is not there.
    pub fn of_files<'a>(patterns: impl IntoIterator<Item = &'a str>) -> Result<Vec<Self>, BatchError> {
        let mut files: Vec<PathBuf> = Vec::new();
        let mut known = BTreeSet::new();
        for pattern in patterns {
            for file in matching(pattern)? {
                if known.insert(file.canonicalize().unwrap_or_else(|_| file.clone())) {
                    files.push(file);
                }
            }
        }
        let names = names_of(&files);
        let named = names.into_iter().zip(files);
        Ok(named.map(|(name, file)| Self { name, content: BatchContent::File(file) }).collect())
    }
}

/// The files that a pattern stands for; itself, where it is a path.
fn matching(pattern: &str) -> Result<Vec<PathBuf>, BatchError> {
    let path = PathBuf::from(pattern);
    if path.exists() || !pattern.contains(['*', '?', '[']) {
        return Ok(vec![path]);
    }
    let wrong = |why: String| BatchError::Pattern { pattern: pattern.to_owned(), why };
    let found = glob::glob(pattern).map_err(|error| wrong(error.to_string()))?;
    let found: Result<Vec<PathBuf>, _> = found.collect();
    let mut found = found.map_err(|error| wrong(error.to_string()))?;
    found.retain(|path| path.is_file());
    if found.is_empty() {
        return Err(BatchError::NoFile { pattern: pattern.to_owned() });
    }
    Ok(found)
}

/// Names of files that tell them apart, as short as they can be.
fn names_of(files: &[PathBuf]) -> Vec<String> {
    let stem =
        |path: &Path| path.file_stem().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let shared = shared_folder(files);
    let folders = |path: &Path, last: String| {
        let steps = path.parent().unwrap_or(Path::new("")).components().skip(shared);
        let steps = steps.filter_map(|step| match step {
            Component::Normal(name) => Some(name.to_string_lossy().into_owned()),
            _ => None,
        });
        steps.chain([last]).collect::<Vec<String>>().join("_")
    };
    let whole =
        |path: &Path| path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let ways: [&dyn Fn(&Path) -> String; 3] =
        [&stem, &|path| folders(path, stem(path)), &|path| folders(path, whole(path))];
    let mut names = Vec::new();
    for way in ways {
        names = files.iter().map(|file| way(file)).collect();
        if are_distinct(&names) {
            break;
        }
    }
    distinct(names)
}

/// How many steps the folders of all files have in common.
fn shared_folder(files: &[PathBuf]) -> usize {
    let folders: Vec<Vec<Component>> =
        files.iter().filter_map(|file| file.parent()).map(|folder| folder.components().collect()).collect();
    let Some((first, others)) = folders.split_first() else { return 0 };
    (0..first.len())
        .take_while(|place| others.iter().all(|other| other.get(*place) == first.get(*place)))
        .count()
}

fn are_distinct(names: &[String]) -> bool {
    let known: BTreeSet<String> = names.iter().map(|name| name.to_lowercase()).collect();
    known.len() == names.len()
}

/// The same names, where one that was there before, in capitals or not, has a number behind it.
pub(super) fn distinct(names: Vec<String>) -> Vec<String> {
    let mut known = BTreeSet::new();
    let one = |name: String| {
        let numbered = (2..).map(|number| format!("{name}_{number}"));
        let free =
            std::iter::once(name.clone()).chain(numbered).find(|name| known.insert(name.to_lowercase()));
        free.unwrap_or(name)
    };
    names.into_iter().map(one).collect()
}

/// A name as that of a file on any system.
pub(super) fn file_name(name: &str) -> String {
    let safe = |c: char| if c.is_ascii_alphanumeric() || "-_+=.".contains(c) { c } else { '_' };
    let safe: String = name.chars().map(safe).collect();
    match safe.trim_start_matches('.') {
        "" => "recording".to_owned(),
        name => name.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_as_short_as_distinguishes_files() {
        let names = |files: &[&str]| names_of(&files.iter().map(PathBuf::from).collect::<Vec<_>>());
        assert_eq!(names(&["a/one.csv", "a/two.h5"]), ["one", "two"]);
        assert_eq!(names(&["lab/mon/scan.csv", "lab/tue/scan.csv"]), ["mon_scan", "tue_scan"]);
        assert_eq!(names(&["scan.csv", "scan.h5", "SCAN.mat"]), ["scan.csv", "scan.h5", "SCAN.mat"]);
        assert_eq!(names(&["a_b/c.csv", "a/b_c.csv"]), ["c", "b_c"]);
        assert_eq!(distinct(["x", "X", "x"].map(str::to_owned).to_vec()), ["x", "X_2", "x_3"]);
        assert_eq!(["day 1/scan:2", "..", "über"].map(file_name), ["day_1_scan_2", "recording", "_ber"]);
    }

    #[test]
    fn a_pattern_gives_each_file_once_and_one_that_matches_none_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["b.csv", "a.csv", "c.txt"] {
            std::fs::write(folder.path().join(name), "").unwrap();
        }
        let within = |pattern: &str| format!("{}/{pattern}", folder.path().display());
        let (all, one) = (within("*.csv"), within("a.csv"));
        let found = BatchRecording::of_files([all.as_str(), one.as_str()]).unwrap();
        assert_eq!(found.iter().map(|one| one.name.as_str()).collect::<Vec<_>>(), ["a", "b"]);
        let (none, wrong) = (within("*.h5"), within("[a.csv"));
        assert!(matches!(BatchRecording::of_files([none.as_str()]), Err(BatchError::NoFile { .. })));
        assert!(matches!(BatchRecording::of_files([wrong.as_str()]), Err(BatchError::Pattern { .. })));
    }
}

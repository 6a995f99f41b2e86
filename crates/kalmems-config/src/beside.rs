//! Files that were read beside a recording.

use std::any::Any;
use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// What was read from a file.
pub type ReadFile = Arc<dyn Any + Send + Sync>;

/// What was read of files beside a recording, for experiments that differ in numbers and name the same files: each direction of an uncertainty and each
/// trial of a diagnosis would read them again.
///
/// Copies share the memory, and of each file it is that which was read last. Whoever takes it sees to it that the file is still the same.
#[derive(Clone, Default)]
pub struct FilesBeside(Arc<Mutex<BTreeMap<PathBuf, ReadFile>>>);

impl FilesBeside {
    /// What was read of a file last.
    pub fn get(&self, file: &Path) -> Option<ReadFile> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).get(file).cloned()
    }

    /// Keeps what was read of a file.
    pub fn put(&self, file: PathBuf, read: ReadFile) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).insert(file, read);
    }
}

/// What was read changes nothing of what an experiment says.
impl PartialEq for FilesBeside {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl fmt::Debug for FilesBeside {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("FilesBeside")
    }
}

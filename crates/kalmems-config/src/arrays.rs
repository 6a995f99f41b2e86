//! Arrays in memory instead of files that an experiment names.

use kalmems_formats::Arrays;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Arrays by the file in whose place they stand, as the experiment names it: whoever would open that file reads them.
///
/// Copies share the memory.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ArraysByFile(Arc<BTreeMap<PathBuf, Arrays>>);

impl ArraysByFile {
    /// Those instead of a file.
    pub fn get(&self, file: &Path) -> Option<Arrays> {
        self.0.get(file).cloned()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

impl FromIterator<(PathBuf, Arrays)> for ArraysByFile {
    fn from_iter<T: IntoIterator<Item = (PathBuf, Arrays)>>(arrays: T) -> Self {
        Self(Arc::new(arrays.into_iter().collect()))
    }
}

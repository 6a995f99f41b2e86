//! A file of whichever format.

use crate::{CsvHints, FormatError, Table, csv};
use std::path::Path;

/// What an experiment file says of a file beyond its path.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Hints {
    /// Where the table is in a file of several.
    pub group: Option<String>,
    /// The names of the columns, in their order.
    pub columns: Option<Vec<String>>,
    /// How text is written.
    pub csv: CsvHints,
}

/// Opens a table.
pub fn open(path: &Path, hints: &Hints) -> Result<Box<dyn Table>, FormatError> {
    csv::open_csv(path, hints)
}

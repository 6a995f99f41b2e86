//! Text, a row a line.

use crate::source::ReadSeek;
use crate::{FormatError, Hints, Table};
use std::path::Path;

/// Opens a text file, or a pipe.
pub fn open_csv(path: &Path, hints: &Hints) -> Result<Box<dyn Table>, FormatError> {
    from_reader(Box::new(std::fs::File::open(path)?), hints)
}

/// Opens text that is no file on its own.
pub(crate) fn from_reader(_file: Box<dyn ReadSeek>, _hints: &Hints) -> Result<Box<dyn Table>, FormatError> {
    Err(FormatError::Unsupported {
        format: "CSV",
        what: "text".to_owned(),
        remedy: "use another format".to_owned(),
    })
}

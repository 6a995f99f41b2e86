//! Text, a row a line, in the dialects that instruments write.

mod cell;
mod dialect;
mod grouped;
mod hints;
mod input;
mod later;
pub(crate) mod number;
mod split;
mod table;
mod utf16;

pub use cell::CellReader;
pub(crate) use cell::excerpt;
pub use dialect::is_value;
pub use grouped::may_be_grouped;
pub use hints::CsvHints;

use crate::{Hints, ReadSeek, Result, Table};
use input::CsvInput;
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Opens a text file, or a pipe: it is read once, from front to back.
pub fn open_csv(path: &Path, hints: &Hints) -> Result<Box<dyn Table>> {
    let file = File::open(path)?;
    let metadata = file.metadata()?;
    let total = if metadata.is_file() { metadata.len() } else { 0 };
    from_input(CsvInput::new(Box::new(file), total), hints)
}

/// Opens text that is read once, from front to back, such as the beginning of a pipe and its rest.
pub fn read_csv(text: impl Read + Send + 'static, hints: &Hints) -> Result<Box<dyn Table>> {
    from_input(CsvInput::new(Box::new(text), 0), hints)
}

/// Opens text that is no file on its own.
pub(crate) fn from_reader(mut file: Box<dyn ReadSeek>, hints: &Hints) -> Result<Box<dyn Table>> {
    let total = file.seek(std::io::SeekFrom::End(0))?;
    file.seek(std::io::SeekFrom::Start(0))?;
    from_input(CsvInput::new(Box::new(file), total), hints)
}

fn from_input(mut input: CsvInput, hints: &Hints) -> Result<Box<dyn Table>> {
    let dialect = dialect::recognise(&mut input, hints)?;
    Ok(Box::new(table::CsvTable::new(input, dialect)))
}

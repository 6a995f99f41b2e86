//! What is told of a file before it is read, and of a pipe from its beginning.

use super::StatedFile;
use super::survey::{ColumnSurvey, survey as survey_table};
use crate::recording::ReadError;
use crate::recording::read::ReadProgress;
use kalmems_formats::Table;
use std::fs::File;
use std::io::{Cursor, Read};
use std::path::Path;

/// As much of a pipe is kept to tell what its columns are.
const BEGINNING: u64 = 1 << 22;

/// The survey and the table to be read after it: a file is read twice, of a pipe the beginning is kept.
pub(super) fn survey(
    path: &Path,
    stated: &StatedFile,
    progress: ReadProgress,
) -> Result<(ColumnSurvey, Box<dyn Table>), ReadError> {
    let hints = &stated.hints;
    let failed = |source| ReadError::of_format(path, source);
    let file = |source| ReadError::Io { file: path.display().to_string(), source };
    let open = || kalmems_formats::open(path, hints).map_err(failed);
    if std::fs::metadata(path).map_err(file)?.is_file() {
        return Ok((survey_table(open()?, path, stated, progress)?, open()?));
    }
    let mut pipe = File::open(path).map_err(file)?;
    let mut beginning = Vec::new();
    pipe.by_ref().take(BEGINNING).read_to_end(&mut beginning).map_err(file)?;
    let whole = (beginning.len() as u64) < BEGINNING;
    // The last line may be cut.
    let lines = beginning.iter().rposition(|byte| *byte == b'\n').filter(|_| !whole);
    let lines = beginning.get(..lines.map_or(beginning.len(), |end| end + 1)).unwrap_or_default().to_vec();
    let bytes = lines.len();
    let table = kalmems_formats::read_csv(Cursor::new(lines), hints).map_err(failed)?;
    let mut survey = survey_table(table, path, stated, progress)?;
    if !whole {
        survey
            .sentences
            .push(format!("This was recognised in the first {bytes} bytes, as a pipe is read only once."));
    }
    let table = kalmems_formats::read_csv(Cursor::new(beginning).chain(pipe), hints).map_err(failed)?;
    Ok((survey, table))
}

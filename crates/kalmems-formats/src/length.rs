//! Whether a file is long, without reading it.

use crate::{Hints, Result, open};
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::Path;

/// Whether a file has more rows than `most`: as it says itself, and of text by its lines, of which only so many are looked
/// at.
///
/// Lines above and between the rows count as well: of a file with nearly as many rows it is not exact.
///
/// # Errors
/// Where the file cannot be opened as a table.
pub fn has_more_rows(path: &Path, hints: &Hints, most: u64) -> Result<bool> {
    if let Some(rows) = open(path, hints)?.description().rows {
        return Ok(rows > most);
    }
    let mut file = BufReader::with_capacity(1 << 16, File::open(path)?);
    let mut lines = 0_u64;
    loop {
        let chunk = file.fill_buf()?;
        if chunk.is_empty() {
            return Ok(false);
        }
        // So few at a time that a byte holds their count: many bytes are counted side by side.
        for part in chunk.chunks(255) {
            lines += u64::from(part.iter().map(|byte| u8::from(*byte == b'\n')).sum::<u8>());
        }
        if lines > most {
            return Ok(true);
        }
        let length = chunk.len();
        file.consume(length);
    }
}

//! How much of a file is believed before it is read.

use crate::{FormatError, Result};
use std::fmt::Display;

/// Bytes of a header, of the metadata of one object, or of the values of labels that are kept in memory.
pub(crate) const HEADER_BYTES: u64 = 16 << 20;
/// Columns of a table, and objects that are looked at for columns.
pub(crate) const COLUMNS: usize = 65_536;
/// Bytes of a name, a unit or another short text.
pub(crate) const TEXT_BYTES: usize = 4096;
/// Bytes of one row.
pub(crate) const ROW_BYTES: usize = 4 << 20;
/// Bytes that are decoded together; a block of wide rows has fewer rows instead.
pub(crate) const BLOCK_BYTES: usize = 8 << 20;
/// Rows for each byte of a file: what a constant column packs to. More is a claim without data.
const ROWS_PER_BYTE: u64 = 4096;
/// What deflate can unpack from one byte at most, by its format.
const UNPACKED_PER_BYTE: u64 = 1032;

/// Refuses what is larger than a limit.
pub(crate) fn at_most(
    format: &'static str,
    what: &str,
    found: impl TryInto<u64>,
    limit: impl TryInto<u64>,
) -> Result<()> {
    let [found, limit] = [found.try_into().unwrap_or(u64::MAX), limit.try_into().unwrap_or(u64::MAX)];
    if found <= limit {
        return Ok(());
    }
    Err(FormatError::TooLarge { format, what: what.to_owned(), found, limit })
}

/// Adds one of many things, of which a file has at most as many as columns.
pub(crate) fn push<T>(format: &'static str, what: &str, all: &mut Vec<T>, one: T) -> Result<()> {
    at_most(format, what, all.len() + 1, COLUMNS)?;
    all.push(one);
    Ok(())
}

/// Refuses more rows than a file of its length can hold.
pub(crate) fn plausible_rows(format: &'static str, rows: u64, file_bytes: u64) -> Result<()> {
    let limit = file_bytes.saturating_mul(ROWS_PER_BYTE);
    at_most(format, "the number of rows that it claims", rows, limit)
}

/// Refuses a length that the packed bytes cannot unpack to.
pub(crate) fn plausible_unpacked(format: &'static str, what: &str, unpacked: u64, packed: u64) -> Result<()> {
    let limit = packed.saturating_add(64).saturating_mul(UNPACKED_PER_BYTE);
    at_most(format, &format!("what {what} claims to unpack to"), unpacked, limit)
}

/// A few of many things, for messages.
pub(crate) fn list(things: &[impl Display]) -> String {
    const SHOWN: usize = 8;
    let mut text = things.iter().take(SHOWN).map(ToString::to_string).collect::<Vec<_>>().join(", ");
    if things.len() > SHOWN {
        text.push_str(&format!(" and {} more", things.len() - SHOWN));
    }
    text
}

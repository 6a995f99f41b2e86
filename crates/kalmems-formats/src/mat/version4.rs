//! MAT files of version 4: matrices one after the other, each behind a header of 20 bytes and its name (MathWorks,
//! MAT-File Format, appendix on level 4).

use super::MatVariables;
use super::array::{MatValue, MatVariable};
use crate::cursor::ByteCursor;
use crate::element::{CellPlaces, Element, ElementKind};
use crate::source::SharedFile;
use crate::stream::FileStretch;
use crate::{FormatError, Result, limits};
use std::sync::Arc;

pub(super) const FORMAT: &str = "MAT 4";
/// Bytes before a matrix' name.
const HEADER: u64 = 20;

/// What a header says.
struct Mat4Header {
    element: Element,
    /// 0 numbers, 1 text, 2 sparse.
    kind: u32,
    rows: u64,
    columns: u64,
    complex: bool,
    name_bytes: usize,
}

/// Whether bytes begin as such a file does: a header that holds what it can, and a name behind it.
pub(crate) fn begins(beginning: &[u8]) -> bool {
    let Some(header) = beginning.get(..20).and_then(Mat4Header::read) else { return false };
    let name = beginning.get(20..20 + header.name_bytes).unwrap_or_default();
    let Some((0, letters)) = name.split_last() else { return false };
    letters.first().is_some_and(u8::is_ascii_alphabetic)
        && letters.iter().all(|letter| letter.is_ascii_alphanumeric() || *letter == b'_')
}

impl Mat4Header {
    /// None where it is no header.
    fn read(bytes: &[u8]) -> Option<Self> {
        // The thousands say which order of bytes it is, in that order.
        let of_order = |big_endian: bool| {
            let mut words = ByteCursor::new(FORMAT, bytes, 0).with(0, big_endian);
            let mut word = || words.u32().ok();
            let (code, rows, columns, complex, name) = (word()?, word()?, word()?, word()?, word()?);
            let (machine, zero, number, kind) = (code / 1000, code / 100 % 10, code / 10 % 10, code % 10);
            let (element, bytes) = match number {
                0 => (ElementKind::Float, 8),
                1 => (ElementKind::Float, 4),
                2 => (ElementKind::Signed, 4),
                3 => (ElementKind::Signed, 2),
                4 => (ElementKind::Unsigned, 2),
                5 => (ElementKind::Unsigned, 1),
                _ => return None,
            };
            let name_bytes = name as usize;
            let is_header = machine == u32::from(big_endian)
                && zero == 0
                && kind <= 2
                && complex <= 1
                && (2..=limits::TEXT_BYTES).contains(&name_bytes);
            is_header.then_some(Self {
                element: Element { kind: element, bytes, big_endian },
                kind,
                rows: u64::from(rows),
                columns: u64::from(columns),
                complex: complex == 1,
                name_bytes,
            })
        };
        of_order(false).or_else(|| of_order(true))
    }
}

/// All matrices, and the stretch that they are in.
pub(super) fn variables(source: &Arc<SharedFile>) -> Result<MatVariables> {
    let stretch = FileStretch::stored(Arc::clone(source), FORMAT, "the file");
    let mut found = Vec::new();
    let mut at = 0;
    let mut text_bytes = limits::HEADER_BYTES;
    while at < source.length() {
        let bytes = source.bytes(FORMAT, at, 20)?;
        let header = Mat4Header::read(&bytes).ok_or_else(|| {
            let found = format!("`{}`", bytes.escape_ascii());
            FormatError::damaged(FORMAT, format!("byte {at}"), found, "the header of a matrix")
        })?;
        let name = source.bytes(FORMAT, at + HEADER, header.name_bytes as u64)?;
        let name = String::from_utf8_lossy(name.strip_suffix(&[0]).unwrap_or(&name)).into_owned();
        let place = at + HEADER + header.name_bytes as u64;
        // All three are of 32 bits, or a few.
        let count = u128::from(header.rows) * u128::from(header.columns) * if header.complex { 2 } else { 1 };
        let length = u64::try_from(count * header.element.bytes as u128).unwrap_or(u64::MAX);
        at = source.within(FORMAT, place, length)?;
        let (rows, columns, element) = (header.rows, header.columns, header.element);
        let value = match header.kind {
            _ if header.complex => MatValue::Other("complex numbers"),
            0 => MatValue::Numbers { place, element, rows, columns },
            1 => {
                let taken = length.saturating_add(rows.saturating_mul(64));
                limits::at_most(FORMAT, "the length of texts", taken, text_bytes)?;
                text_bytes -= taken;
                MatValue::Texts(texts(source, place, &header)?)
            }
            _ => MatValue::Other("a sparse matrix"),
        };
        let variable = (stretch.clone(), MatVariable { name, value });
        limits::push(FORMAT, "the number of variables", &mut found, variable)?;
    }
    Ok(found)
}

/// Characters by their numbers, column after column: a text a row.
fn texts(source: &SharedFile, place: u64, header: &Mat4Header) -> Result<Vec<Vec<u8>>> {
    // Bounded by the length of texts.
    let small = |length: u64| usize::try_from(length).unwrap_or(0);
    let (rows, count) = (small(header.rows), small(header.rows * header.columns));
    let raw = source.bytes(FORMAT, place, (count * header.element.bytes) as u64)?;
    let mut numbers = Vec::new();
    let cells = CellPlaces { raw: &raw, offset: 0, stride: header.element.bytes, rows: count };
    header.element.numbers(cells, 0, &mut numbers);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    // what is no character becomes one that says so
    let letter = |number: &f64| char::from_u32(*number as u32).unwrap_or(char::REPLACEMENT_CHARACTER);
    Ok(super::array::texts(&numbers.iter().map(letter).collect::<Vec<char>>(), rows))
}

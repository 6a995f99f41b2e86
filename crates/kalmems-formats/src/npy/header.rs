//! The header of an array: its shape and what an element is made of.

use super::literal::{self, Literal};
use crate::element::{Element, ElementKind};
use crate::limits;
use crate::records::{StoredCell, TextEncoding};
use crate::time::{TimeCode, TimeForm, TimeKind, TimeUnit};
use crate::{FormatError, Result, refuse_if};

/// An array.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct NpyHeader {
    /// Bytes before the first element.
    pub(super) bytes: u64,
    pub(super) shape: Vec<u64>,
    /// The first axis runs fastest.
    pub(super) fortran: bool,
    pub(super) element: Descr,
}

/// What an element is.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Descr {
    Plain(Cell),
    /// Fields with names, one after the other.
    Fields(Vec<(String, Cell)>),
}

/// What is at one place of an element.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Cell {
    Stored(StoredCell),
    /// Complex numbers, arrays, padding.
    Other {
        bytes: usize,
        what: String,
    },
}

impl Cell {
    pub(super) fn bytes(&self) -> usize {
        match self {
            Self::Stored(cell) => cell.bytes(),
            Self::Other { bytes, .. } => *bytes,
        }
    }
}

impl Descr {
    pub(super) fn bytes(&self) -> usize {
        match self {
            Self::Plain(cell) => cell.bytes(),
            Self::Fields(fields) => fields.iter().map(|(_, cell)| cell.bytes()).sum(),
        }
    }
}

impl NpyHeader {
    /// Reads a header by way of `next`, which gives the next bytes.
    pub(super) fn read(
        format: &'static str,
        place: &str,
        mut next: impl FnMut(usize) -> Result<Vec<u8>>,
    ) -> Result<Self> {
        let damaged = |found: String, expected: &str| FormatError::damaged(format, place, found, expected);
        let magic = next(8)?;
        refuse_if(!magic.starts_with(b"\x93NUMPY"), || {
            damaged(format!("`{}`", magic.escape_ascii()), "an array, which begins with \\x93NUMPY")
        })?;
        let (version, width) = (magic[6], if magic[6] == 1 { 2 } else { 4 });
        refuse_if(!(1..=3).contains(&version), || {
            damaged(format!("version {version}"), "version 1, 2 or 3")
        })?;
        let length = next(width)?.iter().rev().fold(0, |length, byte| length << 8 | u64::from(*byte));
        limits::at_most(format, "the length of the header", length, limits::HEADER_BYTES / 16)?;
        #[allow(clippy::cast_possible_truncation)] // bounded by the line above
        let raw = next(length as usize)?;
        // Versions 1 and 2 are Latin-1.
        let text = match String::from_utf8(raw) {
            Ok(text) => text,
            Err(bytes) if version < 3 => bytes.as_bytes().iter().map(|byte| char::from(*byte)).collect(),
            Err(_) => return Err(damaged("a header that is no UTF-8".to_owned(), "UTF-8")),
        };
        let parsed = literal::parse(&text).map_err(|(at, expected)| {
            damaged(format!("`{}` at byte {at} of the header", excerpt(&text, at)), expected)
        })?;
        let Literal::Named(entries) = parsed else {
            return Err(damaged("a header without keys".to_owned(), "descr, fortran_order and shape"));
        };
        let entry = |key: &str| entries.iter().find(|(name, _)| name == key).map(|(_, value)| value);
        let (Some(descr), Some(Literal::Flag(fortran)), Some(Literal::Several(shape))) =
            (entry("descr"), entry("fortran_order"), entry("shape"))
        else {
            return Err(damaged("a header without its keys".to_owned(), "descr, fortran_order and shape"));
        };
        let shape = shape
            .iter()
            .map(|length| match length {
                Literal::Integer(length) => Ok(*length),
                _ => Err(damaged("a shape of other things than numbers".to_owned(), "such as (200, 3)")),
            })
            .collect::<Result<Vec<_>, _>>()?;
        let element = descr_of(descr).map_err(|found| damaged(found, "a type such as '<f8'"))?;
        limits::at_most(format, "the bytes of an element", element.bytes(), limits::ROW_BYTES)?;
        Ok(Self { bytes: 8 + width as u64 + length, shape, fortran: *fortran, element })
    }

    /// All elements, and their bytes.
    pub(super) fn size(&self, format: &'static str) -> Result<(u64, u64)> {
        let count = self.shape.iter().try_fold(1_u64, |count, length| count.checked_mul(*length));
        let bytes = count.and_then(|count| count.checked_mul(self.element.bytes() as u64));
        match (count, bytes) {
            (Some(count), Some(bytes)) if bytes < 1 << 62 => Ok((count, bytes)),
            _ => Err(FormatError::TooLarge {
                format,
                what: "the number of elements".to_owned(),
                found: u64::MAX,
                limit: 1 << 62,
            }),
        }
    }
}

fn excerpt(text: &str, at: usize) -> String {
    text.get(at..).unwrap_or_default().chars().take(24).collect()
}

fn descr_of(descr: &Literal) -> Result<Descr, String> {
    match descr {
        Literal::Text(code) => cell(code).map(Descr::Plain),
        Literal::Several(fields) => {
            refuse_if(fields.len() > limits::COLUMNS, || format!("{} fields", fields.len()))?;
            let mut named = Vec::with_capacity(fields.len());
            for field in fields {
                named.push(self::field(field)?);
            }
            // Sums of lengths stay far below 2⁶⁴.
            Ok(Descr::Fields(named))
        }
        _ => Err("a type that is neither a text nor a list".to_owned()),
    }
}

/// A name with a type, and a shape where it is an array.
fn field(field: &Literal) -> Result<(String, Cell), String> {
    let (names, code, shape) = match field {
        Literal::Several(parts) if parts.len() == 2 => (&parts[0], &parts[1], None),
        Literal::Several(parts) if parts.len() == 3 => (&parts[0], &parts[1], Some(&parts[2])),
        _ => return Err("a field that is no tuple of a name, a type and a shape".to_owned()),
    };
    let name = match names {
        Literal::Text(name) => Some(name),
        // A title before the name.
        Literal::Several(names) => names.get(1).and_then(Literal::text),
        _ => None,
    };
    let name = name.ok_or("a field without a name")?.clone();
    let inner = match code {
        Literal::Text(code) => cell(code)?,
        Literal::Several(_) => {
            Cell::Other { bytes: descr_of(code)?.bytes(), what: "fields within a field".to_owned() }
        }
        _ => return Err(format!("no type for the field `{name}`")),
    };
    if let Cell::Other { bytes: 0, what } = &inner {
        // Where the fields behind it are is not known.
        return Err(format!("`{name}`: {what}"));
    }
    let shape = match shape {
        None => &[][..],
        Some(Literal::Several(shape)) => shape,
        Some(_) => return Err(format!("a shape of `{name}` that is no tuple")),
    };
    let mut count = 1_u64;
    for length in shape {
        let Literal::Integer(length) = length else {
            return Err(format!("a shape of `{name}` that is none"));
        };
        count = count.saturating_mul(*length);
        refuse_if(count > limits::ROW_BYTES as u64, || {
            format!("a field `{name}` of more than {} elements", limits::ROW_BYTES)
        })?;
    }
    if count == 1 {
        return Ok((name, inner));
    }
    #[allow(clippy::cast_possible_truncation)] // at most ROW_BYTES
    let bytes = inner.bytes().saturating_mul(count as usize);
    Ok((name, Cell::Other { bytes, what: "an array in each row".to_owned() }))
}

/// The type of a code such as `<f8`.
fn cell(code: &str) -> Result<Cell, String> {
    let unknown = || format!("the type `{}`", code.chars().take(24).collect::<String>());
    let (order, rest) = code.split_at_checked(1).ok_or_else(unknown)?;
    refuse_if(!matches!(order, "<" | ">" | "|" | "="), unknown)?;
    let (kind, rest) = rest.split_at_checked(1).ok_or_else(unknown)?;
    if kind == "O" {
        return Ok(Cell::Other { bytes: 0, what: "Python objects, which only Python reads".to_owned() });
    }
    let end = rest.find(|letter: char| !letter.is_ascii_digit()).unwrap_or(rest.len());
    let (digits, after) = rest.split_at(end);
    let size: usize = digits.parse().map_err(|_| unknown())?;
    refuse_if(size > limits::ROW_BYTES, unknown)?;
    let big_endian = order == ">";
    let number = |kind| {
        let element = Element { kind, bytes: size, big_endian };
        if element.exists() {
            Cell::Stored(StoredCell::Number(element))
        } else {
            Cell::Other { bytes: size, what: format!("numbers of type `{code}`") }
        }
    };
    Ok(match kind {
        "f" => number(ElementKind::Float),
        "i" => number(ElementKind::Signed),
        "u" => number(ElementKind::Unsigned),
        // 0 and 1.
        "b" if size == 1 => number(ElementKind::Unsigned),
        "S" | "a" => Cell::Stored(StoredCell::Text { bytes: size, code: TextEncoding::Bytes }),
        "U" => Cell::Stored(StoredCell::Text { bytes: size * 4, code: TextEncoding::Utf32 { big_endian } }),
        "c" => Cell::Other { bytes: size, what: "complex numbers".to_owned() },
        "M" | "m" if size == 8 => match time_unit(after) {
            Some(unit) => {
                let element = Element { kind: ElementKind::Signed, bytes: size, big_endian };
                let kind = if kind == "M" { TimeKind::Calendar } else { TimeKind::Elapsed };
                Cell::Stored(StoredCell::Time(TimeCode { form: TimeForm::Integer(element), unit, kind }))
            }
            None => Cell::Other { bytes: size, what: format!("dates of {}", unknown()) },
        },
        "M" | "m" => Cell::Other { bytes: size, what: "dates".to_owned() },
        "V" => Cell::Other { bytes: size, what: "bytes without a meaning".to_owned() },
        _ => return Err(unknown()),
    })
}

/// The unit of dates and durations, such as `[ns]` or `[25us]`; none where it is months or years, which differ in length, or
/// not said.
fn time_unit(text: &str) -> Option<TimeUnit> {
    let inside = text.strip_prefix('[')?.strip_suffix(']')?;
    let letters = inside.find(|letter: char| !letter.is_ascii_digit())?;
    let (many, unit) = inside.split_at(letters);
    let many: u32 = if many.is_empty() { 1 } else { many.parse().ok()? };
    let (factor, power) = match unit {
        "W" => (604_800, 0),
        "D" => (86_400, 0),
        "h" => (3600, 0),
        "m" => (60, 0),
        "s" => (1, 0),
        "ms" => (1, -3),
        "us" => (1, -6),
        "ns" => (1, -9),
        "ps" => (1, -12),
        "fs" => (1, -15),
        "as" => (1, -18),
        _ => return None,
    };
    Some(TimeUnit { factor: many.checked_mul(factor)?, power, zero_s: 0 })
}

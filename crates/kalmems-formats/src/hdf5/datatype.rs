//! What the elements of a dataset are (HDF5 File Format Specification, section IV.A.2.d).

use super::file::MetadataCursor;
use crate::element::{self, Element};
use crate::records::{StoredCell, TextEncoding};
use crate::{Result, limits, refuse_if};

/// Types within one another.
const DEPTH: usize = 8;

/// What an element of a dataset is.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum DatatypeKind {
    Number(Element),
    /// A text of a fixed length.
    Text {
        bytes: usize,
    },
    /// A text of its own length.
    Texts,
    /// References to other objects.
    References,
    /// Fields with names, places and kinds.
    Fields {
        bytes: usize,
        fields: Vec<(String, usize, DatatypeKind)>,
    },
    Other(&'static str),
}

impl DatatypeKind {
    /// Bytes of an element; 0 where it has no fixed length.
    pub(super) fn bytes(&self) -> usize {
        match self {
            Self::Number(element) => element.bytes,
            Self::Text { bytes } | Self::Fields { bytes, .. } => *bytes,
            Self::Texts | Self::References | Self::Other(_) => 0,
        }
    }

    /// What stands at its place, if that has one length.
    pub(super) fn stored(&self) -> Option<StoredCell> {
        match self {
            Self::Number(element) => Some(StoredCell::Number(*element)),
            Self::Text { bytes } => Some(StoredCell::Text { bytes: *bytes, code: TextEncoding::Bytes }),
            _ => None,
        }
    }

    /// What it is, for messages.
    pub(super) fn what(&self) -> &'static str {
        match self {
            Self::Number(_) => "numbers",
            Self::Text { .. } | Self::Texts => "text",
            Self::References => "references",
            Self::Fields { .. } => "records with fields",
            Self::Other(what) => what,
        }
    }
}

/// Reads a type.
pub(super) fn read(cursor: &mut MetadataCursor<'_>) -> Result<DatatypeKind> {
    kind(cursor, DEPTH)
}

fn kind(cursor: &mut MetadataCursor<'_>, depth: usize) -> Result<DatatypeKind> {
    refuse_if(depth == 0, || cursor.damaged("types within one another", "no more than eight of them"))?;
    let head = cursor.u8()?;
    let (class, version) = (head & 15, head >> 4);
    #[allow(clippy::cast_possible_truncation)] // three bytes
    let bits = cursor.number(3)? as u32;
    let bytes = cursor.u32()? as usize;
    Ok(match class {
        0 => {
            let (offset, precision) = (cursor.u16()?, cursor.u16()?);
            let kind =
                if bits & 8 != 0 { element::ElementKind::Signed } else { element::ElementKind::Unsigned };
            if offset != 0 || usize::from(precision) != bytes.saturating_mul(8) {
                DatatypeKind::Other("integers with unused bits")
            } else {
                number(kind, bytes, bits & 1 != 0)
            }
        }
        1 => float(cursor, bits, bytes)?,
        3 if bytes > 0 => DatatypeKind::Text { bytes },
        3 => DatatypeKind::Other("texts without characters"),
        4 => {
            cursor.skip(4)?;
            DatatypeKind::Other("bits without a meaning")
        }
        2 => {
            cursor.skip(2)?;
            DatatypeKind::Other("times of HDF5's own kind")
        }
        5 => {
            cursor.skip((bits & 0xff) as usize)?;
            DatatypeKind::Other("bytes without a meaning")
        }
        6 => compound(cursor, version, (bits & 0xffff) as usize, bytes, depth)?,
        7 if bits.trailing_zeros() >= 4 => DatatypeKind::References,
        7 => DatatypeKind::Other("references to parts of datasets"),
        8 => {
            let base = kind(cursor, depth - 1)?;
            for _ in 0..bits & 0xffff {
                name(cursor, version)?;
            }
            cursor.skip(((bits & 0xffff) as usize).saturating_mul(base.bytes()))?;
            base
        }
        9 => {
            kind(cursor, depth - 1)?;
            if bits & 15 == 1 { DatatypeKind::Texts } else { DatatypeKind::Other("lists of several lengths") }
        }
        10 => {
            let axes = usize::from(cursor.u8()?);
            cursor.skip(if version < 3 { 3 + 8 * axes } else { 4 * axes })?;
            kind(cursor, depth - 1)?;
            DatatypeKind::Other("an array in each row")
        }
        11 => DatatypeKind::Other("complex numbers"),
        _ => return Err(cursor.damaged(format!("a type of class {class}"), "0 to 11")),
    })
}

fn number(kind: element::ElementKind, bytes: usize, big_endian: bool) -> DatatypeKind {
    let element = Element { kind, bytes, big_endian };
    if element.exists() {
        DatatypeKind::Number(element)
    } else {
        DatatypeKind::Other("numbers of an unusual length")
    }
}

/// Numbers of IEEE 754, as it lays out their bits.
fn float(cursor: &mut MetadataCursor<'_>, bits: u32, bytes: usize) -> Result<DatatypeKind> {
    let layout = [cursor.u16()?, cursor.u16()?];
    let places = cursor.take(4)?;
    let bias = cursor.u32()?;
    // Exponent's place and bits, the mantissa's bits, the bias; the mantissa is normalised with its first bit implied.
    let ieee: (u8, u8, u8, u32) = match bytes {
        2 => (10, 5, 10, 15),
        4 => (23, 8, 23, 127),
        8 => (52, 11, 52, 1023),
        _ => return Ok(DatatypeKind::Other("floating-point numbers of an unusual length")),
    };
    let sign = (bits >> 8) & 0xff;
    let normal = layout == [0, u16::try_from(8 * bytes).unwrap_or(0)]
        && places == [ieee.0, ieee.1, 0, ieee.2]
        && bias == ieee.3
        && (bits >> 4) & 3 == 2
        && sign as usize == 8 * bytes - 1;
    if !normal {
        return Ok(DatatypeKind::Other("floating-point numbers other than IEEE 754"));
    }
    Ok(match (bits & 1 != 0, bits & 64 != 0) {
        (big_endian, false) => number(element::ElementKind::Float, bytes, big_endian),
        _ => DatatypeKind::Other("numbers of a VAX"),
    })
}

/// The name of a field or of a value of an enumeration.
fn name(cursor: &mut MetadataCursor<'_>, version: u8) -> Result<String> {
    let before = cursor.left();
    let name = cursor.name()?;
    if version < 3 {
        let bytes = before - cursor.left();
        cursor.skip(bytes.next_multiple_of(8) - bytes)?;
    }
    Ok(name)
}

fn compound(
    cursor: &mut MetadataCursor<'_>,
    version: u8,
    count: usize,
    bytes: usize,
    depth: usize,
) -> Result<DatatypeKind> {
    let mut fields = Vec::with_capacity(count.min(limits::COLUMNS));
    for _ in 0..count {
        let name = name(cursor, version)?;
        let width = match bytes {
            _ if version < 3 => 4,
            0..256 => 1,
            256..65_536 => 2,
            65_536..16_777_216 => 3,
            _ => 4,
        };
        let offset = usize::try_from(cursor.number(width)?).unwrap_or(usize::MAX);
        let axes = if version < 2 {
            let axes = cursor.u8()?;
            cursor.skip(27)?;
            axes
        } else {
            0
        };
        let inner = match kind(cursor, depth - 1)? {
            _ if axes > 0 => DatatypeKind::Other("an array in each row"),
            inner if offset.checked_add(inner.bytes()).is_none_or(|end| end > bytes) => {
                DatatypeKind::Other("a field beyond its record")
            }
            DatatypeKind::Fields { fields, .. } if is_complex(&fields) => {
                DatatypeKind::Other("complex numbers")
            }
            DatatypeKind::Fields { .. } => DatatypeKind::Other("fields within a field"),
            inner => inner,
        };
        fields.push((name, offset, inner));
    }
    Ok(match bytes {
        0 => DatatypeKind::Other("fields without bytes"),
        _ if is_complex(&fields) => DatatypeKind::Other("complex numbers"),
        _ => DatatypeKind::Fields { bytes, fields },
    })
}

/// Two numbers, called as h5py and MATLAB call the parts of complex numbers.
fn is_complex(fields: &[(String, usize, DatatypeKind)]) -> bool {
    let [(first, _, DatatypeKind::Number(_)), (second, _, DatatypeKind::Number(_))] = fields else {
        return false;
    };
    matches!((first.as_str(), second.as_str()), ("r", "i") | ("real", "imag"))
}

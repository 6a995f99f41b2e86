//! The types of HDF5 that are read.

use crate::element::{self, Element};
use hdf5_pure::{Datatype, DatatypeByteOrder, FloatingPointLayout};

/// IEEE 754, binary16.
const HALF: FloatingPointLayout = FloatingPointLayout {
    bit_offset: 0,
    bit_precision: 16,
    exponent_location: 10,
    exponent_size: 5,
    mantissa_location: 0,
    mantissa_size: 10,
    exponent_bias: 15,
};

/// What an element of a dataset is.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Kind {
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
        fields: Vec<(String, usize, Kind)>,
    },
    Other(&'static str),
}

impl Kind {
    /// Bytes of an element; 0 where it has no fixed length.
    pub(super) fn bytes(&self) -> usize {
        match self {
            Self::Number(element) => element.bytes,
            Self::Text { bytes } | Self::Fields { bytes, .. } => *bytes,
            Self::Texts | Self::References | Self::Other(_) => 0,
        }
    }
}

/// What a type is read as.
pub(super) fn kind(datatype: &Datatype) -> Kind {
    let number = |kind, size: u32, order: DatatypeByteOrder| {
        let big_endian = match order {
            DatatypeByteOrder::LittleEndian => false,
            DatatypeByteOrder::BigEndian => true,
            DatatypeByteOrder::Vax => return Kind::Other("numbers of a VAX"),
        };
        let element = Element { kind, bytes: usize::try_from(size).unwrap_or(0), big_endian };
        if element.exists() { Kind::Number(element) } else { Kind::Other("numbers of an unusual length") }
    };
    match datatype {
        Datatype::FixedPoint { size, byte_order, layout } => {
            if layout.bit_offset != 0 || u32::from(layout.bit_precision) != size.saturating_mul(8) {
                return Kind::Other("integers with unused bits");
            }
            number(
                if layout.signed { element::Kind::Signed } else { element::Kind::Unsigned },
                *size,
                *byte_order,
            )
        }
        Datatype::FloatingPoint { size, byte_order, layout } => {
            let ieee = match size {
                2 => HALF,
                4 => FloatingPointLayout::IEEE754_BINARY32,
                8 => FloatingPointLayout::IEEE754_BINARY64,
                _ => return Kind::Other("floating-point numbers of an unusual length"),
            };
            if *layout != ieee {
                return Kind::Other("floating-point numbers other than IEEE 754");
            }
            number(element::Kind::Float, *size, *byte_order)
        }
        Datatype::String { size, .. } if *size > 0 => {
            Kind::Text { bytes: usize::try_from(*size).unwrap_or(0) }
        }
        Datatype::VariableLength { is_string: true, .. } => Kind::Texts,
        Datatype::Enumeration { base_type, .. } if !matches!(**base_type, Datatype::Enumeration { .. }) => {
            kind(base_type)
        }
        Datatype::Compound { size, members } => {
            let bytes = usize::try_from(*size).unwrap_or(0);
            let mut fields = Vec::with_capacity(members.len().min(crate::limits::COLUMNS));
            for member in members.iter().take(crate::limits::COLUMNS) {
                let offset = usize::try_from(member.byte_offset).unwrap_or(usize::MAX);
                // Compounds in a compound are left out.
                let inner = match &member.datatype {
                    Datatype::Compound { .. } => Kind::Other("fields within a field"),
                    datatype => kind(datatype),
                };
                let fits = offset.checked_add(inner.bytes()).is_some_and(|end| end <= bytes);
                let inner = if fits { inner } else { Kind::Other("a field beyond its record") };
                fields.push((member.name.clone(), offset, inner));
            }
            if bytes == 0 { Kind::Other("fields without bytes") } else { Kind::Fields { bytes, fields } }
        }
        Datatype::Reference { .. } => Kind::References,
        Datatype::Array { .. } => Kind::Other("an array in each row"),
        Datatype::Opaque { .. } | Datatype::BitField { .. } => Kind::Other("bytes without a meaning"),
        _ => Kind::Other("a type that is not read"),
    }
}

//! Numbers as binary formats keep them.

use crate::TimeReader;
use crate::decimal::Shift;

/// How a number is kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ElementKind {
    Unsigned,
    Signed,
    /// IEEE 754.
    Float,
    /// Sound: in parts of full scale, which is 2 to the power of one less than the bits.
    Pcm,
    /// Sound of 8 bits: the same, from 128 on.
    PcmByte,
}

/// A number without a loss.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum ExactNumber {
    Integer(i128),
    Float(f64),
}

impl ExactNumber {
    /// Whether both are the same number, or none.
    pub(crate) fn is(self, other: Self) -> bool {
        #[allow(clippy::cast_possible_truncation)]
        // a number without a fraction; beyond the range it is none of these
        let same = |integer: i128, float: f64| {
            float.fract() == 0.0 && float.abs() < 1e30 && float as i128 == integer
        };
        match (self, other) {
            (Self::Integer(one), Self::Integer(other)) => one == other,
            (Self::Float(one), Self::Float(other)) => one == other || (one.is_nan() && other.is_nan()),
            (Self::Integer(integer), Self::Float(float)) | (Self::Float(float), Self::Integer(integer)) => {
                same(integer, float)
            }
        }
    }

    /// The nearest number of 64 bits.
    pub(crate) fn rounded(self) -> f64 {
        match self {
            Self::Integer(integer) => integer as f64,
            Self::Float(float) => float,
        }
    }
}

/// A number of 1, 2, 3, 4 or 8 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Element {
    pub(crate) kind: ElementKind,
    pub(crate) bytes: usize,
    pub(crate) big_endian: bool,
}

/// Where cells stand: from an offset on in each of some records of one length.
#[derive(Clone, Copy)]
pub(crate) struct CellPlaces<'a> {
    pub(crate) raw: &'a [u8],
    pub(crate) offset: usize,
    pub(crate) stride: usize,
    pub(crate) rows: usize,
}

impl<'a> CellPlaces<'a> {
    /// A single cell.
    pub(crate) fn one(raw: &'a [u8]) -> Self {
        Self { raw, offset: 0, stride: raw.len(), rows: 1 }
    }

    /// The cells, of so many bytes each.
    pub(crate) fn of(self, bytes: usize) -> impl Iterator<Item = &'a [u8]> {
        let cell = move |record: &'a [u8]| record.get(self.offset..self.offset + bytes);
        self.raw.chunks(self.stride.max(1)).filter_map(cell).take(self.rows)
    }
}

impl Element {
    pub(crate) fn little(kind: ElementKind, bytes: usize) -> Self {
        Self { kind, bytes, big_endian: false }
    }

    /// Whether there is such a number.
    pub(crate) fn exists(self) -> bool {
        match self.kind {
            ElementKind::Unsigned | ElementKind::Signed => matches!(self.bytes, 1 | 2 | 4 | 8),
            ElementKind::Float => matches!(self.bytes, 2 | 4 | 8),
            ElementKind::Pcm => matches!(self.bytes, 2..=4),
            ElementKind::PcmByte => self.bytes == 1,
        }
    }

    /// Whether it is an integer with more digits than f64 has.
    pub(crate) fn is_long(self) -> bool {
        self.bytes == 8 && self.kind != ElementKind::Float
    }

    /// Appends the numbers of some cells, times 10^power, rounded once.
    pub(crate) fn numbers(self, cells: CellPlaces<'_>, power: i32, out: &mut Vec<f64>) {
        let CellPlaces { raw, offset, stride, rows } = cells;
        if self.bytes > 8 || power != 0 && self.is_long() {
            let mut shift = Shift::new(power);
            out.extend(cells.of(self.bytes).map(|cell| shift.integer(self.integer(cell))));
            return;
        }
        let start = out.len();
        macro_rules! widen {
            ($type:ty, $widen:expr) => {{
                const BYTES: usize = size_of::<$type>();
                let widen = $widen;
                // Iterators of known lengths, so that no number asks whether there is room for it.
                let cells = raw.chunks_exact(stride.max(1)).take(rows);
                let cell = |record: &[u8]| record.get(offset..)?.first_chunk::<BYTES>().copied();
                if self.big_endian {
                    out.extend(cells.map(|record| {
                        cell(record).map_or(f64::NAN, |cell| widen(<$type>::from_be_bytes(cell)))
                    }));
                } else if stride == BYTES {
                    let cells = raw.as_chunks::<BYTES>().0.iter().take(rows);
                    out.extend(cells.map(|cell| widen(<$type>::from_le_bytes(*cell))));
                } else {
                    out.extend(cells.map(|record| {
                        cell(record).map_or(f64::NAN, |cell| widen(<$type>::from_le_bytes(cell)))
                    }));
                }
            }};
        }
        match (self.kind, self.bytes) {
            (ElementKind::Float, 8) => widen!(f64, |x| x),
            (ElementKind::Float, 4) => widen!(f32, f64::from),
            (ElementKind::Float, 2) => widen!(u16, half),
            (ElementKind::Unsigned, 1) => widen!(u8, f64::from),
            (ElementKind::Unsigned, 2) => widen!(u16, f64::from),
            (ElementKind::Unsigned, 4) => widen!(u32, f64::from),
            (ElementKind::Unsigned, 8) => widen!(u64, |x| x as f64),
            (ElementKind::Signed, 1) => widen!(i8, f64::from),
            (ElementKind::Signed, 2) => widen!(i16, f64::from),
            (ElementKind::Signed, 4) => widen!(i32, f64::from),
            (ElementKind::Signed, 8) => widen!(i64, |x| x as f64),
            (ElementKind::PcmByte, 1) => widen!(u8, |x| (f64::from(x) - 128.0) / 128.0),
            (ElementKind::Pcm, 2) => widen!(i16, |x| f64::from(x) / 32_768.0),
            (ElementKind::Pcm, 4) => widen!(i32, |x| f64::from(x) / 2_147_483_648.0),
            (ElementKind::Pcm, 3) => out.extend(cells.of(3).map(|b| {
                // As the upper three bytes of four.
                f64::from(i32::from_le_bytes([0, b[0], b[1], b[2]])) / 2_147_483_648.0
            })),
            // `exists` is asked before.
            _ => out.extend(std::iter::repeat_n(f64::NAN, rows)),
        }
        if power != 0 {
            let mut shift = Shift::new(power);
            for number in &mut out[start..] {
                *number = shift.float(*number);
            }
        }
    }

    /// Appends the times that stand in some cells.
    pub(crate) fn times(self, cells: CellPlaces<'_>, times: &mut TimeReader, out: &mut Vec<f64>) {
        match self.kind {
            ElementKind::Unsigned | ElementKind::Signed => {
                out.extend(cells.of(self.bytes).map(|b| times.integer(self.integer(b))));
            }
            _ => {
                let start = out.len();
                self.numbers(cells, 0, out);
                // Exactly what was widened.
                #[allow(clippy::cast_possible_truncation)]
                let mut time = |number: f64| match self.bytes {
                    4 => times.single(number as f32),
                    _ => times.float(number),
                };
                out[start..].iter_mut().for_each(|number| *number = time(*number));
            }
        }
    }

    /// A number as a label: its shortest form.
    pub(crate) fn label(self, raw: &[u8], out: &mut Vec<u8>) {
        out.clear();
        let text = match self.exact(raw) {
            ExactNumber::Integer(integer) => integer.to_string(),
            ExactNumber::Float(float) => shortest(float),
        };
        out.extend_from_slice(text.as_bytes());
    }

    /// A number as it stands, without a loss.
    pub(crate) fn exact(self, raw: &[u8]) -> ExactNumber {
        match self.kind {
            ElementKind::Unsigned | ElementKind::Signed => ExactNumber::Integer(self.integer(raw)),
            _ => {
                let mut number = Vec::with_capacity(1);
                self.numbers(CellPlaces::one(raw), 0, &mut number);
                ExactNumber::Float(number.first().copied().unwrap_or(f64::NAN))
            }
        }
    }

    /// A number of another kind as this kind of element has it.
    pub(crate) fn cast(self, number: ExactNumber) -> ExactNumber {
        match (self.kind, self.bytes, number) {
            #[allow(clippy::cast_possible_truncation)] // rounded to what the element holds
            (ElementKind::Float, 4, ExactNumber::Float(float)) => ExactNumber::Float(f64::from(float as f32)),
            _ => number,
        }
    }

    /// A whole number, whatever its length.
    pub(crate) fn integer(self, raw: &[u8]) -> i128 {
        let mut bytes = [0; 16];
        for (place, byte) in raw.iter().take(self.bytes).enumerate() {
            bytes[if self.big_endian { self.bytes - 1 - place } else { place }] = *byte;
        }
        let number = i128::from_le_bytes(bytes);
        let bits = 128 - 8 * self.bytes;
        if self.kind == ElementKind::Signed { (number << bits) >> bits } else { number }
    }
}

/// A number in its shortest form: `3`, not `3.0`.
pub(crate) fn shortest(number: f64) -> String {
    if number == 0.0 || (1e-5..1e16).contains(&number.abs()) || !number.is_finite() {
        format!("{number}")
    } else {
        format!("{number:e}")
    }
}

/// A number of 16 bits (IEEE 754, binary16), which f64 holds exactly.
pub(crate) fn half(bits: u16) -> f64 {
    let sign = if bits & 0x8000 == 0 { 1.0 } else { -1.0 };
    let (exponent, fraction) = (i32::from((bits >> 10) & 0x1f), f64::from(bits & 0x3ff));
    let size = match exponent {
        0 => fraction * 2f64.powi(-24),
        31 if fraction == 0.0 => f64::INFINITY,
        31 => f64::NAN,
        _ => (1024.0 + fraction) * 2f64.powi(exponent - 25),
    };
    sign * size
}

#[cfg(test)]
mod tests {
    use super::*;

    fn one(kind: ElementKind, big_endian: bool, raw: &[u8], power: i32) -> f64 {
        let element = Element { kind, bytes: raw.len(), big_endian };
        assert!(element.exists());
        let mut numbers = Vec::new();
        element.numbers(CellPlaces::one(raw), power, &mut numbers);
        assert_eq!(numbers.len(), 1);
        numbers[0]
    }

    #[test]
    fn every_kind_widens_exactly() {
        for (kind, raw, number) in [
            (ElementKind::Unsigned, &[200][..], 200.0),
            (ElementKind::Signed, &[200][..], -56.0),
            (ElementKind::Unsigned, &[1, 2][..], 513.0),
            (ElementKind::Signed, &[0xfe, 0xff][..], -2.0),
            (ElementKind::Signed, &[0, 0, 0, 0x80][..], -2_147_483_648.0),
            (ElementKind::Unsigned, &[0, 0, 0, 0x80][..], 2_147_483_648.0),
            (ElementKind::Signed, &[0, 0, 0, 0, 0, 0, 0, 0x80][..], -9_223_372_036_854_775_808.0),
            (ElementKind::Unsigned, &[0, 0, 0, 0, 0, 0, 0, 0x80][..], 9_223_372_036_854_775_808.0),
            (ElementKind::Float, &0.1_f32.to_le_bytes()[..], 0.100_000_001_490_116_12),
            (ElementKind::Float, &0.1_f64.to_le_bytes()[..], 0.1),
            (ElementKind::Float, &[0, 0x3c][..], 1.0),
            (ElementKind::Float, &[0xff, 0x7b][..], 65504.0),
            (ElementKind::Float, &[1, 0x80][..], -5.960_464_477_539_063e-8),
            (ElementKind::PcmByte, &[0][..], -1.0),
            (ElementKind::Pcm, &[0, 0xc0][..], -0.5),
            (ElementKind::Pcm, &[1, 0, 0][..], 1.0 / 8_388_608.0),
            (ElementKind::Pcm, &[0, 0, 0x80][..], -1.0),
            (ElementKind::Pcm, &[0, 0, 0, 0x40][..], 0.5),
        ] {
            assert_eq!(one(kind, false, raw, 0), number, "{kind:?} {raw:?}");
            if raw.len() != 3 {
                let swapped: Vec<u8> = raw.iter().rev().copied().collect();
                assert_eq!(one(kind, true, &swapped, 0), number, "{kind:?} {raw:?} swapped");
            }
        }
    }

    #[test]
    fn a_power_of_ten_is_applied_to_the_digits() {
        assert_eq!(one(ElementKind::Float, false, &5.71_f64.to_le_bytes(), -12), 5.71e-12);
        assert_eq!(one(ElementKind::Signed, true, &(-571_i16).to_be_bytes(), -2), -5.71);
        assert_eq!(
            one(ElementKind::Unsigned, false, &u64::MAX.to_le_bytes(), -3),
            "18446744073709551615e-3".parse().unwrap()
        );
    }

    #[test]
    fn numbers_as_labels() {
        let mut label = Vec::new();
        for (kind, raw, text) in [
            (ElementKind::Signed, &(-3_i64).to_le_bytes()[..], "-3"),
            (ElementKind::Unsigned, &u64::MAX.to_le_bytes()[..], "18446744073709551615"),
            (ElementKind::Float, &2.0_f64.to_le_bytes()[..], "2"),
            (ElementKind::Float, &0.1_f64.to_le_bytes()[..], "0.1"),
            (ElementKind::Float, &1e300_f64.to_le_bytes()[..], "1e300"),
        ] {
            Element::little(kind, raw.len()).label(raw, &mut label);
            assert_eq!(label, text.as_bytes());
        }
    }
}

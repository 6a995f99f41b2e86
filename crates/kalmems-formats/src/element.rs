//! Numbers as binary formats keep them.

use crate::TimeReader;
use crate::decimal::Shift;

/// How a number is kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
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
pub(crate) enum Exact {
    Integer(i128),
    Float(f64),
}

impl Exact {
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
    pub(crate) kind: Kind,
    pub(crate) bytes: usize,
    pub(crate) big_endian: bool,
}

impl Element {
    pub(crate) fn little(kind: Kind, bytes: usize) -> Self {
        Self { kind, bytes, big_endian: false }
    }

    /// Whether there is such a number.
    pub(crate) fn exists(self) -> bool {
        match self.kind {
            Kind::Unsigned | Kind::Signed => matches!(self.bytes, 1 | 2 | 4 | 8),
            Kind::Float => matches!(self.bytes, 2 | 4 | 8),
            Kind::Pcm => matches!(self.bytes, 2..=4),
            Kind::PcmByte => self.bytes == 1,
        }
    }

    /// Appends the numbers that stand in `raw` from `offset` on, `stride` bytes apart, times 10^power, rounded once.
    pub(crate) fn numbers(
        self,
        raw: &[u8],
        offset: usize,
        stride: usize,
        rows: usize,
        power: i32,
        out: &mut Vec<f64>,
    ) {
        if power != 0 && self.bytes == 8 && self.kind != Kind::Float {
            let mut shift = Shift::new(power);
            out.extend(
                records(raw, offset, stride, self.bytes).take(rows).map(|b| shift.integer(self.integer(b))),
            );
            return;
        }
        let start = out.len();
        macro_rules! widen {
            ($type:ty, $widen:expr) => {{
                const BYTES: usize = size_of::<$type>();
                let cells = records(raw, offset, stride, BYTES).take(rows);
                let widen = $widen;
                if self.big_endian {
                    out.extend(cells.map(|b| widen(<$type>::from_be_bytes(array::<BYTES>(b)))));
                } else {
                    out.extend(cells.map(|b| widen(<$type>::from_le_bytes(array::<BYTES>(b)))));
                }
            }};
        }
        match (self.kind, self.bytes) {
            (Kind::Float, 8) => widen!(f64, |x| x),
            (Kind::Float, 4) => widen!(f32, f64::from),
            (Kind::Float, 2) => widen!(u16, half),
            (Kind::Unsigned, 1) => widen!(u8, f64::from),
            (Kind::Unsigned, 2) => widen!(u16, f64::from),
            (Kind::Unsigned, 4) => widen!(u32, f64::from),
            (Kind::Unsigned, 8) => widen!(u64, |x| x as f64),
            (Kind::Signed, 1) => widen!(i8, f64::from),
            (Kind::Signed, 2) => widen!(i16, f64::from),
            (Kind::Signed, 4) => widen!(i32, f64::from),
            (Kind::Signed, 8) => widen!(i64, |x| x as f64),
            (Kind::PcmByte, 1) => widen!(u8, |x| (f64::from(x) - 128.0) / 128.0),
            (Kind::Pcm, 2) => widen!(i16, |x| f64::from(x) / 32_768.0),
            (Kind::Pcm, 4) => widen!(i32, |x| f64::from(x) / 2_147_483_648.0),
            (Kind::Pcm, 3) => out.extend(records(raw, offset, stride, 3).take(rows).map(|b| {
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

    /// Appends the times that stand in `raw` from `offset` on, `stride` bytes apart.
    pub(crate) fn times(
        self,
        raw: &[u8],
        offset: usize,
        stride: usize,
        rows: usize,
        times: &mut TimeReader,
        out: &mut Vec<f64>,
    ) {
        let cells = records(raw, offset, stride, self.bytes).take(rows);
        match (self.kind, self.bytes) {
            (Kind::Unsigned | Kind::Signed, _) => out.extend(cells.map(|b| times.integer(self.integer(b)))),
            (Kind::Float, 4) if self.big_endian => {
                out.extend(cells.map(|b| times.single(f32::from_be_bytes(array(b)))));
            }
            (Kind::Float, 4) => out.extend(cells.map(|b| times.single(f32::from_le_bytes(array(b))))),
            _ => {
                let start = out.len();
                self.numbers(raw, offset, stride, rows, 0, out);
                for number in &mut out[start..] {
                    *number = times.float(*number);
                }
            }
        }
    }

    /// A number as a label: its shortest form.
    pub(crate) fn label(self, raw: &[u8], out: &mut Vec<u8>) {
        out.clear();
        match self.kind {
            Kind::Unsigned | Kind::Signed => out.extend_from_slice(self.integer(raw).to_string().as_bytes()),
            _ => {
                let mut number = Vec::with_capacity(1);
                self.numbers(raw, 0, self.bytes, 1, 0, &mut number);
                let number = number.first().copied().unwrap_or(f64::NAN);
                out.extend_from_slice(shortest(number).as_bytes());
            }
        }
    }

    /// A number as it stands, without a loss.
    pub(crate) fn exact(self, raw: &[u8]) -> Exact {
        match self.kind {
            Kind::Unsigned | Kind::Signed => Exact::Integer(self.integer(raw)),
            _ => {
                let mut number = Vec::with_capacity(1);
                self.numbers(raw, 0, self.bytes, 1, 0, &mut number);
                Exact::Float(number.first().copied().unwrap_or(f64::NAN))
            }
        }
    }

    /// A number of another kind as this kind of element has it.
    pub(crate) fn cast(self, number: Exact) -> Exact {
        match (self.kind, self.bytes, number) {
            #[allow(clippy::cast_possible_truncation)] // rounded to what the element holds
            (Kind::Float, 4, Exact::Float(float)) => Exact::Float(f64::from(float as f32)),
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
        if self.kind == Kind::Signed { (number << bits) >> bits } else { number }
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

fn records(raw: &[u8], offset: usize, stride: usize, bytes: usize) -> impl Iterator<Item = &[u8]> {
    raw.chunks(stride.max(1)).filter_map(move |record| record.get(offset..offset + bytes))
}

fn array<const N: usize>(bytes: &[u8]) -> [u8; N] {
    let mut array = [0; N];
    array.copy_from_slice(&bytes[..N]);
    array
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

    fn one(kind: Kind, big_endian: bool, raw: &[u8], power: i32) -> f64 {
        let element = Element { kind, bytes: raw.len(), big_endian };
        assert!(element.exists());
        let mut numbers = Vec::new();
        element.numbers(raw, 0, raw.len(), 1, power, &mut numbers);
        assert_eq!(numbers.len(), 1);
        numbers[0]
    }

    #[test]
    fn every_kind_widens_exactly() {
        for (kind, raw, number) in [
            (Kind::Unsigned, &[200][..], 200.0),
            (Kind::Signed, &[200][..], -56.0),
            (Kind::Unsigned, &[1, 2][..], 513.0),
            (Kind::Signed, &[0xfe, 0xff][..], -2.0),
            (Kind::Signed, &[0, 0, 0, 0x80][..], -2_147_483_648.0),
            (Kind::Unsigned, &[0, 0, 0, 0x80][..], 2_147_483_648.0),
            (Kind::Signed, &[0, 0, 0, 0, 0, 0, 0, 0x80][..], -9_223_372_036_854_775_808.0),
            (Kind::Unsigned, &[0, 0, 0, 0, 0, 0, 0, 0x80][..], 9_223_372_036_854_775_808.0),
            (Kind::Float, &0.1_f32.to_le_bytes()[..], 0.100_000_001_490_116_12),
            (Kind::Float, &0.1_f64.to_le_bytes()[..], 0.1),
            (Kind::Float, &[0, 0x3c][..], 1.0),
            (Kind::Float, &[0xff, 0x7b][..], 65504.0),
            (Kind::Float, &[1, 0x80][..], -5.960_464_477_539_063e-8),
            (Kind::PcmByte, &[0][..], -1.0),
            (Kind::Pcm, &[0, 0xc0][..], -0.5),
            (Kind::Pcm, &[1, 0, 0][..], 1.0 / 8_388_608.0),
            (Kind::Pcm, &[0, 0, 0x80][..], -1.0),
            (Kind::Pcm, &[0, 0, 0, 0x40][..], 0.5),
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
        assert_eq!(one(Kind::Float, false, &5.71_f64.to_le_bytes(), -12), 5.71e-12);
        assert_eq!(one(Kind::Signed, true, &(-571_i16).to_be_bytes(), -2), -5.71);
        assert_eq!(
            one(Kind::Unsigned, false, &u64::MAX.to_le_bytes(), -3),
            "18446744073709551615e-3".parse().unwrap()
        );
    }

    #[test]
    fn numbers_as_labels() {
        let mut label = Vec::new();
        for (kind, raw, text) in [
            (Kind::Signed, &(-3_i64).to_le_bytes()[..], "-3"),
            (Kind::Unsigned, &u64::MAX.to_le_bytes()[..], "18446744073709551615"),
            (Kind::Float, &2.0_f64.to_le_bytes()[..], "2"),
            (Kind::Float, &0.1_f64.to_le_bytes()[..], "0.1"),
            (Kind::Float, &1e300_f64.to_le_bytes()[..], "1e300"),
        ] {
            Element::little(kind, raw.len()).label(raw, &mut label);
            assert_eq!(label, text.as_bytes());
        }
    }
}

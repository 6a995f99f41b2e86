//! One cell of a recording: its bytes as a number in SI, or what else it is.

use crate::units::Unit;
use std::io::Write as _;

/// How the numbers of a column become SI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Scale {
    /// They are SI already, or have no unit.
    One,
    /// A power of ten: the exponent is changed in the text, so that `5.71` in pF is the number 5.71e-12.
    Decimal(i32),
    /// Any other factor.
    Factor(f64),
}

impl Scale {
    pub(crate) fn of(unit: Option<Unit>) -> Self {
        let factor = unit.map_or(1.0, |u| u.factor());
        let power = factor.log10().round();
        if power.is_nan() || power.abs() > 300.0 {
            return Self::Factor(factor);
        }
        #[allow(clippy::cast_possible_truncation)] // bounded by the line above
        let power = power as i32;
        if format!("1e{power}").parse() != Ok(factor) {
            Self::Factor(factor)
        } else if power == 0 {
            Self::One
        } else {
            Self::Decimal(power)
        }
    }
}

/// What a cell holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Cell {
    /// A finite number, in SI.
    Number(f64),
    /// Nothing.
    Missing,
    /// `nan` in any spelling.
    Nan,
    /// `inf` in any spelling, or a number beyond the range of f64.
    Infinite,
    /// Anything else.
    Text,
}

impl Cell {
    /// Reads a cell. `scratch` is reused, so that no cell allocates.
    pub(crate) fn read(bytes: &[u8], scale: Scale, scratch: &mut Vec<u8>) -> Self {
        let bytes = bytes.trim_ascii();
        if bytes.is_empty() {
            return Self::Missing;
        }
        let Ok(number) = fast_float2::parse::<f64, _>(bytes) else { return Self::Text };
        if number.is_nan() {
            return Self::Nan;
        }
        let si = match scale {
            Scale::One => number,
            Scale::Factor(factor) => number * factor,
            Scale::Decimal(power) => shifted(bytes, power, scratch).unwrap_or(number),
        };
        if si.is_finite() { Self::Number(si) } else { Self::Infinite }
    }
}

/// The number times a power of ten, rounded once. `None` for `inf`, which has no exponent to change.
fn shifted(number: &[u8], power: i32, scratch: &mut Vec<u8>) -> Option<f64> {
    let end = number.iter().position(|b| matches!(b, b'e' | b'E')).unwrap_or(number.len());
    let (digits, exponent) = number.split_at(end);
    let exponent = match exponent.get(1..) {
        None => 0,
        // An exponent that does not fit i32 is far beyond any number; the sign alone decides.
        Some(text) => match std::str::from_utf8(text).ok()?.parse::<i32>() {
            Ok(exponent) => exponent,
            Err(_) if text.starts_with(b"-") => i32::MIN,
            Err(_) => i32::MAX,
        },
    };
    scratch.clear();
    scratch.extend_from_slice(digits);
    write!(scratch, "e{}", exponent.saturating_add(power)).ok()?;
    fast_float2::parse(&scratch).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::{Header, Value};
    use proptest::prelude::*;

    fn read(text: &str, column: &str) -> Cell {
        Cell::read(text.as_bytes(), Scale::of(Header::parse(column).unit), &mut Vec::new())
    }

    #[test]
    fn what_a_cell_is() {
        for (text, cell) in [
            ("1.5", Cell::Number(1.5)),
            (" -1.5e3 ", Cell::Number(-1500.0)),
            ("+.5", Cell::Number(0.5)),
            ("5.", Cell::Number(5.0)),
            ("", Cell::Missing),
            (" \r", Cell::Missing),
            ("NaN", Cell::Nan),
            ("-nan", Cell::Nan),
            ("inf", Cell::Infinite),
            ("-Infinity", Cell::Infinite),
            ("1e999", Cell::Infinite),
            ("1,5", Cell::Text),
            ("1.2.3", Cell::Text),
            ("0x10", Cell::Text),
            ("1 V", Cell::Text),
            ("-", Cell::Text),
            ("e5", Cell::Text),
        ] {
            assert_eq!(read(text, "cap_V"), cell, "{text:?}");
        }
        for (text, cell) in [
            ("inf", Cell::Infinite),
            ("nan", Cell::Nan),
            ("1e308", Cell::Infinite),
            ("1e-99999999999", Cell::Number(0.0)),
            ("1e99999999999", Cell::Infinite),
        ] {
            assert_eq!(read(text, "cap_kV"), cell, "{text:?}");
        }
    }

    #[test]
    fn si_is_rounded_once() {
        for (text, column, si) in [
            ("5.71", "cap_pF", 5.71e-12),
            ("5.71E2", "cap_pF", 5.71e-10),
            ("17.86", "shunt_kohm", 17.86e3),
            ("19.2", "gap_um", 19.2e-6),
            ("3", "pressure_bar", 3e5),
            ("5", "stiffness_mN_per_m", 5e-3),
            ("0.3", "noise_nV_per_rtHz", 0.3e-9),
            ("8", "time_min", 480.0),
        ] {
            assert_eq!(read(text, column), Cell::Number(si), "{text} in {column}");
        }
        let Cell::Number(rate) = read("180", "gyro_dps") else { panic!() };
        approx::assert_relative_eq!(rate, std::f64::consts::PI, max_relative = 1e-15);
    }

    proptest! {
        /// A cell and a value of an experiment file with the same digits are the same number.
        #[test]
        fn agrees_with_a_value_bit_for_bit(x in -1e9..1e9_f64, exponential: bool) {
            let text = if exponential { format!("{x:e}") } else { format!("{x}") };
            let value = Value::parse(&format!("{text} pF")).unwrap().si();
            prop_assert_eq!(read(&text, "cap_pF"), Cell::Number(value));
        }
    }
}

//! Numbers times a power of ten, rounded once.

use crate::csv::number::{DecimalDigits, quick, scaled};
use std::io::Write as _;

/// Shifts the decimal point of numbers. What stands for a binary number is the shortest decimal number that reads
/// back as it, the nearest of those and of two the even one, which is what a text file of the same data holds; so both give
/// the same bits.
pub struct Shift {
    power: i32,
    shortest: zmij::Buffer,
    text: Vec<u8>,
}

impl Shift {
    /// One that multiplies by this power of ten.
    pub fn new(power: i32) -> Self {
        Self { power, shortest: zmij::Buffer::new(), text: Vec::with_capacity(40) }
    }

    /// The number times the power of ten. NaN and infinities stay as they are; what is too large is infinite.
    #[inline]
    pub fn float(&mut self, number: f64) -> f64 {
        if self.power == 0 || number == 0.0 || !number.is_finite() { number } else { self.shifted(number) }
    }

    fn shifted(&mut self, number: f64) -> f64 {
        let text = self.shortest.format_finite(number);
        // As the reader of text does, and as it does, only where the rounding is sure.
        if let Some((shifted, end)) = quick(text.as_bytes(), 0, b'.', self.power)
            && end == text.len()
        {
            return shifted;
        }
        self.text.clear();
        let (digits, exponent) = match text.split_once('e') {
            Some((digits, exponent)) => (digits, exponent.parse::<i32>().unwrap_or(0)),
            None => (text, 0),
        };
        self.text.extend_from_slice(digits.as_bytes());
        self.parse(exponent).unwrap_or(number)
    }

    /// The integer times the power of ten; rounded once even where it has more digits than f64 keeps.
    pub fn integer(&mut self, number: i128) -> f64 {
        if self.power == 0 {
            return number as f64;
        }
        self.text.clear();
        // Writing into memory cannot fail.
        let _ = write!(self.text, "{number}");
        self.parse(0).unwrap_or(number as f64)
    }

    fn parse(&mut self, exponent: i32) -> Option<f64> {
        let _ = write!(self.text, "e{}", exponent.saturating_add(self.power));
        fast_float2::parse(&self.text).ok()
    }
}

/// start + row·step of the shortest decimal digits of both, rounded once: what a text file of the same clock holds.
pub(crate) fn affine(start: f64, step: f64, row: u64) -> f64 {
    exact_affine(start, step, row).unwrap_or(start + row as f64 * step)
}

/// `None` where the digits of both do not fit together.
fn exact_affine(start: f64, step: f64, row: u64) -> Option<f64> {
    let (start, step) = (shortest(start)?, shortest(step)?);
    let q = if start.w == 0 { step.q } else { start.q.min(step.q) };
    let scaled_up = |digits: DecimalDigits| {
        let w = i128::from(digits.w);
        let w = w.checked_mul(10_i128.checked_pow(digits.q.checked_sub(q)?.try_into().ok()?)?)?;
        Some(if digits.negative { -w } else { w })
    };
    let start = if start.w == 0 { 0 } else { scaled_up(start)? };
    let sum = scaled_up(step)?.checked_mul(i128::from(row))?.checked_add(start)?;
    let size = match u64::try_from(sum.unsigned_abs()).ok().and_then(|w| scaled(w, q)) {
        Some(size) => size,
        None => fast_float2::parse(format!("{}e{q}", sum.unsigned_abs())).ok()?,
    };
    Some(if sum < 0 { -size } else { size })
}

fn shortest(number: f64) -> Option<DecimalDigits> {
    let mut shortest = zmij::Buffer::new();
    Some(DecimalDigits::read(shortest.format(number).as_bytes(), 0, b'.')?.0)
}

#[cfg(test)]
mod tests {
    use super::Shift;
    use proptest::prelude::*;

    /// The same by way of the standard library alone.
    fn by_text(number: f64, power: i32) -> f64 {
        let shortest = format!("{number:e}");
        // Of two that are as near the library takes the larger one; rounded to as many digits it is the even one.
        let digits = shortest.split_once('e').unwrap().0.trim_start_matches('-').len();
        let nearest = format!("{number:.*e}", digits.saturating_sub(2));
        let text = if nearest.parse() == Ok(number) { nearest } else { shortest };
        let (digits, exponent) = text.split_once('e').unwrap();
        format!("{digits}e{}", exponent.parse::<i32>().unwrap() + power).parse().unwrap()
    }

    #[test]
    fn a_point_is_shifted_in_the_digits() {
        for (number, power, shifted) in [
            (5.71, -12, 5.71e-12),
            (571.0, -12, 5.71e-10),
            (0.1, 3, 100.0),
            (17.86, 3, 17.86e3),
            (-0.3, -9, -0.3e-9),
            (1e300, 10, f64::INFINITY),
            (5e-324, -1, 0.0),
            (1.797_693_134_862_315_7e308, 0, f64::MAX),
        ] {
            assert_eq!(Shift::new(power).float(number).to_bits(), shifted.to_bits(), "{number}e{power}");
        }
        assert_eq!(Shift::new(3).float(-0.0).to_bits(), (-0.0_f64).to_bits());
        assert!(Shift::new(3).float(f64::NAN).is_nan());
        assert_eq!(Shift::new(-3).float(f64::NEG_INFINITY), f64::NEG_INFINITY);
    }

    /// 33030808352293.0625 lies between two numbers of 17 digits, of which writers take the even one.
    #[test]
    fn of_two_that_are_as_near_the_even_one_stands_for_a_number() {
        let number = f64::from_bits(4_809_293_089_715_135_760);
        assert_eq!(format!("{number:.6}"), "33030808352293.062500");
        let [even, odd]: [f64; 2] =
            ["33030808352293.062e18", "33030808352293.063e18"].map(|text| text.parse().unwrap());
        assert!(Shift::new(18).float(number) == even && even != odd);
    }

    #[test]
    fn an_integer_keeps_all_its_digits() {
        // 2⁶⁴ − 1 times 10⁻³, whose digits f64 rounds once; its own rounding first would be another number.
        for number in [u64::MAX, 9_007_199_254_740_993, 3] {
            for power in [-30, -3, 0, 2] {
                let text: f64 = format!("{number}e{power}").parse().unwrap();
                assert_eq!(Shift::new(power).integer(i128::from(number)).to_bits(), text.to_bits());
            }
        }
        // Rounding twice shows in some of them.
        let twice =
            |number: i64| Shift::new(3).float(number as f64) != Shift::new(3).integer(i128::from(number));
        assert!((0..1000).any(|step| twice(9_007_199_254_740_993 + 2 * step)));
    }

    proptest! {
        #[test]
        fn as_from_text(bits: u64, power in -40..40_i32) {
            let number = f64::from_bits(bits);
            prop_assume!(number.is_finite());
            prop_assert_eq!(Shift::new(power).float(number).to_bits(), by_text(number, power).to_bits());
        }

        #[test]
        fn as_from_text_for_everyday_numbers(number in -1e6..1e6_f64, power in -15..15_i32) {
            prop_assert_eq!(Shift::new(power).float(number).to_bits(), by_text(number, power).to_bits());
        }
    }
}

//! Decimal numbers from text, correctly rounded: a quick way for what measurements look like.
//!
//! The digits are read eight at a time as an integer w, so that the number is w·10^q. Where both are small it is one
//! exact multiplication or division (W. D. Clinger, "How to read floating point numbers accurately", PLDI 1990).
//! Otherwise w is multiplied by the first 128 bits of 10^q (D. Lemire, "Number parsing at a gigabyte per second",
//! Software: Practice and Experience 51 (2021) 1700). What is cut off bounds the product from both sides; where both
//! bounds round to one number it is that, and where they do not, which happens for exact ties and next to them, the
//! quick way gives up and the slow one, which knows every case, is taken.

/// The largest power of ten in the table: 5^54 and the division by it fit 128 bits.
const LARGEST: usize = 54;

/// Powers of ten that f64 holds exactly.
const EXACT: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18,
    1e19, 1e20, 1e21, 1e22,
];

/// What shifts up to eight digits to the left.
const SHIFT: [u64; 9] = [1, 10, 100, 1000, 10_000, 100_000, 1_000_000, 10_000_000, 100_000_000];

/// 10^q = m·2^e with m of 128 bits, the first of which is set, rounded down.
#[derive(Clone, Copy)]
struct PowerOfTen {
    mantissa: u128,
    exponent: i32,
}

/// 10^q for q from −[`LARGEST`] to [`LARGEST`].
static POWERS: [PowerOfTen; 2 * LARGEST + 1] = powers();

#[allow(clippy::cast_possible_truncation, clippy::cast_possible_wrap)] // small counts
const fn powers() -> [PowerOfTen; 2 * LARGEST + 1] {
    let mut table = [PowerOfTen { mantissa: 1 << 127, exponent: -127 }; 2 * LARGEST + 1];
    let mut five: u128 = 1;
    let mut q: usize = 0;
    while q <= LARGEST {
        let zeros = five.leading_zeros();
        // 5^q·2^q, whose first bit becomes bit 127.
        table[LARGEST + q] = PowerOfTen { mantissa: five << zeros, exponent: q as i32 - zeros as i32 };
        // 1/5^q by long division, bit by bit, from the first bit that is set on: 5^q < 2^126, so that twice the rest fits.
        let mut quotient: u128 = 0;
        let mut rest: u128 = 1;
        let mut exponent = 0;
        while quotient >> 127 == 0 {
            rest <<= 1;
            quotient <<= 1;
            exponent -= 1;
            if rest >= five {
                rest -= five;
                quotient |= 1;
            }
        }
        if q > 0 {
            table[LARGEST - q] = PowerOfTen { mantissa: quotient, exponent: exponent - q as i32 };
        }
        five = if q < LARGEST { five * 5 } else { five };
        q += 1;
    }
    table
}

/// The digits of a number: ±w·10^q, with all digits of the text that count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct DecimalDigits {
    pub(crate) negative: bool,
    pub(crate) w: u64,
    pub(crate) q: i32,
}

impl DecimalDigits {
    /// Reads a number that begins at `start` and is written with `point`; its digits and where it ends. `None` is no
    /// verdict: where there are more digits than fit 64 bits the slow way decides.
    #[inline]
    pub(crate) fn read(text: &[u8], start: usize, point: u8) -> Option<(Self, usize)> {
        let mut place = start;
        let sign = *text.get(place)?;
        let negative = sign == b'-';
        place += usize::from(negative || sign == b'+');
        let first = place;
        let mut w = 0;
        digits(text, &mut place, &mut w);
        let mut count = place - first;
        let mut q = 0;
        if text.get(place) == Some(&point) {
            place += 1;
            let behind = place;
            digits(text, &mut place, &mut w);
            let fraction = place - behind;
            count += fraction;
            q = i32::try_from(fraction).ok()?.checked_neg()?;
        }
        if count == 0 {
            return None;
        }
        let last = place;
        if let Some(b'e' | b'E') = text.get(place) {
            q = q.checked_add(exponent(text, &mut place)?)?;
        }
        // 19 digits fit 64 bits; zeros in front are none.
        if count > 19 && count - leading_zeros(text.get(first..last)?, point) > 19 {
            return None;
        }
        Some((Self { negative, w, q }, place))
    }
}

/// Reads a number that begins at `start` and is written with `point`, times 10^`power`; the number and where it ends.
/// `None` is no verdict: the slow way decides.
#[inline]
pub(crate) fn quick(text: &[u8], start: usize, point: u8, power: i32) -> Option<(f64, usize)> {
    let (DecimalDigits { negative, w, q }, place) = DecimalDigits::read(text, start, point)?;
    let number = scaled(w, q.checked_add(power)?)?;
    Some((if negative { -number } else { number }, place))
}

/// Appends the digits from `place` on to `w` and moves `place` behind them. More than 64 bits wrap around.
#[inline]
fn digits(text: &[u8], place: &mut usize, w: &mut u64) {
    while let Some(chunk) = text.get(*place..).and_then(<[u8]>::first_chunk::<8>) {
        let bytes = u64::from_le_bytes(*chunk) ^ 0x3030_3030_3030_3030;
        // The high bit of a byte that is no digit; a carry spoils only bytes behind it.
        let others = (bytes.wrapping_add(0x7676_7676_7676_7676) | bytes) & 0x8080_8080_8080_8080;
        let count = others.trailing_zeros() as usize / 8;
        if count == 0 {
            return;
        }
        // What is behind the digits goes, and zeros come before them.
        let value = eight(bytes << (64 - 8 * count));
        *w = w.wrapping_mul(SHIFT.get(count).copied().unwrap_or(1)).wrapping_add(value);
        *place += count;
        if count < 8 {
            return;
        }
    }
    while let Some(digit) = text.get(*place).map(|byte| byte.wrapping_sub(b'0')).filter(|digit| *digit < 10) {
        *w = w.wrapping_mul(10).wrapping_add(u64::from(digit));
        *place += 1;
    }
}

/// Eight digits, a byte each, the first in the lowest byte: pairs, then fours, then all.
#[inline]
const fn eight(bytes: u64) -> u64 {
    let pairs = bytes.wrapping_mul(10).wrapping_add(bytes >> 8);
    let even = (pairs & 0x0000_00ff_0000_00ff).wrapping_mul(100 + (1_000_000 << 32));
    let odd = ((pairs >> 16) & 0x0000_00ff_0000_00ff).wrapping_mul(1 + (10_000 << 32));
    even.wrapping_add(odd) >> 32
}

/// Reads an exponent of at most four digits, `place` being at its letter.
fn exponent(text: &[u8], place: &mut usize) -> Option<i32> {
    let mut at = *place + 1;
    let sign = *text.get(at)?;
    at += usize::from(matches!(sign, b'+' | b'-'));
    let first = at;
    let mut value = 0_i32;
    while let Some(digit) = text.get(at).map(|byte| byte.wrapping_sub(b'0')).filter(|digit| *digit < 10) {
        if at - first == 4 {
            return None;
        }
        value = value * 10 + i32::from(digit);
        at += 1;
    }
    if at == first {
        return None;
    }
    *place = at;
    Some(if sign == b'-' { -value } else { value })
}

fn leading_zeros(text: &[u8], point: u8) -> usize {
    text.iter().take_while(|byte| **byte == b'0' || **byte == point).filter(|byte| **byte == b'0').count()
}

/// w·10^q, rounded to nearest, ties to even; `None` where that is not sure or q is beyond the table.
#[inline]
#[allow(clippy::cast_possible_truncation, clippy::cast_possible_wrap)] // small counts, and 53 bits
pub(crate) fn scaled(w: u64, q: i32) -> Option<f64> {
    if w <= 1 << 53 {
        let exact = |q: i32| EXACT.get(usize::try_from(q).ok()?).copied();
        if let Some(power) = exact(q) {
            return Some(w as f64 * power);
        }
        if let Some(power) = exact(-q) {
            return Some(w as f64 / power);
        }
    }
    if w == 0 {
        return Some(0.0);
    }
    let index = q.checked_add(LARGEST as i32)?;
    let power = POWERS.get(usize::try_from(index).ok()?)?;
    let zeros = w.leading_zeros();
    let w = u128::from(w << zeros);
    // The first 128 of the 192 bits of w·m, below the true product by less than 2: each of the two roundings down,
    // that of m times w/2⁶⁴ < 1 and that of the low product, takes less than 1.
    let low = (w * (power.mantissa & u128::from(u64::MAX))) >> 64;
    let product = w * (power.mantissa >> 64) + low;
    // Bit 127 or 126 is the first; 53 bits stay.
    let first = product.leading_zeros();
    let cut = 128 - 53 - first;
    let rest = product & ((1 << cut) - 1);
    let half = 1_u128 << (cut - 1);
    // On a tie, or less than 2 below one, the true product may be on either side of it.
    if rest == half || rest == half - 1 {
        return None;
    }
    let kept = (product >> cut) as u64 + u64::from(rest > half);
    // kept·2^(cut + exponent of m + 64 − zeros), of ordinary size, as q is small; both factors are exact.
    let exponent = cut as i32 + power.exponent + 64 - zeros as i32;
    let scale = f64::from_bits(u64::try_from(exponent + 1023).ok().filter(|e| (1..2047).contains(e))? << 52);
    Some(kept as f64 * scale)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// What the quick way makes of a text, with other text behind it.
    fn read(text: &str, power: i32) -> Option<(f64, usize)> {
        quick(format!("{text},12345678901234567890").as_bytes(), 0, b'.', power)
    }

    #[test]
    fn the_power_table_holds_powers_of_ten() {
        for q in -54..=54_i32 {
            let power = POWERS[usize::try_from(q + 54).unwrap()];
            assert_eq!(power.mantissa >> 127, 1, "{q}");
            // The first 53 bits, cut off, are the power or the number below it.
            let cut = (power.mantissa >> 75) as f64 * 2_f64.powi(power.exponent + 75);
            let exact: f64 = format!("1e{q}").parse().unwrap();
            assert!(cut <= exact && exact <= cut.next_up(), "{q}: {cut:e}");
        }
    }

    #[test]
    fn where_a_number_ends() {
        for (text, number, length) in [
            ("1.5", 1.5, 3),
            ("-0.000000000000000000001", -1e-21, 24),
            ("+7", 7.0, 2),
            (".5", 0.5, 2),
            ("5.", 5.0, 2),
            ("1e5x", 1e5, 3),
            ("1E-05", 1e-5, 5),
            ("12345678", 12_345_678.0, 8),
            ("123456789.25", 123_456_789.25, 12),
            ("1.5 V", 1.5, 3),
            // Zeros behind a second point are none of it.
            ("00000000000000000000.00000.000", 0.0, 26),
        ] {
            assert_eq!(read(text, 0), Some((number, length)), "{text}");
        }
        assert!(read("-0", 0).unwrap().0.is_sign_negative());
        for text in ["", "-", ".", "e5", "1e", "1e+", "nan", "1e99999", "12345678901234567890123"] {
            assert_eq!(read(text, 0), None, "{text}");
        }
    }

    #[test]
    fn ties_and_their_neighbours() {
        // 2⁵³ + 1 is halfway; the digits behind it decide.
        for text in [
            "9007199254740993",
            "9007199254740993.0",
            "9007199254740993.001",
            "9007199254740992.999",
            "0.50000000000000000",
            "0.1250000000000000000",
            "1.00000000000000011",
            "1.0000000000000001110",
        ] {
            if let Some((number, _)) = read(text, 0) {
                assert_eq!(number, text.parse::<f64>().unwrap(), "{text}");
            }
        }
    }

    fn agrees(text: &str, power: i32) -> Result<bool, TestCaseError> {
        let Some((number, length)) = read(text, power) else { return Ok(false) };
        prop_assert_eq!(length, text.len());
        let (digits, exponent) = text.split_once('e').unwrap_or((text, "0"));
        let expected: f64 = format!("{digits}e{}", exponent.parse::<i32>().unwrap() + power).parse().unwrap();
        prop_assert_eq!(number.to_bits(), expected.to_bits(), "{}e{}", text, power);
        Ok(true)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4000))]

        /// The standard library is the other way; everyday numbers are never left to the slow one.
        #[test]
        fn agrees_with_the_standard_library(x in -1e4..1e4_f64, digits in 0..18_usize, power in -12..4_i32) {
            let (plain, fixed, exponential) = (format!("{x}"), format!("{x:.digits$}"), format!("{x:e}"));
            agrees(&fixed, power)?;
            prop_assert!(agrees(&plain, power)? && agrees(&exponential, power)?);
        }

        #[test]
        fn any_number_agrees(bits: u64, power in -60..60_i32) {
            let x = f64::from_bits(bits);
            prop_assume!(x.is_finite());
            agrees(&format!("{x:e}"), power)?;
        }

        #[test]
        fn any_digits_agree(w: u64, q in -60..60_i32) {
            agrees(&format!("{w}e{q}"), 0)?;
        }

        /// Half way between two numbers, and one digit next to it.
        #[test]
        fn halves_agree(w in 1_u64 << 52..1 << 53, shift in 1..11_u32, off in -1..2_i64, q in -3..1_i32) {
            let half = ((w << 1) + 1) << (shift - 1);
            agrees(&format!("{}e{q}", half.saturating_add_signed(off)), 0)?;
        }
    }
}

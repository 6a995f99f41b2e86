//! An exact number of seconds.

use crate::csv::number::{DecimalDigits, scaled};
use crate::time::TimeUnit;
use std::fmt;
use std::str::FromStr;

/// Parts of a second that are told apart, in a second.
const PARTS: i128 = 1_000_000_000_000_000_000;
/// As a power of ten.
const PLACES: i32 = 18;

/// A point in time as seconds from some zero on: whole ones of 64 bits and parts of 10⁻¹⁸ s, exactly. What is finer is rounded to them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Instant {
    parts: i128,
}

impl Instant {
    /// Zero.
    pub const ZERO: Self = Self { parts: 0 };

    /// Whole seconds.
    pub const fn of_seconds(seconds: i64) -> Self {
        Self { parts: seconds as i128 * PARTS }
    }

    /// Whole seconds and parts of 10⁻¹⁸ s behind them, fewer than 10¹⁸.
    pub(crate) const fn new(seconds: i64, parts: u64) -> Self {
        Self { parts: seconds as i128 * PARTS + parts as i128 }
    }

    /// So many parts, where their seconds are of 64 bits.
    fn of_parts(parts: i128) -> Option<Self> {
        i64::try_from(parts.div_euclid(PARTS)).is_ok().then_some(Self { parts })
    }

    /// Seconds since 1904 and fractions of 2⁻⁶⁴ s, as LabVIEW and TDMS keep them, from 1970 on. `None` beyond the range.
    pub(crate) fn of_labview(seconds: i64, fraction: u64) -> Option<Self> {
        // Fewer than 10¹⁸, but where the fraction is nearer to a whole second than half a part.
        let parts = (u128::from(fraction) * PARTS.unsigned_abs() + (1 << 63)) >> 64;
        let seconds = i128::from(seconds) + i128::from(super::LABVIEW_ZERO_S);
        Self::of_parts(seconds * PARTS + i128::try_from(parts).ok()?)
    }

    /// An integer in a unit, exactly. `None` beyond the range.
    pub fn of_integer(number: i128, unit: TimeUnit) -> Option<Self> {
        Self::of_decimal(number.unsigned_abs(), 0, number < 0, unit)
    }

    /// The shortest decimal number that stands for a finite f64, in a unit. `None` beyond the range, or not finite.
    pub fn of_float(number: f64, unit: TimeUnit) -> Option<Self> {
        if !number.is_finite() {
            return None;
        }
        let mut shortest = zmij::Buffer::new();
        let (digits, _) = DecimalDigits::read(shortest.format_finite(number).as_bytes(), 0, b'.')?;
        Self::of_digits(digits, unit)
    }

    /// What was read of a text, in a unit.
    #[inline]
    pub(crate) fn of_digits(digits: DecimalDigits, unit: TimeUnit) -> Option<Self> {
        Self::of_decimal(u128::from(digits.w), digits.q, digits.negative, unit)
    }

    /// w·10^q, or its opposite, in a unit.
    #[inline]
    pub(crate) fn of_decimal(w: u128, q: i32, negative: bool, unit: TimeUnit) -> Option<Self> {
        let w = if w == 0 { 0 } else { w.checked_mul(u128::from(unit.factor))? };
        let q = q.checked_add(unit.power)?.checked_add(PLACES)?;
        let parts = match 10_u128.checked_pow(q.unsigned_abs()) {
            _ if w == 0 => 0,
            Some(power) if q >= 0 => w.checked_mul(power)?,
            // Finer than a part: rounded to it.
            Some(finer) => w / finer + u128::from(w % finer >= finer.div_ceil(2)),
            None if q < 0 => 0,
            None => return None,
        };
        let parts = i128::try_from(parts).ok()?;
        let zero = i128::from(unit.zero_s) * PARTS;
        Self::of_parts(zero.checked_add(if negative { -parts } else { parts })?)
    }

    /// The seconds from another one to this, rounded once.
    #[inline]
    pub fn since(self, origin: Self) -> f64 {
        let parts = self.parts - origin.parts;
        let size = seconds_of(parts.unsigned_abs());
        if parts < 0 { -size } else { size }
    }

    /// Whether it is within so many seconds of zero.
    pub fn is_within(self, seconds: u32) -> bool {
        let seconds = i64::from(seconds);
        self >= Self::of_seconds(-seconds) && self <= Self::of_seconds(seconds)
    }

    /// The nearest nanosecond.
    pub(crate) fn to_nanosecond(self) -> Self {
        const NANO: i128 = PARTS / 1_000_000_000;
        Self { parts: (self.parts + NANO / 2).div_euclid(NANO) * NANO }
    }

    /// Whole seconds, rounded down, and the parts of 10⁻¹⁸ s behind them.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // of 64 bits, and fewer than `PARTS`
    pub(crate) const fn seconds_and_parts(self) -> (i64, u64) {
        (self.parts.div_euclid(PARTS) as i64, self.parts.rem_euclid(PARTS) as u64)
    }
}

/// Parts of a second as f64 seconds, rounded once.
#[inline]
#[allow(clippy::cast_possible_truncation)] // fewer than `PARTS`
fn seconds_of(all: u128) -> f64 {
    let (seconds, parts) = (all / PARTS.unsigned_abs(), (all % PARTS.unsigned_abs()) as u64);
    // In units in which it is a whole number of 64 bits: parts, picoseconds, or nanoseconds.
    for (unit, places) in [(1, 18_u32), (1_000_000, 12), (1_000_000_000, 9)] {
        if parts.is_multiple_of(unit)
            && let Ok(seconds) = u64::try_from(seconds)
            && let Some(whole) = seconds.checked_mul(10_u64.pow(places))
            && let Some(whole) = whole.checked_add(parts / unit)
            && let Some(number) = scaled(whole, -places.cast_signed())
        {
            return number;
        }
    }
    // A text that is always a number.
    fast_float2::parse(format!("{all}e-{PLACES}")).unwrap_or(seconds as f64)
}

/// As a decimal number of seconds, exactly: `1763834400.123456`.
impl fmt::Display for Instant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (sign, size) = (if self.parts < 0 { "-" } else { "" }, self.parts.unsigned_abs());
        let (seconds, parts) = (size / PARTS.unsigned_abs(), size % PARTS.unsigned_abs());
        if parts == 0 {
            return write!(f, "{sign}{seconds}");
        }
        let fraction = format!("{parts:018}");
        write!(f, "{sign}{seconds}.{}", fraction.trim_end_matches('0'))
    }
}

/// A text that is no decimal number of seconds, or one beyond the range.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("it is no decimal number of seconds such as `1763834400.123456`, or is beyond 292 years times 10⁹")]
pub struct NoInstant;

impl FromStr for Instant {
    type Err = NoInstant;

    /// As it is displayed.
    fn from_str(text: &str) -> Result<Self, NoInstant> {
        super::reader::exact(text.as_bytes(), b'.', TimeUnit::SECOND).ok_or(NoInstant)
    }
}

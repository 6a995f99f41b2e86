//! An exact number of seconds.

use crate::csv::number::{DecimalDigits, scaled};
use crate::time::TimeUnit;
use std::fmt;
use std::str::FromStr;

/// Parts of a second that are told apart, in a second.
const PARTS: u64 = 1_000_000_000_000_000_000;
/// As a power of ten.
const PLACES: i32 = 18;

/// A point in time as seconds from some zero on: whole ones and parts of 10⁻¹⁸ s, exactly. What is finer is rounded to them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Instant {
    /// Whole seconds, rounded down.
    seconds: i64,
    /// Parts of the next second, fewer than [`PARTS`].
    parts: u64,
}

impl Instant {
    /// Zero.
    pub const ZERO: Self = Self { seconds: 0, parts: 0 };

    /// Whole seconds.
    pub const fn of_seconds(seconds: i64) -> Self {
        Self { seconds, parts: 0 }
    }

    /// Whole seconds and parts of 10⁻¹⁸ s behind them, fewer than 10¹⁸.
    pub(crate) const fn new(seconds: i64, parts: u64) -> Self {
        Self { seconds, parts }
    }

    /// Seconds since 1904 and fractions of 2⁻⁶⁴ s, as LabVIEW and TDMS keep them, from 1970 on. `None` beyond the range.
    pub(crate) fn of_labview(seconds: i64, fraction: u64) -> Option<Self> {
        let seconds = seconds.checked_add(super::LABVIEW_ZERO_S)?;
        let scaled = u128::from(fraction) * u128::from(PARTS) + (1 << 63);
        // Fewer than 10¹⁸, but where the fraction is nearer to a whole second than half a part.
        let parts = u64::try_from(scaled >> 64).ok()?;
        if parts == PARTS {
            Some(Self { seconds: seconds.checked_add(1)?, parts: 0 })
        } else {
            Some(Self { seconds, parts })
        }
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
        if w == 0 {
            return Some(Self::of_seconds(unit.zero_s));
        }
        let w = w.checked_mul(u128::from(unit.factor))?;
        let q = q.checked_add(unit.power)?;
        let (whole, parts) = split(w, q)?;
        let time = if negative {
            let borrowed = parts > 0;
            let whole = whole.checked_neg()?.checked_sub(i64::from(borrowed))?;
            Self { seconds: whole, parts: if borrowed { PARTS - parts } else { 0 } }
        } else {
            Self { seconds: whole, parts }
        };
        Some(Self { seconds: time.seconds.checked_add(unit.zero_s)?, ..time })
    }

    /// The seconds from another one to this, rounded once.
    #[inline]
    pub fn since(self, origin: Self) -> f64 {
        let (late, early, sign) = if self >= origin { (self, origin, 1.0) } else { (origin, self, -1.0) };
        let borrow = late.parts < early.parts;
        let parts = if borrow { late.parts + PARTS - early.parts } else { late.parts - early.parts };
        // The difference of two i64 fits u64.
        let seconds = late.seconds.abs_diff(early.seconds) - u64::from(borrow);
        sign * seconds_of(seconds, parts)
    }

    /// Whether it is within so many seconds of zero.
    pub fn is_within(self, seconds: u32) -> bool {
        let seconds = i64::from(seconds);
        self >= Self::of_seconds(-seconds) && self <= Self::of_seconds(seconds)
    }

    /// The nearest nanosecond.
    pub(crate) fn to_nanosecond(self) -> Self {
        const NANO: u64 = PARTS / 1_000_000_000;
        let parts = (self.parts + NANO / 2) / NANO * NANO;
        let carry = parts / PARTS;
        Self { seconds: self.seconds.saturating_add_unsigned(carry), parts: parts % PARTS }
    }

    /// Whole seconds, rounded down, and the parts of 10⁻¹⁸ s behind them.
    pub(crate) const fn seconds_and_parts(self) -> (i64, u64) {
        (self.seconds, self.parts)
    }
}

/// w·10^q as whole ones and parts of 10⁻¹⁸, the last rounded to nearest. `None` beyond i64.
#[inline]
fn split(w: u128, q: i32) -> Option<(i64, u64)> {
    if q >= 0 {
        // More zeros than i64 has are beyond it.
        let whole = w.checked_mul(10_u128.checked_pow(q.unsigned_abs())?)?;
        return Some((i64::try_from(whole).ok()?, 0));
    }
    let places = q.unsigned_abs();
    // Below 2¹²⁸·10⁻⁵⁷ s nothing is left.
    if places > 57 {
        return Some((0, 0));
    }
    if q >= -PLACES {
        // What measurements write: one division of 64 bits.
        let unit = 10_u64.pow(places);
        let (whole, rest) = match u64::try_from(w) {
            Ok(w) => (u128::from(w / unit), w % unit),
            #[allow(clippy::cast_possible_truncation)] // less than the unit
            Err(_) => (w / u128::from(unit), (w % u128::from(unit)) as u64),
        };
        return Some((i64::try_from(whole).ok()?, rest * 10_u64.pow(PLACES.unsigned_abs() - places)));
    }
    // Finer than a part: rounded to it.
    let all = match 10_u128.checked_pow(places - PLACES.unsigned_abs()) {
        Some(finer) => w / finer + u128::from(w % finer >= finer.div_ceil(2)),
        None => 0,
    };
    let (whole, parts) = (all / u128::from(PARTS), all % u128::from(PARTS));
    Some((i64::try_from(whole).ok()?, u64::try_from(parts).ok()?))
}

/// Whole seconds and parts as f64, rounded once.
#[inline]
fn seconds_of(seconds: u64, parts: u64) -> f64 {
    if seconds == 0
        && let Some(number) = scaled(parts, -PLACES)
    {
        return number;
    }
    // In units in which it is a whole number of 64 bits: picoseconds, or nanoseconds.
    for (unit, places) in [(1_000_000, 12_u32), (1_000_000_000, 9)] {
        if parts.is_multiple_of(unit)
            && let Some(whole) = seconds.checked_mul(10_u64.pow(places))
            && let Some(whole) = whole.checked_add(parts / unit)
            && let Some(number) = scaled(whole, -places.cast_signed())
        {
            return number;
        }
    }
    // A text that is always a number.
    fast_float2::parse(format!("{seconds}.{parts:018}")).unwrap_or(seconds as f64)
}

/// As a decimal number of seconds, exactly: `1763834400.123456`.
impl fmt::Display for Instant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (sign, seconds, parts) = if self.seconds < 0 {
            let whole = self.parts == 0;
            let parts = if whole { 0 } else { PARTS - self.parts };
            ("-", self.seconds.unsigned_abs() - u64::from(!whole), parts)
        } else {
            ("", self.seconds.unsigned_abs(), self.parts)
        };
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

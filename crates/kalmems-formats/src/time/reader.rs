//! The times of one column as f64 seconds from an origin on.

use super::{Instant, TimeUnit, parse_iso};
use crate::csv::number::DecimalDigits;
use crate::{CellFinding, CellReader, Shift};

/// A clock that begins within so many seconds of zero counts from zero on: f64 keeps 15 ps of them.
const NEAR_ZERO_S: u32 = 100_000;

/// Reads the times of a column. They count from an origin on, which is the first time, or zero where the first time is
/// within 10⁵ s of it; each is rounded once.
///
/// ```
/// use kalmems_formats::{TimeReader, TimeUnit};
/// let mut times = TimeReader::new(TimeUnit::SECOND, None);
/// assert_eq!(times.integer(1_763_834_400), 0.0);
/// assert_eq!(times.float(1_763_834_400.000_001), 1e-6);
/// assert_eq!(times.origin().unwrap().to_utc().unwrap(), "2025-11-22T18:00:00Z");
/// ```
pub struct TimeReader {
    unit: TimeUnit,
    /// Whether texts are dates and times of a day, not numbers.
    iso: bool,
    origin: Option<Instant>,
    shift: Shift,
    cells: CellReader,
    /// How far apart the coarsest numbers are that binary times are rounded to, in s.
    resolution_s: f64,
}

impl TimeReader {
    /// One for numbers of a unit; with an origin, where that is not for the first time to say.
    pub fn new(unit: TimeUnit, origin: Option<Instant>) -> Self {
        let shift = Shift::new(unit.power);
        Self { unit, iso: false, origin, shift, cells: CellReader::default(), resolution_s: 0.0 }
    }

    /// One for texts that are dates and times of a day.
    #[must_use]
    pub fn of_iso(origin: Option<Instant>) -> Self {
        Self { iso: true, ..Self::new(TimeUnit::SECOND, origin) }
    }

    /// Where the times count from, once one is read.
    pub const fn origin(&self) -> Option<Instant> {
        self.origin
    }

    /// To how many seconds the numbers of a binary format are rounded, the coarsest so far; 0 where they are exact.
    pub const fn resolution_s(&self) -> f64 {
        self.resolution_s
    }

    /// Whether the times are numbers times a power of ten and nothing else, which any reader of numbers can read.
    pub(crate) fn is_plain(&self) -> bool {
        self.counts_from_zero() && !self.iso && self.unit.factor == 1
    }

    /// The power of ten of the unit.
    pub(crate) const fn power(&self) -> i32 {
        self.unit.power
    }

    fn counts_from_zero(&self) -> bool {
        self.origin == Some(Instant::ZERO) && self.unit.zero_s == 0
    }

    /// An exact time from the origin on.
    #[inline]
    pub fn instant(&mut self, time: Instant) -> f64 {
        let origin = *self
            .origin
            .get_or_insert_with(|| if time.is_within(NEAR_ZERO_S) { Instant::ZERO } else { time });
        time.since(origin)
    }

    /// An integer of a binary format.
    #[inline]
    pub fn integer(&mut self, number: i128) -> f64 {
        if !self.counts_from_zero()
            && let Some(time) = Instant::of_integer(number, self.unit)
        {
            return self.instant(time);
        }
        self.far(|shift| shift.integer(number))
    }

    /// A number of a binary format, taken as its shortest decimal digits.
    #[inline]
    pub fn float(&mut self, number: f64) -> f64 {
        self.rounded(number, number.abs().next_up() - number.abs())
    }

    /// A time that a regular clock computes.
    #[inline]
    pub(crate) fn computed(&mut self, time: f64) -> f64 {
        match Instant::of_float(time, self.unit) {
            Some(exact) if !self.counts_from_zero() => self.instant(exact),
            _ => time,
        }
    }

    /// A number of 32 bits of a binary format.
    #[inline]
    pub fn single(&mut self, number: f32) -> f64 {
        self.rounded(f64::from(number), f64::from(number.abs().next_up() - number.abs()))
    }

    /// A number whose next neighbour is so far away.
    fn rounded(&mut self, number: f64, apart: f64) -> f64 {
        if !number.is_finite() {
            return number;
        }
        if apart.is_finite() {
            self.resolution_s = self.resolution_s.max(apart * self.unit.in_seconds());
        }
        if !self.counts_from_zero()
            && let Some(time) = Instant::of_float(number, self.unit)
        {
            return self.instant(time);
        }
        self.far(|shift| shift.float(number))
    }

    /// A number that counts from zero on, or that is beyond the range of instants.
    fn far(&mut self, seconds: impl FnOnce(&mut Shift) -> f64) -> f64 {
        let seconds = seconds(&mut self.shift) * f64::from(self.unit.factor);
        if self.counts_from_zero() {
            return seconds;
        }
        // Beyond the range of instants: such a time says nothing of where a clock begins.
        let origin_s = self.origin.map_or(0.0, |origin| origin.since(Instant::ZERO));
        seconds + (self.unit.zero_s as f64 - origin_s)
    }

    /// The time at `start` of a text whose decimal point is `point`, and where it ends. `None` is no verdict:
    /// [`cell`](Self::cell) decides.
    #[inline]
    pub(crate) fn quick(
        &mut self,
        text: &[u8],
        start: usize,
        separator: u8,
        point: u8,
    ) -> Option<(f64, usize)> {
        if self.iso {
            let rest = text.get(start..)?;
            let end = memchr::memchr3(separator, b'\n', b'\r', rest)?;
            return Some((self.instant(parse_iso(rest.get(..end)?)?.instant()), start + end));
        }
        if self.counts_from_zero() {
            let (number, end) = crate::csv::number::quick(text, start, point, self.unit.power)?;
            return Some((number * f64::from(self.unit.factor), end));
        }
        let (digits, end) = DecimalDigits::read(text, start, point)?;
        Some((self.instant(Instant::of_digits(digits, self.unit)?), end))
    }

    /// The time in a cell whose decimal point is `point`, or what is wrong with it.
    pub fn cell(&mut self, cell: &[u8], point: u8) -> Result<f64, CellFinding> {
        if self.iso {
            let cell = cell.trim_ascii();
            return match parse_iso(cell) {
                Some(time) => Ok(self.instant(time.instant())),
                // What is no number either says what it is; a number is no date.
                None => Err(self
                    .cells
                    .read(cell, b'.', 0)
                    .err()
                    .unwrap_or_else(|| CellFinding::Text(crate::csv::excerpt(cell)))),
            };
        }
        if !self.counts_from_zero()
            && let Some(time) = exact(cell.trim_ascii(), point, self.unit)
        {
            return Ok(self.instant(time));
        }
        let seconds = self.cells.read(cell, point, self.unit.power)?;
        let time = self.far(|_| seconds);
        if time.is_finite() { Ok(time) } else { Err(CellFinding::Infinite(crate::csv::excerpt(cell))) }
    }
}

/// The digits of a text that are kept: 19 before the point and 18 behind it, and fewer where a unit multiplies them.
const KEPT: [usize; 2] = [37, 32];

/// A decimal number of any length in a unit. `None` where it is none, or beyond the range.
pub(super) fn exact(text: &[u8], point: u8, unit: TimeUnit) -> Option<Instant> {
    if let Some((digits, end)) = DecimalDigits::read(text, 0, point) {
        return if end == text.len() { Instant::of_digits(digits, unit) } else { None };
    }
    let (negative, unsigned) = match text.split_first()? {
        (b'-', rest) => (true, rest),
        (b'+', rest) => (false, rest),
        _ => (false, text),
    };
    let end = unsigned.iter().position(|byte| matches!(byte, b'e' | b'E')).unwrap_or(unsigned.len());
    let (mantissa, exponent) = unsigned.split_at(end);
    let mut q = match exponent.split_first() {
        None => 0,
        Some((_, digits)) => std::str::from_utf8(digits).ok()?.parse::<i32>().ok()?,
    };
    let most = KEPT[usize::from(unit.factor > 1)];
    let (mut w, mut kept, mut seen, mut behind) = (0_u128, 0, false, false);
    for byte in mantissa {
        if *byte == point && !behind {
            behind = true;
            continue;
        }
        let digit = byte.checked_sub(b'0').filter(|digit| *digit < 10)?;
        seen = true;
        if kept < most {
            w = w * 10 + u128::from(digit);
            kept += usize::from(w > 0);
            q = q.checked_sub(i32::from(behind))?;
        } else {
            q = q.checked_add(i32::from(!behind))?;
        }
    }
    if seen { Instant::of_decimal(w, q, negative, unit) } else { None }
}

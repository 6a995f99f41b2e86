//! Dates and times as text: ISO 8601, and what is near to it and has one meaning.

use super::Instant;
use chrono::{Datelike, NaiveDate};

/// A text that is a date or a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum IsoTime {
    /// A date, with a time of the day or at its beginning, in UTC where it names no other offset.
    Calendar(Instant),
    /// A time of a day alone.
    OfDay(Instant),
}

impl IsoTime {
    /// The seconds, since 1970 or since the beginning of the day.
    pub(crate) const fn instant(self) -> Instant {
        match self {
            Self::Calendar(instant) | Self::OfDay(instant) => instant,
        }
    }
}

/// Seconds of a day.
const DAY_S: i64 = 86_400;

/// Reads `2026-11-22T18:00:00.123456789Z`, with an offset such as `+01:00`, with a blank for the `T`, with slashes in a date
/// that begins with the year, a date alone, or `18:00:00.123` alone. `None` for anything else.
///
/// There are no leap seconds: a second 60 is the first of the next minute (POSIX).
#[inline]
pub(crate) fn parse_iso(text: &[u8]) -> Option<IsoTime> {
    let mut rest = UnreadText { text: text.trim_ascii() };
    let Some(days) = rest.date() else {
        let of_day = rest.time_of_day()?;
        return rest.text.is_empty().then_some(IsoTime::OfDay(of_day));
    };
    if rest.text.is_empty() {
        return Some(IsoTime::Calendar(Instant::of_seconds(days.checked_mul(DAY_S)?)));
    }
    rest.one_of(b"Tt ")?;
    let (seconds, parts) = rest.time_of_day()?.seconds_and_parts();
    let offset_s = rest.offset()?;
    let seconds = days.checked_mul(DAY_S)?.checked_add(seconds - offset_s)?;
    rest.text.is_empty().then_some(IsoTime::Calendar(Instant::new(seconds, parts)))
}

/// What is not read yet.
struct UnreadText<'a> {
    text: &'a [u8],
}

impl UnreadText<'_> {
    fn one_of(&mut self, letters: &[u8]) -> Option<u8> {
        let (first, rest) = self.text.split_first()?;
        letters.contains(first).then(|| {
            self.text = rest;
            *first
        })
    }

    /// So many digits.
    fn digits(&mut self, count: usize) -> Option<i64> {
        let (digits, rest) = self.text.split_at_checked(count)?;
        let mut number = 0;
        for digit in digits {
            number = number * 10 + i64::from(digit.checked_sub(b'0').filter(|digit| *digit < 10)?);
        }
        self.text = rest;
        Some(number)
    }

    /// The days since 1970 of a date that begins with its year; nothing is taken where there is none.
    fn date(&mut self) -> Option<i64> {
        let mut rest = UnreadText { text: self.text };
        let year = rest.digits(4)?;
        let mark = rest.one_of(b"-/")?;
        let month = rest.digits(2)?;
        rest.one_of(&[mark])?;
        let day = rest.digits(2)?;
        let [year, month, day] = [year, month, day].map(|number| u32::try_from(number).unwrap_or(0));
        let date = NaiveDate::from_ymd_opt(year.cast_signed(), month, day)?;
        self.text = rest.text;
        Some(date.to_epoch_days().into())
    }

    /// Hours of one or two digits, minutes, and perhaps seconds with a fraction.
    fn time_of_day(&mut self) -> Option<Instant> {
        let hours = if self.text.get(1) == Some(&b':') { self.digits(1)? } else { self.digits(2)? };
        self.one_of(b":")?;
        let minutes = self.digits(2)?;
        let (mut seconds, mut parts) = (0, 0);
        if self.one_of(b":").is_some() {
            seconds = self.digits(2)?;
            if self.one_of(b".,").is_some() {
                parts = self.fraction()?;
            }
        }
        if hours > 23 || minutes > 59 || seconds > 60 {
            return None;
        }
        Some(Instant::new(hours * 3600 + minutes * 60 + seconds, parts))
    }

    /// The digits behind a point, of which the first 18 count: there is nothing finer than that.
    fn fraction(&mut self) -> Option<u64> {
        let count = self.text.iter().take_while(|byte| byte.is_ascii_digit()).count();
        let (digits, rest) = self.text.split_at_checked(count)?;
        if digits.is_empty() {
            return None;
        }
        self.text = rest;
        let digits = digits.iter().copied().chain(std::iter::repeat(b'0')).take(18);
        Some(digits.fold(0, |parts, digit| parts * 10 + u64::from(digit - b'0')))
    }

    /// The offset from UTC in s: none, `Z`, `+01`, `+0100` or `+01:00`.
    fn offset(&mut self) -> Option<i64> {
        // Some write a blank before it.
        let marks: &[u8] = if self.one_of(b" ").is_some() { b"+-" } else { b"Zz+-" };
        let sign = match self.one_of(marks) {
            None | Some(b'Z' | b'z') => return Some(0),
            Some(b'-') => -1,
            Some(_) => 1,
        };
        let hours = self.digits(2)?;
        let minutes = if self.one_of(b":").is_none() && self.text.is_empty() { 0 } else { self.digits(2)? };
        (hours < 24 && minutes < 60).then_some(sign * (hours * 3600 + minutes * 60))
    }
}

impl Instant {
    /// As a date and time of UTC, if it counts from 1970: `2026-11-22T18:00:00.123456Z`. `None` outside the years 0 to 9999.
    pub fn to_utc(self) -> Option<String> {
        let (seconds, parts) = self.seconds_and_parts();
        let date = NaiveDate::from_epoch_days(i32::try_from(seconds.div_euclid(DAY_S)).ok()?)?;
        if !(0..=9999).contains(&date.year()) {
            return None;
        }
        let second = seconds.rem_euclid(DAY_S);
        let (hours, minutes, second) = (second / 3600, second / 60 % 60, second % 60);
        let mut text = format!("{date}T{hours:02}:{minutes:02}:{second:02}");
        if parts > 0 {
            let fraction = format!(".{parts:018}");
            text.push_str(fraction.trim_end_matches('0'));
        }
        text.push('Z');
        Some(text)
    }
}

//! Times that lose no digit, whatever they count from.
//!
//! A clock that counts seconds since 1970 has ten digits before the point: f64 keeps 0.24 µs of them. So a time is taken as an
//! [`Instant`], an exact number of seconds, and what is handed on is its difference to an origin, rounded once.

mod code;
mod instant;
mod iso;
mod reader;
#[cfg(test)]
mod tests;

pub(crate) use code::{TimeCode, TimeForm, labview};
pub use instant::{Instant, NoInstant};
pub(crate) use iso::{IsoTime, parse_iso};
pub use reader::TimeReader;

/// What a column of times counts, exactly: `factor`·10^`power` seconds each, from `zero_s` on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TimeUnit {
    /// 1 for seconds and their decimal parts, 60 for minutes, 86400 for days.
    pub factor: u32,
    /// The power of ten: −3 for milliseconds.
    pub power: i32,
    /// What is added to the seconds: −2082844800 where the count begins with 1904 and is to begin with 1970.
    pub zero_s: i64,
}

impl TimeUnit {
    /// Seconds as they are.
    pub const SECOND: Self = Self { factor: 1, power: 0, zero_s: 0 };

    /// Decimal parts of a second.
    pub const fn decimal(power: i32) -> Self {
        Self { factor: 1, power, zero_s: 0 }
    }

    /// Whole seconds.
    pub const fn seconds(factor: u32) -> Self {
        Self { factor, power: 0, zero_s: 0 }
    }

    /// The same, counted from another second on.
    #[must_use]
    pub const fn from(self, zero_s: i64) -> Self {
        Self { zero_s, ..self }
    }

    /// About how long one is, in s.
    pub(crate) fn in_seconds(self) -> f64 {
        f64::from(self.factor) * 10_f64.powi(self.power)
    }
}

/// What a format itself says of a column of times, whose unit is then a second.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TimeKind {
    /// Instants of the calendar, as seconds since the beginning of 1970 in UTC, without leap seconds (POSIX).
    Calendar,
    /// Durations, or times of a day.
    Elapsed,
}

/// The first second of 1904 in UTC, from which LabVIEW counts, in seconds since 1970.
pub const LABVIEW_ZERO_S: i64 = -2_082_844_800;

/// The day 0 of a spreadsheet, 30 December 1899, in seconds since 1970.
pub const SPREADSHEET_ZERO_S: i64 = -2_209_161_600;

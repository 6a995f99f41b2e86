//! Where the times of a recording count from.

use kalmems_formats::Instant;
use serde::Serialize;

/// Where the times of a recording count from, where that is not zero of its clock.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct TimeOrigin {
    /// What the clock of the file shows there, in s, exactly: `1763834400.123456`. Since 1970 where it is of the calendar.
    pub seconds: String,
    /// The same as a date of UTC, where the clock is one of the calendar.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub utc: Option<String>,
}

impl TimeOrigin {
    /// `None` for zero.
    pub(super) fn of(origin: Instant, calendar: bool) -> Option<Self> {
        (origin != Instant::ZERO).then(|| Self {
            seconds: origin.to_string(),
            utc: Some(origin).filter(|_| calendar).and_then(Instant::to_utc),
        })
    }

    /// In a sentence.
    pub fn sentence(&self) -> String {
        let Self { seconds, utc } = self;
        match utc {
            Some(utc) => format!("Times count from {utc} on, {seconds} s since 1970."),
            None => format!("Times count from {seconds} s of the file's clock on."),
        }
    }
}

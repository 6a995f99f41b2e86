//! Units of time that name an instant, as xarray and the CF conventions write them: `seconds since 1970-01-01`.

use crate::time::{IsoTime, TimeUnit, parse_iso};

/// What the numbers of a dataset with such a unit count. `None` for any other text.
pub(super) fn time(unit: &str) -> Option<TimeUnit> {
    let (word, since) = unit.split_once(" since ")?;
    let (factor, power) = match word.trim().to_ascii_lowercase().as_str() {
        "days" | "day" | "d" => (86_400, 0),
        "hours" | "hour" | "h" | "hr" | "hrs" => (3600, 0),
        "minutes" | "minute" | "min" | "mins" => (60, 0),
        "seconds" | "second" | "s" | "sec" | "secs" => (1, 0),
        "milliseconds" | "millisecond" | "ms" | "msec" => (1, -3),
        "microseconds" | "microsecond" | "us" | "µs" => (1, -6),
        "nanoseconds" | "nanosecond" | "ns" => (1, -9),
        _ => return None,
    };
    let IsoTime::Calendar(zero) = parse_iso(since.trim().as_bytes())? else { return None };
    let (zero_s, 0) = zero.seconds_and_parts() else { return None };
    Some(TimeUnit { factor, power, zero_s })
}

#[cfg(test)]
mod tests {
    use super::time;

    #[test]
    fn a_unit_that_names_an_instant() {
        let of = |unit: &str| time(unit).map(|unit| (unit.factor, unit.power, unit.zero_s));
        for (unit, expected) in [
            ("seconds since 1970-01-01", Some((1, 0, 0))),
            ("days since 1899-12-30", Some((86_400, 0, -2_209_161_600))),
            ("nanoseconds since 1970-01-01T00:00:01", Some((1, -9, 1))),
            ("s", None),
            ("seconds since the start", None),
            ("months since 1970-01-01", None),
        ] {
            assert_eq!(of(unit), expected, "{unit}");
        }
    }
}

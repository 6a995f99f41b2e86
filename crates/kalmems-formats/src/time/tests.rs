//! Exact times against integers of 128 bits and the standard library's reading of text.

use super::{Instant, IsoTime, TimeReader, TimeUnit, parse_iso};
use proptest::prelude::*;

/// An exact time in 10⁻¹⁸ s by the digits alone: no code of this crate.
fn attoseconds(text: &str) -> i128 {
    let (sign, digits) = text.strip_prefix('-').map_or((1, text), |digits| (-1, digits));
    let (whole, fraction) = digits.split_once('.').unwrap_or((digits, ""));
    sign * format!("{whole}{fraction:0<18}").parse::<i128>().unwrap()
}

/// 10⁻¹⁸ s in s, rounded once by the standard library.
fn seconds(attoseconds: i128) -> f64 {
    format!("{attoseconds}e-18").parse().unwrap()
}

fn decimal() -> impl Strategy<Value = String> {
    let size = prop_oneof![0..10_i64, 0..2_000_000_i64, 1_700_000_000..1_800_000_000_i64, 0..1_i64 << 53];
    (any::<bool>(), size, 0..1_000_000_000_000_000_000_u64, 0..=18_usize).prop_map(
        |(minus, whole, parts, places)| {
            let parts = format!("{parts:018}");
            let sign =
                if minus && (whole > 0 || parts[..places].contains(|digit| digit != '0')) { "-" } else { "" };
            if places == 0 { format!("{sign}{whole}") } else { format!("{sign}{whole}.{}", &parts[..places]) }
        },
    )
}

/// Whether a number is as near to its shortest digits as to their neighbour: 9829408014.1015625 to …562 and …563.
fn lies_between(number: f64) -> bool {
    let exact = format!("{number:.60}");
    let exact = exact.trim_end_matches('0');
    exact.ends_with('5') && exact.len() == format!("{number}").len() + 1
}

#[test]
fn a_time_between_two_representable_numbers_is_reported() {
    assert!(
        lies_between(9_829_408_014.101_563) && !lies_between(8_862_752_833.759_203) && !lies_between(0.5)
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4000))]

    #[test]
    fn a_difference_of_texts_is_rounded_once(late in decimal(), early in decimal()) {
        let [a, b]: [Instant; 2] = [late.parse().unwrap(), early.parse().unwrap()];
        let exact = attoseconds(&late) - attoseconds(&early);
        let expected = if exact == 0 { 0.0 } else { seconds(exact) };
        prop_assert_eq!(a.since(b).to_bits(), expected.to_bits(), "{} - {}", late, early);
        prop_assert_eq!(a.cmp(&b), exact.cmp(&0));
    }

    #[test]
    fn what_is_shown_is_what_was_read(text in decimal()) {
        let instant: Instant = text.parse().unwrap();
        prop_assert_eq!(attoseconds(&instant.to_string()), attoseconds(&text));
    }

    /// Integers and decimals of any unit, near their origin and far from it.
    #[test]
    fn integers_in_a_unit_are_exact(first: i64, step in -1_000_000_000_i64..1_000_000_000, factor in 1_u32..100_000, power in -12..1_i32) {
        let second = first.saturating_add(step);
        let unit = TimeUnit { factor, power, zero_s: -2_082_844_800 };
        let in_unit = |number: i64| Instant::of_integer(i128::from(number), unit);
        let (Some(a), Some(b)) = (in_unit(second), in_unit(first)) else {
            // Beyond i64 seconds.
            let largest = (first as f64).abs().max((second as f64).abs()) * f64::from(factor) * 10_f64.powi(power);
            prop_assert!(largest > 9.2e18, "{}", largest);
            return Ok(());
        };
        let unit = i128::from(factor) * 10_i128.pow((18 + power).unsigned_abs());
        let exact = (i128::from(second) - i128::from(first)) * unit;
        let expected = if exact == 0 { 0.0 } else { seconds(exact) };
        prop_assert_eq!(a.since(b).to_bits(), expected.to_bits());
    }

    /// A binary number is its shortest decimal digits, where the first is so far from zero that the others count from it.
    #[test]
    fn floats_are_their_shortest_digits(first in 100_001.0..1e10_f64, second in 1e5..1e10_f64) {
        let mut times = TimeReader::new(TimeUnit::SECOND, None);
        times.float(first);
        let exact = attoseconds(&format!("{second}")) - attoseconds(&format!("{first}"));
        // Of two that are as near, writers differ: of 17 digits, and where the number lies in their middle.
        if format!("{first}{second}").len() > 34 || lies_between(first) || lies_between(second) {
            return Ok(());
        }
        let expected = if exact == 0 { 0.0 } else { seconds(exact) };
        prop_assert_eq!(times.float(second).to_bits(), expected.to_bits());
    }

    /// Any text: no panic, and what is read as a number is what the standard library reads.
    #[test]
    fn any_text_is_a_time_or_a_fault(text in "[-+0-9.eE:TZ /]{0,30}", first in "[0-9]{0,12}") {
        for origin in [None, Some(Instant::ZERO), first.parse().ok()] {
            let mut times = TimeReader::new(TimeUnit::decimal(-3), origin);
            let read = times.cell(text.as_bytes(), b'.');
            if let (Ok(time), Some(Instant::ZERO)) = (&read, origin) {
                let trimmed = text.trim();
                let (digits, exponent) = trimmed.split_once(['e', 'E']).unwrap_or((trimmed, "0"));
                let expected: f64 = format!("{digits}e{}", exponent.parse::<i64>().unwrap().saturating_sub(3)).parse().unwrap();
                prop_assert_eq!(time.to_bits(), expected.to_bits(), "{}", text);
            }
            // What there is of it.
            let _ = TimeReader::of_iso(origin).cell(text.as_bytes(), b'.');
        }
    }
}

/// Day by day through four centuries, counted on the fingers.
#[test]
fn dates_follow_each_other() {
    let (mut year, mut month, mut day) = (1800, 1, 1);
    // 1 January 1970 is 62091 days later: 170 years, 41 of which are leap years.
    let mut days = -(170 * 365 + 41);
    while year < 2200 {
        let text = format!("{year:04}-{month:02}-{day:02}");
        let instant = Instant::of_seconds(days * 86_400);
        assert_eq!(parse_iso(text.as_bytes()), Some(IsoTime::Calendar(instant)), "{text}");
        assert_eq!(instant.to_utc().unwrap(), format!("{text}T00:00:00Z"));
        days += 1;
        day += 1;
        let leap = year % 4 == 0 && (year % 100 != 0 || year % 400 == 0);
        let last = [31, if leap { 29 } else { 28 }, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31][month - 1];
        if day > last {
            assert_eq!(parse_iso(format!("{year:04}-{month:02}-{day:02}").as_bytes()), None);
            (day, month) = (1, month + 1);
        }
        if month > 12 {
            (month, year) = (1, year + 1);
        }
    }
}

#[test]
fn dates_and_times_of_a_day_as_text() {
    let calendar = |text: &str| match parse_iso(text.as_bytes())? {
        IsoTime::Calendar(instant) => Some(instant.to_string()),
        IsoTime::OfDay(_) => panic!("{text}"),
    };
    for (text, seconds) in [
        ("1970-01-01T00:00:00Z", "0"),
        ("1969-12-31T23:59:59.25Z", "-0.75"),
        ("2026-11-22T18:00:00.123456789Z", "1795370400.123456789"),
        (" 2026-11-22t18:00:00,123456789 ", "1795370400.123456789"),
        ("2026-11-22 18:00", "1795370400"),
        ("2026/11/22 18:00:00+02", "1795363200"),
        ("2026-11-22T18:00:00 -0130", "1795375800"),
        ("2026-11-22T18:00:00.000000000000000000999Z", "1795370400"),
        // A leap second is the first of the next minute.
        ("2016-12-31T23:59:60Z", "1483228800"),
        ("0000-02-29", "-62162121600"),
    ] {
        assert_eq!(calendar(text).as_deref(), Some(seconds), "{text}");
    }
    for (text, seconds) in [("18:00:00.123", "64800.123"), ("7:05", "25500")] {
        assert_eq!(parse_iso(text.as_bytes()), Some(IsoTime::OfDay(seconds.parse().unwrap())), "{text}");
    }
    for text in [
        "",
        "2026",
        "2026-11-22T",
        "2026-02-29",
        "2026-13-01",
        "2026-11/22",
        "22.11.2026",
        "11/22/2026",
        "2026-11-22T24:00:00",
        "2026-11-22T18:00:61",
        "2026-11-22T18:00:00.",
        "2026-11-22T18:00:00 PM",
        "2026-11-22T18:00:00+25:00",
        "18",
        "18:00:00Z",
        "-18:00:00",
        "2026-11-22T18:00:00Zx",
        "١٨:٠٠:٠٠",
    ] {
        assert_eq!(parse_iso(text.as_bytes()), None, "{text}");
    }
}

#[test]
fn stamps_of_labview_keep_their_fractions() {
    for (seconds, fraction, shown) in [
        (2_082_844_800, 0, "0"),
        (2_082_844_800, 1 << 63, "0.5"),
        (2_082_844_799, 1 << 62, "-0.75"),
        // 2⁻⁶⁴ s is less than half a part, and 2⁶⁴ − 1 of them are a second but for less than that.
        (2_082_844_800, 1, "0"),
        (2_082_844_800, u64::MAX, "1"),
    ] {
        assert_eq!(Instant::of_labview(seconds, fraction).unwrap().to_string(), shown);
    }
    assert_eq!(Instant::of_labview(i64::MIN, 0), None);
}

#[test]
fn texts_beyond_the_range_are_no_instants() {
    for text in ["1e19", "-1e300", "9223372036854775808", "", "-", ".", "1e", "1.2.3", "0x1", "nan"] {
        assert!(text.parse::<Instant>().is_err(), "{text}");
    }
    for (text, shown) in [
        ("9223372036854775807.999999999999999999", "9223372036854775807.999999999999999999"),
        ("-0", "0"),
        ("1e-30", "0"),
        ("0.0000000000000000005", "0.000000000000000001"),
        ("1700000000.12345678901234567890123456789", "1700000000.123456789012345679"),
    ] {
        assert_eq!(text.parse::<Instant>().unwrap().to_string(), shown, "{text}");
    }
}

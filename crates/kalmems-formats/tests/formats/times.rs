//! Times since 1970 from every format that keeps them: `tools/times.py` wrote the fixtures, and the standard library reads
//! the times from the start on that they stand for.

use super::{column, content, fixture, npy_array};
use kalmems_formats::{Block, Hints, Instant, Table, TimeKind, TimeUnit, WantedColumn, open, open_reader};
use std::io::Cursor;

/// When the first row was sampled, in µs since 1970.
const START_US: i64 = 1_763_834_400_123_456;

/// The times of a column and where they count from.
fn times(table: &mut dyn Table, name: &str, unit: TimeUnit, origin: Option<Instant>) -> (Vec<f64>, Instant) {
    let wanted = [WantedColumn::Time { column: column(table, name), unit, origin }];
    table.want(&wanted).unwrap_or_else(|error| panic!("{name}: {error}"));
    let (mut times, mut block) = (Vec::new(), Block::with_capacity(37));
    loop {
        table.read(&mut block).unwrap();
        if block.is_end() {
            return (times, block.origin);
        }
        times.extend_from_slice(&block.numbers[0]);
    }
}

/// The row's time from the start on, by the standard library.
fn microsecond(row: usize) -> f64 {
    format!("{row}e-6").parse().unwrap()
}

fn assert_counts_from_start(name: &str, times: &[f64], origin: Instant, rows: usize) {
    assert_eq!(origin.to_string(), "1763834400.123456", "{name}");
    assert_eq!(origin.to_utc().unwrap(), "2025-11-22T18:00:00.123456Z");
    assert_eq!(times.len(), rows, "{name}");
    for (row, time) in times.iter().enumerate().filter(|(_, time)| !time.is_nan()) {
        assert_eq!(time.to_bits(), microsecond(row).to_bits(), "{name}: row {row}, {time:e}");
    }
}

#[test]
fn dates_of_binary_formats_count_from_the_first_and_lose_nothing() {
    for (file, name, rows) in [
        ("times.npz", "time", 2000),
        ("times.npy", "time", 50),
        ("times.parquet", "time", 2000),
        ("times.parquet", "time_local", 2000),
    ] {
        let mut table = open(&fixture(file), &Hints::default()).unwrap();
        assert_eq!(table.time_kind(column(&*table, name)), Some(TimeKind::Calendar), "{file}");
        // What the name would say does not matter.
        let (found, origin) = times(&mut *table, name, TimeUnit::decimal(-3), None);
        assert_counts_from_start(file, &found, origin, rows);
    }
    // What is no time (NaT) is none.
    let mut table = open(&fixture("times.npy"), &Hints::default()).unwrap();
    let (found, _) = times(&mut *table, "time", TimeUnit::SECOND, None);
    assert!(found[7].is_nan() && found.iter().filter(|time| time.is_nan()).count() == 1);
}

/// NumPy counts in multiples of a unit where it is told so.
#[test]
fn dates_in_multiples_of_a_unit_are_read() {
    let ticks: Vec<u8> = (0..100_i64).flat_map(|row| (70_553_376_000_000 + row).to_le_bytes()).collect();
    let bytes = Cursor::new(npy_array(b"[('time', '<M8[25us]')]", "(100,)", &ticks));
    let mut table = open_reader(bytes, "", &Hints::default()).unwrap();
    let (found, origin) = times(&mut *table, "time", TimeUnit::SECOND, None);
    assert_eq!(origin.to_string(), "1763834400");
    let expected: Vec<f64> = (0..100).map(|row| microsecond(25 * row)).collect();
    assert_eq!(found, expected);
}

#[test]
fn integers_and_rounded_numbers_of_hdf5_count_from_the_first() {
    let mut table = open(&fixture("times.h5"), &Hints::default()).unwrap();
    let (found, origin) = times(&mut *table, "time_ns", TimeUnit::decimal(-9), None);
    assert_counts_from_start("time_ns", &found, origin, 2000);
    // 1.7e9 s as f64 stands for its shortest decimal digits, which are the microseconds.
    let mut table = open(&fixture("times.h5"), &Hints::default()).unwrap();
    let time = column(&*table, "time_s");
    table.want(&[WantedColumn::Time { column: time, unit: TimeUnit::SECOND, origin: None }]).unwrap();
    let mut block = Block::with_capacity(2000);
    table.read(&mut block).unwrap();
    assert_counts_from_start("time_s", &block.numbers[0], block.origin, 2000);
    assert_eq!(block.resolution_s, 2.0_f64.powi(-22));
    // As xarray writes them.
    let mut table = open(&fixture("times.h5"), &Hints::default()).unwrap();
    let (found, origin) = times(&mut *table, "since", TimeUnit::SECOND, None);
    assert_eq!(origin.to_utc().unwrap(), "2025-11-22T18:00:00Z");
    assert_eq!(found[999], 999e-6);
}

#[test]
fn what_a_date_is_as_a_number_a_duration_and_a_label() {
    let mut table = open(&fixture("times.parquet"), &Hints::default()).unwrap();
    let [ms, day, date] = ["time_ms", "of_day", "time"].map(|name| column(&*table, name));
    assert_eq!(
        (table.time_kind(day), table.time_kind(ms)),
        (Some(TimeKind::Elapsed), Some(TimeKind::Calendar))
    );
    assert_eq!(table.time_kind(column(&*table, "cap_V")), None);
    let wanted = [
        WantedColumn::Number { column: ms, power: 0 },
        WantedColumn::Number { column: day, power: 0 },
        WantedColumn::Label { column: date },
    ];
    let found = content(&mut *table, &wanted, 100).unwrap();
    assert_eq!(found.numbers[0][0], 1_763_834_400.123);
    assert_eq!(found.numbers[1][1], 64_800.123_457);
    assert_eq!(found.labels[0][2], "2025-11-22T18:00:00.123458Z");
    let mut table = open(&fixture("times.npy"), &Hints::default()).unwrap();
    let wanted = [
        WantedColumn::Label { column: column(&*table, "since") },
        WantedColumn::Number { column: column(&*table, "since"), power: 0 },
    ];
    let found = content(&mut *table, &wanted, 100).unwrap();
    assert_eq!((found.labels[0][2].as_str(), found.numbers[0][2]), ("0.000002", 2e-6));
}

/// Seconds since 1904 and 2⁻⁶⁴ s: not the decimal microsecond, but next to it.
#[test]
fn stamps_of_labview_are_exact_to_an_attosecond() {
    let mut table = open(&fixture("times.tdms"), &Hints::default()).unwrap();
    let (found, origin) = times(&mut *table, "time", TimeUnit::SECOND, None);
    assert!(origin.to_utc().unwrap().starts_with("2025-11-22T18:00:00.12345"), "{origin}");
    assert_eq!(found.len(), 50);
    for (row, time) in found.iter().enumerate() {
        // npTDMS itself rounds to 2⁻⁶⁴ s after a division by 10⁶ in f64.
        assert!((time - microsecond(row)).abs() < 1e-15, "{row}: {time:e}");
    }
}

/// The same times as text in every way that is read; a row is 1 µs after the one before.
fn texts() -> Vec<(&'static str, TimeUnit, String)> {
    let second = TimeUnit::SECOND;
    let of = |cell: &dyn Fn(i64) -> String| {
        let rows = (0..300).map(|row| format!("{},{row}\n", cell(START_US + row)));
        "time,x_1\n".to_owned() + &rows.collect::<String>()
    };
    let parts = |us: i64| (us / 1_000_000, us % 1_000_000);
    let iso = |us: i64| format!("18:00:00.{:06}", us % 1_000_000);
    vec![
        ("s, 6 decimals", second, of(&|us| format!("{}.{:06}", parts(us).0, parts(us).1))),
        ("s, 9 decimals", second, of(&|us| format!("{}.{:06}000", parts(us).0, parts(us).1))),
        (
            "s, 30 decimals",
            second,
            of(&|us| format!("+{}.{:06}{}", parts(us).0, parts(us).1, "0".repeat(24))),
        ),
        (
            "s, exponent",
            second,
            of(&|us| format!("{}.{:015}E+9", us / 1_000_000_000_000_000, us % 1_000_000_000_000_000)),
        ),
        ("ms", TimeUnit::decimal(-3), of(&|us| format!("{}.{:03}", us / 1000, us % 1000))),
        ("us", TimeUnit::decimal(-6), of(&|us| us.to_string())),
        ("ns", TimeUnit::decimal(-9), of(&|us| (us * 1000).to_string())),
        ("ISO, Z", second, of(&|us| format!("2025-11-22T{}Z", iso(us)))),
        ("ISO, offset", second, of(&|us| format!("2025-11-22T{}+00:00", iso(us)))),
        ("ISO, another day", second, of(&|us| format!("2025-11-23T03:30:00.{:06}000+0930", us % 1_000_000))),
        ("pandas", second, of(&|us| format!("2025-11-22 {}", iso(us)))),
        ("quoted", second, of(&|us| format!("\"2025/11/22 {}\"", iso(us)))),
    ]
}

#[test]
fn times_since_1970_as_text_count_from_the_first_and_lose_nothing() {
    for (name, unit, text) in texts() {
        let mut table = open_reader(Cursor::new(text.into_bytes()), "a.csv", &Hints::default()).unwrap();
        let (found, origin) = times(&mut *table, "time", unit, None);
        assert_counts_from_start(name, &found, origin, 300);
    }
}

/// A file beside another one counts from where that one does.
#[test]
fn a_given_origin_is_kept_and_the_difference_is_exact() {
    let origin: Instant = "1763834399.999999999".parse().unwrap();
    for (name, unit, text) in texts() {
        let mut table = open_reader(Cursor::new(text.into_bytes()), "a.csv", &Hints::default()).unwrap();
        let (found, kept) = times(&mut *table, "time", unit, Some(origin));
        assert_eq!((found[5], kept), (0.123_461_001, origin), "{name}");
    }
}

/// Digits of a clock near zero are those of any number: no origin, and no other rounding.
#[test]
fn a_clock_that_begins_near_zero_counts_from_zero() {
    for (first, unit) in [
        ("0", TimeUnit::SECOND),
        ("-99999.5", TimeUnit::SECOND),
        ("100000", TimeUnit::SECOND),
        ("1666", TimeUnit::seconds(60)),
    ] {
        let text =
            format!("time,x_1\n{first},1\n9.9999999999999995e-07,2\n1e300,3\n,4\n123456.7890123456789,5\n");
        let mut table = open_reader(Cursor::new(text.into_bytes()), "a.csv", &Hints::default()).unwrap();
        let (found, origin) = times(&mut *table, "time", unit, None);
        assert_eq!(origin, Instant::ZERO);
        let factor = f64::from(unit.factor);
        let expected: Vec<f64> = [first, "9.9999999999999995e-07", "1e300", "nan", "123456.7890123456789"]
            .map(|text| text.parse::<f64>().unwrap() * factor)
            .to_vec();
        for (found, expected) in found.iter().zip(&expected) {
            assert!(
                found.to_bits() == expected.to_bits() || found.is_nan() && expected.is_nan(),
                "{found} {expected}"
            );
        }
    }
}

#[test]
fn one_wild_time_does_not_say_where_the_others_count_from() {
    let text = "time,x_1\n1e300,1\n-1e300,1\n1763834400.5,2\n1763834400.500001,3\n1e300,4\n";
    let mut table = open_reader(Cursor::new(text.as_bytes().to_vec()), "a.csv", &Hints::default()).unwrap();
    let (found, origin) = times(&mut *table, "time", TimeUnit::SECOND, None);
    assert_eq!(origin.to_string(), "1763834400.5");
    assert_eq!(found, [1e300, -1e300, 0.0, 1e-6, 1e300]);
}

#[test]
fn a_second_column_of_times_is_refused() {
    let mut table = open_reader(Cursor::new(b"a,b\n1,2\n".to_vec()), "a.csv", &Hints::default()).unwrap();
    let time = |column| WantedColumn::Time { column, unit: TimeUnit::SECOND, origin: None };
    let error = table.want(&[time(0), time(1)]).unwrap_err();
    assert_eq!(error.to_string(), "CSV: a second column as the times of the rows is not read; name one");
}

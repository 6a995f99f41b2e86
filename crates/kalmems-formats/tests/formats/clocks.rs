//! Clocks that formats state beside the samples.

use super::{column, content, fixture};
use kalmems_formats::{Block, Hints, Instant, Table, TimeUnit, WantedColumn, open};

fn table(name: &str) -> Box<dyn Table> {
    open(&fixture(name), &Hints::default()).unwrap()
}

/// The times of a file, and the numbers of another column, which is NaN where it has none.
fn times_and(name: &str, other: &str) -> (Vec<f64>, Vec<f64>) {
    let mut table = table(name);
    let time = column(&*table, "time_s");
    let wanted = [
        WantedColumn::Time { column: time, unit: TimeUnit::SECOND, origin: Some(Instant::ZERO) },
        WantedColumn::Number { column: column(&*table, other), power: 0 },
    ];
    let mut content = content(&mut *table, &wanted, 7).unwrap();
    let numbers = content.numbers.pop().unwrap();
    (content.numbers.pop().unwrap(), numbers)
}

#[test]
fn a_channel_that_begins_whole_samples_later_begins_so_many_rows_later() {
    for name in ["later.tdms", "stated.h5"] {
        let (times, drive) = times_and(name, "drive_V");
        let (_, cap) = times_and(name, "cap_V");
        let step = if name == "stated.h5" { 5e-4 } else { 1e-3 };
        assert_eq!((times.len(), drive.len(), cap.len()), (48, 48, 48), "{name}");
        for (row, time) in times.iter().enumerate() {
            approx::assert_relative_eq!(*time, row as f64 * step, max_relative = 1e-15);
        }
        assert!(
            cap[..8].iter().all(|value| value.is_nan()) && drive[40..].iter().all(|value| value.is_nan())
        );
        let first = if name == "stated.h5" { 0.0 } else { 100.0 };
        assert_eq!((drive[39], cap[8], cap[47]), (39.0, first, first + 39.0), "{name}");
    }
    let mut later = table("later.tdms");
    let cap = WantedColumn::Number { column: column(&*later, "cap_V"), power: -3 };
    let faults = content(&mut *later, &[cap], 100).unwrap().faults;
    assert_eq!(faults.len(), 8);
    assert!(faults.iter().all(|(_, _, fault)| *fault == kalmems_formats::CellFinding::Missing));
}

#[test]
fn a_channel_that_begins_between_the_samples_of_another_is_refused_beside_it_by_name() {
    let mut between = table("between.tdms");
    let numbers: Vec<WantedColumn> = ["drive_V", "cap_V"]
        .map(|name| WantedColumn::Number { column: column(&*between, name), power: 0 })
        .into();
    let said = between.want(&numbers).unwrap_err().to_string();
    assert_eq!(
        said,
        "TDMS: `cap_V` together with `drive_V` (it starts 0.0033 s after `drive_V`: 3.3 samples, no whole number) is not read; \
         name columns that were sampled together, or this one alone with `clock = { rate = … }`"
    );
    let time =
        WantedColumn::Time { column: column(&*between, "time_s"), unit: TimeUnit::SECOND, origin: None };
    assert!(between.want(&[time, numbers[1]]).is_err());
    assert!(between.want(&[time, numbers[0]]).is_ok() && between.want(&numbers[1..]).is_ok());
    assert!(between.description().columns[2].apart.as_ref().unwrap().contains("0.0033 s after"));
}

#[test]
fn waveforms_of_a_channel_keep_their_own_starts_and_intervals_and_tell_where_they_begin() {
    let (times, numbers) = times_and("waveforms.tdms", "cap_V");
    assert_eq!(times.len(), 150);
    for (row, time) in times.iter().enumerate() {
        let k = row as f64;
        let expected = match row {
            0..60 => k * 1e-3,
            60..100 => 60.0 + (k - 60.0) * 1e-3,
            _ => 61.0 + (k - 100.0) * 5e-4,
        };
        approx::assert_relative_eq!(*time, expected, max_relative = 1e-14);
        assert_eq!(numbers[row], k);
    }
    let mut table = table("waveforms.tdms");
    let cap = column(&*table, "cap_V");
    table.want(&[WantedColumn::Number { column: cap, power: 0 }]).unwrap();
    let (mut block, mut breaks, mut begin) = (Block::with_capacity(32), Vec::new(), 0);
    loop {
        table.read(&mut block).unwrap();
        if block.is_end() {
            break;
        }
        breaks.extend(block.breaks.iter().map(|(row, missing)| (begin + row, *missing)));
        begin += block.rows;
    }
    // The second waveform goes on from the first.
    assert_eq!(breaks, [(60, 59_940), (100, 960)]);
}

#[test]
fn a_rate_an_interval_and_a_start_that_a_file_states_make_its_times() {
    for (name, step, start, other) in [
        ("stated.mat", 1e-4, -2e-3, "A"),
        ("stated.npz", 1e-4, 0.25, "cap_V"),
        ("stated.parquet", 1e-4, 0.25, "cap_V"),
        ("broadcast.wav", 1.25e-4, 3600.5, "channel1_1"),
        ("ticks.h5", 1e-3, 7e-3, "x"),
    ] {
        let named = if name == "ticks.h5" { "timestamp_s" } else { "time_s" };
        let mut table = table(name);
        let wanted = [
            WantedColumn::Time {
                column: column(&*table, named),
                unit: TimeUnit::SECOND,
                origin: Some(Instant::ZERO),
            },
            WantedColumn::Number { column: column(&*table, other), power: 0 },
        ];
        let content = content(&mut *table, &wanted, 16).unwrap();
        assert_eq!(content.numbers[0].len(), 40, "{name}");
        for (row, time) in content.numbers[0].iter().enumerate() {
            approx::assert_relative_eq!(*time, start + row as f64 * step, max_relative = 1e-14);
        }
        assert!(content.faults.is_empty(), "{name}: {:?}", content.faults);
    }
}

//! Each kind of finding from a small file, and what is read from files of every form.

use super::*;
use crate::config::layout::ColumnCompensation;
use crate::config::{CurvePiece, TemperatureCurve};
use crate::units::kind;
use kalmems_core::Portable;
use proptest::prelude::*;
use std::fmt::Write as _;
use std::ops::Range;
use std::time::Instant;

fn layout(clock: &str, segments: &str, columns: &[&str]) -> RecordingLayout {
    RecordingLayout {
        clock: if clock.is_empty() {
            TimeSource::Rate { rate_hz: 1000.0, start_s: 0.5 }
        } else {
            TimeSource::Column(clock.to_owned())
        },
        segment_column: (!segments.is_empty()).then(|| segments.to_owned()),
        columns: (!columns.is_empty()).then(|| columns.iter().map(|&c| c.to_owned()).collect()),
        declared: Vec::new(),
        hints: Hints::default(),
        nominal_rate_hz: None,
        origin: None,
        restarts: None,
    }
}

fn read(bytes: &[u8], layout: &RecordingLayout) -> Result<SampledRecording, ReadError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.csv");
    std::fs::write(&path, bytes).unwrap();
    SampledRecording::read(&path, layout)
}

/// The diagnosis as text, whether or not the recording can be used.
fn diagnosis(text: &str, layout: &RecordingLayout) -> String {
    let (verdict, findings) = match read(text.as_bytes(), layout) {
        Ok(recording) => ("usable", recording.diagnosis),
        Err(ReadError::Unusable { findings, .. }) => ("unusable", findings),
        Err(other) => return other.to_string(),
    };
    let mut text = verdict.to_owned();
    for finding in findings {
        write!(text, "\n{:?} {:?}: {finding}", finding.severity(), finding.kind).unwrap();
    }
    text
}

/// A sine of `amplitude` steps, rounded to whole steps, with `clip` as its highest and lowest value.
fn sine(rows: usize, period: f64, amplitude: f64, phase: f64, clip: f64) -> String {
    let mut text = "time_us,cap_V\n".to_owned();
    for i in 0..rows {
        let angle = std::f64::consts::TAU * i as f64 / period + phase;
        let code = (amplitude * angle.sin()).round().clamp(-clip, clip);
        // One step is 5/1024 V, written with fewer digits than it has.
        writeln!(text, "{i},{:.5}", code * 5.0 / 1024.0).unwrap();
    }
    text
}

/// Files with each kind of finding: name, text and layout.
fn files() -> Vec<(&'static str, String, RecordingLayout)> {
    let time = layout("time_s", "", &["cap_V"]);
    let rows = "time_s,cap_V\n0,1\n1,2\n";
    let clipped = sine(600, 200.0, 100.0, 0.0, 80.0);
    let files = [
        ("good", rows, time.clone()),
        ("empty", "", time.clone()),
        ("only comments", "# nothing\n\n", time.clone()),
        ("header only", "# a comment\ntime_s,cap_V\n", time.clone()),
        ("no header", "# a comment\n0,1\n1,2\n", time.clone()),
        ("names in a comment", "# time_s,cap_V\n0,1\n1,2\n", time.clone()),
        ("no line end", "time_s,cap_V\n0,1\n1,2", time.clone()),
        ("semicolons", "time_s;cap_V\n0;1\n", time.clone()),
        ("no such column", "time_s,cap_mV\n0,1\n1,2\n", time.clone()),
        ("nothing like it", "time_s,x_m\n0,1\n1,2\n", time.clone()),
        ("twice", "time_s,cap_V,cap_V\n0,1,1\n1,2,2\n", time.clone()),
        ("twice, all", "time_s,cap_V,cap_V\n0,1,1\n1,2,2\n", layout("time_s", "", &[])),
        ("unknown unit", "time_s,cap_v\n0,1\n1,2\n", layout("time_s", "", &["cap_v"])),
        ("no unit", "time_s,direction\n0,1\n1,2\n", layout("time_s", "", &["direction"])),
        ("no unit, all", "time_s,direction\n0,1\n1,2\n", layout("time_s", "", &[])),
        ("time in volts", "time_V,cap_V\n0,1\n1,2\n", layout("time_V", "", &["cap_V"])),
        ("wrong rows", "time_s,cap_V\n0,1\n1\n2,3\n3,4,5\n", time.clone()),
        ("words", "time_s,cap_V\n0,1\n1,high\n2,\"1,5\"\n3,0\n", time.clone()),
        ("time missing", "time_s,cap_V\n0,1\n,2\nnan,3\nlate,4\n4,5\n", time.clone()),
        ("time repeated", "time_s,cap_V\n0,1\n1,2\n1,3\n1,4\n2,5\n", time.clone()),
        ("time decreases", "time_s,cap_V\n0,1\n1,2\n2,3\n0,4\n1,5\n2,6\n0,7\n", time.clone()),
        ("no label", "r,time_s,cap_V\n,0,1\n,1,2\na,2,3\n,3,4\na,4,5\n", layout("time_s", "r", &["cap_V"])),
        (
            "returns",
            "r,time_s,cap_V\na,0,1\na,1,2\nb,0,3\nb,1,4\na,0,5\na,1,6\n",
            layout("time_s", "r", &["cap_V"]),
        ),
        ("blank lines", "time_s,cap_V\n0,1\n\n \n1,2\n2,3\n\n\n", time.clone()),
        ("blank line in one column", "cap_V\n1\n\n3\n\n", layout("", "", &["cap_V"])),
        ("missing", "time_s,cap_V\n0,1\n1,\n2,3\n3, \n4,NaN\n5,-inf\n6,1e999\n7,0\n", time.clone()),
        ("gaps", "time_s,cap_V\n0,1\n1,2\n2,3\n5,4\n6,3\n8,2\n9,3\n", time.clone()),
        (
            "irregular",
            "time_ms,cap_V\n0,1\n1,2\n2.02,3\n3,4\n4.5,3\n5.5,2\n6.5,3\n7.5,2\n",
            layout("time_ms", "", &["cap_V"]),
        ),
        ("constant", "time_s,cap_V\n0,0\n1,0\n2,0\n3,\n", time.clone()),
        ("saturated", clipped.as_str(), layout("time_us", "", &["cap_V"])),
        (
            "all at once",
            "time_s,cap_V\n0,1\n1\n2,x\n2,5\n3,\n1,4\n",
            layout("time_s", "record", &["cap_V", "drive_V"]),
        ),
    ];
    files.map(|(name, text, layout): (_, &str, RecordingLayout)| (name, text.to_owned(), layout)).to_vec()
}

#[test]
fn every_kind_of_finding_says_where_what_and_what_to_do() {
    let mut report = String::new();
    for (name, text, layout) in files() {
        writeln!(report, "## {name}\n{}\n", diagnosis(&text, &layout)).unwrap();
    }
    insta::assert_snapshot!(report);
}

#[test]
fn the_error_lists_everything() {
    let error = read(b"time_s,cap_V\n0,1\n1\n2,x\n2,\n", &layout("time_s", "", &["cap_V"])).unwrap_err();
    let text = error.to_string();
    let (first, rest) = text.split_once('\n').unwrap();
    assert!(first.ends_with("a.csv` cannot be used as a recording:"), "{first}");
    assert_eq!(rest.lines().count(), 4, "{rest}");
    assert!(rest.lines().last().unwrap().starts_with("  note: line 5"), "{rest}");
}

#[test]
fn findings_are_counted_per_column_and_segment() {
    let text = "r,time_s,a_V,b_V\nx,0,1,2\nx,1,,3\nx,2,,4\ny,0,,\ny,1,5,6\ny,2,4,7\n";
    let found = read(text.as_bytes(), &layout("time_s", "r", &["a_V", "b_V"])).unwrap().diagnosis;
    let found: Vec<_> = found
        .iter()
        .map(|f| (f.column.as_deref().unwrap(), f.segment.as_deref().unwrap(), f.first_row, f.count))
        .collect();
    assert_eq!(found, [("a_V", "x", 3, 2), ("a_V", "y", 5, 1), ("b_V", "y", 5, 1)]);
}

#[test]
fn numbers_become_si() {
    let text = "time_us,cap_pF,gyro_dps,gap_um\n0,5.71,180,19.2\n1.6,5.72,90,1e1\n";
    let recording = read(text.as_bytes(), &layout("time_us", "", &[])).unwrap();
    assert_eq!(recording.column("cap_pF").unwrap().values, [5.71e-12, 5.72e-12]);
    assert_eq!(recording.column("gap_um").unwrap().values, [19.2e-6, 1e-5]);
    assert_eq!(recording.column("gap_um").unwrap().header.unit_text, "um");
    approx::assert_relative_eq!(recording.column("gyro_dps").unwrap().values[0], std::f64::consts::PI);
    let time = &recording.segments()[0].time;
    assert_eq!((time.start_s(), time.at(1), time.interval_s()), (0.0, 1.6e-6, Some(1.6e-6)));
    assert!(time.at(2).is_nan());
}

#[test]
fn a_column_that_was_not_read_is_named_with_its_neighbour() {
    let recording = read(b"time_s,cap1A_V,cap2A_V\n0,1,2\n", &layout("time_s", "", &[])).unwrap();
    let error = recording.column("cap_1A_V").unwrap_err().to_string();
    insta::assert_snapshot!(error, @"the recording `a.csv` has no column `cap_1A_V`; did you mean `cap1A_V`?");
    let error = recording.column("zz").unwrap_err().to_string();
    insta::assert_snapshot!(error, @"the recording `a.csv` has no column `zz`; there are `cap1A_V`, `cap2A_V`");
}

#[test]
fn segments_by_text_and_by_number() {
    for (labels, expected) in [
        (["train1", "train1", "test", "test"], ["train1", "test"]),
        (["1711.0", "1711", "1711.5", "1.7115e3"], ["1711.0", "1711.5"]),
    ] {
        let times = [0.0, 0.1, 0.0, 0.1];
        let mut text = "time_s,record_Hz,x_V\n".to_owned();
        for (row, (label, time)) in labels.iter().zip(times).enumerate() {
            writeln!(text, "{time},{label},{row}").unwrap();
        }
        let recording = read(text.as_bytes(), &layout("time_s", "record_Hz", &["x_V"])).unwrap();
        let segments = recording.segments();
        assert_eq!(segments.iter().map(|s| s.label.as_str()).collect::<Vec<_>>(), expected);
        assert_eq!((segments[0].rows.clone(), segments[1].rows.clone()), (0..2, 2..4));
        assert_eq!(recording.column("x_V").unwrap().of(&segments[1]), [2.0, 3.0]);
        assert_eq!((segments[1].time.start_s(), segments[1].time.at(1)), (0.0, 0.1));
        assert!(segments[1].time.is_uniform());
    }
}

#[test]
fn a_rate_is_a_clock() {
    let recording = read(b"r,x_V\na,1\na,2\nb,3\n", &layout("", "r", &["x_V"])).unwrap();
    let segments = recording.segments();
    assert_eq!((segments[0].time.at(1), segments[1].time.start_s()), (0.501, 0.5));
    assert_eq!(segments[1].time.interval_s(), Some(0.001));
    let bad =
        RecordingLayout { clock: TimeSource::Rate { rate_hz: 0.0, start_s: 0.0 }, ..layout("", "", &[]) };
    assert!(matches!(read(b"x_V\n1\n", &bad), Err(ReadError::Clock { .. })));
}

#[test]
fn forms_of_files() {
    let plain = "time_s,cap_V\n0,1\n1,2\n";
    let expected = read(plain.as_bytes(), &layout("time_s", "", &[])).unwrap();
    for text in [
        "time_s,cap_V\n0,1\n1,2",
        "time_s,cap_V\r\n0,1\r\n1,2\r\n",
        "time_s,cap_V\r\n0,1\r\n1,2\r\n\r\n",
        "\u{feff}time_s,cap_V\n0,1\n1,2\n",
        "\u{feff}# a comment, with a \" in it\n#\n\ntime_s,cap_V\n0,1\n1,2\n",
        "\"time_s\",\"cap_V\"\r\n\"0\",\"1\"\r\n\"1\",\"2\"\r\n",
        " time_s , cap_V\n 0 , 1\n1,2\n\n\n",
        "time_s   cap_V\n  0   1\n  1\t2\n",
        "# time_s cap_V\n0.0e+00 1.0e+00\n1.0e+00 2.0e+00\n",
        "sep=;\ntime_s;cap_V\n0;1,0\n1;2,0\n",
    ] {
        let recording = read(text.as_bytes(), &layout("time_s", "", &[])).unwrap();
        assert_eq!(recording.columns, expected.columns, "{text:?}");
        assert_eq!(recording.segments, expected.segments, "{text:?}");
        let found: Vec<_> = recording.diagnosis.iter().map(|finding| finding.kind).collect();
        let expected: &[_] = if text.ends_with('\n') { &[] } else { &[FindingKind::NoLineEnd] };
        assert_eq!(found, expected, "{text:?}");
    }
    let wide: Vec<u8> =
        std::iter::once(0xfeff).chain(plain.encode_utf16()).flat_map(u16::to_le_bytes).collect();
    let recording = read(&wide, &layout("time_s", "", &[])).unwrap();
    assert_eq!((&recording.columns, &recording.diagnosis), (&expected.columns, &expected.diagnosis));
}

/// What a scope writes: a channel is no unit, and neither is a text that nobody reads a fault.
#[test]
fn columns_of_scopes_have_the_units_that_their_files_state() {
    let picoscope = "Time,Channel A,Channel B\n(ms),(V),(mV)\n\n0,1.5,-3\n1,1.6,-4\n";
    let recording = read(picoscope.as_bytes(), &layout("Time_ms", "", &[])).unwrap();
    let units: Vec<_> = recording.columns.iter().map(|c| (c.header.column.as_str(), c.header.unit)).collect();
    let unit = |text: &str| Some(Unit::parse(text).unwrap());
    assert_eq!(units, [("Channel A_V", unit("V")), ("Channel B_mV", unit("mV"))]);
    assert_eq!(recording.columns[1].values, [-3e-3, -4e-3]);
    let with_text = "stamp,time_s,cap_V\n2024-05-01T12:00:00.000001,0,1\n2024-05-01T12:00:00.000002,1,2\n";
    let recording = read(with_text.as_bytes(), &layout("time_s", "", &["cap_V"])).unwrap();
    assert_eq!((recording.rows, recording.diagnosis.len()), (2, 0));
}

#[test]
fn lines_are_those_of_an_editor() {
    for (text, line) in [
        ("time_s,cap_V\n0,1\n1,\n", 3),
        ("time_s,cap_V\n0,1\n1,", 3),
        ("time_s,cap_V\r\n0,1\r\n1,\r\n", 3),
        ("# one\n# two\ntime_s,cap_V\n0,1\n1,\n", 5),
        ("\n\r\ntime_s,cap_V\n0,1\n1,\n", 5),
        ("time_s,\"cap_V\n\"\n0,1\n1,\n", 4),
        ("time_s,cap_V\n0,\"1\n\"\n1,\"\n\"\n2,3\n", 4),
        ("time_s,cap_V\n0,1\n\n\n1,\n2,3\n", 5),
    ] {
        let findings = read(text.as_bytes(), &layout("time_s", "", &[])).unwrap().diagnosis;
        let missing = findings.iter().find(|f| f.kind == FindingKind::Missing).unwrap();
        assert_eq!(missing.first_row, line, "{text:?}");
    }
}

#[test]
fn the_source_is_hashed_as_it_is_read() {
    let recording = read(b"a_V\n1\n", &layout("", "", &[])).unwrap();
    let source = recording.source();
    assert_eq!((source.file.as_str(), source.bytes), ("a.csv", 6));
    // printf 'a_V\n1\n' | sha256sum
    assert_eq!(source.sha256, "00c60fae14fe20a58bd1400e865c793da0b5a6322181a5cf2037598a6b4f21d8");
}

#[test]
fn the_sines_of_a_column_are_kept_as_long_as_its_numbers() {
    let recording = read(b"a_V,b_V\n1,5\n2,6\n3,7\n", &layout("", "", &[])).unwrap();
    let found = |recording: &SampledRecording, column: &str, amplitude: f64| {
        let sine = Sine { offset: 0.0, amplitude, frequency_hz: 1.0, phase_rad: 0.0, residual_rms: 0.0 };
        let column = recording.column(column).unwrap();
        column.sines(0..3, 1, || Some(vec![sine])).first().map(|sine| sine.amplitude)
    };
    assert_eq!([found(&recording, "a_V", 1.0), found(&recording, "b_V", 2.0)], [Some(1.0), Some(2.0)]);
    // Copies have them, and those of the columns that are not changed.
    let changed = recording.what_if("a_V", |_, values| values[0] = 0.0);
    assert_eq!([found(&changed, "a_V", 3.0), found(&changed, "b_V", 3.0)], [Some(3.0), Some(2.0)]);
    assert_eq!(found(&recording.clone(), "a_V", 4.0), Some(1.0));
    let exchanged = recording.exchanged("a_V", "b_V");
    assert_eq!([found(&exchanged, "a_V", 5.0), found(&exchanged, "b_V", 5.0)], [Some(5.0); 2]);
    assert_eq!(found(&recording.first_rows(2), "a_V", 6.0), Some(6.0));
}

#[test]
fn reading_reports_progress_and_can_be_stopped() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("long.csv");
    let rows = 200_000;
    let mut text = "x_V\n".to_owned();
    for i in 0..rows {
        writeln!(text, "{i}").unwrap();
    }
    std::fs::write(&path, &text).unwrap();
    let mut reports = Vec::new();
    let begun = Instant::now();
    let recording = SampledRecording::read_with(&path, &layout("", "", &[]), &mut |done, total| {
        reports.push((done, total));
        ControlFlow::Continue(())
    })
    .unwrap();
    assert_eq!(recording.rows(), rows);
    let length = text.len() as u64;
    // Each part of the rows is reported, and whenever the patience of a caller has passed once more.
    let by_rows = rows / 65_536 + 1;
    let by_time = usize::try_from(begun.elapsed().as_millis() / 100).unwrap();
    assert!((by_rows..=by_rows + by_time).contains(&reports.len()), "{reports:?}");
    assert!(reports.is_sorted() && reports.iter().all(|r| r.1 == length));
    assert_eq!(reports.last(), Some(&(length, length)));

    let mut calls = 0;
    let stopped = SampledRecording::read_with(&path, &layout("", "", &[]), &mut |_, _| {
        calls += 1;
        ControlFlow::Break(())
    });
    assert!(matches!(stopped, Err(ReadError::Interrupted { .. })));
    assert_eq!(calls, 1);
}

#[test]
fn a_file_that_is_not_there() {
    let error = SampledRecording::read("nowhere/a.csv".as_ref(), &layout("", "", &[])).unwrap_err();
    assert!(error.to_string().starts_with("cannot read `nowhere/a.csv`: "), "{error}");
}

#[test]
fn times_far_from_zero_are_uniform_within_their_rounding() {
    let mut text = "time_s,x_V\n".to_owned();
    for i in 0..1000 {
        writeln!(text, "{},{i}", 1.7e9 + f64::from(i) * 1e-5).unwrap();
    }
    let recording = read(text.as_bytes(), &layout("time_s", "", &[])).unwrap();
    assert_eq!(recording.diagnosis, []);
}

fn saturated(text: &str) -> usize {
    let recording = read(text.as_bytes(), &layout("time_us", "", &["cap_V"])).unwrap();
    let found = recording.diagnosis.iter().filter(|f| f.kind == FindingKind::Saturation);
    found.map(|f| f.count).sum()
}

#[test]
fn a_signal_between_two_levels_is_not_saturated() {
    let mut text = "time_us,cap_V\n".to_owned();
    for i in 0..1000 {
        writeln!(text, "{i},{}", if i / 50 % 2 == 0 { 0 } else { 5 }).unwrap();
    }
    assert_eq!(saturated(&text), 0);
}

#[test]
fn a_signal_that_settles_is_not_saturated() {
    for time_constant in [20.0, 50.0, 200.0, 1000.0] {
        for steps in [50.0, 255.0, 4095.0, 1e6] {
            let mut text = "time_us,cap_V\n".to_owned();
            for i in 0..8000 {
                let code = (steps * (1.0 - (-f64::from(i) / time_constant).exp())).round();
                writeln!(text, "{i},{code}").unwrap();
            }
            assert_eq!(saturated(&text), 0, "{time_constant} {steps}");
        }
    }
}

/// A signal of so many rows, whose values are rounded to whole steps.
fn steps(rows: u32, value: impl Fn(f64) -> f64) -> String {
    let mut text = "time_us,cap_V\n".to_owned();
    for i in 0..rows {
        writeln!(text, "{i},{}", value(f64::from(i)).round()).unwrap();
    }
    text
}

/// Numbers of variance 1 that are nearly normal, one for each row.
fn nearly_normal(seed: u64, row: f64) -> f64 {
    let uniform = |k: u32| {
        let turn = (12.989_8 * row + 78.233 * f64::from(k) + 0.37 * seed as f64).portable_sin();
        (43_758.545_3 * turn).rem_euclid(1.0)
    };
    (0..12).map(uniform).sum::<f64>() - 6.0
}

/// A rail that a few samples of each cycle reach is one, whatever the noise and the resolution are. Of the cycles whose next sample is a step
/// from the rail the samples are not counted.
#[test]
fn a_signal_of_few_samples_in_a_cycle_is_saturated() {
    for period in [24.3, 31.9, 45.3] {
        for amplitude in [100.0, 1800.0, 3e4] {
            for noise in [0.0, 0.01] {
                let limit = (0.8_f64 * amplitude).round();
                let wave = |row: f64| {
                    let wave = (std::f64::consts::TAU * row / period).portable_sin();
                    amplitude * (wave + noise * nearly_normal(1, row))
                };
                let text = steps(8000, |row| wave(row).min(limit));
                let (found, at) = (
                    saturated(&text),
                    text.lines().filter(|line| line.ends_with(&format!(",{limit}"))).count(),
                );
                assert!(4 * found > at && found <= at, "{period} {amplitude} {noise}: {found} of {at}");
                assert_eq!(saturated(&steps(8000, wave)), 0, "{period} {amplitude} {noise}");
            }
        }
    }
}

/// What a reading gives, bit for bit: columns, segments with their times, and findings.
#[derive(Debug, PartialEq)]
struct ReadingBits {
    columns: Vec<Vec<u64>>,
    segments: Vec<SegmentBits>,
    findings: String,
}

/// Label, rows, times and usual interval of a segment.
type SegmentBits = (String, Range<usize>, Vec<u64>, Option<f64>);

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|v| v.to_bits()).collect()
}

fn whole(path: &Path, layout: &RecordingLayout) -> Result<ReadingBits, String> {
    let recording = SampledRecording::read(path, layout).map_err(|error| error.to_string())?;
    let segment =
        |s: &Segment| (s.label.clone(), s.rows.clone(), bits(&s.time.to_vec()), s.time.interval_s());
    Ok(ReadingBits {
        columns: recording.columns().iter().map(|c| bits(&c.values)).collect(),
        segments: recording.segments().iter().map(segment).collect(),
        findings: format!("{:?}", recording.diagnosis()),
    })
}

/// The same put together from stretches, each of which is checked to hold what is promised around it.
fn put_together(path: &Path, layout: &RecordingLayout, around: StretchSize) -> Result<ReadingBits, String> {
    let go_on = &mut |_, _| ControlFlow::Continue(());
    let mut stretches = Stretches::open(path, layout, around).map_err(|error| error.to_string())?;
    let mut whole = ReadingBits { columns: Vec::new(), segments: Vec::new(), findings: String::new() };
    while let Some(stretch) = stretches.next(go_on).map_err(|error| error.to_string())? {
        let Stretch { recording, fresh, begins, ends } = &stretch;
        let [own] = recording.segments() else { panic!() };
        assert_eq!(own.rows, 0..recording.rows());
        let first = whole.columns.first().map_or(0, Vec::len);
        if *begins {
            assert_eq!(fresh.start, 0);
            whole.segments.push((own.label.clone(), first..first, Vec::new(), own.time.interval_s()));
        }
        whole.columns.resize(recording.columns().len(), Vec::new());
        let segment = whole.segments.last_mut().unwrap();
        assert_eq!(fresh.start, around.before.min(segment.1.len()));
        let (times, usual) = (&mut segment.2, &segment.3);
        let now = bits(&own.time.to_vec());
        assert_eq!(now[..fresh.start], times[times.len() - fresh.start..]);
        times.extend(&now[fresh.clone()]);
        assert_eq!(own.time.interval_s(), *usual);
        for (all, column) in whole.columns.iter_mut().zip(recording.columns()) {
            let now = bits(&column.values);
            let again = &all[all.len() - fresh.start..];
            let differs = now[..fresh.start].iter().zip(again).position(|(a, b)| a != b);
            assert_eq!(differs, None, "{around:?} {} {fresh:?} {}", column.header.column, all.len());
            all.extend(&now[fresh.clone()]);
        }
        segment.1.end += fresh.len();
        let size = if *begins { around.first } else { around.rows };
        let there = recording.rows() - fresh.end;
        if *ends {
            assert!((1..size + around.after.max(1)).contains(&fresh.len()) && there == 0);
        } else {
            assert!(fresh.len() == size && there == around.after);
        }
        stretches.reuse(stretch);
    }
    let (source, findings) = stretches.finish();
    assert_eq!(source.bytes, std::fs::metadata(path).unwrap().len());
    whole.findings = format!("{findings:?}");
    Ok(whole)
}

#[test]
fn stretches_put_together_are_the_recording() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.csv");
    let mut many = files();
    let records = "r,x_V\na,1\na,2\nb,3\nb,4\nb,5\nc,6\n";
    many.push(("a rate", records.to_owned(), layout("", "r", &["x_V"])));
    for (name, text, layout) in many {
        std::fs::write(&path, &text).unwrap();
        let expected = whole(&path, &layout);
        for (rows, before, after) in [(1, 0, 0), (1, 3, 2), (2, 1, 1), (7, 0, 5), (1000, 10, 10)] {
            // The usual interval is that of the first stretch.
            let around = StretchSize { rows, first: 1000, before, after };
            let found = put_together(&path, &layout, around);
            assert!(found == expected, "{name} {around:?}: {found:?} for {expected:?}");
        }
    }
}

/// What is given at a time may follow from the interval of each record, which is known before anything of it is given.
#[test]
fn a_record_is_given_as_its_interval_asks() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.csv");
    let mut text = "r,time_s,x_V\n".to_owned();
    for (label, interval) in [("a", 1), ("b", 3)] {
        for k in 0..30 {
            writeln!(text, "{label},{},0", k * interval).unwrap();
        }
    }
    std::fs::write(&path, text).unwrap();
    let mut go_on = |_: u64, _: u64| ControlFlow::Continue(());
    let around = StretchSize { rows: 10, first: 5, before: 0, after: 1 };
    let mut stretches = Stretches::open(&path, &layout("time_s", "r", &[]), around).unwrap();
    let (mut intervals, mut given) = (Vec::new(), Vec::new());
    loop {
        if let Some(interval_s) = stretches.beginning(&mut go_on).unwrap() {
            intervals.push(interval_s);
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // 1 and 3
            let more = interval_s as usize;
            stretches.give(StretchSize { rows: 10, first: 5 + more, before: more, after: 2 * more });
        }
        let Some(stretch) = stretches.next(&mut go_on).unwrap() else { break };
        given.push((stretch.fresh.clone(), stretch.recording.rows(), stretch.ends));
    }
    assert_eq!(intervals, [1.0, 3.0]);
    // 6, 10, 10 and 4 rows of the first; of the second 8 and 10, and 12, as 6 would have to come after 10.
    let of_a = [(0..6, 8, false), (1..11, 13, false), (1..11, 13, false), (1..5, 5, true)];
    let of_b = [(0..8, 14, false), (3..13, 19, false), (3..15, 15, true)];
    assert_eq!(given, of_a.into_iter().chain(of_b).collect::<Vec<_>>());
}

/// Several records far longer than a stretch and than what is kept, with what each check looks for.
#[test]
fn long_recordings_in_stretches_have_the_findings_of_the_whole() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.csv");
    let mut text = "r,time_s,clipped_V,still_V,smooth_V,grows_V\n".to_owned();
    for (label, rows) in [("a", 60_000), ("b", 50), ("c", 70_000)] {
        for i in 0..rows {
            if label == "c" && (40_000..40_003).contains(&i) {
                continue;
            }
            let angle = std::f64::consts::TAU * f64::from(i) / 3011.7;
            let clip = if label == "a" { 80.0 } else { 90.0 };
            let clipped = (100.0 * angle.sin()).round().clamp(-80.0, clip);
            let grows = (100.0 * angle.sin() * f64::from(1 + i / 10_000)).round().min(300.0);
            let smooth = if i == 35_000 { String::new() } else { format!("{:.3}", angle.cos()) };
            let jitter = if label == "c" && i == 50_000 { ".3" } else { "" };
            writeln!(text, "{label},{i}{jitter},{clipped},{},{smooth},{grows}", u8::from(label == "c"))
                .unwrap();
        }
    }
    std::fs::write(&path, &text).unwrap();
    for (layout, kinds) in [
        (layout("time_s", "r", &[]), 10),
        (layout("", "r", &["clipped_V", "grows_V"]), 4),
        (layout("", "", &["clipped_V", "smooth_V", "still_V"]), 2),
    ] {
        let expected = whole(&path, &layout).unwrap();
        assert!(expected.findings.matches("Finding {").count() >= kinds, "{}", expected.findings);
        for around in [
            StretchSize { rows: 1000, first: 1000, before: 0, after: 0 },
            StretchSize { rows: 777, first: 20_000, before: 300, after: 50 },
            StretchSize { rows: 65_536, first: 65_536, before: 10_000, after: 10_000 },
        ] {
            let found = put_together(&path, &layout, around).unwrap();
            assert_eq!(found.findings, expected.findings, "{around:?}");
            assert!(found == expected, "{around:?}");
        }
    }
}

/// A record whose clock runs, stops for a while, goes back and jumps far away.
fn jumping() -> String {
    let mut text = "time_s,x_V\n".to_owned();
    let times = (0..60).map(f64::from).chain((0..60).map(|k| 160.0 + f64::from(k)));
    let times = times.chain((0..60).map(|k| 100.5 + f64::from(k))).chain([1e300, 161.0, 162.0, 163.0]);
    for (row, time) in times.enumerate() {
        writeln!(text, "{time},{}", row % 7).unwrap();
    }
    text
}

#[test]
fn a_record_is_cut_behind_long_gaps_and_where_its_clock_goes_back() {
    let restarts = Some(Restarts::beyond(50.0));
    let layout = RecordingLayout { restarts, ..layout("time_s", "", &["x_V"]) };
    let mut text = jumping();
    // More rows, so that two of them that go back are few.
    for k in 0..300 {
        writeln!(text, "{},{}", 164 + k, k % 5).unwrap();
    }
    let recording = read(text.as_bytes(), &layout).unwrap();
    let of = |s: &Segment| (s.rows.clone(), s.stretch.number, s.stretch.clock_run, s.stretch.after_s);
    assert_eq!(
        recording.segments().iter().map(of).collect::<Vec<_>>(),
        [
            (0..60, 1, 1, None),
            (60..120, 2, 1, Some(59.0)),
            (120..180, 3, 2, Some(219.0)),
            (180..181, 4, 2, Some(159.5)),
            (181..484, 5, 3, Some(1e300)),
        ]
    );
    assert_eq!(recording.segments()[1].time.at(0).to_bits(), 160_f64.to_bits());
    assert_eq!(recording.column("x_V").unwrap().of(&recording.segments()[4])[..4], [6.0, 0.0, 1.0, 0.0]);
    let found: Vec<String> = recording.diagnosis().iter().map(ToString::to_string).collect();
    insta::assert_snapshot!(found.join("\n"), @"
    line 62, column `time_s`: nothing for 101 s after 59 s, longer than the 50 s that are predicted over (the first of 2 gaps); nothing is put in: a new stretch begins, and the estimate begins anew; `longest` in `[recording.gaps]` says what is predicted over
    line 122, column `time_s`: 100.5 s after 219 s (the first of 2 times); the times are kept as they stand: a new stretch begins, and the estimate begins anew
    ");
    // Without a policy the same file is refused, and shortly.
    let text = diagnosis(&text, &RecordingLayout { restarts: None, ..layout });
    assert!(
        text.starts_with("unusable\nFatal DecreasingTime: line 122, column `time_s`: 100.5 s after 219 s"),
        "{text}"
    );
    assert!(text.lines().all(|line| line.len() < 300), "{text}");
}

#[test]
fn a_record_that_is_cut_is_the_same_in_stretches() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.csv");
    let mut text = "r,time_s,x_V\n".to_owned();
    for label in ["a", "b"] {
        for k in 0..4000 {
            let time = f64::from(k) + if k > 1000 { 500.0 } else { 0.0 } - if k > 2500 { 900.0 } else { 0.0 };
            let gap = if k > 3000 { 30.0 } else { 0.0 };
            writeln!(text, "{label},{},{}", time + gap, k % 11).unwrap();
        }
    }
    std::fs::write(&path, &text).unwrap();
    let restarts = Some(Restarts::beyond(50.0));
    let layout = RecordingLayout { restarts, ..layout("time_s", "r", &["x_V"]) };
    let expected = whole(&path, &layout).unwrap();
    assert_eq!(expected.segments.len(), 6, "{:?}", expected.findings);
    for kind in ["LongGap", "ClockBack", "kind: Gap"] {
        assert_eq!(expected.findings.matches(kind).count(), 2, "{}", expected.findings);
    }
    for around in [
        StretchSize { rows: 100, first: 100, before: 0, after: 0 },
        StretchSize { rows: 77, first: 900, before: 300, after: 50 },
        StretchSize { rows: 5000, first: 5000, before: 10, after: 10 },
    ] {
        let found = put_together(&path, &layout, around).unwrap();
        assert!(found == expected, "{around:?}: {} for {}", found.findings, expected.findings);
    }
}

#[test]
fn rows_in_no_order_and_rows_between_gaps_alone_are_refused_with_what_to_do() {
    let layout = RecordingLayout { restarts: Some(Restarts::beyond(5.0)), ..layout("time_s", "", &["x_V"]) };
    // Two records with one clock each, row by row.
    let mut mixed = "time_s,x_V\n".to_owned();
    for k in 0..30_000 {
        writeln!(mixed, "{},{}", if k % 2 == 0 { k } else { k + 100_000 }, k % 5).unwrap();
    }
    let text = diagnosis(&mixed, &layout);
    assert!(text.contains("Fatal DecreasingTime") && text.contains("sort the rows"), "{text}");
    // Samples that come more slowly than the policy allows.
    let mut slow = "time_s,x_V\n".to_owned();
    for k in 0..100 {
        writeln!(slow, "{},{}", 10 * k, k % 5).unwrap();
    }
    let text = diagnosis(&slow, &layout);
    assert!(text.contains("Fatal SparseTime") && text.contains("[recording.gaps]"), "{text}");
    // Of rows that arrive nothing is refused; a stretch begins with each.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.csv");
    std::fs::write(&path, &slow).unwrap();
    let table = kalmems_formats::open(&path, &layout.hints).unwrap();
    let around = StretchSize { rows: 10, first: 10, before: 0, after: 1 };
    let mut stretches = Stretches::of_arriving(table, &path, &layout, around).unwrap();
    let mut count = 0;
    while let Some(stretch) = stretches.next(&mut |_, _| ControlFlow::Continue(())).unwrap() {
        count += usize::from(stretch.begins);
        stretches.reuse(stretch);
    }
    assert_eq!(count, 100);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// A turning point of a coarsely rounded sine is no saturation, however long it stays on one step.
    #[test]
    fn a_rounded_sine_is_not_saturated(
        amplitude in 0.6..2000.0_f64, period in 10.0..3000.0_f64, phase in 0.0..6.3_f64,
    ) {
        prop_assert_eq!(saturated(&sine(4000, period, amplitude, phase, 1e9)), 0);
    }

    /// A sine that is clipped by a few steps is, and all of its clipped rows are counted.
    #[test]
    fn a_clipped_sine_is_saturated(
        amplitude in 100.0..2000.0_f64, period in 200.0..1000.0_f64, phase in 0.0..6.3_f64, part in 0.3..0.9_f64,
    ) {
        let clip = (part * amplitude).round();
        let text = sine(4000, period, amplitude, phase, clip);
        let rail = format!("{:.5}", clip * 5.0 / 1024.0);
        let clipped = text.lines().filter(|line| line.trim_start_matches(|c| c != ',').trim_start_matches([',', '-']) == rail).count();
        // Runs that the record cuts short at its ends may be shorter than those that count: n rows after which the sine
        // has left its rail by less than is asked for, and one step of rounding.
        let slope = std::f64::consts::TAU / period * amplitude * (1.0 - part * part).sqrt();
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // some tens
        let short = SATURATION_RUN.max(((SATURATION_STEPS + 1.0) / slope).ceil() as usize);
        prop_assert!(saturated(&text).abs_diff(clipped) <= 2 * short, "{} of {clipped}", saturated(&text));
    }

    /// Nor is one whose cycles have a whole number of samples, nor one whose values are written twice, with noise or without.
    #[test]
    fn a_sine_that_repeats_is_not_saturated(
        amplitude in 5.0..4000.0_f64, period in 5_u32..200, phase in 0.0..6.3_f64, held in 1_u32..3,
        noise in prop_oneof![Just(0.0), 0.01..5.0_f64], seed in 0_u64..1000,
    ) {
        let text = steps(6000, |row| {
            let row = (row / f64::from(held)).floor();
            let turn = std::f64::consts::TAU * row / f64::from(period) + phase;
            amplitude * turn.portable_sin() + noise * nearly_normal(seed, row)
        });
        prop_assert_eq!(saturated(&text), 0);
    }

    #[test]
    fn no_bytes_panic(bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
        let _ = read(&bytes, &layout("time_s", "", &[]));
        let _ = read(&bytes, &layout("", "", &[]));
    }

    /// Bytes that look more like a recording reach further.
    #[test]
    fn nothing_like_a_recording_panics(text in "(#\n)?(r,)?time_s,x_V\r?\n([0-9a\",. \r\n-]|nan|inf|1e9|,){0,80}") {
        let _ = read(text.as_bytes(), &layout("time_s", "", &["x_V"]));
        let _ = read(text.as_bytes(), &layout("time_s", "r", &[]));
        let _ = read(text.as_bytes(), &layout("", "x_V", &[]));
    }

    #[test]
    fn finite_columns_are_read_back_bit_for_bit(
        rows in proptest::collection::vec((any::<f64>(), any::<f64>()), 1..40), exponential: bool,
    ) {
        let rows: Vec<_> = rows.into_iter().filter(|(a, b)| a.is_finite() && b.is_finite()).collect();
        prop_assume!(!rows.is_empty());
        let mut text = "a_V,b_1\n".to_owned();
        for (a, b) in &rows {
            if exponential { writeln!(text, "{a:e},{b:e}") } else { writeln!(text, "{a},{b}") }.unwrap();
        }
        let recording = read(text.as_bytes(), &layout("", "", &["a_V", "b_1"])).unwrap();
        let bits = |values: &[f64]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        let (a, b): (Vec<f64>, Vec<f64>) = rows.into_iter().unzip();
        prop_assert_eq!(bits(&recording.column("a_V").unwrap().values), bits(&a));
        prop_assert_eq!(bits(&recording.column("b_1").unwrap().values), bits(&b));
    }
}

/// The independent recordings: file, clock, segments, columns, rows, segments, kinds of note.
#[test]
#[ignore = "needs KALMEMS_REFERENCE_DATA"]
fn reference_recordings_are_usable() {
    let folder = std::env::var_os("KALMEMS_REFERENCE_DATA").expect("KALMEMS_REFERENCE_DATA names the folder");
    let caps = ["drive_V", "cap1A_V", "cap1B_V", "cap2A_V", "cap2B_V"];
    for (file, clock, segment, columns, rows, segments, notes) in [
        (
            "accel-open-loop-1g/recording.csv",
            "time_s",
            "",
            &["feedback_V", "output_V"][..],
            25_000,
            1,
            "[Constant]",
        ),
        ("accel-open-loop-1g/truth.csv", "time_s", "", &[], 25_000, 1, "[]"),
        ("piston-nominal/recording.csv", "time_s", "", &["cap_F"], 32_000, 1, "[]"),
        ("piston-nominal/truth.csv", "time_s", "", &["position_m", "phase_rad"], 32_000, 1, "[]"),
        ("shared-scanner/recording.csv", "time_s", "", &["drive_V", "cap_V"], 24_001, 1, "[]"),
        ("shared-scanner/truth.csv", "time_s", "", &["angle_rad", "rate_rad_per_s"], 24_001, 1, "[]"),
        ("stage-room/bias_on.csv", "time_s", "record", &caps, 18_400, 8, "[]"),
        ("stage-room/bias_on.csv", "time_s", "record", &["ldv_V"], 18_400, 8, "[]"),
        ("stage-room/bias_off.csv", "time_s", "record", &caps, 18_400, 8, "[]"),
        ("stage-room/zero_drive.csv", "time_s", "", &["cap1A_on_V", "cap2B_off_V"], 800, 1, "[]"),
        ("stage-room/gyro.csv", "", "record", &["gyro_rad_per_s"], 8_000, 4, "[]"),
        ("stage-room/truth.csv", "", "record", &["frequency_Hz"], 8, 8, "[Constant]"),
        (
            "stage-sweep/recording.csv",
            "time_s",
            "frequency_Hz",
            &["frequency_Hz", "drive_V", "ldv_V"],
            25_500,
            17,
            "[]",
        ),
        (
            "threshold-nominal/recording.csv",
            "time_s",
            "",
            &["drive_V", "cap_V", "psd_V"],
            40_000,
            1,
            "[Constant]",
        ),
        ("threshold-nominal/crossings.csv", "time_s", "", &["rate_rad_per_s"], 100, 1, "[IrregularTime]"),
        ("threshold-nominal/truth.csv", "time_s", "", &["angle_rad", "rate_rad_per_s"], 40_000, 1, "[]"),
    ] {
        let path = Path::new(&folder).join("recordings").join(file);
        let recording = SampledRecording::read(&path, &layout(clock, segment, columns)).unwrap();
        assert_eq!((recording.rows(), recording.segments().len()), (rows, segments), "{file}");
        let found: Vec<_> = recording.diagnosis.iter().map(|f| f.kind).collect();
        assert_eq!(format!("{found:?}"), notes, "{file}: {:?}", recording.diagnosis);
        if !clock.is_empty() && notes != "[IrregularTime]" {
            assert!(recording.segments().iter().all(|s| s.time.is_uniform()), "{file}");
        }
    }
}

/// A column with what the settings say of it.
fn declared(column: &str, key: &str, [unit, scale, offset]: [&str; 3]) -> DeclaredColumn {
    let value = |text: &str| (!text.is_empty()).then(|| crate::units::Value::parse(text).unwrap());
    let unit = (!unit.is_empty()).then(|| (unit.to_owned(), Unit::parse(unit).unwrap()));
    let (scale, offset) = (value(scale), value(offset));
    let said = unit.is_some() || scale.is_some() || offset.is_some();
    DeclaredColumn {
        column: column.to_owned(),
        key: key.to_owned(),
        usual_unit: Some(if key == DeclaredColumn::CLOCK { "s" } else { "V" }),
        reading: said.then_some(ColumnReading { unit, scale, offset, ..ColumnReading::default() }),
    }
}

fn with(layout: RecordingLayout, declared: &[DeclaredColumn]) -> RecordingLayout {
    RecordingLayout { declared: declared.to_vec(), ..layout }
}

#[test]
fn a_declared_column_is_read_as_the_settings_say_and_this_is_reported() {
    let text = "t,Ucap,gyro_mV\n0,5.71,100\n1,0.1,200\n2,,300\n";
    let columns = [
        declared("t", DeclaredColumn::CLOCK, ["ms", "", ""]),
        declared("Ucap", "signal", ["V", "10 mV/V", ""]),
        declared("gyro", "rate", ["", "0.5 rad/s/V", "1 rad/s"]),
    ];
    let layout = with(layout("t", "", &["Ucap", "gyro"]), &columns);
    let recording = read(text.as_bytes(), &layout).unwrap();
    let ucap = recording.column_of("Ucap", &kind::VOLTAGE).unwrap();
    // The exponent is moved, and the number rounded once.
    assert_eq!(ucap.values[..2], [5.71e-2, 1e-3]);
    let gyro = recording.column_of("gyro", &kind::ANGULAR_RATE).unwrap();
    assert_eq!(gyro.values, [1.05, 1.1, 1.15]);
    assert_eq!(recording.segments()[0].time.interval_s(), Some(1e-3));
    insta::assert_snapshot!(diagnosis(text, &layout));
}

/// A column is compensated at the temperature of another one, which is read for that alone; the other sensor enters with its own bias and scale factor.
#[test]
fn a_column_is_compensated_over_the_temperature_and_against_other_columns() {
    let text = "time_s,t_K,x_V,y_V\n0,300,5,3\n1,310,5,3\n2,,5,3\n3,330,5,3\n";
    let curve = |name: &str, unit: &str, coefficients: &[f64]| TemperatureCurve {
        name: name.to_owned(),
        unit: unit.to_owned(),
        range_k: [290.0, 320.0],
        pieces: vec![CurvePiece { reference_k: 300.0, coefficients: coefficients.to_vec() }],
        expanded_square: Vec::new(),
    };
    let compensation = |unit: &str, cross: &[(String, TemperatureCurve)]| ColumnCompensation {
        temperature: declared("t_K", "temperature", ["", "", ""]),
        bias: Some(curve("bias", unit, &[1.0, 0.1])),
        scale_factor: Some(curve("scale", "1", &[2.0])),
        cross_axis: cross.to_vec(),
    };
    let cross = [("y_V".to_owned(), curve("cross", "1", &[0.5]))];
    let column = |name: &str, compensation: ColumnCompensation| {
        let reading =
            ColumnReading { compensation: Some(Ok(Box::new(compensation))), ..ColumnReading::default() };
        DeclaredColumn { reading: Some(reading), ..declared(name, "signal", ["", "", ""]) }
    };
    // What is clipped is seen in the values as they were measured, although no two compensated ones are the same.
    let clipped = sine(600, 200.0, 100.0, 0.0, 80.0);
    let rows = clipped.lines().enumerate().map(|(row, line)| match row {
        0 => format!("{line},t_K\n"),
        _ => format!("{line},{}\n", 300.0 + 0.01 * row as f64),
    });
    let warming = with(layout("time_us", "", &["cap_V"]), &[column("cap_V", compensation("V", &[]))]);
    let recording = read(rows.collect::<String>().as_bytes(), &warming).unwrap();
    let found = recording.diagnosis.iter().filter(|found| found.kind == FindingKind::Saturation);
    assert_eq!(found.map(|found| found.count).sum::<usize>(), saturated(&clipped));
    assert!(saturated(&clipped) > 0);
    let columns = [column("x_V", compensation("V", &cross)), column("y_V", compensation("V", &[]))];
    let layout = with(layout("time_s", "", &["x_V"]), &columns);
    let recording = read(text.as_bytes(), &layout).unwrap();
    assert_eq!(recording.columns().len(), 1);
    let values = &recording.column("x_V").unwrap().values;
    // At 300 K y is (3 − 1)/2 and x (5 − 1 − 0.5·1)/2; at 310 K y is (3 − 2)/2 and x (5 − 2 − 0.25)/2; beyond 320 K the curves keep 3.
    assert_eq!([values[0], values[1], values[3]], [1.75, 1.375, 1.0]);
    assert!(values[2].is_nan());
    let found = diagnosis(text, &layout);
    assert!(found.contains("330 K is beyond the curves from 290 to 320 K"), "{found}");
    let wrong = with(layout.clone(), &[column("x_V", compensation("A", &[])), columns[1].clone()]);
    let found = diagnosis(text, &wrong);
    assert!(found.contains("the curve `bias` is in `A`, which does not fit"), "{found}");
}

/// What is at the ends of a stated range or beyond them is no value, in the unit of the result, and nothing else.
#[test]
fn values_at_or_beyond_a_stated_range_are_counted_as_overload() {
    let text = "time_s,Ucap_mV\n0,100\n1,5000\n2,4999\n3,-6000\n4,-4999\n";
    let ranged = |low: &str, high: &str| {
        let ends = [low, high].map(|end| crate::units::Value::parse(end).unwrap());
        let reading = Some(ColumnReading { range: Some(ends), ..ColumnReading::default() });
        DeclaredColumn { reading, ..declared("Ucap_mV", "signal", ["", "", ""]) }
    };
    let layout = |column| with(layout("time_s", "", &["Ucap_mV"]), &[column]);
    let recording = read(text.as_bytes(), &layout(ranged("-5 V", "5 V"))).unwrap();
    let values = &recording.column("Ucap_mV").unwrap().values;
    assert_eq!(
        values.iter().map(|value| value.is_nan()).collect::<Vec<_>>(),
        [false, true, false, true, false]
    );
    let found: Vec<String> = recording.diagnosis().iter().map(ToString::to_string).collect();
    assert!(found.iter().any(|said| {
        said.starts_with("line 3, column `Ucap_mV`: 5 is at or beyond the stated range from -5 to 5, in SI (the first of 2 cells)")
    }), "{found:?}");
    let wrong = diagnosis(text, &layout(ranged("-1 A", "1 A")));
    assert!(wrong.contains("Contradiction") && wrong.contains("the end `-1 A` of the range"), "{wrong}");
}

#[test]
fn what_the_settings_say_wrongly_of_a_column_is_refused_with_the_way_out() {
    let text = "t,Ucap,cap_mV,x y\n0,1,2,3\n1,2,1,4\n";
    let clock = declared("t", DeclaredColumn::CLOCK, ["s", "", ""]);
    let mut report = String::new();
    for column in [
        declared("Ucap", "signal", ["", "", ""]),
        declared("x y", "drive", ["", "2", ""]),
        declared("cap", "signal", ["V", "", ""]),
        declared("cap_mV", "signal", ["", "", "1 s"]),
        declared("nothing", "signal", ["V", "", ""]),
    ] {
        let layout = with(layout("t", "", &[&column.column]), &[clock.clone(), column.clone()]);
        writeln!(report, "## {}\n{}\n", column.column, diagnosis(text, &layout)).unwrap();
    }
    let plain = declared("t", DeclaredColumn::CLOCK, ["", "", ""]);
    let layout = with(layout("t", "", &["cap_mV"]), &[plain]);
    writeln!(report, "## t\n{}", diagnosis(text, &layout)).unwrap();
    insta::assert_snapshot!(report);
    let column = declared("Ucap", "acceleration", ["V", "2 V/gn", ""]);
    let layout = with(self::layout("t", "", &["Ucap"]), &[clock, column]);
    let error = read(text.as_bytes(), &layout).unwrap().column_of("Ucap", &kind::ACCELERATION).unwrap_err();
    assert!(error.to_string().contains("`scale = \"0.5 gn/V\"`"), "{error}");
}

/// Rows whose times are these.
fn at_times(times: impl Iterator<Item = f64>) -> String {
    times.enumerate().fold("time_s,x_V\n".to_owned(), |mut text, (row, time)| {
        writeln!(text, "{time},{}", row % 7).unwrap();
        text
    })
}

#[test]
fn intervals_are_judged_by_the_nominal_rate_unless_all_contradict_it() {
    let nominal =
        |rate_hz: f64| RecordingLayout { nominal_rate_hz: Some(rate_hz), ..layout("time_s", "", &["x_V"]) };
    let late = |k: u32| f64::from(k * 7919 % 13) * 1e-6;
    // A clock of 996 µs, two times in hundred of which are late: by the median of the times alone the others are right as well.
    let nearly = at_times((0..400).map(|k| f64::from(k) * 996e-6 + if k % 50 == 9 { 9e-6 } else { 0.0 }));
    assert_eq!(diagnosis(&nearly, &nominal(1000.0)).matches("IrregularTime").count(), 1);
    assert!(diagnosis(&nearly, &nominal(1000.0)).contains("off the interval of the nominal rate of 0.001 s"));
    assert_eq!(diagnosis(&nearly, &layout("time_s", "", &["x_V"])), "usable");
    // Every time is late by another delay; the rate is that of the settings on average.
    let jittered = at_times((0..400).map(|k| f64::from(k) * 1e-3 + 3.0 * late(k)));
    let found = diagnosis(&jittered, &nominal(1000.0));
    assert!(found.contains("IrregularTime") && !found.contains("OtherRate"), "{found}");
    // The settings say twice the rate.
    insta::assert_snapshot!(diagnosis(&at_times((0..400).map(|k| f64::from(k) * 1e-3)), &nominal(2000.0)), @"
    usable
    Note OtherRate: line 2, column `time_s`: the median interval is that of a rate of 1000 Hz, and the settings say 2000 Hz; the times are kept as they stand: correct `rate` of the `clock`, or the unit or `scale` of its `column`
    ");
}

/// Bursts of so many rows, 2 µs apart, of a clock of 1 kHz.
fn in_bursts(rows: u32, size: u32) -> impl Iterator<Item = f64> {
    (0..rows).map(move |k| f64::from(k / size * size + size) * 1e-3 + 2e-6 * f64::from(k % size))
}

#[test]
fn in_bursts_samples_are_missing_by_the_mean_interval_or_the_nominal_one() {
    let layout = layout("time_s", "", &["x_V"]);
    let nominal = RecordingLayout { nominal_rate_hz: Some(1000.0), ..layout.clone() };
    for size in [4, 30, 300] {
        let whole = at_times(in_bursts(9000, size));
        let late = at_times(in_bursts(9000, size).map(|time| if time > 4.0 { time + 60.0 } else { time }));
        for layout in [&layout, &nominal] {
            let found = diagnosis(&whole, layout);
            assert!(found.contains("IrregularTime") && !found.contains("missing"), "{size}: {found}");
            let found = diagnosis(&late, layout);
            let count = found.split_once(" samples are missing").unwrap().0.rsplit(' ').next().unwrap();
            let count: f64 = count.parse().unwrap();
            assert!((count - 60_000.0).abs() < 900.0 && found.contains("(1 gap)"), "{size}: {found}");
        }
    }
    // Declared as what is sampled within a burst: the rest is missing.
    let fast = RecordingLayout { nominal_rate_hz: Some(5e5), ..layout };
    let found = diagnosis(&at_times(in_bursts(9000, 30)), &fast);
    assert!(found.contains("are missing where one is expected every 2e-6 s"), "{found}");
}

/// A text of another kind is refused without a word of it, whatever its columns are called.
#[test]
fn cells_of_a_text_without_numbers_are_not_quoted() {
    let columns = Some(vec!["time_s".to_owned(), "cap_V".to_owned()]);
    let hints = Hints { columns, ..Hints::default() };
    for text in ["swordfish,b\nc,swordfish\n", "time_s,cap_V\nswordfish,b\nc,swordfish\n"] {
        let found = diagnosis(
            text,
            &RecordingLayout { hints: hints.clone(), ..layout("time_s", "cap_V", &["cap_V"]) },
        );
        assert!(found.contains("the cell is no number") && !found.contains("swordfish"), "{found}");
    }
}

/// As loggers write that have no names: the first sample must not be lost for them.
#[test]
fn a_first_row_that_begins_with_a_date_is_no_line_of_names() {
    for (first, second) in [("2014-05-07 16:29:30.020", "2014-05-07 16:29:30.030"), ("16:29:30", "16:29:31")]
    {
        for word in ["", ",left"] {
            let text = format!("{first}{word},0.1\n{second}{word},0.2\n");
            let found = diagnosis(&text, &layout("time_s", "", &[]));
            assert!(found.contains("the first line holds numbers"), "{found}");
        }
    }
}

/// Of a column that holds what another holds, with its sign or the other, both are told; levels that are the same for a while, or constants,
/// are none.
#[test]
fn a_column_that_repeats_another_is_reported_for_both() {
    let mut text = "time_s,a_V,b_V,c_V,d_V,e_V\n".to_owned();
    for i in 0..40 {
        let a = f64::from(i * i % 17) - 3.0;
        writeln!(text, "{},{a},{},{a},7,7", f64::from(i) * 1e-3, if i < 30 { a } else { -a }).unwrap();
    }
    let of = |text: &str| {
        let recording = read(text.as_bytes(), &layout("time_s", "", &[])).unwrap();
        let found = recording.diagnosis.iter().filter(|f| f.kind == FindingKind::Repeats);
        found.map(|f| format!("{}: {}", f.column.as_deref().unwrap(), f.detail)).collect::<Vec<_>>()
    };
    let words = |one: &str, other: &str, sign: &str| {
        [[one, other], [other, one]]
            .map(|[of, as_in]| format!("{of}: repeats column `{as_in}`{sign} in every row"))
    };
    assert_eq!(of(&text), words("a_V", "c_V", ""));
    let turned = text.lines().enumerate().map(|(row, line)| {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        if row > 0 {
            cells[3] = format!("{}", -cells[1].parse::<f64>().unwrap());
        }
        cells.join(",") + "\n"
    });
    assert_eq!(of(&turned.collect::<String>()), words("a_V", "c_V", " with the other sign"));
    // A few rows tell nothing.
    assert!(of(&text.lines().take(12).fold(String::new(), |all, line| all + line + "\n")).is_empty());
}

/// A converter that hangs is told with its line and its rows; a rail is a rail.
#[test]
fn a_stuck_value_is_reported_beside_saturation() {
    let mut rows: Vec<f64> = (0..4000).map(|i| (500.0 * (f64::from(i) * 0.05).sin()).round()).collect();
    let held = rows[700];
    rows[700..730].fill(held);
    let text = rows
        .iter()
        .enumerate()
        .fold("time_us,cap_V\n".to_owned(), |all, (i, code)| all + &format!("{i},{}\n", code * 0.001));
    let recording = read(text.as_bytes(), &layout("time_us", "", &["cap_V"])).unwrap();
    let [finding] = recording.diagnosis.as_slice() else { panic!("{:?}", recording.diagnosis) };
    assert_eq!((finding.kind, finding.first_row, finding.count), (FindingKind::Stuck, 702, 30));
}

/// What is clipped, stays or repeats another column is told while the rows come: once in a stretch, with the samples until then counted.
#[test]
fn a_recording_that_arrives_tells_its_faults_while_it_goes_on() {
    // Of the second of two records the rail is at another height; a channel of both is another one with the other sign.
    let mut text = "record,time_s,x_V,y_V,z_V\n".to_owned();
    for row in 0..40_000 {
        let (record, limit) = if row < 20_000 { ("a", 0.6) } else { ("b", 0.8) };
        let time = f64::from(row);
        let mut noise = (43_758.545_3 * (12.989_8 * time).portable_sin()).rem_euclid(1.0) - 0.5;
        if (30_000..30_020).contains(&row) {
            noise = 0.1;
        }
        let x = (0.01 * time).portable_sin() + 1e-3 * noise;
        // The first record is clipped from its middle on.
        let x = if row < 10_000 { 0.5 * x } else { x.clamp(-limit, limit) };
        text += &format!("{record},{:e},{x:e},{noise:e},{:e}\n", 1e-6 * time, -noise);
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("arrives.csv");
    std::fs::write(&path, &text).unwrap();
    let layout = layout("time_s", "record", &["x_V", "y_V", "z_V"]);
    let mut told = Vec::new();
    for rows in [1, 999] {
        let around = StretchSize { rows, first: 500, before: 0, after: 0 };
        let mut stretches = Stretches::open(&path, &layout, around).unwrap();
        let mut found = stretches.news();
        let (mut given, mut before) = (0, [0; 2]);
        while let Some(stretch) = stretches.next(&mut |_, _| ControlFlow::Continue(())).unwrap() {
            given += stretch.fresh.len();
            stretches.reuse(stretch);
            let news = stretches.news();
            // The file is read ahead by a block, which says of its lines what they are.
            assert!(news.iter().all(|finding| finding.first_row <= given + 40_000));
            found.extend(news);
            let counts = stretches.disturbed();
            assert!(counts[0] >= before[0] && counts[1] >= before[1]);
            before = counts;
        }
        found.extend(stretches.news());
        let counts = stretches.disturbed();
        let (_, diagnosis) = stretches.finish();
        let texts: Vec<String> = found.iter().map(ToString::to_string).collect();
        let of = |kind, column: &str| {
            let is = |finding: &&Finding| finding.kind == kind && finding.column.as_deref() == Some(column);
            found.iter().filter(is).collect::<Vec<_>>()
        };
        let clipped = of(FindingKind::Saturation, "x_V");
        assert_eq!(clipped.len(), 2, "{texts:#?}");
        let segments: Vec<_> = clipped.iter().map(|finding| finding.segment.as_deref()).collect();
        assert_eq!(segments, [Some("a"), Some("b")]);
        assert!(clipped[0].first_row > 10_000 && clipped[1].first_row > 20_000, "{texts:#?}");
        for column in ["y_V", "z_V"] {
            assert_eq!(of(FindingKind::Repeats, column).len(), 1, "{texts:#?}");
            assert_eq!(of(FindingKind::Stuck, column).len(), 1, "{texts:#?}");
        }
        assert_eq!(found.len(), 6, "{texts:#?}");
        assert_eq!(counts[1], 40);
        // At the end the rail of the first record is none, as the second goes beyond it.
        let at_end = |column: &str, kind| {
            let of = |finding: &&Finding| finding.kind == kind && finding.column.as_deref() == Some(column);
            diagnosis.iter().filter(of).map(|finding| finding.count).sum::<usize>()
        };
        assert_eq!(["y_V", "z_V"].map(|column| at_end(column, FindingKind::Stuck)), [20, 20]);
        assert!(counts[0] > at_end("x_V", FindingKind::Saturation), "{counts:?} {diagnosis:?}");
        told.push(texts);
    }
    assert_eq!(told[0], told[1]);
}

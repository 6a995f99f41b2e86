//! The same recording with times since 1970, in every way that laboratories write them, and with times from its first row on.

use crate::parts::{goes_on_after_a_kill, same_bits_in_a_stream};
use kalmems::config::Experiment;
use kalmems::inspect::inspect;
use kalmems::progress::Silent;
use kalmems::recording::{FindingKind, SampledRecording};
use kalmems::rigs::published;
use kalmems::workflow;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Finds a number within this part of what was expected.
fn assert_near(found: f64, expected: f64, part: f64) {
    assert!((found - expected).abs() <= part * expected.abs(), "{found} is not {expected}");
}

/// Rows of the recording that are taken, as many as the fixtures of `kalmems-formats/tools/times.py` have.
const ROWS: usize = 2000;

/// When the first row was sampled, in µs since 1970.
const START_US: i64 = 1_763_834_400_123_456;

fn example(file: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../examples/shared_scanner").join(file)
}

fn fixture(file: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../kalmems-formats/tests/fixtures").join(file)
}

/// The beginning of an example's file with another time in each row, which are 1 µs apart.
fn with_times(file: &str, name: &str, time: impl Fn(i64) -> String) -> String {
    rows_with_times(file, name, time, ROWS)
}

/// So many of its rows.
fn rows_with_times(file: &str, name: &str, time: impl Fn(i64) -> String, rows: usize) -> String {
    let text = std::fs::read_to_string(example(file)).unwrap();
    let mut lines = text.lines();
    let (_, header) = lines.next().unwrap().split_once(',').unwrap();
    let mut text = format!("{name},{header}\n");
    for (row, line) in (0..).zip(lines.take(rows)) {
        let (_, cells) = line.split_once(',').unwrap();
        writeln!(text, "{},{cells}", time(row)).unwrap();
    }
    text
}

type Cell = fn(i64) -> String;

/// Name of the time and its cells, microseconds after the start.
fn ways() -> [(&'static str, Cell); 7] {
    let seconds: Cell = |row| format!("{}.{:06}", (START_US + row) / 1_000_000, (START_US + row) % 1_000_000);
    [
        ("time_s", seconds),
        ("time_unix_s", |row| {
            format!("{}.{:06}000", (START_US + row) / 1_000_000, (START_US + row) % 1_000_000)
        }),
        ("time_ms", |row| format!("{}.{:03}", (START_US + row) / 1000, (START_US + row) % 1000)),
        ("time_us", |row| (START_US + row).to_string()),
        ("time_ns", |row| (1000 * (START_US + row)).to_string()),
        ("time", |row| format!("2025-11-22T18:00:00.{:06}Z", 123_456 + row)),
        ("timestamp", |row| format!("2025-11-22 19:00:00.{:06}+01:00", 123_456 + row)),
    ]
}

/// The example over a recording of this name, whose first 0.2 ms are not scored.
fn experiment(folder: &Path, name: &str, clock: &str) -> Experiment {
    let text = std::fs::read_to_string(example("experiment.toml")).unwrap();
    let text = text
        .replace(
            "file = \"recording.csv\"\nclock = { column = \"time_s\" }",
            &format!("file = {name:?}\nclock = {{ column = {clock:?} }}"),
        )
        .replace("skip = \"8 ms\"", "skip = \"0.2 ms\"");
    published().parse(&text, &folder.join("experiment.toml")).unwrap_or_else(|e| panic!("{e}"))
}

/// Every bit of the trajectories and of the errors against the reference.
fn bits(experiment: &Experiment) -> (Vec<u64>, String, Option<String>) {
    let outcome = workflow::estimate(published(), experiment, &Silent).unwrap_or_else(|e| panic!("{e}"));
    let recording = &outcome.recordings[0];
    let segment = &recording.segments[0];
    let trajectories = segment.estimate.trajectories.iter();
    let all = trajectories.flat_map(|t| {
        let states = t.states.iter().flat_map(|state| state.mean.iter().chain(&state.sd));
        t.time_s.iter().chain(&t.innovation).chain(states)
    });
    let origin = recording.recording.source().origin.as_ref().map(|origin| origin.seconds.clone());
    (all.map(|value| value.to_bits()).collect(), format!("{:?}", segment.errors), origin)
}

/// The example as it is, over as many rows.
fn relative(folder: &Path) -> (Vec<u64>, String, Option<String>) {
    let plain: Cell = |row| format!("0.{row:06}");
    std::fs::write(folder.join("recording.csv"), with_times("recording.csv", "time_s", plain)).unwrap();
    std::fs::write(folder.join("reference.csv"), with_times("reference.csv", "time_s", plain)).unwrap();
    let found = bits(&experiment(folder, "recording.csv", "time_s"));
    assert!(found.0.len() > 3 * ROWS && found.2.is_none() && found.1.contains("Some"), "{}", found.1);
    found
}

#[test]
fn a_recording_gives_the_same_bits_whatever_its_times_count_from() {
    let folder = tempfile::tempdir().unwrap();
    let expected = relative(folder.path());
    for (name, time) in ways() {
        std::fs::write(folder.path().join("epoch.csv"), with_times("recording.csv", name, time)).unwrap();
        std::fs::write(folder.path().join("reference.csv"), with_times("reference.csv", name, time)).unwrap();
        let (found, errors, origin) = bits(&experiment(folder.path(), "epoch.csv", name));
        assert_eq!(origin.as_deref(), Some("1763834400.123456"), "{name}");
        assert!(found == expected.0, "{name}");
        assert_eq!(errors, expected.1, "{name}");
    }
    // The reference still counts as the last of them.
    for (file, clock) in [
        ("times.npz", "time"),
        ("times.parquet", "time"),
        ("times.parquet", "time_local"),
        ("times.h5", "time_ns"),
    ] {
        std::fs::copy(fixture(file), folder.path().join(file)).unwrap();
        let text = std::fs::read_to_string(folder.path().join("reference.csv")).unwrap();
        std::fs::write(folder.path().join("reference.csv"), text.replace("timestamp,", &format!("{clock},")))
            .unwrap();
        if clock == "time_ns" {
            let time = ways()[4].1;
            std::fs::write(folder.path().join("reference.csv"), with_times("reference.csv", clock, time))
                .unwrap();
        }
        let (found, errors, _) = bits(&experiment(folder.path(), file, clock));
        assert!(found == expected.0, "{file}, {clock}");
        assert_eq!(errors, expected.1, "{file}, {clock}");
        std::fs::write(
            folder.path().join("reference.csv"),
            with_times("reference.csv", "timestamp", ways()[6].1),
        )
        .unwrap();
    }
}

/// A reference that begins at another time than the recording stays on its clock.
#[test]
fn a_reference_counts_from_the_origin_of_its_recording() {
    let folder = tempfile::tempdir().unwrap();
    let expected = relative(folder.path());
    let (name, time) = ways()[0];
    std::fs::write(folder.path().join("epoch.csv"), with_times("recording.csv", name, time)).unwrap();
    let reference = with_times("reference.csv", name, time);
    let mut lines = reference.lines();
    let header = lines.next().unwrap();
    let later: Vec<&str> = lines.skip(1500).collect();
    std::fs::write(folder.path().join("reference.csv"), format!("{header}\n{}\n", later.join("\n"))).unwrap();
    let epoch = bits(&experiment(folder.path(), "epoch.csv", name));
    let text = std::fs::read_to_string(folder.path().join("recording.csv")).unwrap();
    assert!(text.starts_with("time_s"));
    let reference = with_times("reference.csv", "time_s", |row| format!("0.{row:06}"));
    let later: Vec<&str> = reference.lines().skip(1501).collect();
    std::fs::write(
        folder.path().join("reference.csv"),
        format!("time_s,{}\n{}\n", header.split_once(',').unwrap().1, later.join("\n")),
    )
    .unwrap();
    let near = bits(&experiment(folder.path(), "recording.csv", "time_s"));
    assert_eq!(epoch.1, near.1);
    assert!(near.1 != expected.1 && near.1.contains("Some"), "{}", near.1);
}

#[test]
fn a_stream_counts_as_the_file_does_and_says_from_where() {
    let folder = tempfile::tempdir().unwrap();
    let text = std::fs::read_to_string(example("stream.toml")).unwrap();
    for (name, time) in ways() {
        let path = folder.path().join("recording.csv");
        let recorded = with_times("recording.csv", name, time);
        std::fs::write(&path, &recorded).unwrap();
        let text = text
            .replace("every = 10", "every = 1")
            .replace("skip = \"8 ms\"", "skip = \"0.2 ms\"")
            .replace("\"time_s\"", &format!("{name:?}"));
        let experiment =
            published().parse(&text, &folder.path().join("stream.toml")).unwrap_or_else(|e| panic!("{e}"));
        let rig = published().rig(&experiment).unwrap();
        let recording = SampledRecording::read(&path, &rig.layout(&experiment, 0).unwrap()).unwrap();
        assert_eq!(recording.origin().to_string(), "1763834400.123456");
        let (_, summary) = same_bits_in_a_stream(&experiment, &recording, (recorded.as_bytes(), 100));
        assert_eq!(summary.origin.unwrap().seconds, "1763834400.123456", "{name}");
    }
}

/// The example as a stream whose clock is this column, with an estimate of every sample.
fn streaming(folder: &Path, input: &str, clock: &str) -> Experiment {
    let text = std::fs::read_to_string(example("stream.toml")).unwrap();
    let text = text
        .replace("every = 10", "every = 1")
        .replace("skip = \"8 ms\"", "skip = \"0.2 ms\"")
        .replace("[stream.input.text]\ncolumns = [\"time_s\", \"drive_V\", \"cap_V\"]", input)
        .replace("\"time_s\"", &format!("{clock:?}"));
    published().parse(&text, &folder.join("stream.toml")).unwrap_or_else(|e| panic!("{e}"))
}

const TEXT_OF_NANOSECONDS: &str = "[stream.input.text]\ncolumns = [\"time_ns\", \"drive_V\", \"cap_V\"]";

#[test]
fn frames_with_integer_nanoseconds_since_1970_count_as_the_file_does() {
    let folder = tempfile::tempdir().unwrap();
    let recorded = with_times("recording.csv", "time_ns", |row| (1000 * (START_US + row)).to_string());
    let path = folder.path().join("recording.csv");
    std::fs::write(&path, &recorded).unwrap();
    let fields = "[stream.input.frames]\nsync = \"a55a\"\n\
                  fields = [\"i64 time_ns\", \"f64 drive_V\", \"f64 cap_V\"]";
    let experiment = streaming(folder.path(), fields, "time_ns");
    let mut frames = Vec::new();
    for line in recorded.lines().skip(1) {
        let mut cells = line.split(',');
        frames.extend_from_slice(&[0xa5, 0x5a]);
        frames.extend_from_slice(&cells.next().unwrap().parse::<i64>().unwrap().to_le_bytes());
        cells.for_each(|cell| frames.extend_from_slice(&cell.parse::<f64>().unwrap().to_le_bytes()));
    }
    let rig = published().rig(&experiment).unwrap();
    let recording = SampledRecording::read(&path, &rig.layout(&experiment, 0).unwrap()).unwrap();
    let (_, summary) = same_bits_in_a_stream(&experiment, &recording, (&frames, 100));
    assert_eq!(summary.origin.unwrap().seconds, "1763834400.123456");
}

#[test]
fn a_stream_that_goes_on_after_a_kill_counts_from_where_the_first_one_did() {
    let folder = tempfile::tempdir().unwrap();
    let time = |row: i64| (1000 * (START_US + row)).to_string();
    let recorded = rows_with_times("recording.csv", "time_ns", time, usize::MAX);
    let experiment = streaming(folder.path(), TEXT_OF_NANOSECONDS, "time_ns");
    // Of both runs every time is compared with that of one run, bit by bit.
    goes_on_after_a_kill(&experiment, recorded.as_bytes(), 0.7, 0.0);
}

/// A tone of 31.35 kHz, sampled with 1 MHz.
fn tone(name: &str, time: Cell) -> String {
    let mut text = format!("{name},cap_V\n");
    for row in 0..20_000_i64 {
        let phase = std::f64::consts::TAU * 0.031_35 * row as f64;
        writeln!(text, "{},{:.5}", time(row), phase.sin()).unwrap();
    }
    text
}

/// Unix seconds with six decimals were read into one f64 each: 1.0486 MHz and 32.87 kHz, and nothing was found irregular.
#[test]
fn an_inspection_of_unix_seconds_shows_the_rate_and_the_lines_that_there_are() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("recording.csv");
    for (name, time) in ways() {
        let name = if name == "timestamp" { "when" } else { name };
        std::fs::write(&path, tone(name, time)).unwrap();
        let inspection = inspect(&path).unwrap();
        let segment = inspection.longest_segment().unwrap();
        assert_near(segment.rate_hz.unwrap(), 1e6, 1e-12);
        assert!(segment.uniform && inspection.diagnosis.is_empty(), "{name}: {:?}", inspection.diagnosis);
        let line = &inspection.channels[0].spectrum.as_ref().unwrap().lines[0];
        assert_near(line.frequency, 31_350.0, 1e-5);
        let said = inspection.recognised.last().unwrap();
        let calendar = matches!(name, "time" | "when" | "time_unix_s");
        let expected = if calendar {
            "Times count from 2025-11-22T18:00:00.123456Z on, 1763834400.123456 s since 1970."
        } else {
            "Times count from 1763834400.123456 s of the file's clock on."
        };
        assert_eq!(said, expected, "{name}");
    }
}

/// f64 keeps 0.24 µs of the seconds since 1970: of µs the digits are still there, of 3.3 µs they are not.
#[test]
fn times_that_a_file_has_rounded_are_named_with_what_to_write() {
    let inspection = inspect(&fixture("times.h5")).unwrap();
    assert_eq!(inspection.time.as_deref(), Some("time_ns"), "an integer clock");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("rounded.npy");
    let interval = 1.0 / 300_000.0;
    let rows: Vec<f64> =
        (0..4000).flat_map(|k| [1_763_834_400.0 + f64::from(k) * interval, f64::from(k % 7)]).collect();
    std::fs::write(&path, npy(&rows)).unwrap();
    let text =
        "clock = { column = \"time_s\" }\nformat = { kind = \"npy\", columns = [\"time_s\", \"cap_V\"] }";
    let all = std::fs::read_to_string(example("experiment.toml")).unwrap();
    let all = all.replace(
        "file = \"recording.csv\"\nclock = { column = \"time_s\" }",
        &format!("file = \"rounded.npy\"\n{text}"),
    );
    let experiment = published().parse(&all, &folder.path().join("experiment.toml")).unwrap();
    let recording =
        SampledRecording::read(&path, &experiment.recording(0).unwrap().layout(&["cap_V"])).unwrap();
    let time = &recording.segments()[0].time;
    // The median of rounded intervals would be a multiple of 0.24 µs, 0.15 % off at best.
    assert_near(time.interval_s().unwrap(), interval, 1e-4);
    assert!(!time.is_uniform());
    let found: Vec<String> = recording.diagnosis().iter().map(ToString::to_string).collect();
    assert_eq!(recording.diagnosis()[0].kind, FindingKind::RoundedTime);
    insta::assert_snapshot!(found.join("\n"));
}

/// A NumPy array of two columns.
fn npy(rows: &[f64]) -> Vec<u8> {
    let mut header =
        format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({}, 2), }}", rows.len() / 2);
    while (10 + header.len() + 1) % 64 != 0 {
        header.push(' ');
    }
    header.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend_from_slice(&u16::try_from(header.len()).unwrap().to_le_bytes());
    bytes.extend_from_slice(header.as_bytes());
    bytes.extend(rows.iter().flat_map(|value| value.to_le_bytes()));
    bytes
}

/// A host that gets packets of 64 rows and stamps them as it takes them out of its buffer.
#[test]
fn stamps_of_a_host_are_named_with_the_rate_to_declare() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("recording.csv");
    let mut text = "time_us,cap_V\n".to_owned();
    for row in 0..6400_u32 {
        let (packet, of_packet) = (row / 64, row % 64);
        let late = packet * 7919 % 13;
        writeln!(text, "{}.{:02},{}", packet * 640 + of_packet + late, of_packet * 37 % 40, row % 5).unwrap();
    }
    std::fs::write(&path, text).unwrap();
    let inspection = inspect(&path).unwrap();
    let bursts: Vec<String> = inspection
        .diagnosis
        .iter()
        .filter(|finding| finding.kind == FindingKind::BurstTime)
        .map(ToString::to_string)
        .collect();
    insta::assert_snapshot!(bursts.join("\n"));
}

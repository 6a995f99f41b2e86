//! Times without samples, and clocks that go back: what is predicted over, where an estimate begins anew, and that neither
//! takes long.

use serde_json::Value;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::time::{Duration, Instant};

fn examples() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// The rows of an example's recording, with those of its reference behind each, where that has a file of its own; header and
/// cells.
fn rows(example: &str) -> Vec<Vec<String>> {
    let of = |name: &str| {
        let text = std::fs::read_to_string(examples().join(example).join(name)).unwrap_or_default();
        let cells = |line: &str| line.split(',').map(str::to_owned).collect();
        text.lines().map(cells).collect::<Vec<Vec<String>>>()
    };
    let (mut rows, reference) = (of("recording.csv"), of("reference.csv"));
    assert!(!rows.is_empty(), "{example} has no recording");
    for (row, known) in rows.iter_mut().zip(reference) {
        row.extend(known.into_iter().skip(1));
    }
    rows
}

/// An example in a folder of its own, its reference in its recording's file.
struct Altered {
    folder: tempfile::TempDir,
}

impl Altered {
    /// The time of each row goes through `time`, which leaves a row out where it gives none; and text of the experiment is
    /// replaced.
    fn of(example: &str, time: impl Fn(usize, f64) -> Option<f64>, replaced: [&str; 2]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let mut csv = String::new();
        for (row, cells) in rows(example).into_iter().enumerate() {
            let (clock, others) = cells.split_first().unwrap();
            let Some(row) = row.checked_sub(1) else {
                writeln!(csv, "{clock},{}", others.join(",")).unwrap();
                continue;
            };
            if let Some(time) = time(row, clock.parse().unwrap()) {
                writeln!(csv, "{time:?},{}", others.join(",")).unwrap();
            }
        }
        std::fs::write(folder.path().join("recording.csv"), csv).unwrap();
        let toml = std::fs::read_to_string(examples().join(example).join("experiment.toml")).unwrap();
        assert!(toml.contains(replaced[0]));
        let toml = toml.replace("file = \"reference.csv\"\n", "").replace(replaced[0], replaced[1]);
        std::fs::write(folder.path().join("experiment.toml"), toml).unwrap();
        Self { folder }
    }

    fn run(&self, arguments: &[&str]) -> (Output, Duration) {
        let started = Instant::now();
        let mut command = Command::new(env!("CARGO_BIN_EXE_kalmems"));
        let output = command.current_dir(self.folder.path()).args(arguments).output().unwrap();
        (output, started.elapsed())
    }

    /// Estimates it: the metrics of the recording, what is said, and how long it took.
    fn estimate(&self) -> (Value, String, Duration) {
        let (output, took) = self.run(&["estimate", "experiment.toml", "--out", "out", "--json", "--force"]);
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{said}");
        let metrics: Value = serde_json::from_slice(&output.stdout).unwrap();
        (metrics["recordings"][0].clone(), said, took)
    }

    fn files(&self) -> Vec<String> {
        let files = std::fs::read_dir(self.folder.path().join("out")).unwrap();
        let mut files: Vec<String> = files.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        files.sort();
        files
    }
}

/// Whether a run took no longer than another one but for what other work on the machine costs: what steps over the gap would
/// take is far more.
fn as_fast(took: Duration, usual: Duration) -> bool {
    took < usual * 4 + Duration::from_secs(20)
}

const NOTHING: [&str; 2] = ["", ""];

/// The root mean square errors of the filters in a segment, in the unit of the metrics.
fn errors(segment: &Value) -> Vec<(String, f64)> {
    let estimators = segment["estimators"].as_array().unwrap();
    let error = |e: &Value| {
        let angle = e["errors"]["angle"]["rmse_deg"].as_f64();
        let value = e["values"].as_object().and_then(|values| values.values().next()).map(|v| &v["rmse"]);
        angle.or_else(|| value.and_then(Value::as_f64)).unwrap_or(f64::NAN)
    };
    estimators.iter().map(|e| (e["key"].as_str().unwrap().to_owned(), error(e))).collect()
}

/// What corrects itself by the signal, and so has the motion again however it begins.
fn corrected(errors: &[(String, f64)]) -> impl Iterator<Item = &(String, f64)> {
    errors.iter().filter(|(key, _)| !key.starts_with("model"))
}

#[test]
fn a_gap_of_whatever_length_begins_a_stretch_that_is_as_right_as_the_whole_and_takes_no_time() {
    let whole = Altered::of("shared_scanner", |_, t| Some(t), NOTHING);
    let (before, _, usual) = whole.estimate();
    assert!(before.get("stretches").is_none() && before["segments"][0].get("stretch").is_none());
    let known = errors(&before["segments"][0]);
    for gap_s in [60.0, 3600.0, 86_400.0, 1e6] {
        let altered = Altered::of(
            "shared_scanner",
            |row, t| Some(t + if row >= 12_000 { gap_s } else { 0.0 }),
            NOTHING,
        );
        let (recording, _, took) = altered.estimate();
        assert!(as_fast(took, usual), "{gap_s}: {took:?} for {usual:?}");
        assert_eq!(recording["stretches"]["restarts"], 1);
        assert_eq!(recording["stretches"]["left_out"], 0);
        let segments = recording["segments"].as_array().unwrap();
        assert_eq!(segments.len(), 2);
        assert_eq!(segments[1]["stretch"]["number"], 2);
        assert_eq!(recording["diagnosis"][0]["kind"], "long_gap");
        for segment in segments {
            for ((key, error), (_, whole)) in corrected(&errors(segment)).zip(corrected(&known)) {
                assert!(*error < 1.5 * whole, "{gap_s} {key}: {error} for {whole}");
            }
        }
        let files = altered.files();
        assert!(files.contains(&"trajectory_ekf.csv".to_owned()), "{files:?}");
        assert!(files.contains(&"stretch_2_trajectory_ekf.csv".to_owned()), "{files:?}");
    }
}

/// A slope from one side of the gap to the other is no crossing of the threshold, wherever in the cycle the gap lies.
#[test]
fn crossings_of_a_threshold_are_not_made_up_over_a_gap() {
    let estimate = |gap: std::ops::Range<usize>| {
        let (recording, said, _) =
            Altered::of("threshold_scanner", |row, t| (!gap.contains(&row)).then_some(t), NOTHING).estimate();
        assert!(!said.contains("lost the signal"), "{gap:?}: {said}");
        errors(&recording["segments"][0])
    };
    let whole = estimate(0..0);
    for start in [6000, 6300, 6600] {
        for ((key, error), (_, whole)) in estimate(start..start + 200).iter().zip(&whole) {
            assert!(*error < 1.1 * whole, "{start} {key}: {error} deg for {whole}");
        }
    }
}

#[test]
fn a_single_row_at_a_time_of_1e300_is_a_stretch_that_is_left_out() {
    let whole = Altered::of("shared_scanner", |_, t| Some(t), NOTHING);
    let (before, _, usual) = whole.estimate();
    let altered =
        Altered::of("shared_scanner", |row, t| Some(if row == 24_000 { 1e300 } else { t }), NOTHING);
    let (recording, _, took) = altered.estimate();
    assert!(as_fast(took, usual), "{took:?} for {usual:?}");
    assert_eq!(recording["stretches"]["restarts"], 1);
    assert_eq!(recording["stretches"]["left_out"], 1);
    assert_eq!(recording["stretches"]["first_left_out"][0]["stretch"], 2);
    assert_eq!(recording["segments"].as_array().unwrap().len(), 1);
    for ((key, error), (_, whole)) in
        errors(&recording["segments"][0]).iter().zip(&errors(&before["segments"][0]))
    {
        assert!((error / whole - 1.0).abs() < 1e-3, "{key}: {error} for {whole}");
    }
    // Its digits are told shortly.
    let message = recording["diagnosis"][0]["message"].as_str().unwrap();
    assert!(message.contains("1e300") && message.len() < 300, "{message}");
    let page = std::fs::read_to_string(altered.folder.path().join("out/report.html")).unwrap();
    assert!(!page.contains("0000000000000000000000"), "a number with all its zeros");
    // Where nothing else is there, that is an error.
    let altered = Altered::of(
        "shared_scanner",
        |row, t| (row < 200).then_some(if row < 100 { t } else { t + 1.0 }),
        NOTHING,
    );
    let (output, _) = altered.run(&["estimate", "experiment.toml", "--out", "out"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("settling time"), "{}", text(&output.stderr));
}

#[test]
fn a_segment_of_which_no_stretch_can_be_estimated_is_an_error() {
    // A record of 12 ms, and one of two pieces, each shorter than the settling time, or the second of them not.
    for (ends, code) in [(20_500, 1), (24_000, 0)] {
        let row = |row: usize| row < 12_500 || (15_000 + 5000 * usize::from(code == 1)..ends).contains(&row);
        let replaced = ["clock = {", "segments = { column = \"take\" }\nclock = {"];
        let altered = Altered::of("shared_scanner", |k, time_s| row(k).then_some(time_s), replaced);
        let path = altered.folder.path().join("recording.csv");
        let rows = std::fs::read_to_string(&path).unwrap();
        let label = |(k, line): (usize, &str)| match k {
            0 => format!("{line},take\n"),
            1..=12_000 => format!("{line},a\n"),
            _ => format!("{line},b\n"),
        };
        std::fs::write(&path, rows.lines().enumerate().map(label).collect::<String>()).unwrap();
        let (output, _) = altered.run(&["estimate", "experiment.toml", "--out", "out"]);
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{said}");
        assert_eq!(altered.folder.path().join("out").exists(), code == 0);
        if code == 1 {
            assert!(said.contains("segment `b`") && said.contains("more than the settling time"), "{said}");
        }
    }
}

#[test]
fn a_clock_that_goes_back_begins_a_stretch_that_is_compared_with_its_own_reference() {
    let whole = Altered::of("shared_scanner", |_, t| Some(t), NOTHING);
    let (before, ..) = whole.estimate();
    let known = errors(&before["segments"][0]);
    let altered =
        Altered::of("shared_scanner", |row, t| Some(if row >= 12_000 { t - 0.01 } else { t }), NOTHING);
    let (recording, ..) = altered.estimate();
    assert_eq!(recording["diagnosis"][0]["kind"], "clock_back");
    assert_eq!(recording["diagnosis"][0]["count"], 1);
    let segments = recording["segments"].as_array().unwrap();
    assert_eq!(segments.len(), 2);
    assert_eq!(segments[1]["stretch"]["clock_run"], 2);
    for segment in segments {
        for ((key, error), (_, whole)) in corrected(&errors(segment)).zip(corrected(&known)) {
            assert!(*error < 1.5 * whole, "{key}: {error} for {whole}");
        }
    }
}

#[test]
fn a_gap_within_the_longest_is_predicted_over_and_the_longest_can_be_said_in_cycles_or_as_a_time() {
    let gap = |row: usize, t: f64| Some(t + if row >= 12_000 { 640e-6 } else { 0.0 });
    for (longest, restarts) in [("", 0), ("5 cycles", 1), ("0.5 ms", 1), ("1 ms", 0), ("20 cycles", 0)] {
        let table = format!("clock = {{ column = \"time_s\" }}\ngaps = {{ longest = \"{longest}\" }}");
        let clock = "clock = { column = \"time_s\" }";
        let table = if longest.is_empty() { clock } else { &table };
        let altered = Altered::of("shared_scanner", gap, [clock, table]);
        let (recording, ..) = altered.estimate();
        let found = recording["stretches"]["restarts"].as_u64().unwrap_or(0);
        assert_eq!(found, restarts, "{longest}");
        let bridged = recording["segments"][0]["estimators"][1]["counts"]["bridged"].as_u64().unwrap();
        assert_eq!(bridged, if restarts == 0 { 640 } else { 0 }, "{longest}");
    }
    for (longest, why) in [
        ("1 h", "1024 cycles"),
        ("-1 cycles", "above 0"),
        ("many", "a number of cycles, such as `20 cycles`"),
        ("3 V", "a time"),
    ] {
        let table = format!("clock = {{ column = \"time_s\" }}\ngaps = {{ longest = \"{longest}\" }}");
        let altered = Altered::of("shared_scanner", gap, ["clock = { column = \"time_s\" }", &table]);
        let (output, _) = altered.run(&["estimate", "experiment.toml", "--out", "out"]);
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{longest}: {said}");
        assert!(said.contains("recording[0].gaps.longest") && said.contains(why), "{longest}: {said}");
    }
}

#[test]
fn a_gap_of_an_hour_while_samples_arrive_begins_a_stretch_and_takes_no_time() {
    let source = examples().join("shared_scanner");
    let folder = tempfile::tempdir().unwrap();
    let toml = std::fs::read_to_string(source.join("stream.toml")).unwrap();
    std::fs::write(folder.path().join("stream.toml"), toml).unwrap();
    let recording = std::fs::read_to_string(source.join("recording.csv")).unwrap();
    let mut took = Vec::new();
    for gap_s in [0.0, 60.0, 3600.0, 1e300] {
        let mut csv = String::new();
        for (row, line) in recording.lines().enumerate() {
            let Some((time, rest)) = line.split_once(',').filter(|_| row > 0) else { continue };
            let time: f64 = time.parse().unwrap();
            writeln!(csv, "{:?},{rest}", if row > 12_000 { time + gap_s } else { time }).unwrap();
        }
        std::fs::write(folder.path().join("samples.csv"), csv).unwrap();
        let started = Instant::now();
        let mut command = Command::new(env!("CARGO_BIN_EXE_kalmems"));
        let arguments = ["stream", "stream.toml", "--from", "samples.csv", "--lines", "lines.csv"];
        let output = command.current_dir(folder.path()).args(arguments).output().unwrap();
        took.push(started.elapsed());
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{gap_s}: {said}");
        assert!(as_fast(took[took.len() - 1], took[0]), "{gap_s}: {took:?}");
        if gap_s > 0.0 && gap_s < 1e300 {
            assert!(said.contains("a new stretch begins"), "{gap_s}: {said}");
            let lines = std::fs::read_to_string(folder.path().join("lines.csv")).unwrap();
            let estimates = lines.lines().filter_map(|line| line.strip_prefix("ekf,"));
            let times = estimates.filter_map(|line| line.split(',').next()?.parse::<f64>().ok());
            let after = times.filter(|time| *time > gap_s).count();
            assert!(after > 1000, "{gap_s}: {after} estimates after the gap");
        }
    }
}

#[test]
fn inspect_and_estimate_agree_on_a_gap_in_a_free_decay() {
    let source = examples().join("threshold_scanner");
    let folder = tempfile::tempdir().unwrap();
    let recording = std::fs::read_to_string(source.join("recording.csv")).unwrap();
    let kept = recording.lines().enumerate().filter(|(row, _)| !(4000..4200).contains(row));
    let csv: String = kept.flat_map(|(_, line)| [line, "\n"]).collect();
    std::fs::write(folder.path().join("recording.csv"), csv).unwrap();
    std::fs::copy(source.join("as_published.toml"), folder.path().join("experiment.toml")).unwrap();
    let run = |arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_kalmems"));
        command.current_dir(folder.path()).args(arguments).output().unwrap()
    };
    let inspected = text(&run(&["inspect", "recording.csv"]).stdout);
    assert!(inspected.contains("200 samples are missing"), "{inspected}");
    assert!(inspected.contains("an estimate predicts over the gap where it knows the drive"), "{inspected}");
    assert!(inspected.contains("`identify` takes records without a gap"), "{inspected}");
    let identified = run(&["identify", "experiment.toml", "--out", "identified"]);
    let said = text(&identified.stderr);
    assert_eq!(identified.status.code(), Some(1), "{said}");
    assert!(said.contains("expected a record without gaps"), "{said}");
    let estimated = run(&["estimate", "experiment.toml", "--out", "out", "--json"]);
    assert_eq!(estimated.status.code(), Some(0), "{}", text(&estimated.stderr));
    let metrics: Value = serde_json::from_slice(&estimated.stdout).unwrap();
    let segment = &metrics["recordings"][0]["segments"][0];
    assert_eq!(segment["estimators"][0]["counts"]["bridged"], 200);
}

#[test]
fn inspect_lists_the_stretches_of_a_clock_that_goes_back() {
    let altered =
        Altered::of("shared_scanner", |row, t| Some(if row >= 12_000 { t - 0.01 } else { t }), NOTHING);
    let (output, _) = altered.run(&["inspect", "recording.csv"]);
    let said = text(&output.stdout);
    assert!(said.contains("stretch 2") && said.contains("the estimate begins anew"), "{said}");
    assert!(!said.contains("cannot be used"), "{said}");
}

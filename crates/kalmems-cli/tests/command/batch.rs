//! `kalmems batch` as a user meets it: killed, with more recordings, with equal ones, and with some that are none.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

fn run(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_kalmems")).current_dir(folder).args(arguments).output().unwrap()
}

fn code(output: &Output) -> Option<i32> {
    output.status.code()
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr)
}

fn example(name: &str) -> String {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../examples/shared_scanner");
    fs::read_to_string(root.join(name)).unwrap()
}

/// The example's experiment, whose reference is in a file of its own, and so many recordings of different length in `scans`, with their
/// references in `truth`.
fn laboratory(recordings: usize) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("experiment.toml"), example("experiment.toml")).unwrap();
    let rows = |name: &str, count: usize| {
        example(name).lines().take(count + 1).collect::<Vec<_>>().join("\n") + "\n"
    };
    for kind in ["scans", "truth"] {
        fs::create_dir(folder.path().join(kind)).unwrap();
    }
    for number in 0..recordings {
        let count = 12_000 - 100 * number;
        for (kind, name) in [("scans", "recording.csv"), ("truth", "reference.csv")] {
            fs::write(folder.path().join(format!("{kind}/scan{number}.csv")), rows(name, count)).unwrap();
        }
    }
    folder
}

const BATCH: [&str; 6] =
    ["batch", "scans/*.csv", "--experiment", "experiment.toml", "--reference", "truth/{name}.csv"];

fn batch(folder: &Path, out: &str, further: &[&str]) -> Output {
    run(folder, &[&BATCH[..], &["--out", out], further].concat())
}

fn files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut found = BTreeMap::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = PathBuf::from(path.file_name().unwrap());
        if path.is_dir() {
            found.extend(files(&path).into_iter().map(|(inner, bytes)| (name.join(inner), bytes)));
        } else {
            found.insert(name, fs::read(&path).unwrap());
        }
    }
    found
}

/// The rows of a table by the names of its columns.
fn rows(path: &Path) -> Vec<BTreeMap<String, String>> {
    let mut reader = csv::Reader::from_path(path).unwrap();
    reader.deserialize().map(Result::unwrap).collect()
}

#[test]
fn a_batch_that_was_killed_goes_on_and_writes_the_same_bytes() {
    let folder = laboratory(5);
    let folder = folder.path();
    let whole = batch(folder, "whole", &["--threads", "2"]);
    assert_eq!(code(&whole), Some(0), "{}", said(&whole));
    let whole = files(&folder.join("whole"));
    assert_eq!(whole.keys().filter(|name| name.starts_with("trajectories")).count(), 5);
    assert!(!folder.join("whole.unfinished").exists());

    let mut killed = Command::new(env!("CARGO_BIN_EXE_kalmems"))
        .current_dir(folder)
        .args([&BATCH[..], &["--out", "killed", "--threads", "1"]].concat())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let journal = folder.join("killed.journal");
    let since = Instant::now();
    // A line that is half written is none yet.
    while fs::read_to_string(&journal).map_or(0, |text| text.matches('\n').count()) < 2 {
        assert!(killed.try_wait().unwrap().is_none(), "it came to its end before it could be stopped");
        assert!(since.elapsed() < Duration::from_secs(60));
        std::thread::sleep(Duration::from_millis(2));
    }
    killed.kill().unwrap();
    killed.wait().unwrap();
    assert!(!folder.join("killed").exists());
    let again = batch(folder, "killed", &[]);
    assert_eq!(code(&again), Some(0), "{}", said(&again));
    assert!(said(&again).contains("were finished by killed.journal already"), "{}", said(&again));
    assert_eq!(files(&folder.join("killed")), whole);
}

#[test]
fn the_summary_has_a_row_for_each_recording_with_its_errors_and_the_figures_of_an_estimate_alone() {
    let folder = laboratory(2);
    let folder = folder.path();
    let output = batch(folder, "out", &[]);
    assert_eq!(code(&output), Some(0), "{}", said(&output));
    let summary = rows(&folder.join("out/summary.csv"));
    assert_eq!(summary.iter().map(|row| row["recording"].as_str()).collect::<Vec<_>>(), ["scan0", "scan1"]);
    // The same by hand.
    let alone = example("experiment.toml")
        .replace("\"recording.csv\"", "\"scans/scan1.csv\"")
        .replace("\"reference.csv\"", "\"truth/scan1.csv\"");
    fs::write(folder.join("alone.toml"), alone).unwrap();
    let estimate = run(folder, &["estimate", "alone.toml", "--json", "--out", "alone"]);
    assert_eq!(code(&estimate), Some(0), "{}", said(&estimate));
    let metrics: serde_json::Value = serde_json::from_slice(&estimate.stdout).unwrap();
    let estimators = metrics["recordings"][0]["segments"][0]["estimators"].as_array().unwrap();
    let row = &summary[1];
    let same = estimators.iter().find(|one| one["name"] == row["filter"].as_str()).unwrap();
    for (column, value) in [
        ("consistency.mean_nis", &same["consistency"]["mean_nis"]),
        ("errors.angle.rmse_deg", &same["errors"]["angle"]["rmse_deg"]),
        ("counts.samples", &same["counts"]["samples"]),
    ] {
        assert_eq!(row[column], value.to_string(), "{column}");
    }
    assert_eq!(row["grade"], same["grade"].as_str().unwrap());
    let all = rows(&folder.join("out/results.csv"));
    assert_eq!(all.len(), 2 * estimators.len());
    assert_eq!(all.iter().filter(|row| row["trusted"] == "yes").count(), 2);
    // Without references of their own, the reference of the experiment's recording is not taken for theirs.
    let without =
        run(folder, &["batch", "scans/scan1.csv", "--experiment", "experiment.toml", "--out", "bare"]);
    assert_eq!(code(&without), Some(0), "{}", said(&without));
    assert!(said(&without).contains("is in a file of its own and is left out"), "{}", said(&without));
    assert!(!rows(&folder.join("bare/summary.csv"))[0].contains_key("errors.angle.rmse_deg"));
}

#[test]
fn the_trajectories_are_those_of_an_estimate_to_the_last_bit_and_can_be_a_recording() {
    let folder = laboratory(1);
    let folder = folder.path();
    assert_eq!(code(&batch(folder, "out", &[])), Some(0));
    let alone = example("experiment.toml")
        .replace("\"recording.csv\"", "\"scans/scan0.csv\"")
        .replace("\"reference.csv\"", "\"truth/scan0.csv\"");
    fs::write(folder.join("alone.toml"), alone).unwrap();
    assert_eq!(code(&run(folder, &["estimate", "alone.toml", "--out", "alone"])), Some(0));
    let inspected = run(folder, &["inspect", "out/trajectories/scan0.parquet"]);
    assert!(said(&inspected).contains("angle_sd_rad"), "{}", said(&inspected));
    let file = fs::File::open(folder.join("out/trajectories/scan0.parquet")).unwrap();
    let mut table =
        kalmems_formats::open_reader(file, "scan0.parquet", &kalmems_formats::Hints::default()).unwrap();
    let names: Vec<String> = table.description().columns.iter().map(|column| column.name.clone()).collect();
    let place = |name: &str| names.iter().position(|own| own == name).unwrap();
    let wanted = ["angle_rad", "rate_sd_rad_per_s", "innovation_V", "nis_1"];
    let numbers = wanted.map(|name| kalmems_formats::WantedColumn::Number { column: place(name), power: 0 });
    table.want(&numbers).unwrap();
    let mut found = vec![Vec::new(); wanted.len()];
    let mut block = kalmems_formats::Block::with_capacity(4096);
    loop {
        table.read(&mut block).unwrap();
        if block.rows == 0 {
            break;
        }
        for (all, new) in found.iter_mut().zip(&block.numbers) {
            all.extend_from_slice(&new[..block.rows]);
        }
    }
    // The filters one after the other, as the summary of an estimate has them.
    let keys: Vec<String> =
        rows(&folder.join("out/results.csv")).iter().map(|row| row["estimator"].clone()).collect();
    let mut row = 0;
    for key in keys {
        for own in rows(&folder.join(format!("alone/trajectory_{key}.csv"))) {
            for (name, all) in wanted.iter().zip(&found) {
                let expected: f64 = own
                    .get(*name)
                    .filter(|cell| !cell.is_empty())
                    .map_or(f64::NAN, |cell| cell.parse().unwrap());
                assert_eq!(all[row].to_bits(), expected.to_bits(), "{key} {name} {row}");
            }
            row += 1;
        }
    }
    assert_eq!(row, found[0].len());
}

#[test]
fn what_is_new_is_estimated_what_is_equal_is_not_and_what_fails_keeps_no_other_from_its_results() {
    let folder = laboratory(2);
    let folder = folder.path();
    assert_eq!(code(&batch(folder, "out", &[])), Some(0));
    fs::copy(folder.join("scans/scan0.csv"), folder.join("scans/again.csv")).unwrap();
    fs::copy(folder.join("truth/scan0.csv"), folder.join("truth/again.csv")).unwrap();
    fs::write(folder.join("scans/noise.csv"), "time_s,mutual_V\n0,nothing\n").unwrap();
    let output = batch(folder, "out", &[]);
    assert_eq!(code(&output), Some(5), "{}", said(&output));
    assert!(
        said(&output).contains("4 recordings: 2 estimated, 1 with the content of another, 1 failed"),
        "{}",
        said(&output)
    );
    assert!(said(&output).contains("`scan0` is `again`"), "{}", said(&output));
    let summary = rows(&folder.join("out/summary.csv"));
    let by = |name: &str| summary.iter().find(|row| row["recording"] == name).unwrap();
    assert_eq!(by("scan0")["same_as"], "again");
    assert_eq!(by("scan0")["consistency.mean_nis"], by("again")["consistency.mean_nis"]);
    assert_eq!(by("scan0")["trajectories"], "trajectories/again.parquet");
    assert!(by("noise")["error"].contains("noise.csv") && by("noise")["trajectories"].is_empty());
    let kept: Vec<PathBuf> = files(&folder.join("out/trajectories")).into_keys().collect();
    assert_eq!(kept, ["again.parquet", "scan1.parquet"].map(PathBuf::from));
    // The result before is kept, as the store has it.
    assert!(folder.join("out.previous/trajectories/scan0.parquet").is_file());
    // Another experiment is other work.
    let text = example("experiment.toml").replace("skip = \"8 ms\"", "skip = \"9 ms\"");
    assert_ne!(text, example("experiment.toml"));
    fs::write(folder.join("experiment.toml"), text).unwrap();
    let refused = batch(folder, "out", &[]);
    assert_eq!(code(&refused), Some(1));
    assert!(said(&refused).contains("belongs to another batch"), "{}", said(&refused));
    assert_eq!(code(&batch(folder, "out", &["--force"])), Some(5));
    // Where nothing can be estimated the exit code is that of an error, and the results say why.
    let none = run(folder, &["batch", "scans/noise.csv", "--experiment", "experiment.toml", "--out", "none"]);
    assert_eq!(code(&none), Some(1), "{}", said(&none));
    assert_eq!(rows(&folder.join("none/summary.csv")).len(), 1);
    let unmatched = run(folder, &["batch", "scans/*.h5", "--experiment", "experiment.toml", "--out", "none"]);
    assert!(said(&unmatched).contains("no file matches `scans/*.h5`"), "{}", said(&unmatched));
}

#[test]
fn an_arbitrary_sign_is_in_answer_and_grade_and_in_the_row_of_a_batch() {
    let folder = laboratory(1);
    let folder = folder.path();
    let text = example("true_stiffness.toml");
    let is_other = |line: &&str| !line.starts_with("first_peak");
    let lines: Vec<&str> = text.lines().filter(is_other).collect();
    assert_eq!(lines.len() + 1, text.lines().count());
    let text = lines.join("\n");
    fs::write(folder.join("experiment.toml"), text).unwrap();
    for name in ["recording.csv", "reference.csv"] {
        fs::write(folder.join(name), example(name)).unwrap();
    }
    let alone = said(&run(folder, &["estimate", "experiment.toml", "--out", "alone"]));
    assert!(alone.contains("passes with remarks); its sign is arbitrary"), "{alone}");
    assert!(alone.contains("; arbitrary: the sign of `angle`"), "{alone}");
    let all = batch(folder, "all", &[]);
    assert!(said(&all).contains("arbitrary sign of"), "{}", said(&all));
    assert_eq!(rows(&folder.join("all/summary.csv"))[0]["segment.arbitrary_signs"], "angle");
}

/// A position that wanders, seen by an optical and an electrical sensor.
const STAGE: &str = r#"
name = "stage"
[device.equations]
states = { x = "m" }
derivative = { x = "0" }
parameters = { gain = "2 A/m", offset = "0.3 A" }
measure = { optical = "x in m", electrical = "gain*x + offset in A" }
noise = { optical = "0.04[m^2]", electrical = "0.25[A^2]", x = "9[m^2/s]" }
[[recording]]
role = "test"
file = "recording.csv"
clock = { column = "time_s" }
channels = { optical = "optical_m", electrical = "electrical_A" }
[estimate]
skip = "0 s"
[[estimate.filter]]
name = "Both"
method = "ekf"
gate = false
start = { x = "0 m" }
start_sd = { x = "1 m" }
"#;

#[test]
fn a_batch_has_the_mean_nis_of_each_signal_in_its_table_and_in_its_json() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    fs::write(folder.join("experiment.toml"), STAGE).unwrap();
    // Noise of the stated variances, one of two alternating signs; the electrical sensor lacks every second sample, and the second one is off by 3 A.
    for (name, off) in [("first", 0.0), ("second", 3.0)] {
        let row = |k: u32| {
            let sign = |of: u32| if of.is_multiple_of(2) { 1.0 } else { -1.0 };
            let electrical = if k.is_multiple_of(2) {
                format!("{}", 0.3 + off + 0.5 * sign(k / 2))
            } else {
                String::new()
            };
            format!("{},{},{electrical}\n", f64::from(k) * 1e-3, 0.2 * sign(k))
        };
        let rows: String = (0..200).map(row).collect();
        fs::write(folder.join(format!("{name}.csv")), format!("time_s,optical_m,electrical_A\n{rows}"))
            .unwrap();
    }
    let command = ["batch", "first.csv", "second.csv", "--experiment", "experiment.toml", "--out", "all"];
    let table = said(&run(folder, &command));
    assert!(table.contains("mean NIS of optical") && table.contains("mean NIS of electrical"), "{table}");
    let told = run(folder, &[&command[..], &["--json"]].concat());
    let told: serde_json::Value = serde_json::from_slice(&told.stdout).unwrap();
    let found = told["by_signal"].as_array().unwrap();
    let named: Vec<[&str; 2]> =
        found.iter().map(|of| ["recording", "signal"].map(|key| of[key].as_str().unwrap())).collect();
    let of = |name| ["optical", "electrical"].map(|signal| [name, signal]);
    assert_eq!(named, [of("first"), of("second")].concat());
    let updates: Vec<u64> = found.iter().map(|of| of["updates"].as_u64().unwrap()).collect();
    assert_eq!(updates, [200, 100, 200, 100]);
    let nis: Vec<f64> = found.iter().map(|of| of["mean_nis"].as_f64().unwrap()).collect();
    assert!(nis[1] < 2.0 && nis[3] > 5.0, "{nis:?}");
    // As in the tables of the folder.
    for (row, place) in rows(&folder.join("all/summary.csv")).iter().zip([0, 2]) {
        for (signal, place) in [("optical", place), ("electrical", place + 1)] {
            let written: f64 = row[&format!("by_signal.{signal}.mean_nis")].parse().unwrap();
            assert!((written / nis[place] - 1.0).abs() < 1e-12, "{written} {nis:?}");
        }
    }
}

//! `kalmems study` as a user meets it: killed, interrupted, and against the same by hand.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

fn run(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_kalmems")).current_dir(folder).args(arguments).output().unwrap()
}

fn good(folder: &Path, arguments: &[&str]) -> String {
    let output = run(folder, arguments);
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

fn example(name: &str) -> String {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../examples/shared_scanner");
    fs::read_to_string(root.join(name)).unwrap()
}

fn replaced(text: &str, was: &str, is: &str) -> String {
    assert!(text.contains(was), "{was}");
    text.replace(was, is)
}

/// The shipped study and its simulation, short.
fn short(duration_ms: u32) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let mut text = example("simulation.toml");
    text = replaced(&text, "duration = \"60 ms\"", &format!("duration = \"{duration_ms} ms\""));
    text = replaced(&text, "skip = \"45 ms\"", "skip = \"0.5 ms\"");
    text = replaced(
        &text,
        "angle = \"1e-4 rad\", rate = \"0 rad/s\" } # from",
        "angle = \"0.1 rad\", rate = \"0 rad/s\" } # from",
    );
    fs::write(folder.path().join("simulation.toml"), text).unwrap();
    fs::write(folder.path().join("study.toml"), example("study.toml")).unwrap();
    folder
}

fn files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut found = BTreeMap::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(
                files(&path).into_iter().map(|(name, bytes)| (Path::new("figures").join(name), bytes)),
            );
        } else {
            found.insert(path.file_name().unwrap().into(), fs::read(&path).unwrap());
        }
    }
    found
}

/// A study that has written so many lines of its journal.
fn begun(folder: &Path, out: &str, lines: usize) -> Child {
    let mut child = Command::new(env!("CARGO_BIN_EXE_kalmems"))
        .current_dir(folder)
        .args(["study", "study.toml", "--threads", "1", "--out", out])
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let journal = folder.join(format!("{out}.journal"));
    let since = Instant::now();
    while fs::read_to_string(&journal).map_or(0, |text| text.matches('\n').count()) <= lines {
        assert!(child.try_wait().unwrap().is_none(), "it came to its end before it could be stopped");
        assert!(since.elapsed() < Duration::from_secs(60));
        std::thread::sleep(Duration::from_millis(2));
    }
    child
}

#[test]
fn a_study_that_was_killed_goes_on_and_writes_the_same_bytes() {
    let folder = short(2);
    let folder = folder.path();
    good(folder, &["study", "study.toml", "--threads", "2", "--out", "whole"]);
    let whole = files(&folder.join("whole"));
    assert!(whole.len() >= 10, "{:?}", whole.keys());

    let mut killed = begun(folder, "killed", 4);
    killed.kill().unwrap();
    killed.wait().unwrap();
    let journal = fs::read_to_string(folder.join("killed.journal")).unwrap();
    assert!(journal.lines().count() < 64 && !folder.join("killed").exists());
    let output = run(folder, &["study", "study.toml", "--threads", "2", "--out", "killed"]);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(said.contains("of 63 runs were in killed.journal already"), "{said}");
    assert_eq!(files(&folder.join("killed")), whole);
    // What was finished is not made again.
    let finished = journal.rfind('\n').unwrap();
    assert!(fs::read_to_string(folder.join("killed.journal")).unwrap().starts_with(&journal[..finished]));

    for shard in ["2/2", "1/2"] {
        good(folder, &["study", "study.toml", "--shard", shard, "--out", "part"]);
    }
    good(folder, &["merge", "part.1-of-2.journal", "part.2-of-2.journal", "--out", "part"]);
    assert_eq!(files(&folder.join("part")), whole);
    let gap = run(folder, &["merge", "part.1-of-2.journal", "--out", "gap"]);
    assert_eq!(gap.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&gap.stderr).contains("31 of 63 runs are in none of the journals"));
    assert_eq!(run(folder, &["study", "study.toml", "--shard", "3/2"]).status.code(), Some(2));
}

#[cfg(unix)]
#[test]
fn an_interrupted_study_ends_with_130_and_prints_how_to_go_on() {
    let folder = short(20);
    let child = begun(folder.path(), "out", 2);
    // Another process must not write the same journal.
    let busy = run(folder.path(), &["study", "study.toml", "--out", "out"]);
    assert!(String::from_utf8_lossy(&busy.stderr).contains("another run is writing to"));
    Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    let output = child.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(130), "{said}");
    assert!(
        said.contains("of 63 runs are in out.journal, and the same command goes on from there"),
        "{said}"
    );
    assert!(!folder.path().join("out").exists());
}

/// The second way: the truth's file with the run's seed through `simulate`, what is told through `estimate`.
#[test]
fn a_run_is_what_simulate_and_estimate_make_of_it() {
    let folder = short(2);
    let folder = folder.path();
    good(folder, &["study", "study.toml", "--out", "study"]);
    let table = fs::read_to_string(folder.join("study/results.csv")).unwrap();
    let header: Vec<&str> = table.lines().next().unwrap().split(',').collect();
    let run: BTreeMap<&str, &str> =
        header.iter().copied().zip(table.lines().nth(5).unwrap().split(',')).collect();
    assert_eq!((run["told_stiffness_N_m"], run["process_noise_rad2_per_s3"]), ("0.0001094", "1000000.0"));

    let text = fs::read_to_string(folder.join("simulation.toml")).unwrap();
    let truth = replaced(&text, "seed = 1", &format!("seed = {}", run["seed"]));
    fs::write(folder.join("truth.toml"), truth).unwrap();
    good(folder, &["simulate", "truth.toml", "--out", "simulated"]);
    let told = fs::read_to_string(folder.join("simulated/experiment.toml")).unwrap();
    let told = replaced(&told, "1.10e-4 N m", "1.094e-4 N m");
    fs::write(folder.join("simulated/told.toml"), replaced(&told, "1e4 rad^2/s^3", "1e6 rad^2/s^3")).unwrap();
    let json = good(folder, &["estimate", "simulated/told.toml", "--json", "--out", "estimate"]);
    let metrics: serde_json::Value = serde_json::from_str(&json).unwrap();
    let estimator = &metrics["recordings"][0]["segments"][0]["estimators"][0];
    let mut compared = 0;
    for (column, cell) in run {
        let mut leaf = estimator;
        for name in column.split('.') {
            leaf = &leaf[name];
        }
        // As text: every digit.
        if leaf.is_number() {
            let line = column.rsplit('.').next().unwrap();
            assert!(json.contains(&format!("\"{line}\": {cell}")), "{column}: {cell} is not in\n{json}");
            compared += 1;
        }
    }
    assert!(compared >= 15, "{compared}");
}

#[test]
fn an_experiment_file_is_calibrated_by_itself() {
    let folder = short(2);
    let folder = folder.path();
    let json = good(folder, &["study", "simulation.toml", "--calibration", "--runs", "3", "--json"]);
    let summary: serde_json::Value = serde_json::from_str(&json).unwrap();
    let filter = &summary["calibration"]["filters"][0];
    assert_eq!((filter["estimator"].as_str(), filter["runs"].as_u64()), (Some("ekf"), Some(3)));
    assert_eq!(filter["claims"][0]["quantity"], "angle");
    let out = folder.join("out/calibrations/shared_scanner_start");
    assert!(out.join("calibration.csv").exists() && out.join("report.html").exists());
    let text = good(folder, &["study", "simulation.toml", "--calibration", "--runs", "3"]);
    assert!(text.contains("Verdicts") && text.contains("within 1 sd, % (68.3)"), "{text}");
    // How many runs a study has says its file.
    assert_eq!(run(folder, &["study", "study.toml", "--runs", "3"]).status.code(), Some(2));
}

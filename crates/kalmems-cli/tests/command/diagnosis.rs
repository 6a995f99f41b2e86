//! `kalmems diagnose`: what it says, and the experiment that it writes.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use tempfile::TempDir;

fn run(arguments: &[&str], folder: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_kalmems")).current_dir(folder).args(arguments).output().unwrap()
}

fn example(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples").join(name)
}

/// The scanner's example in a folder of its own.
fn scanner() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for file in ["experiment.toml", "recording.csv", "reference.csv"] {
        std::fs::copy(example("shared_scanner").join(file), folder.path().join(file)).unwrap();
    }
    folder
}

#[test]
fn the_examples_stiffness_is_found_and_the_experiment_that_is_written_passes() {
    let folder = scanner();
    let before = std::fs::read_to_string(folder.path().join("experiment.toml")).unwrap();
    let output = run(&["diagnose", "experiment.toml", "--write", "mended.toml"], folder.path());
    let said = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    // The book and the README print this; the recording was simulated with 1.10e-4 N m.
    insta::assert_snapshot!(said);

    let mended = std::fs::read_to_string(folder.path().join("mended.toml")).unwrap();
    assert_eq!(std::fs::read_to_string(folder.path().join("experiment.toml")).unwrap(), before);
    // One value is another; comments and all else stay.
    let differing = before.lines().zip(mended.lines()).filter(|(a, b)| a != b).count();
    assert_eq!((differing, mended.lines().count()), (1, before.lines().count()));

    for (file, code) in [("experiment.toml", Some(3)), ("mended.toml", Some(0))] {
        let judged = run(&["estimate", file, "--strict", "--out", &format!("out_{file}")], folder.path());
        assert_eq!(judged.status.code(), code, "{file}: {}", String::from_utf8_lossy(&judged.stdout));
    }
}

#[test]
fn no_file_is_replaced_and_none_is_written_elsewhere() {
    let folder = scanner();
    std::fs::write(folder.path().join("mine.toml"), "mine").unwrap();
    for (to, why) in [
        ("mine.toml", "`--force`, which keeps the present file as"),
        ("../there.toml", "in the folder of the experiment"),
    ] {
        let output = run(&["diagnose", "experiment.toml", "--write", to], folder.path());
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(1) && said.contains(why), "{said}");
    }
    assert_eq!(std::fs::read_to_string(folder.path().join("mine.toml")).unwrap(), "mine");
}

#[test]
fn a_filter_without_innovations_cannot_be_diagnosed() {
    let folder = scanner();
    for (filter, why) in
        [("Model alone", "are not white when it is right"), ("Nobody", "there are `Model alone`, `EKF`")]
    {
        let output = run(&["diagnose", "experiment.toml", "--filter", filter], folder.path());
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(1) && said.contains(why), "{said}");
    }
}

#[test]
fn an_experiment_that_is_right_has_nothing_to_change_and_its_notes() {
    let output = run(&["diagnose", "experiment.toml", "--json"], &example("piston_mirror"));
    let found: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(found["finding"], "nothing_to_change");
    let notes = found["notes"].as_array().unwrap();
    let names: Vec<&str> = notes.iter().map(|note| note["parameter"].as_str().unwrap()).collect();
    // Of a parallel plate the position is the reference distance over what the coefficient makes of the capacitance.
    assert!(
        names.contains(&"capacitance.reference_distance") && names.contains(&"capacitance.coefficients[1]"),
        "{names:?}"
    );
    for note in notes {
        let scale = note["change"]["scale"].as_f64().unwrap();
        assert!((scale - 0.01).abs() < 1e-4 && note["hidden"] == 1.0, "{note}");
    }
}

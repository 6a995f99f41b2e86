//! A device of one's own, `examples/own_rig`, with the command as for the published ones.
//!
//! This program is both: with a variable of the environment set it is the command that the example makes.

#![allow(clippy::inline_always)] // `#[model]` writes it

#[path = "../../../examples/own_rig/src/device.rs"]
mod device;
#[path = "../../../examples/own_rig/src/model.rs"]
mod model;
#[path = "../../../examples/own_rig/src/rig.rs"]
mod rig;

use kalmems::rigs::{DrivenRig, published};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};
use std::{env, fs};

const AS_COMMAND: &str = "KALMEMS_OWN_RIG";

fn main() -> ExitCode {
    if env::var_os(AS_COMMAND).is_some() {
        return kalmems_cli::run(&published().clone().with(DrivenRig(rig::CombDevice)));
    }
    if env::args().any(|argument| argument == "--ignored" || argument == "--list") {
        return ExitCode::SUCCESS;
    }
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path();
    let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/own_rig");
    for file in ["experiment.toml", "study.toml"] {
        fs::copy(example.join(file), place.join(file)).unwrap();
    }
    the_short_way_is_short(&example);
    run(place, &["simulate", "experiment.toml", "--out", "simulated"], None);
    run(place, &["inspect", "experiment.toml"], None);
    a_stated_frequency_is_found(place);
    samples_that_arrive_give_the_same(place);
    run(place, &["study", "study.toml", "--out", "study"], None);
    assert!(fs::read_to_string(place.join("study/results.csv")).unwrap().lines().count() > 3);
    println!("a device of one's own: estimated, simulated, reported, streamed and studied");
    ExitCode::SUCCESS
}

/// Runs the command; what it printed.
fn run(place: &Path, arguments: &[&str], input: Option<PathBuf>) -> String {
    let input = input.map_or(Stdio::null(), |file| fs::File::open(file).unwrap().into());
    let mut command = Command::new(env::current_exe().unwrap());
    let output =
        command.env(AS_COMMAND, "1").current_dir(place).args(arguments).stdin(input).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {said}");
    String::from_utf8(output.stdout).unwrap()
}

/// Lines of the example, its settings and its experiment with it.
fn the_short_way_is_short(example: &Path) {
    let lines = |file: &str| fs::read_to_string(example.join(file)).unwrap().lines().count();
    let files =
        ["src/device.rs", "src/main.rs", "src/model.rs", "src/rig.rs", "Cargo.toml", "experiment.toml"];
    let lines: usize = files.into_iter().map(lines).sum();
    assert!(lines <= 250, "{lines} lines");
}

/// The filter with the frequency as a state is better than the one that is told a wrong one, and right about itself.
fn a_stated_frequency_is_found(place: &Path) {
    let told = fs::read_to_string(place.join("simulated/experiment.toml")).unwrap();
    let wrong = told.replace("natural_frequency = \"10 kHz\"", "natural_frequency = \"10.02 kHz\"");
    assert_ne!(told, wrong);
    fs::write(place.join("simulated/experiment.toml"), wrong).unwrap();
    run(place, &["estimate", "simulated/experiment.toml", "--out", "estimate"], None);
    let metrics = fs::read_to_string(place.join("estimate/metrics.json")).unwrap();
    let metrics: serde_json::Value = serde_json::from_str(&metrics).unwrap();
    let estimators = metrics["recordings"][0]["segments"][0]["estimators"].as_array().unwrap();
    let of = |key: &str| estimators.iter().find(|estimator| estimator["key"] == key).unwrap();
    let error = |key: &str| of(key)["values"]["deflection"]["rmse"].as_f64().unwrap();
    assert!(error("ekf_with_the_frequency") < 0.5 * error("ekf"), "{metrics:#}");
    assert_eq!(of("ekf_with_the_frequency")["verdict"], "consistent", "{metrics:#}");
    assert!(fs::read_to_string(place.join("estimate/report.html")).unwrap().contains("deflection"));
    // Nobody has told the diagnosis of this device.
    let diagnosis = run(place, &["diagnose", "simulated/experiment.toml"], None);
    assert!(
        diagnosis.contains("natural_frequency: the log-likelihood") && diagnosis.contains("explain"),
        "{diagnosis}"
    );
}

/// The samples one after the other say what the recording as a whole said.
fn samples_that_arrive_give_the_same(place: &Path) {
    let lines =
        run(place, &["stream", "simulated/experiment.toml"], Some(place.join("simulated/recording.csv")));
    assert!(lines.lines().count() > 1000, "{lines}");
}

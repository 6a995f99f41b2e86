//! `kalmems expand`: the shipped experiments with their devices as equations, estimated as by their rigs.

use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

fn examples() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../examples").canonicalize().unwrap()
}

fn done(arguments: &[&str], folder: &Path) {
    let output =
        Command::new(env!("CARGO_BIN_EXE_kalmems")).current_dir(folder).args(arguments).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{}: {arguments:?}: {said}", folder.display());
}

/// The files of a folder in another one.
fn copied(of: &Path) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    if !of.is_dir() {
        return folder;
    }
    for file in fs::read_dir(of).unwrap().map(|entry| entry.unwrap().path()).filter(|file| file.is_file()) {
        fs::copy(&file, folder.path().join(file.file_name().unwrap())).unwrap();
    }
    folder
}

/// A filter in a record: the record's label, the filter's name, its mean NIS, and the root mean square error of the first quantity that a
/// reference knows.
type FilterNumbers = (String, String, f64, Option<f64>);

/// What the filters of an experiment say.
fn estimated(experiment: &str, folder: &Path, quantity: &str) -> Vec<FilterNumbers> {
    let out = folder.join(format!("out_{experiment}"));
    done(&["estimate", experiment, "--out", out.to_str().unwrap()], folder);
    let metrics: Value =
        serde_json::from_str(&fs::read_to_string(out.join("metrics.json")).unwrap()).unwrap();
    let segments = metrics["recordings"][0]["segments"].as_array().unwrap();
    let of_segment = |segment: &Value| -> Vec<FilterNumbers> {
        let label = segment["label"].as_str().unwrap_or_default().to_owned();
        let filters = segment["estimators"].as_array().unwrap().iter();
        filters
            .map(|filter| {
                let name = filter["name"].as_str().unwrap().to_owned();
                let nis = filter["consistency"]["mean_nis"].as_f64().unwrap_or(f64::NAN);
                (label.clone(), name, nis, filter["values"][quantity]["rmse"].as_f64())
            })
            .collect()
    };
    segments.iter().flat_map(of_segment).collect()
}

/// An example, the quantity whose errors are compared, and the filters that are the same to the printed digits and those that differ by a
/// stated reason: by how much at most, in the mean NIS.
struct Expanded {
    device: &'static str,
    quantity: &'static str,
    same: &'static [&'static str],
    alike: &'static [(&'static str, f64)],
}

const EXAMPLES: [Expanded; 5] = [
    Expanded { device: "shared_scanner", quantity: "none", same: &["EKF", "UKF"], alike: &[] },
    Expanded {
        device: "threshold_scanner",
        quantity: "none",
        same: &["Hybrid", "Hybrid, resonance tracked"],
        // Its rig takes the variance of an angle at a crossing by the slope of the signal, the equations by the rate that the filter has.
        alike: &[("Hybrid, led by the crossings", 0.01)],
    },
    Expanded {
        device: "accelerometer",
        quantity: "acceleration",
        same: &["EKF", "EKF, smoothed", "Settled gain"],
        alike: &[],
    },
    Expanded {
        device: "piston_mirror",
        quantity: "position",
        same: &["Five states", "Five states, smoothed", "Three states"],
        alike: &[],
    },
    Expanded {
        device: "micro_stage",
        quantity: "none",
        same: &[],
        // What the drive makes of the signals is the mean over records, and the samples of the start are not judged: 700 of 1380.
        alike: &[("EKF", 0.15), ("EKF, 1A alone", 0.15)],
    },
];

#[test]
#[ignore = "long: `.ci/run --all` runs it"]
fn long_an_expanded_example_is_estimated_as_by_its_rig() {
    for Expanded { device, quantity, same, alike } in &EXAMPLES {
        let folder = copied(&examples().join(device));
        let folder = folder.path();
        // What is compared is the estimate; the test of the device's numbers takes most of the time.
        let text = fs::read_to_string(folder.join("experiment.toml")).unwrap();
        let text = text.replacen("\n[estimate]\n", "\n[estimate]\ncheck_numbers = false\n", 1);
        assert!(text.contains("check_numbers"), "{device}");
        fs::write(folder.join("experiment.toml"), text).unwrap();
        done(&["expand", "experiment.toml", "--write", "expanded.toml"], folder);
        let rig = estimated("experiment.toml", folder, quantity);
        let text = estimated("expanded.toml", folder, quantity);
        let mut compared = 0;
        for (label, name, nis, rmse) in &rig {
            let other = text.iter().find(|(l, n, ..)| l == label && n == name);
            let bound = if same.contains(&&**name) {
                0.0
            } else if let Some((_, bound)) = alike.iter().find(|(known, _)| known == name) {
                *bound
            } else {
                continue;
            };
            compared += 1;
            let (_, _, other_nis, other_rmse) = other.unwrap_or_else(|| panic!("{device}: {label} {name}"));
            println!("{device} {label} {name}: {nis:.4} {other_nis:.4}, {rmse:.4?} {other_rmse:.4?}");
            let off = (other_nis - nis).abs();
            assert!(off < 5e-4 + bound * nis, "{device} {label} {name}: {nis} {other_nis}");
            if let Some((rmse, other)) = rmse.zip(*other_rmse) {
                assert!((other / rmse - 1.0).abs() < 5e-3, "{device} {name}: {rmse:e} {other:e}");
            }
        }
        assert!(compared >= same.len() + alike.len(), "{device}: {compared}");
    }
}

/// Every experiment of a published device that ships can be written out, and what is written is an experiment.
#[test]
fn every_example_of_a_published_device_can_be_expanded() {
    let mut count = 0;
    for folder in fs::read_dir(examples()).unwrap().map(|entry| entry.unwrap().path()) {
        let copy = copied(&folder);
        let files = fs::read_dir(copy.path()).unwrap().map(|entry| entry.unwrap().path());
        let files: Vec<PathBuf> =
            files.filter(|file| file.extension().is_some_and(|ending| ending == "toml")).collect();
        for file in files {
            let text = fs::read_to_string(&file).unwrap();
            let is_published =
                ["shared_scanner", "threshold_scanner", "accelerometer", "piston_mirror", "micro_stage"]
                    .iter()
                    .any(|device| text.contains(&format!("[device.{device}")));
            if !is_published {
                continue;
            }
            let name = file.file_name().unwrap().to_str().unwrap();
            let expanded = format!("expanded_{name}");
            done(&["expand", name, "--write", &expanded], copy.path());
            if text.contains("\n[simulate]\n") {
                done(&["simulate", &expanded, "--out", &format!("simulated_{name}")], copy.path());
            }
            count += 1;
        }
    }
    assert!(count >= 20, "{count}");
}

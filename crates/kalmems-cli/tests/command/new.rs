//! `kalmems new`: the way from a recording to an answer that the book shows, and what is refused.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

fn run(arguments: &[&str], folder: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_kalmems")).current_dir(folder).args(arguments).output().unwrap()
}

fn recording() -> String {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().unwrap();
    root.join("examples/shared_scanner/recording.csv").display().to_string()
}

/// The commands of the book's first chapter, and what it says of them.
#[test]
fn a_recording_leads_to_an_answer_that_passes() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let made =
        run(&["new", &recording(), "--device", "shared_scanner", "--write", "my_scanner.toml"], folder);
    let said = String::from_utf8(made.stderr).unwrap();
    assert!(made.status.success(), "{said}");
    for sentence in [
        "`cap_V`: a swing of a steady size, its strongest line 461.91 mV at 31.35 kHz.",
        "`drive` is the column `drive_V`, by its name",
        "estimate it with: kalmems estimate my_scanner.toml",
    ] {
        assert!(said.contains(sentence), "{said}");
    }
    // What a laboratory believes of its own device.
    let path = folder.join("my_scanner.toml");
    let text = std::fs::read_to_string(&path).unwrap();
    assert!(
        text.contains("stiffness = \"1.10e-4 N m\"") && text.contains("noise_variance = \"from_recording\"")
    );
    std::fs::write(&path, text.replace("stiffness = \"1.10e-4 N m\"", "stiffness = \"1.1033e-4 N m\""))
        .unwrap();

    let first = run(&["estimate", "my_scanner.toml", "--out", "first", "--json"], folder);
    let metrics: serde_json::Value = serde_json::from_slice(&first.stdout).unwrap();
    let noise = &metrics["noise_from_recording"][0];
    assert_eq!(noise["key"], "device.shared_scanner.readout.noise_variance");
    assert_eq!(noise["filter"], "EKF, stiffness as a state");
    let found: f64 = noise["written"].as_str().unwrap().strip_suffix(" V^2").unwrap().parse().unwrap();
    assert!((found / 1.92e-4 - 1.0).abs() < 0.03, "{noise}");
    // What was used stands in the result.
    let used = std::fs::read_to_string(folder.join("first/run.toml")).unwrap();
    assert!(!used.contains("from_recording"), "{used}");

    let diagnosed = run(&["diagnose", "my_scanner.toml", "--write", "mended.toml"], folder);
    let said = String::from_utf8(diagnosed.stdout).unwrap();
    assert!(diagnosed.status.success() && said.contains("resonator.stiffness = \"1.100"), "{said}");
    for (file, code) in [("my_scanner.toml", Some(3)), ("mended.toml", Some(0))] {
        let judged = run(&["estimate", file, "--strict", "--out", &format!("out_{file}")], folder);
        assert_eq!(judged.status.code(), code, "{file}: {}", String::from_utf8_lossy(&judged.stdout));
    }
}

#[test]
fn all_devices_are_listed_and_a_template_is_simulated() {
    let folder = tempfile::tempdir().unwrap();
    let listed = String::from_utf8(run(&["new", "--list"], folder.path()).stdout).unwrap();
    for device in
        ["shared_scanner", "threshold_scanner", "micro_stage", "accelerometer", "piston_mirror", "equations"]
    {
        assert!(listed.lines().any(|line| line.starts_with(&format!("{device}: "))), "{listed}");
    }
    let printed = run(&["new", "--device", "threshold_scanner"], folder.path());
    let text = String::from_utf8(printed.stdout).unwrap();
    assert!(text.starts_with("name = \"my_threshold_scanner\""), "{text}");
    std::fs::write(folder.path().join("planned.toml"), text).unwrap();
    let simulated = run(&["simulate", "planned.toml", "--out", "planned"], folder.path());
    assert!(simulated.status.success(), "{}", String::from_utf8_lossy(&simulated.stderr));
}

#[test]
fn nothing_is_replaced_and_what_is_missing_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::write(folder.join("mine.toml"), "mine").unwrap();
    std::fs::write(folder.join("scope.csv"), "time_s,CH1_V,CH2_V\n0,1,2\n1e-6,2,1\n2e-6,1,2\n").unwrap();
    let recording = recording();
    for (arguments, why, code) in [
        (vec!["new", "--device", "piston_mirror", "--write", "mine.toml"], "exists already", 1),
        (vec!["new", "--device", "mirror"], "expected one of `shared_scanner`", 1),
        (
            vec!["new", "scope.csv", "--device", "shared_scanner"],
            "say which, such as `--channel drive=CH1_V`",
            1,
        ),
        (
            vec!["new", &recording, "--device", "shared_scanner", "--further", "rest=a.csv"],
            "found the role `rest`",
            1,
        ),
        (vec!["new", &recording], "--device", 2),
    ] {
        let output = run(&arguments, folder);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(code) && said.contains(why), "{arguments:?}: {said}");
    }
    assert_eq!(std::fs::read_to_string(folder.join("mine.toml")).unwrap(), "mine");
}

/// `script` of util-linux runs a command on a terminal of its own.
#[test]
fn a_column_that_its_name_does_not_tell_is_asked_for_on_a_terminal() {
    let folder = tempfile::tempdir().unwrap();
    let row = |k: u32| format!("{:.6},{},{}\n", f64::from(k) * 1e-6, 90 + k % 32, 0.1 * f64::from(k % 16));
    let rows: String = (0..3000).map(row).collect();
    std::fs::write(folder.path().join("scope.csv"), format!("time_s,CH1_V,CH2_V\n{rows}")).unwrap();
    let command = format!(
        "{} new scope.csv --device shared_scanner --write new.toml",
        env!("CARGO_BIN_EXE_kalmems").replace(' ', "\\ ")
    );
    let script = Command::new("script")
        .current_dir(folder.path())
        .args(["-qec", &command, "/dev/null"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn();
    let Ok(mut script) = script else {
        println!("SKIPPED: there is no `script`");
        return;
    };
    script.stdin.take().unwrap().write_all(b"1\n").unwrap();
    let output = script.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(
        output.status.success()
            && said.contains("Which column is `drive`, the voltage that drives the device?"),
        "{said}"
    );
    let text = std::fs::read_to_string(folder.path().join("new.toml")).unwrap();
    assert!(text.contains("channels = { drive = \"CH1_V\", signal = \"CH2_V\" }"), "{text}");
}

/// What a page with a form needs to ask.
#[test]
fn open_questions_are_json_for_a_program_that_asks_and_an_answer_closes_one() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::write(folder.join("scope.csv"), "time_s,CH1_V,CH2_V\n0,1,2\n1e-6,2,1\n2e-6,1,2\n").unwrap();
    let asked = |channels: &[&str]| {
        let mut arguments = vec!["new", "scope.csv", "--device", "shared_scanner", "--json"];
        for channel in channels {
            arguments.extend(["--channel", channel]);
        }
        let output = run(&arguments, folder);
        let told: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        (output.status.code(), told)
    };
    let (code, told) = asked(&[]);
    assert_eq!(code, Some(1));
    assert_eq!(told["questions"][0]["meaning"], "drive");
    assert_eq!(told["questions"][0]["candidates"], serde_json::json!(["CH1_V", "CH2_V"]));
    let (code, told) = asked(&["drive=CH2_V"]);
    assert_eq!((code, told["questions"].is_null()), (Some(0), true), "{told}");
}

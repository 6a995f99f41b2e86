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
    // One value is another, and the description is said to be that of the file before; comments and all else stay.
    let differing: Vec<&str> =
        before.lines().zip(mended.lines()).filter(|(a, b)| a != b).map(|(_, b)| b).collect();
    assert_eq!((differing.len(), mended.lines().count()), (2, before.lines().count()));
    let description = mended.parse::<toml::Table>().unwrap()["description"].as_str().unwrap().to_owned();
    let (corrected, earlier) = description.split_once(". Description of the file before that: ").unwrap();
    assert!(
        corrected
            .starts_with("Corrected by `kalmems diagnose`: `device.shared_scanner.resonator.stiffness = ")
    );
    assert!(before.contains(&format!("description = \"{earlier}\"")), "{description}");

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

/// A free decay whose noise is 25 times what is stated, and called `n`: it is a noise by where it enters. With no range to find it in, the end of the
/// search would be its value.
fn decay(noise: f64) -> TempDir {
    use std::fmt::Write as _;
    let folder = tempfile::tempdir().unwrap();
    let mut state = 7_u64;
    let mut uniform = move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    let mut text = "time_s,cap_V\n".to_owned();
    for k in 0..4000_u32 {
        let time = f64::from(k) * 1e-3;
        let normal = (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
        // Initial rate −0.5 V/s, damping 2 1/s.
        let motion = 0.5 * (-time).exp() * (194.778 * time).cos();
        writeln!(text, "{time:.3},{:.9}", motion + noise * normal).unwrap();
    }
    std::fs::write(folder.path().join("decay.csv"), text).unwrap();
    let experiment = "name = \"decay\"\n[device.equations]\nstates = { x = \"V\", v = \"V/s\" }\n\
        derivative = { x = \"v\", v = \"-w^2*x - g*v\" }\nmeasure = { signal = \"x in V\" }\nnoise = { signal = \"n\", v = \"q\" }\n\
        [device.equations.parameters]\nw = \"194.778 rad/s\"\ng = \"2.0 1/s\"\nn = \"1e-6 V^2\"\nq = \"1e-6 V^2/s^3\"\n\
        [[recording]]\nrole = \"test\"\nfile = \"decay.csv\"\nclock = { column = \"time_s\" }\nchannels = { signal = \"cap_V\" }\n\
        [estimate]\nskip = \"100 ms\"\n[[estimate.filter]]\nname = \"EKF\"\nmethod = \"ekf\"\n\
        start = { x = \"0.5 V\", v = \"-0.5 V/s\" }\nstart_sd = { x = \"0.1 V\", v = \"20 V/s\" }\n";
    std::fs::write(folder.path().join("decay.toml"), experiment).unwrap();
    folder
}

#[test]
fn a_noise_is_found_whatever_its_name_and_no_end_of_a_search_is_a_value() {
    let folder = decay(5e-3);
    let output = run(&["diagnose", "decay.toml", "--json"], folder.path());
    let found: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(found["finding"], "explained", "{found}");
    let written = found["causes"][0]["edits"][0]["to"].as_str().unwrap();
    let noise: f64 = written.trim_matches('"').split(' ').next().unwrap().parse().unwrap();
    // (5 mV)²; known to √(2/3900).
    assert!((noise / 2.5e-5 - 1.0).abs() < 0.1, "{written}");
    // A noise a million times as large is beyond all that is tried.
    let folder = decay(10.0);
    let output = run(&["diagnose", "decay.toml", "--json"], folder.path());
    let found: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    for cause in ["causes", "closest"].iter().flat_map(|list| found[list].as_array().unwrap()) {
        let is_noise = cause["name"] == "parameters.n";
        assert!(!is_noise || cause["edits"].as_array().unwrap().is_empty(), "{cause}");
    }
}

/// A frequency that is 0.06 % off, with a noise from the recording: the noise is found again with the frequency that was found, and that is held
/// against the frequency of the file and not against itself.
#[test]
fn what_is_identified_with_a_noise_from_the_recording_is_held_against_the_numbers_of_the_file() {
    let folder = decay(5e-3);
    let path = folder.path().join("decay.toml");
    let text = std::fs::read_to_string(&path).unwrap();
    let text = text
        .replace("signal = \"n\", v", "signal = \"from_recording\", v")
        .replace("194.778", "194.895")
        .replace("n = \"1e-6 V^2\"\n", "");
    std::fs::write(&path, text + "[identify]\nparameters = [\"w\"]\n").unwrap();
    let output = run(&["identify", "decay.toml", "--json", "--out", "found"], folder.path());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let found: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let frequency = found["parameters"][0]["value"].as_f64().unwrap();
    assert!((frequency / 194.778 - 1.0).abs() < 1e-4, "{found}");
    let notes = found["notes"].to_string();
    let (_, rose) = notes.split_once("rose by ").unwrap();
    let rose: f64 = rose.split(' ').next().unwrap().parse().unwrap();
    assert!(rose > 10.0, "{notes}");
}

/// A scanner whose comb is 0.2 % and whose damping is 2 % off: several pairs explain the recording, with other angles each.
#[test]
#[ignore = "a minute; cargo test -p kalmems-cli --test command -- --ignored slow_"]
fn slow_an_ambiguous_set_of_causes_is_written_only_where_one_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let told = |width: &str, damping: &str, more: &str| {
        format!(
            "name = \"start\"\n[device.shared_scanner.resonator]\ninertia = \"1.15e-14 kg m^2\"\nstiffness = \"1.10e-4 N m\"\ndamping = \"{damping}\"\n\
             [device.shared_scanner.comb]\nnominal_capacitance = \"5.71 pF\"\nangular_width = \"{width}\"\nbias_capacitance = \"9.79 pF\"\n\
             [device.shared_scanner.readout]\ngain = \"-0.3574 V/pF\"\noffset = \"6.3945 V\"\nnoise_variance = \"1.92e-4 V^2\"\n\
             [device.shared_scanner.carrier]\namplitude = \"6 V\"\nfrequency = \"500 kHz\"\nincluded_in_drive = false\n{more}\n\
             [estimate]\nskip = \"45 ms\"\nfirst_peak = \"positive\"\nprocess_noise = {{ angular_acceleration = \"1e4 rad^2/s^3\" }}\n\
             [[estimate.filter]]\nname = \"EKF\"\nmethod = \"ekf\"\nstart = {{ angle = \"1e-4 rad\", rate = \"0 rad/s\" }}\n\
             start_sd = {{ angle = \"1e-3 rad\", rate = \"100 rad/s\" }}\n"
        )
    };
    let simulate = "[simulate]\nduration = \"60 ms\"\nsampling_rate = \"1 MHz\"\nintegration_rate = \"10 MHz\"\nseed = 5008\n\
                    start = { angle = \"1e-4 rad\" }\ndrive = { sine = { offset = \"90 V\", amplitude = \"90 V\", frequency = \"31.35 kHz\" } }\n";
    std::fs::write(folder.path().join("truth.toml"), told("0.2 rad", "5.95e-12 N m s", simulate)).unwrap();
    let made = run(&["simulate", "truth.toml", "--out", "made"], folder.path());
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    let recording = "[[recording]]\nrole = \"test\"\nfile = \"made/recording.csv\"\nclock = { column = \"time_s\" }\n\
                     channels = { drive = \"drive_V\", signal = \"cap_V\" }\n";
    std::fs::write(folder.path().join("wrong.toml"), told("0.2004 rad", "6.069e-12 N m s", recording))
        .unwrap();
    let refused = run(&["diagnose", "wrong.toml", "--write", "mended.toml"], folder.path());
    let why = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(refused.status.code() == Some(1) && why.contains("such as `--cause 1`"), "{why}");
    assert!(!folder.path().join("mended.toml").exists());
    let named = run(&["diagnose", "wrong.toml", "--write", "mended.toml", "--cause", "2"], folder.path());
    assert!(named.status.success() && folder.path().join("mended.toml").exists());
}

//! `kalmems spectrum`: from the simulation of a mirror to lines, and recorded interferograms.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn run(arguments: &[&str]) -> Output {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..");
    Command::new(env!("CARGO_BIN_EXE_kalmems")).current_dir(root).args(arguments).output().unwrap()
}

fn done(arguments: &[&str]) -> Vec<u8> {
    let output = run(arguments);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    output.stdout
}

fn json(arguments: &[&str]) -> serde_json::Value {
    serde_json::from_slice(&done(arguments)).unwrap()
}

/// Simulate, estimate, spectrum along the estimate, as the example's README has it: two lines 10 per cm apart, 60 scans over
/// one second, the amplitude drifting by 20 % a minute. Beside it along the motion as it began, which is what is known
/// without a sensor.
#[test]
fn two_lines_are_kept_apart_along_the_estimate_and_lost_without() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    done(&["simulate", "examples/piston_mirror/two_lines.toml", "--out", &path("simulated")]);
    done(&["estimate", &path("simulated/experiment.toml"), "--out", &path("estimated")]);
    let mut nominal = "time_s,position_m\n".to_owned();
    for k in 0..32_000 {
        let t = f64::from(k) / 20e3;
        let position = 1e-3 + 0.5e-3 * (std::f64::consts::TAU * 500.0 * t + 0.7).cos();
        writeln!(nominal, "{t},{position}").unwrap();
    }
    std::fs::write(path("nominal.csv"), nominal).unwrap();
    let text = std::fs::read_to_string("../../examples/piston_mirror/two_lines_spectrum.toml").unwrap();
    let spectrum = |trajectory: &str, out: &str| {
        let text = text
            .replace("../../out/simulated/two-lines/", "simulated/")
            .replace("../../out/two-lines-simulated/trajectory_five.csv", trajectory);
        let file = path(&format!("{out}.toml"));
        std::fs::write(&file, text).unwrap();
        json(&["spectrum", &file, "--out", &path(out), "--json"])
    };
    let along = spectrum("estimated/trajectory_five.csv", "along");
    let without = spectrum("nominal.csv", "without");
    let distortion = |found: &serde_json::Value| found["reference"]["rms_over_peak"].as_f64().unwrap();
    println!(
        "distortion {:.2e} along the estimate, {:.2e} without",
        distortion(&along),
        distortion(&without)
    );
    assert_eq!(along["scans"].as_u64(), Some(60));
    assert!(distortion(&along) <= 2e-3);
    for line in 0..2 {
        let shift = along["lines"][line]["shift_per_cm"].as_f64().unwrap();
        println!("line {line}: shift {shift:.1e} per cm");
        assert!(shift.abs() <= 0.01, "{shift}");
        let answer = along["answer"][line].as_str().unwrap();
        assert!(answer.starts_with("line ") && answer.contains('±') && answer.contains(" 1/cm"), "{answer}");
    }
    assert!(distortion(&without) > 0.1);

    // The interferogram that was written, in the place of the light: the same bytes.
    let recorded = text.split("[light]").next().unwrap().to_owned()
        + "[interferogram]\nfile = \"along/interferogram.csv\"\ncolumns = [\"detector_1\"]\n\
           clock = { column = \"time_s\" }\n[path.trajectory]"
        + text.split("[path.trajectory]").nth(1).unwrap();
    let recorded = recorded
        .replace("../../out/simulated/two-lines/", "simulated/")
        .replace("../../out/two-lines-simulated/trajectory_five.csv", "estimated/trajectory_five.csv");
    std::fs::write(path("recorded.toml"), recorded).unwrap();
    let recorded = json(&["spectrum", &path("recorded.toml"), "--out", &path("recorded"), "--json"]);
    assert_eq!(recorded["lines"], along["lines"]);
    for file in [
        "spectrum.csv",
        "scans.csv",
        "spectrum.jdx",
        "figures/spectrum.svg",
        "figures/interferogram.svg",
        "figures/coadding.svg",
    ] {
        let [a, b] =
            ["along", "recorded"].map(|out| std::fs::read(Path::new(&path(out)).join(file)).unwrap());
        assert!(a == b && !a.is_empty(), "{file}");
    }
    let drawn = std::fs::read_to_string(path("along/figures/spectrum.svg")).unwrap();
    for part in ["±2 standard uncertainties", "phase", "minus reference"] {
        assert!(drawn.contains(part), "{part}");
    }
    let refused = run(&["spectrum", &path("recorded.toml"), "--out", &path("along")]);
    assert_eq!(refused.status.code(), Some(1));
    let message = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(message.contains("along/interferogram.csv is read by this run"), "{message}");
    assert!(json(&["schema", "spectrum"])["properties"]["transform"].is_object());
}

/// Both records of the reference data against the instrument's own spectra.
#[test]
#[ignore = "needs the reference data"]
fn recorded_interferograms_give_the_instruments_spectra() {
    let data = std::env::var("KALMEMS_REFERENCE_DATA").expect("KALMEMS_REFERENCE_DATA names the folder");
    let data = PathBuf::from(data).join("real/ftir_opus_doublesided");
    let expected = std::fs::read_to_string(data.join("expected.json")).unwrap();
    let expected: serde_json::Value = serde_json::from_str(&expected).unwrap();
    let folder = tempfile::tempdir().unwrap();
    for (columns, file, key) in [
        (["igsm_forward_au", "igsm_backward_au"], "single_channel.csv", "igsm->sm half-width 0.9/res"),
        (
            ["igrf_forward_au", "igrf_backward_au"],
            "reference_single_channel.csv",
            "igrf->rf half-width 0.9/res",
        ),
    ] {
        let column = if file.starts_with("ref") { "opus_rf_au" } else { "opus_sm_au" };
        let text = format!(
            r#"
name = "opus"
[interferogram]
file = "{data}/interferograms.csv"
columns = ["{}", "{}"]
[path]
laser = {{ wavenumber = "15798.190743 1/cm", samples_per_fringe = 2 }}
[transform]
apodisation = "blackman_harris_3"
phase = "power"
largest_path_difference = "2.25 mm"
zero_filling = 1
[reference.spectrum]
file = "{data}/{file}"
wavenumber = "wavenumber_per_m"
column = "{column}"
"#,
            columns[0],
            columns[1],
            data = data.display()
        );
        let path = folder.path().join("opus.toml");
        std::fs::write(&path, text).unwrap();
        let out = folder.path().join(column);
        let found = json(&["spectrum", path.to_str().unwrap(), "--out", out.to_str().unwrap(), "--json"]);
        let rms = found["reference"]["rms_over_peak"].as_f64().unwrap();
        let independent = expected["independent_check_in_numpy"][key]["rms_over_peak"].as_f64().unwrap();
        println!("{file}: {rms:.3e} of the peak, independently {independent:.3e}");
        assert!(rms <= 1.2 * independent, "{rms} {independent}");
    }
}

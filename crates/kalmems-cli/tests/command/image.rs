//! `kalmems image` on the example that the program ships with.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

#[allow(dead_code)] // its own `main`
#[path = "../../examples/scan_object.rs"]
pub mod scan_object;

fn run(arguments: &[&str]) -> Output {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..");
    Command::new(env!("CARGO_BIN_EXE_kalmems")).current_dir(root).args(arguments).output().unwrap()
}

const EXAMPLE: &str = "examples/shared_scanner/image.toml";
/// How far x and y of the example are ahead of their trajectories, in degrees: `--example lissajous` made it so.
const TRUE_DEG: [f64; 2] = [2.73, -1.6];

fn metrics(folder: &Path) -> serde_json::Value {
    serde_json::from_slice(&std::fs::read(folder.join("metrics.json")).unwrap()).unwrap()
}

#[test]
fn the_search_finds_the_phases_and_the_image_is_written_whole() {
    let folder = tempfile::tempdir().unwrap();
    let out = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    for name in ["a", "b"] {
        let output = run(&["image", EXAMPLE, "--out", &out(name)]);
        assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    }
    for file in [
        "image.png",
        "before.png",
        "forward.png",
        "backward.png",
        "counts.png",
        "counts_preview.png",
        "picture.png",
        "figures/sharpness.svg",
        "figures/position_uncertainty.svg",
        "metrics.json",
    ] {
        let [a, b] = ["a", "b"].map(|name| std::fs::read(folder.path().join(name).join(file)).unwrap());
        assert!(a == b && !a.is_empty(), "{file}");
    }
    let svg = std::fs::read_to_string(folder.path().join("a/figures/sharpness.svg")).unwrap();
    for part in ["phase of x", "phase of y", "before", "found"] {
        assert!(svg.contains(part), "{part}");
    }
    let page = std::fs::read_to_string(folder.path().join("a/report.html")).unwrap();
    assert!(page.contains("at the phases that the search began with") && page.contains("counts_preview.png"));
    let found = metrics(&folder.path().join("a"));
    for (axis, truth) in TRUE_DEG.into_iter().enumerate() {
        let number = |key: &str| found["axes"][axis][key].as_f64().unwrap();
        let error = number("phase_deg") - truth;
        // A small image: a tenth of what moves a sample by a pixel.
        assert!(
            error.abs() < 0.1 * number("one_pixel_deg"),
            "axis {axis}: {error} ± {}",
            number("phase_sd_deg")
        );
    }
    let answer = found["answer"][0].as_str().unwrap();
    assert!(answer.starts_with("100 × 100 pixels, of which "), "{answer}");
    let samples = &found["samples"];
    let parts = ["used", "outside_field", "in_gap", "beyond_trajectory", "without_intensity"];
    let sum: u64 = parts.iter().map(|part| samples[part].as_u64().unwrap()).sum();
    assert_eq!((sum, samples["samples"].as_u64()), (50_000, Some(50_000)));
    let pixels = |key: &str| found[key].as_u64().unwrap();
    assert_eq!(pixels("filled_pixels") + pixels("empty_pixels"), 100 * 100);
}

/// By hand, one axis after the other; what it is against an image of the true phases.
#[test]
fn tuning_by_hand_sharpens_an_image_and_a_reference_measures_by_how_much() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("tuned");
    let out = out.to_str().unwrap();
    let truth = folder.path().join("truth.png");
    let psnr = |x: &str, y: &str, reference: &[&str]| {
        let mut arguments = vec!["image", EXAMPLE, "--out", out, "--json", "--phase-x", x, "--phase-y", y];
        arguments.extend(reference);
        let output = run(&arguments);
        assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
        let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        (json["reference"]["psnr_db"].as_f64(), json["axes"][0]["passes_differ_rms"].as_f64().unwrap())
    };
    psnr("2.73 deg", "-1.6 deg", &[]);
    std::fs::copy(Path::new(out).join("image.png"), &truth).unwrap();
    let reference = ["--reference", truth.to_str().unwrap()];
    let untuned = psnr("0 deg", "0 deg", &reference);
    let nearly = psnr("2.6 deg", "-1.6 deg", &reference);
    let exact = psnr("2.73 deg", "-1.6 deg", &reference);
    // What 16 bits leave of a picture read back: 12·65535² over 1 is 107.1 dB.
    assert!((exact.0.unwrap() - 107.1).abs() < 0.5, "{exact:?}");
    assert!(untuned.0 < nearly.0 && nearly.1 < untuned.1, "{untuned:?} {nearly:?}");
}

#[test]
fn what_is_wrong_is_named_and_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let out = out.to_str().unwrap();
    let text =
        std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(EXAMPLE)).unwrap();
    let file = folder.path().join("image.toml");
    std::fs::write(&file, text).unwrap();
    let lone = file.to_str().unwrap();
    for (arguments, expected) in [
        (vec![EXAMPLE, "--phase-x", "3 mm"], "--phase-x: "),
        (vec![EXAMPLE, "--reference", "README.md"], "expected a grey PNG"),
        (vec![lone], "intensity.file: there is no file"),
        (vec!["nowhere.toml"], "there is no such file"),
    ] {
        let output = run(&[vec!["image", "--out", out], arguments].concat());
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(1), "{message}");
        assert!(message.contains(expected), "{message}");
        assert!(!Path::new(out).exists());
    }
}

/// What the command is for, as the example's README has it: a motion is simulated, estimated, and an object's
/// image put together along the estimate. Beside it the same with filters that are told a stiffness 0.3 %
/// wrong, one with the sensor and one without.
#[test]
fn an_image_along_an_estimate_is_that_along_the_truth() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let done = |arguments: &[&str]| {
        let output = run(arguments);
        assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
        output
    };
    done(&["simulate", "examples/shared_scanner/two_axes.toml", "--out", &path("simulated")]);
    done(&["estimate", &path("simulated/experiment.toml"), "--out", &path("estimated")]);
    let told = std::fs::read_to_string(path("simulated/experiment.toml")).unwrap();
    let model = "[[estimate.filter]]\nname = \"Model\"\nmethod = \"model\"\nstart = \"from_signal\"\n";
    let mut told = told + "\n" + model;
    for (from, to) in [
        ("stiffness = \"1.10e-4 N m\"", "stiffness = \"1.1033e-4 N m\""),
        ("angular_acceleration_x = \"1e4 rad^2/s^3\"", "angular_acceleration_x = \"1e8 rad^2/s^3\""),
    ] {
        assert!(told.contains(from), "{told}");
        told = told.replace(from, to);
    }
    std::fs::write(path("simulated/told.toml"), told).unwrap();
    done(&["estimate", &path("simulated/told.toml"), "--out", &path("told")]);
    scan_object::scan(path("simulated/reference.csv").as_ref(), path("intensity.csv").as_ref()).unwrap();

    let text = std::fs::read_to_string("../../examples/shared_scanner/two_axes_image.toml").unwrap();
    let image = |trajectory: &str, arguments: &[&str]| {
        // The truth and the model alone claim nothing.
        let claims = std::fs::read_to_string(path(trajectory)).unwrap().contains("angle_x_sd_rad");
        let lines = text.lines().filter(|line| claims || !line.starts_with("uncertainty"));
        let text = lines.collect::<Vec<_>>().join("\n");
        let text = text
            .replace("../../out/intensity.csv", "intensity.csv")
            .replace("../../out/shared_scanner_two_axes-simulated/trajectory_ekf.csv", trajectory);
        std::fs::write(path("image.toml"), text).unwrap();
        let (file, out) = (path("image.toml"), path("image"));
        let json = done(&[&["image", &file, "--out", &out, "--force", "--json"], arguments].concat()).stdout;
        serde_json::from_slice::<serde_json::Value>(&json).unwrap()
    };
    let along_truth = image("simulated/reference.csv", &[]);
    assert_eq!(along_truth["samples"]["used"].as_u64(), Some(14_001), "{}", along_truth["samples"]);
    std::fs::copy(path("image/image.png"), path("truth.png")).unwrap();
    let reference = ["--reference", &path("truth.png")];
    let [right, wrong, alone] =
        ["estimated/trajectory_ekf.csv", "told/trajectory_ekf.csv", "told/trajectory_model.csv"]
            .map(|trajectory| image(trajectory, &reference)["reference"]["psnr_db"].as_f64().unwrap());
    let own = image("estimated/trajectory_ekf.csv", &[]);
    // Both axes move at half of their drives' frequencies, 15 675 and 6540 Hz. The motion before the scan, in which the phase of y
    // turns by 40°, is no part of the sine: 6544.8 Hz. During the scan both phases still turn by some degrees; lines through the phases of the
    // true motion, from four cycles at a time by another program, have these slopes.
    let frequency = |axis: usize| own["axes"][axis]["frequency_hz"].as_f64().unwrap();
    println!("frequencies: {} and {} Hz", frequency(0), frequency(1));
    assert!((frequency(0) - 15_675.25).abs() < 0.05 && (frequency(1) - 6_540.47).abs() < 0.05);
    let findings: Vec<&str> =
        own["findings"].as_array().unwrap().iter().filter_map(|text| text.as_str()).collect();
    let unsettled = findings.iter().filter(|text| text.contains("the motion has not settled"));
    assert!(
        unsettled.clone().count() == 1 && unsettled.clone().all(|text| text.starts_with("y: ")),
        "{findings:?}"
    );
    let page = std::fs::read_to_string(path("image/report.html")).unwrap();
    assert!(page.contains("<summary>1 note</summary>") && page.contains(unsettled.clone().next().unwrap()));
    // How far the places of samples are off, in pixels, beside what the image says of them.
    for (place, axis, half_field) in [(0, "angle_x_rad", 0.18), (1, "angle_y_rad", 0.125)] {
        let [found, truth] =
            ["estimated/trajectory_ekf.csv", "simulated/reference.csv"].map(|file| column(&path(file), axis));
        let truth: std::collections::BTreeMap<String, f64> = truth.into_iter().collect();
        let errors: Vec<f64> = (found.iter())
            .filter(|(_, angle)| angle.abs() < half_field)
            .filter_map(|(time, angle)| Some(angle - truth.get(time)?))
            .collect();
        let rms = (errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64).sqrt();
        let (pixels, claimed) =
            (80.0 * rms / (2.0 * half_field), own["axes"][place]["place_sd_px"].as_f64().unwrap());
        println!("{axis}: off by {pixels:.4} pixels, claimed {claimed:.4}, {} samples", errors.len());
        assert!(errors.len() > 5000 && (0.5..2.0).contains(&(pixels / claimed)), "{pixels} {claimed}");
    }
    println!("{right:.1} dB; with a wrong stiffness {wrong:.1} dB, and without the sensor {alone:.1} dB");
    // White noise between 0 and 1 of the intensities' own deviation would be 34 dB.
    assert!(right > 34.0, "{right}");
    assert!(right > wrong && wrong > alone + 6.0, "{right} {wrong} {alone}");
}

/// The values of a column of a CSV file, each with its time as it is written.
fn column(file: &str, name: &str) -> Vec<(String, f64)> {
    let text = std::fs::read_to_string(file).unwrap();
    let mut lines = text.lines();
    let place = lines.next().unwrap().split(',').position(|column| column == name).unwrap();
    let cells = lines.map(|line| line.split(',').collect::<Vec<_>>());
    cells.map(|cells| (cells[0].to_owned(), cells[place].parse().unwrap_or(f64::NAN))).collect()
}

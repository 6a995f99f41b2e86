//! What is exported is the filter of the estimate, or is refused with the reason.

use kalmems::export::{ExportError, ExportRequest, Exported, SourceDigits, SourceLanguage};
use kalmems::rigs::published;
use kalmems::simulate::WhiteNoise;
use std::fmt::Write as _;
use std::fs;
use std::num::NonZeroU32;
use std::path::Path;
use std::process::Command;

/// A lag whose input is held between samples, and a measurement in which the input is itself.
fn lag(interpolation: &str, filter: &str, noise: &str) -> String {
    format!(
        "name = \"lag\"\n[device.equations]\nstates = {{ x = \"V\", b = \"V\" }}\ninputs = {{ drive = \"V\" }}\ninterpolation = \"{interpolation}\"\n\
         derivative = {{ x = \"(drive - x)/tau\", b = \"-b/tau_b\" }}\nmeasure = {{ i = \"drive - x + b in V\" }}\n\
         noise = {{ i = \"{noise}\", x = \"1e-6[V^2/s]\" }}\nparameters = {{ tau = \"1 ms\", tau_b = \"1 s\" }}\n\
         [[recording]]\nrole = \"test\"\nfile = \"rec.csv\"\nclock = {{ column = \"time_s\" }}\n\
         channels = {{ drive = \"drive_V\", i = \"i_V\" }}\n[estimate]\nskip = \"1 ms\"\n\
         [[estimate.filter]]\nname = \"EKF\"\nmethod = \"ekf\"\nstart = {{}}\nstart_sd = {{ x = \"0.1 V\", b = \"1 mV\" }}\n{filter}\n"
    )
}

/// A thousand samples of it, the drive as `interpolation` has it.
fn record(folder: &Path, interpolation: &str) {
    let (interval, tau) = (1e-5_f64, 1e-3);
    let mut noise = WhiteNoise::new(3, 1);
    let drive = |k: u32| (std::f64::consts::TAU * 1200.0 * interval * f64::from(k)).sin();
    let mut x = 0.0;
    let mut text = "time_s,drive_V,i_V\n".to_owned();
    for k in 0..1000_u32 {
        if let Some(before) = k.checked_sub(1) {
            let held = match interpolation {
                "hold" => drive(before),
                _ => 0.5 * (drive(before) + drive(k)),
            };
            x = held + (x - held) * (-interval / tau).exp();
        }
        let seen = drive(k) - x + 1e-3 * noise.sample();
        writeln!(text, "{:.5},{:e},{seen:e}", interval * f64::from(k), drive(k)).unwrap();
    }
    fs::write(folder.join("rec.csv"), text).unwrap();
}

fn exported(folder: &Path, text: &str, digits: SourceDigits) -> Result<Exported, ExportError> {
    let experiment = published().parse(text, &folder.join("lag.toml")).unwrap();
    let request = ExportRequest {
        target: SourceLanguage::C,
        filter: "EKF".to_owned(),
        interval_s: None,
        update_every: NonZeroU32::MIN,
        samples: 300,
        adjustable: Vec::new(),
        digits,
        verify: false,
        notes: Vec::new(),
    };
    published().rig(&experiment).unwrap().export(&experiment, &request)
}

/// The source's own test of itself by the states of the estimate, where there is a compiler.
fn runs(folder: &Path, exported: &Exported) {
    if Command::new("cc").arg("--version").output().is_err() {
        println!("SKIPPED: there is no C compiler");
        return;
    }
    for (name, content) in &exported.files {
        fs::write(folder.join(name), content).unwrap();
    }
    let main = "#include \"lag_self_test.h\"\nint main(void)\n{\n    float worst;\n    return lag_self_test(&worst) ? 0 : 1;\n}\n";
    fs::write(folder.join("try.c"), main).unwrap();
    let compiled = Command::new("cc")
        .args([
            "-std=c99",
            "-Wall",
            "-Wextra",
            "-Werror",
            "-O1",
            "-o",
            "try",
            "try.c",
            "lag.c",
            "lag_self_test.c",
        ])
        .current_dir(folder)
        .output()
        .unwrap();
    assert!(compiled.status.success(), "{}", String::from_utf8_lossy(&compiled.stderr));
    assert!(Command::new(folder.join("try")).status().unwrap().success());
    let program = Command::new("cc")
        .args(["-std=c99", "-Wall", "-Wextra", "-Werror", "-c", "main.c"])
        .current_dir(folder)
        .output()
        .unwrap();
    assert!(program.status.success(), "{}", String::from_utf8_lossy(&program.stderr));
}

#[test]
fn a_measurement_sees_the_input_of_its_sample_where_predictions_hold_another() {
    for interpolation in ["hold", "mean"] {
        let folder = tempfile::tempdir().unwrap();
        record(folder.path(), interpolation);
        let text = lag(interpolation, "gate = false", "1e-6[V^2]");
        let exported = exported(folder.path(), &text, SourceDigits::AsNeeded).unwrap();
        let header = &exported.files.iter().find(|(name, _)| name == "lag.h").unwrap().1;
        let held = if interpolation == "hold" { "start" } else { "middle" };
        assert!(
            header.contains(&format!(
                "lag_step(lag_t *filter, float u_drive_{held}, float u_drive_end, float y_i)"
            )),
            "{header}"
        );
        runs(folder.path(), &exported);
    }
}

/// Two inputs with an interpolation each, both in the measurement, and the slope of one of them as well.
#[test]
fn a_source_takes_several_inputs_and_a_slope_as_the_estimate_does() {
    let all = ["quintic", "cubic", "linear", "sine", "band_limited", "hold", "mean"];
    for (interpolation, of_bias) in all.iter().zip(all.iter().rev()) {
        let folder = tempfile::tempdir().unwrap();
        record(folder.path(), "mean");
        let place = folder.path().join("rec.csv");
        let recorded = fs::read_to_string(&place).unwrap();
        let rows = recorded.lines().enumerate().map(|(k, line)| match k {
            0 => format!("{line},bias_V\n"),
            _ => format!("{line},{:e}\n", 0.3 * (std::f64::consts::TAU * 0.0037 * k as f64).cos()),
        });
        fs::write(&place, rows.collect::<String>()).unwrap();
        let text = lag("hold", "gate = false", "1e-6[V^2]")
            .replace("inputs = { drive = \"V\" }", "inputs = { drive = \"V\", bias = \"V\" }")
            .replace(
                "interpolation = \"hold\"",
                &format!("interpolation = {{ drive = \"{interpolation}\", bias = \"{of_bias}\" }}"),
            )
            .replace("(drive - x)/tau", "(drive + 0.5*bias - x)/tau")
            .replace("drive - x + b in V", "drive - x + b + 0.2*bias + 1[us]*ddt(drive) in V")
            .replace("drive = \"drive_V\",", "drive = \"drive_V\", bias = \"bias_V\",");
        let exported = exported(folder.path(), &text, SourceDigits::AsNeeded).unwrap();
        let step = exported.columns.join(", ");
        for name in ["u_drive", "u_bias", "y_i"] {
            assert!(step.contains(name), "{step}");
        }
        println!("{interpolation} and {of_bias}: {step}");
        runs(folder.path(), &exported);
    }
}

#[test]
fn a_filter_of_one_state_tests_itself_against_the_library() {
    let folder = tempfile::tempdir().unwrap();
    record(folder.path(), "hold");
    let second = [", b = \"V\"", ", b = \"-b/tau_b\"", " + b", ", tau_b = \"1 s\"", ", b = \"1 mV\""];
    let text =
        second.iter().fold(lag("hold", "gate = false", "1e-6[V^2]"), |text, part| text.replace(part, ""));
    runs(folder.path(), &exported(folder.path(), &text, SourceDigits::AsNeeded).unwrap());
}

#[test]
fn a_key_of_the_filter_that_the_source_lacks_is_refused_with_its_reason() {
    let folder = tempfile::tempdir().unwrap();
    record(folder.path(), "hold");
    for (key, reason) in [
        ("gate = false\nsmooth_lag = \"1 ms\"", "has no smoother; leave `smooth_lag` out"),
        ("update = \"huber\"", "has no update `huber`"),
    ] {
        let text = lag("hold", key, "1e-6[V^2]");
        let said = exported(folder.path(), &text, SourceDigits::AsNeeded).unwrap_err().to_string();
        assert!(said.contains(reason), "{key}: {said}");
    }
}

/// A variance that a filter takes a sample for in place of the noise: the source has it, as its rehearsal shows.
#[test]
fn the_variance_that_a_filter_takes_samples_for_is_in_the_source() {
    let folder = tempfile::tempdir().unwrap();
    record(folder.path(), "hold");
    let text = lag("hold", "gate = false\nsignal_variance = \"1e-4 V^2\"", "1e-6[V^2]");
    let exported = exported(folder.path(), &text, SourceDigits::AsNeeded).unwrap();
    runs(folder.path(), &exported);
}

/// A claim that numbers of 32 and 64 bits with inputs of 32 bits do not resolve: nothing is exported, and the state is named.
#[test]
fn a_source_that_its_rehearsal_finds_apart_from_the_estimate_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    record(folder.path(), "hold");
    let text = lag("hold", "gate = false", "1e-16[V^2]").replace("1e-6[V^2/s]", "1e-17[V^2/s]");
    match exported(folder.path(), &text, SourceDigits::AsNeeded) {
        Err(ExportError::Rehearsal { filter, share, .. }) => {
            assert!(filter == "EKF" && share > 0.02, "{share}");
        }
        other => panic!("{:?}", other.map(|exported| exported.filter)),
    }
}

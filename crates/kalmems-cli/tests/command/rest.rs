//! `kalmems calibrate gyro` of records that are called ones at rest and have gaps, odd times or motion.

use std::fmt::Write;
use std::path::PathBuf;
use std::process::Command;

/// Standard deviation 1 about 0: the sum of twelve uniform numbers.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        let mut uniform = || {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 11) as f64 / (1_u64 << 53) as f64
        };
        (0..12).map(|_| uniform()).sum::<f64>() - 6.0
    }
}

/// What is found in a record at rest, and what is told of it. A row is a time and a rate, or nothing for a rate.
fn rest(rows: impl Iterator<Item = (f64, Option<f64>)>, clock: &str) -> (serde_json::Value, String) {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let mut text = "time_s,w_rad_per_s\n".to_owned();
    for (time, rate) in rows {
        let rate = rate.map_or_else(|| "nan".to_owned(), |rate| format!("{rate:.8}"));
        writeln!(text, "{time:.6},{rate}").unwrap();
    }
    std::fs::write(path("rest.csv"), text).unwrap();
    let settings = format!(
        "name = \"rest\"\n[gyroscope]\nrate = \"100 Hz\"\nclock_tolerance = \"1 %\"\nchannels = {{ z = \"w_rad_per_s\" }}\n[rest]\n\
         file = \"rest.csv\"\n{clock}"
    );
    std::fs::write(path("rest.toml"), settings).unwrap();
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..");
    let arguments = ["calibrate", "gyro", &path("rest.toml"), "--out", &path("out"), "--json"];
    let output =
        Command::new(env!("CARGO_BIN_EXE_kalmems")).current_dir(root).args(arguments).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let found: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    (found["rest"][0].clone(), found["findings"].to_string())
}

const ROWS: usize = 20_000;
const COLUMN: &str = "clock = { column = \"time_s\" }\n";

/// White noise of 1 mrad/s about 0.02 rad/s.
fn white(seed: u64) -> Vec<f64> {
    let mut noise = Noise(seed);
    (0..ROWS).map(|_| 0.02 + 1e-3 * noise.next()).collect()
}

fn close(found: &serde_json::Value, key: &str, expected: f64, within: f64) {
    let value = found[key].as_f64().unwrap_or_else(|| panic!("{key}: {found}"));
    assert!((value / expected - 1.0).abs() < within, "{key}: {value}, expected {expected}");
}

#[test]
fn a_number_that_is_missing_divides_the_record_and_does_not_end_it() {
    let rows = white(1).into_iter().enumerate();
    let rows = rows.map(|(k, rate)| (k as f64 * 0.01, (k != 1000).then_some(rate)));
    let (found, told) = rest(rows, COLUMN);
    assert_eq!((&found["samples"], &found["gaps"]), (&(ROWS - 1).into(), &1.into()), "{found}");
    close(&found, "duration_s", 199.99, 1e-9);
    // σ·√τ of white noise.
    close(&found, "angle_random_walk", 1e-4, 0.05);
    assert!(told.contains("are missing in one place") && !told.contains("it moves"), "{told}");
    let longest = found["allan"].as_array().unwrap().last().unwrap()[0].as_f64().unwrap();
    assert!((longest - 81.92).abs() < 1e-9, "{longest}");
}

#[test]
fn times_of_a_host_in_bursts_show_the_rate_all_the_same() {
    let arrival = |k: usize| ((k / 5 + 1) * 5) as f64 / 99.3 + 0.0004 * (k % 5) as f64;
    let rows = white(2).into_iter().enumerate().map(|(k, rate)| (arrival(k), Some(rate)));
    let (found, told) = rest(rows, COLUMN);
    close(&found, "duration_s", ROWS as f64 / 99.3, 1e-4);
    close(&found, "angle_random_walk", 1e-3 / 99.3_f64.sqrt(), 0.05);
    assert_eq!(found.get("gaps"), None, "{found}");
    assert!(told.contains("bursts of up to 5 samples"), "{told}");
    assert!(!told.contains("nominal rate"), "{told}");
}

/// Bursts of one to eight samples that are 2 µs apart, of which the middle ones may be late by 100 s.
#[test]
fn missing_samples_are_counted_by_the_rate_and_not_by_the_intervals_within_bursts() {
    let mut sizes = Noise(8);
    let mut arrival = Vec::new();
    while arrival.len() < ROWS {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // 1 to 8
        let size = (4.5 + 2.0 * sizes.next()).clamp(1.0, 8.0) as usize;
        let end = (arrival.len() + size) as f64 / 99.3;
        arrival.extend((0..size).map(|k| end + 2e-6 * k as f64));
    }
    for gap_s in [0.0, 100.0] {
        let time = |k: usize| arrival[k] + if k < 8000 { 0.0 } else { gap_s };
        let rows = white(9).into_iter().enumerate().map(|(k, rate)| (time(k), Some(rate)));
        let (found, told) = rest(rows, COLUMN);
        close(&found, "duration_s", ROWS as f64 / 99.3, 1e-2);
        let counted: Vec<f64> = told
            .split("column `time_s`: ")
            .filter_map(|finding| finding.split_once(" samples are missing")?.0.parse().ok())
            .collect();
        match counted.as_slice() {
            [] => assert!(gap_s < 1.0, "{told}"),
            [count] => assert!(gap_s > 1.0 && (count / (99.3 * gap_s) - 1.0).abs() < 0.02, "{told}"),
            _ => panic!("{told}"),
        }
        assert!(!told.contains("estimate") && !told.contains("recording.gaps"), "{told}");
        assert!(gap_s < 1.0 || told.contains("no difference across the gap"), "{told}");
    }
}

#[test]
fn missing_samples_at_rest_are_reported_for_the_calibration() {
    let rows = white(1).into_iter().enumerate();
    let rows = rows.map(|(k, rate)| (k as f64 * 0.01, (k != 1000).then_some(rate)));
    let (_, told) = rest(rows, COLUMN);
    assert!(told.contains("the calibration leaves the sample out") && !told.contains("estimate"), "{told}");
}

#[test]
fn a_gap_is_not_closed_up() {
    let time = |k: usize| k as f64 * 0.01 + if k < 8000 { 0.0 } else { 100.0 };
    let rows = white(3).into_iter().enumerate().map(|(k, rate)| (time(k), Some(rate)));
    let (found, told) = rest(rows, COLUMN);
    assert_eq!((&found["samples"], &found["gaps"]), (&ROWS.into(), &1.into()), "{found}");
    close(&found, "duration_s", 200.0, 1e-6);
    let longest = found["allan"].as_array().unwrap().last().unwrap()[0].as_f64().unwrap();
    assert!(longest <= 60.0, "{longest}");
    assert!(told.contains("the longest gap is one of 100"), "{told}");
}

#[test]
fn a_rate_off_the_nominal_one_is_reported_and_a_stated_one_is_taken() {
    let rows = || white(4).into_iter().enumerate().map(|(k, rate)| (k as f64 * 0.02, Some(rate)));
    let (found, told) = rest(rows(), COLUMN);
    close(&found, "duration_s", 400.0, 1e-6);
    assert!(told.contains("-50.000 % off the nominal rate of `100 Hz`"), "{told}");
    let (found, told) = rest(rows(), "clock = { rate = \"50 Hz\" }\n");
    close(&found, "duration_s", 400.0, 1e-9);
    assert_eq!(told, "[]");
}

#[test]
fn motion_does_not_pass_as_rest() {
    let mut shaken = white(5);
    for (k, rate) in shaken.iter_mut().enumerate().skip(6000).take(500) {
        *rate += 0.05 * (0.3 * k as f64).sin();
    }
    let timed =
        |values: Vec<f64>| values.into_iter().enumerate().map(|(k, rate)| (k as f64 * 0.01, Some(rate)));
    let (_, told) = rest(timed(shaken), COLUMN);
    assert!(
        told.contains("the record is called one at rest, and between") && told.contains("it moves"),
        "{told}"
    );
    let vibrating: Vec<f64> =
        white(6).iter().enumerate().map(|(k, rate)| rate + 3e-4 * (1.1 * k as f64).sin()).collect();
    let (_, told) = rest(timed(vibrating), COLUMN);
    assert!(told.contains("stands out of its noise"), "{told}");
    let (_, told) = rest(timed(white(7)), COLUMN);
    assert_eq!(told, "[]");
}

/// A record at rest is read in parts: 12 million rows, which as a column take 96 MB, in 100 MB beside the program.
#[cfg(target_os = "linux")]
#[test]
fn a_record_at_rest_of_any_length_takes_bounded_memory() {
    let folder = tempfile::tempdir().unwrap();
    let numbers = (0..12_u64 << 20).map(|k| (k.wrapping_mul(6_364_136_223_846_793_005) >> 40) % 1000);
    let rows: String =
        numbers.fold("w_rad_per_s\n".to_owned(), |rows, number| rows + &number.to_string() + "\n");
    std::fs::write(folder.path().join("rest.csv"), rows).unwrap();
    let settings = "name = \"rest\"\n[gyroscope]\nrate = \"100 Hz\"\nclock_tolerance = \"1 %\"\nchannels = { z = \"w_rad_per_s\" }\n\
                    [rest]\nfile = \"rest.csv\"\nclock = { rate = \"100 Hz\" }\n";
    std::fs::write(folder.path().join("rest.toml"), settings).unwrap();
    // The program itself takes 220 MB of addresses as tests are built.
    let output = Command::new("sh")
        .current_dir(folder.path())
        .args(["-c", "ulimit -v 340000 && exec \"$0\" calibrate gyro rest.toml --out out --json"])
        .arg(env!("CARGO_BIN_EXE_kalmems"))
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let found: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(found["rest"][0]["samples"], 12 << 20);
}

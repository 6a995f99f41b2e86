//! Records that the models do not describe: what is found is named, and no number is certified that does not hold.

use super::simulated::Noise;
use kalmems_applications::ApplicationFile;
use kalmems_applications::calibration::{Calibration, CalibrationError, GyroscopeCalibration, calibrate};
use kalmems_engines::progress::Silent;
use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

fn calibrated(text: &str, folder: &Path) -> Result<Calibration, CalibrationError> {
    calibrate(&GyroscopeCalibration::parse(text, &folder.join("file.toml")).unwrap(), &Silent)
}

/// A gyroscope behind a low pass of 200 Hz, shaken at five frequencies, three records at each.
#[test]
fn a_scale_factor_that_depends_on_the_frequency_is_withheld_and_given_for_each_frequency() {
    const CORNER: f64 = 200.0;
    let folder = tempfile::tempdir().unwrap();
    let mut noise = Noise::new(11);
    let [mut shown, mut reference] = ["record,g_rad_per_s\n".to_owned(), "record,r_rad_per_s\n".to_owned()];
    let frequencies = [20.0, 40.0, 80.0, 120.0, 180.0];
    for record in 0..15 {
        let frequency: f64 = frequencies[record / 3];
        let gain = 1.01 / 1.0_f64.hypot(frequency / CORNER) * (1.0 + 1e-4 * noise.normal());
        let [a, b] = [0, 1].map(|_| TAU * noise.uniform());
        for k in 0..1500 {
            let at = |rate: f64, start: f64| (TAU * frequency * f64::from(k) / rate + start).cos();
            writeln!(shown, "r{record},{:.8}", gain * at(1000.0, a) + 1e-3 * noise.normal()).unwrap();
            writeln!(reference, "r{record},{:.8}", at(2000.0, b) + 1e-4 * noise.normal()).unwrap();
        }
    }
    fs::write(folder.path().join("g.csv"), shown).unwrap();
    fs::write(folder.path().join("r.csv"), reference).unwrap();
    let found = calibrated(
        "name = \"c\"\n[sensor]\nrate = \"1 kHz\"\nclock_tolerance = \"1 %\"\nchannels = { z = \"g_rad_per_s\" }\n\
         [[condition]]\nname = \"room\"\nfile = \"g.csv\"\nsegments = { column = \"record\" }\n\
         [[condition.reference]]\nname = \"table\"\nfile = \"r.csv\"\nsegments = { column = \"record\" }\n\
         clock = { rate = \"2 kHz\" }\nchannels = { z = \"r_rad_per_s\" }\n",
        folder.path(),
    )
    .unwrap();
    let [result] = &found.results[..] else { panic!("one result") };
    assert!(result.withheld.as_ref().is_some_and(|why| why.contains("frequenc")), "{:?}", result.withheld);
    let by_frequency: Vec<f64> = result.by_frequency.iter().map(|one| one.scale_factor.value).collect();
    assert_eq!(by_frequency.len(), frequencies.len(), "{by_frequency:?}");
    for (found, frequency) in by_frequency.iter().zip(frequencies) {
        assert!((found * 1.0_f64.hypot(frequency / CORNER) / 1.01 - 1.0).abs() < 5e-4, "{by_frequency:?}");
    }
}

#[test]
fn a_saturated_record_at_rest_is_refused_by_its_column() {
    let folder = tempfile::tempdir().unwrap();
    let mut noise = Noise::new(12);
    let mut rows = "a_rad_per_s,b_rad_per_s\n".to_owned();
    for _ in 0..4096 {
        let [a, b] = [0, 1].map(|_| 1e-2 * noise.normal());
        writeln!(rows, "{a:.8},{:.8}", b.clamp(-8e-3, 8e-3)).unwrap();
    }
    fs::write(folder.path().join("rest.csv"), rows).unwrap();
    let file = |column: &str| {
        let text = "name = \"r\"\n[sensor]\nrate = \"10 Hz\"\nchannels = { z = \"COLUMN\" }\n[rest]\nfile = \"rest.csv\"\n";
        calibrated(&text.replace("COLUMN", column), folder.path())
    };
    assert!(file("a_rad_per_s").is_ok());
    let refused = file("b_rad_per_s").unwrap_err().to_string();
    assert!(refused.contains("b_rad_per_s") && refused.contains("clipped"), "{refused}");
}

/// Several files of one unit are pooled; a name that is not there is named with those that are.
#[test]
fn records_at_rest_in_several_files_are_pooled() {
    let folder = tempfile::tempdir().unwrap();
    let mut noise = Noise::new(13);
    for (name, bias) in [("a", 0.01), ("b", 0.012), ("c", 0.011)] {
        let mut rows = "g_rad_per_s\n".to_owned();
        for _ in 0..4096 {
            writeln!(rows, "{:.8}", bias + 1e-3 * noise.normal()).unwrap();
        }
        fs::write(folder.path().join(format!("rest_{name}.csv")), rows).unwrap();
    }
    let text = "name = \"r\"\n[sensor]\nrate = \"10 Hz\"\nchannels = { z = \"g_rad_per_s\" }\n\
                [rest]\nfile = \"rest_{record}.csv\"\nrecords = [\"a\", \"b\", \"c\"]\n";
    let found = calibrated(text, folder.path()).unwrap();
    let rest = &found.rest[0];
    assert_eq!((rest.records, rest.samples, rest.bias_freedom), (3, 3 * 4096, 2.0));
    assert!((rest.bias - 0.011).abs() < 5e-5 && (rest.bias_uncertainty - 1e-3 / 3.0_f64.sqrt()).abs() < 5e-5);
    let [low, high] = rest.angle_random_walk_interval.unwrap();
    let walk = 1e-3 / 10.0_f64.sqrt();
    assert!(low < walk && walk < high && (high - low) / walk < 0.1, "{low} {high} {walk}");
    let unnamed = text.replace("records = [\"a\", \"b\", \"c\"]\n", "");
    let refused = GyroscopeCalibration::parse(&unnamed, &folder.path().join("file.toml")).unwrap_err();
    assert!(refused.to_string().contains("needs their names"), "{refused}");
}

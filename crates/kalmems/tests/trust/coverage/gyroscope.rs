//! The scale factor of a gyroscope on the micro-stage, by the vibrometer and by the stage itself, from raw records on: identified, estimated,
//! calibrated.

use super::chance::Chance;
use super::rows::Rows;
use super::stage::{HZ, Told, response, told, write};
use kalmems::applications::ApplicationFile;
use kalmems::applications::calibration::{GyroscopeCalibration, calibrate};
use kalmems::diagnose::identify;
use kalmems::fit::DerivedNumber;
use kalmems::identify::Identified;
use kalmems::progress::Silent;
use kalmems::results::{Metrics, Output, RunInfo, Work, WriteOptions, write_estimate};
use kalmems::rigs::published;
use kalmems::workflow;
use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::fs;
use std::ops::Range;
use std::path::Path;
use std::time::{Duration, SystemTime};

const SCALE: f64 = 1.0137;
const BIAS: f64 = 0.0312;

/// Drives in V: of the records that are trained with, and of those in which the gyroscope is recorded as well.
const DRIVES: [f64; 8] = [1.0, 1.1, 1.2, 1.3, 1.05, 1.15, 1.25, 1.3];
const TRAINED: &str = "training = [\"r0\", \"r1\", \"r2\", \"r3\"]";

/// A quarter of a second at 8.0248 kHz for each record that is not trained with, from a time of its own on, behind 1.745 mrad/s of noise.
fn gyroscope(chance: &mut Chance, folder: &Path) {
    let [re, im] = response();
    let w = TAU * HZ;
    let mut rows = "record,gyro_rad_per_s\n".to_owned();
    for (record, volts) in DRIVES.iter().enumerate().skip(4) {
        let begun = chance.uniform();
        for k in 0..2000 {
            let time = begun + f64::from(k) / 8024.8;
            let (sine, cosine) = (w * time).sin_cos();
            let rate = volts * w * (re * cosine - im * sine);
            writeln!(rows, "r{record},{:e}", SCALE * rate + BIAS + 1.745e-3 * chance.normal()).unwrap();
        }
    }
    fs::write(folder.join("gyro.csv"), rows).unwrap();
}

/// The scale factor with its interval by a reference of each kind that there is, by name.
fn calibrated(folder: &Path, told: &Told) -> Vec<(String, Identified)> {
    let experiment = self::told(folder, told);
    let identified = identify(published(), &experiment, &Silent).unwrap_or_else(|e| panic!("{e}")).experiment;
    let outcome = workflow::estimate(published(), &identified, &Silent).unwrap_or_else(|e| panic!("{e}"));
    let output = Output::begin(&folder.join("stage"), &Work::named("estimate", "stage")).unwrap();
    let info = RunInfo { started: SystemTime::UNIX_EPOCH, took: Duration::ZERO };
    write_estimate(&outcome, &Metrics::of(&outcome), &output, WriteOptions::default(), info, &|| false)
        .unwrap();
    output.commit().unwrap();
    let mut toml = "name = \"gyroscope\"\n[gyroscope]\nrate = \"8 kHz\"\nclock_tolerance = \"1 %\"\n\
                    channels = { y = \"gyro_rad_per_s\" }\n\
                    [[condition]]\nname = \"here\"\nfile = \"gyro.csv\"\nsegments = { column = \"record\" }\n\
                    [[condition.reference]]\nname = \"stage\"\nfile = \"stage/{record}_trajectory_ekf.csv\"\n\
                    clock = { column = \"time_s\" }\nchannels = { y = \"rate_rad_per_s\" }\n"
        .to_owned();
    if told.has_vibrometer {
        toml += "[[condition.reference]]\nname = \"vibrometer\"\nfile = \"on.csv\"\nsegments = { column = \"record\" }\n\
                 clock = { column = \"time_s\" }\nchannels = { y = \"ldv_V\" }\n\
                 vibrometer = { gain = \"50 V/(m/s)\", target_width = \"3 mm\" }\n";
    }
    let file = GyroscopeCalibration::parse(&toml, &folder.join("calibration.toml")).unwrap();
    let found = calibrate(&file, &Silent).unwrap_or_else(|e| panic!("{e}"));
    let of = |result: &kalmems::applications::calibration::CalibratedGyroscope| {
        let scale = &result.scale_factor;
        let number = DerivedNumber { value: scale.value, deviation: scale.uncertainty };
        let own =
            Identified { interval: scale.interval, ..Identified::gaussian("scale factor", number, "", "") };
        (result.reference.clone(), own)
    };
    found.results.iter().map(of).collect()
}

/// Told gaps up to 3 % and gains up to 10 % wrong, as at another temperature, beside a vibrometer; and told gains to 0.05 %, and gaps 0.3 % wrong,
/// without one.
fn scale_factors(seeds: Range<u64>, rows: &mut Rows) {
    rows.of_recordings(seeds, |seed, folder, rows| {
        let mut chance = Chance::new(25_000 + seed);
        write(&mut chance, (&DRIVES, 2400), 4e-6, folder);
        gyroscope(&mut chance, folder);
        let gaps = [0; 4].map(|_| chance.between(-0.03, 0.03_f64).exp());
        let gains = [0; 4].map(|_| chance.between(-0.1, 0.1_f64).exp());
        let with = Told { gaps, gains, of_gains: "", identify: TRAINED, has_vibrometer: true };
        for (reference, scale) in calibrated(folder, &with) {
            rows.push(
                &format!("scale factor by the {reference}, identified with the vibrometer"),
                SCALE,
                &scale,
            );
        }
        fs::remove_dir_all(folder.join("stage")).unwrap();
        let gaps = [0; 4].map(|_| chance.between(-0.003, 0.003_f64).exp());
        let gains = [0; 4].map(|_| 1.0 + 5e-4 * chance.normal());
        let identify = format!("{TRAINED}\ntrusted = \"gain\"");
        let alone = Told { gaps, gains, of_gains: " ± 0.05 %", identify: &identify, has_vibrometer: false };
        for (_, scale) in calibrated(folder, &alone) {
            rows.push("scale factor by the stage, gaps found in place by stated gains", SCALE, &scale);
        }
    });
}

#[test]
#[ignore = "long: `.ci/run --all` runs it"]
fn long_a_few_scale_factors() {
    let mut rows = Rows::default();
    scale_factors(0..2, &mut rows);
    rows.judge();
}

#[test]
#[ignore = "slow: cargo test --release --workspace -- --ignored slow_"]
fn slow_scale_factors() {
    let mut rows = Rows::default();
    scale_factors(0..300, &mut rows);
    rows.judge();
}

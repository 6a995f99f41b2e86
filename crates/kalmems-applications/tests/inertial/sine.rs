//! Sines with a reference in the same file: an accelerometer on a shaker.

use super::coverage::{assert_95_of_100, limits_of_one};
use super::simulated::Noise;
use kalmems_applications::ApplicationFile;
use kalmems_applications::calibration::{
    Calibration, CalibrationError, Certificate, GyroscopeCalibration, RecordOutcome, calibrate,
};
use kalmems_engines::progress::Silent;
use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::fs;

/// Codes of a converter, 16384 of which are stated to be 1 gn.
const FILE: &str = "name = \"shaker\"\n[sensor]\nrate = \"5 kHz\"\n\
    accelerometers = { x = { column = \"ax\", sensitivity = \"16384 LSB/gn\" } }\n\
    [[sine]]\nname = \"x\"\nsensor = \"accelerometer\"\naxis = \"x\"\nfile = \"shaker.csv\"\nreference = \"reference_m_per_s2\"\n\
    segments = { column = \"step\" }\n";
const STATED: &str = "reference_uncertainty = \"0.2 %\"\ndelay_uncertainty = \"2 us\"\n";
const GRAVITY: f64 = 9.806_65;
const RATE: f64 = 5000.0;

/// An accelerometer of second order.
#[derive(Clone, Copy)]
struct Shaken {
    scale: f64,
    resonance_hz: f64,
    damping: f64,
    /// What the scale factor and the phase change from record to record.
    scatter: f64,
    /// The second harmonic of the shaker.
    distortion: f64,
    /// Beyond this the sensor is at its end, in m/s².
    limit: f64,
}

const SHAKEN: Shaken =
    Shaken { scale: 1.013, resonance_hz: 480.0, damping: 0.7, scatter: 1e-3, distortion: 0.0, limit: 1e9 };
const FREQUENCIES: [f64; 10] = [20.0, 40.0, 80.0, 160.0, 320.0, 430.0, 460.0, 490.0, 520.0, 720.0];
/// Records at each frequency.
const REPEATED: usize = 4;

impl Shaken {
    /// Amplitude and phase.
    fn response(&self, frequency: f64) -> (f64, f64) {
        let ratio = frequency / self.resonance_hz;
        let (re, im) = (1.0 - ratio * ratio, 2.0 * self.damping * ratio);
        (self.scale.abs() / re.hypot(im), -im.atan2(re))
    }

    fn write(&self, path: &std::path::Path, seed: u64) {
        let mut noise = Noise::new(seed);
        let mut text = "step,reference_m_per_s2,ax\n".to_owned();
        for step in 0..FREQUENCIES.len() * REPEATED {
            let frequency = FREQUENCIES[step / REPEATED];
            let (gain, lag) = self.response(frequency);
            let gain = gain * self.scale.signum() * (1.0 + self.scatter * noise.normal());
            let (start, lag) = (TAU * noise.uniform(), lag + self.scatter * noise.normal());
            for k in 0..1500 {
                let turn = TAU * frequency * f64::from(k) / RATE + start;
                let harmonic = self.distortion * (2.0 * turn).cos();
                let reference = 20.0 * (turn.cos() + harmonic) + 2e-3 * noise.normal();
                let shown = 20.0 * gain * (turn + lag).cos() + 0.05 * noise.normal();
                let codes = 16384.0 / GRAVITY * (0.3 + shown.clamp(-self.limit, self.limit));
                writeln!(text, "{step},{reference:.6},{codes:.0}").unwrap();
            }
        }
        fs::write(path, text).unwrap();
    }

    fn calibrated(&self, seed: u64) -> Result<Calibration, CalibrationError> {
        let folder = tempfile::tempdir().unwrap();
        self.write(&folder.path().join("shaker.csv"), seed);
        let text = format!("{FILE}{STATED}");
        calibrate(&GyroscopeCalibration::parse(&text, &folder.path().join("shaker.toml")).unwrap(), &Silent)
    }

    fn bandwidth(&self) -> f64 {
        let falls = |frequency: f64| {
            self.response(frequency).0 > std::f64::consts::FRAC_1_SQRT_2 * self.response(FREQUENCIES[0]).0
        };
        let (mut low, mut high) = (100.0, 1000.0);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if falls(middle) { low = middle } else { high = middle }
        }
        low
    }

    fn truth(&self) -> Vec<(String, f64)> {
        let each = FREQUENCIES.iter().flat_map(|frequency| {
            let (gain, lag) = self.response(*frequency);
            [
                (format!("accelerometer_scale_factor_x_at_{frequency:.2}_hz"), gain),
                (format!("accelerometer_sensitivity_x_at_{frequency:.2}_hz"), gain * 16384.0 / GRAVITY),
                (format!("accelerometer_phase_x_at_{frequency:.2}_hz"), lag),
            ]
        });
        each.chain([("accelerometer_bandwidth_x".to_owned(), self.bandwidth())]).collect()
    }
}

fn record(found: &Calibration) -> &RecordOutcome {
    found.records.iter().find(|record| record.kind == "sine").unwrap()
}

/// How often each number is in its interval.
fn held(seeds: std::ops::Range<u64>) -> Vec<(String, usize)> {
    let truth = SHAKEN.truth();
    let mut held: Vec<(String, usize)> = truth.iter().map(|(name, _)| (name.clone(), 0)).collect();
    for seed in seeds {
        let found = SHAKEN.calibrated(seed).unwrap();
        for ((name, value), (_, held)) in truth.iter().zip(&mut held) {
            let estimate =
                record(&found).estimate(name).unwrap_or_else(|| panic!("{name}: {:?}", record(&found)));
            let [low, high] = estimate.interval;
            assert!(low < estimate.value && estimate.value < high, "{name} {estimate:?}");
            // The reference and the delay are exact here: by the records alone.
            let half = estimate.expanded_by_records;
            let half = if name.contains("bandwidth") { 0.5 * (high - low) } else { half };
            *held += usize::from((estimate.value - value).abs() <= half);
        }
    }
    held
}

#[test]
fn a_shaker_gives_amplitude_phase_bandwidth_and_codes_by_the_unit() {
    for (name, held) in held(0..8) {
        assert!(held >= 5, "{name}: {held} of 8");
    }
}

#[test]
#[ignore = "200 records; cargo test -p kalmems-applications --test inertial -- --ignored slow_"]
fn slow_intervals_by_sines_hold_95_of_100() {
    // The sensitivity is the scale factor times a constant.
    let each = held(100..300).into_iter().filter(|(name, _)| !name.contains("sensitivity"));
    assert_95_of_100("sines", each, 200);
}

pub fn with_scale(scale: f64) -> Calibration {
    Shaken { scale, ..SHAKEN }.calibrated(3).unwrap()
}

/// A shaker with a second harmonic of this part.
pub fn with_distortion(distortion: f64) -> Calibration {
    Shaken { distortion, ..SHAKEN }.calibrated(3).unwrap()
}

#[test]
fn a_turned_sign_a_distorted_shaker_and_a_range_that_ends_are_named_and_not_certified() {
    let refused = |found: Calibration, what: &str| {
        let certificate = Certificate::of(&found);
        let failed = certificate.validity.iter().filter(|check| !check.passes);
        assert!(failed.clone().any(|check| check.what.contains(what)), "{what}: {:?}", certificate.validity);
        assert!(!certificate.valid);
    };
    refused(with_scale(-1.013), "follows the reference");
    refused(with_distortion(0.1), "harmonic of the reference");
    let clipped = Shaken { limit: 15.0, ..SHAKEN }.calibrated(3).unwrap_err().to_string();
    assert!(clipped.contains("clipped"), "{clipped}");
}

#[test]
fn what_the_file_does_not_state_of_the_reference_is_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    SHAKEN.write(&folder.path().join("shaker.csv"), 1);
    let file = |text: &str| GyroscopeCalibration::parse(text, &folder.path().join("shaker.toml"));
    let found = calibrate(&file(FILE).unwrap(), &Silent).unwrap();
    let asked = Certificate::of(&found).not_stated.join("; ");
    assert!(asked.contains("reference_uncertainty") && asked.contains("delay_uncertainty"), "{asked}");
    let wrong = file(&FILE.replace("16384 LSB/gn", "16384 gn")).unwrap_err().to_string();
    assert!(wrong.contains("expected codes by a unit"), "{wrong}");
    let none = file(&FILE.replace("axis = \"x\"", "axis = \"y\"")).unwrap_err().to_string();
    assert!(none.contains("no such sensor"), "{none}");
}

/// A sweep from 10 to 900 Hz that swells and fades, and the accelerometer's answer by its equation of motion.
fn write_sweeps(path: &std::path::Path, seed: u64, records: usize) {
    const SAMPLES: usize = 40_000;
    const STEPS: usize = 8;
    let mut noise = Noise::new(seed);
    let mut text = "step,reference_m_per_s2,ax\n".to_owned();
    let span = SAMPLES as f64 / RATE;
    let input = |t: f64| {
        let phase = TAU * (10.0 * t + 0.5 * 890.0 * t * t / span);
        let ends = (t / 0.2).min((span - t) / 0.2).clamp(0.0, 1.0);
        20.0 * (0.5 * std::f64::consts::PI * ends).sin().powi(2) * phase.sin()
    };
    let turn = TAU * SHAKEN.resonance_hz;
    let slope =
        |t: f64, [x, v]: [f64; 2]| [v, turn * turn * (input(t) - x) - 2.0 * SHAKEN.damping * turn * v];
    for record in 0..records {
        let mut state = [0.0; 2];
        for k in 0..SAMPLES {
            let t = k as f64 / RATE;
            let reference = input(t) + 2e-3 * noise.normal();
            let codes = 16384.0 / GRAVITY * (0.3 + SHAKEN.scale * state[0] + 0.05 * noise.normal());
            writeln!(text, "{record},{reference:.6},{codes:.0}").unwrap();
            let h = 1.0 / RATE / STEPS as f64;
            for step in 0..STEPS {
                let t = t + step as f64 * h;
                let after = |by: [f64; 2], part: f64| [0, 1].map(|i| state[i] + part * h * by[i]);
                let a = slope(t, state);
                let b = slope(t + 0.5 * h, after(a, 0.5));
                let c = slope(t + 0.5 * h, after(b, 0.5));
                let d = slope(t + h, after(c, 1.0));
                state = [0, 1].map(|i| state[i] + h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]));
            }
        }
    }
    fs::write(path, text).unwrap();
}

/// How often each amplitude and phase of the bands, and the bandwidth, are in their intervals, and in how many records they are found.
fn sweeps_held(seeds: std::ops::Range<u64>, records: usize) -> BTreeMap<String, [usize; 2]> {
    let folder = tempfile::tempdir().unwrap();
    let text = format!("{FILE}sweep = true\n{STATED}");
    let file = GyroscopeCalibration::parse(&text, &folder.path().join("shaker.toml")).unwrap();
    let mut held = BTreeMap::new();
    for seed in seeds {
        write_sweeps(&folder.path().join("shaker.csv"), seed, records);
        let found = calibrate(&file, &Silent).unwrap();
        for quantity in &record(&found).quantities {
            let own = quantity.estimate;
            let [low, high] = own.interval;
            assert!(low < own.value && own.value < high, "{quantity:?}");
            let (name, is_held) = match quantity.name.split_once("_x_at_") {
                None => {
                    let truth = SHAKEN.bandwidth();
                    (quantity.name.clone(), low <= truth && truth <= high)
                }
                Some((what, frequency)) => {
                    let frequency: f64 = frequency.trim_end_matches("_hz").parse().unwrap();
                    let (gain, lag) = SHAKEN.response(frequency);
                    let truth = match what {
                        "accelerometer_scale_factor" => gain,
                        "accelerometer_phase" => lag,
                        // The scale factor times a constant.
                        _ => continue,
                    };
                    // The frequency in the name is rounded to 0.01 Hz.
                    let half = own.expanded_by_records + 5e-6 * truth.abs();
                    (format!("{what}_at_{frequency:.1}_hz"), (own.value - truth).abs() <= half)
                }
            };
            let [held, of] = held.entry(name).or_default();
            *held += usize::from(is_held);
            *of += 1;
        }
    }
    assert!(held.len() > 50 && held.contains_key("accelerometer_bandwidth_x"), "{held:?}");
    held
}

#[test]
fn a_sweep_gives_the_response_in_bands() {
    for records in [1, 3] {
        let held = sweeps_held(5..6, records);
        assert_eq!(held["accelerometer_bandwidth_x"], [1, 1]);
        // Neighbouring bands share nothing: 19 of 20 are expected.
        let all: usize = held.values().map(|[held, _]| held).sum();
        assert!(all as f64 > 0.87 * held.len() as f64, "{held:?}");
    }
}

#[test]
#[ignore = "400 records; cargo test -p kalmems-applications --test inertial -- --ignored slow_"]
fn slow_intervals_by_sweeps_hold_95_of_100() {
    let held = sweeps_held(100..500, 1);
    // Bands below the beginning of the sweep are found in some records only: those in which their noise happens to be small.
    let (always, sometimes): (Vec<_>, Vec<_>) = held.into_iter().partition(|(_, [_, of])| *of == 400);
    println!("sweeps, in some records only: {sometimes:?}");
    assert!(always.len() > 70 && sometimes.len() <= 6, "{sometimes:?}");
    for (name, [held, of]) in sometimes.into_iter().filter(|(_, [_, of])| *of >= 100) {
        let [least, most] = limits_of_one(of);
        assert!((least..=most).contains(&held), "{name}: {held} of {of}, expected {least} to {most}");
    }
    assert_95_of_100("sweeps", always.into_iter().map(|(name, [held, _])| (name, held)), 400);
}

#[test]
fn a_sweep_with_a_gap_and_one_that_the_sensor_does_not_follow_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("shaker.csv");
    let text = format!("{FILE}sweep = true\n{STATED}");
    let file = GyroscopeCalibration::parse(&text, &folder.path().join("shaker.toml")).unwrap();
    write_sweeps(&path, 5, 1);
    let rows = fs::read_to_string(&path).unwrap();
    let gap = rows.lines().enumerate().map(|(k, line)| match line.rsplit_once(',') {
        Some((before, _)) if k == 20_000 => format!("{before},nan\n"),
        _ => format!("{line}\n"),
    });
    fs::write(&path, gap.collect::<String>()).unwrap();
    let said = calibrate(&file, &Silent).unwrap_err().to_string();
    assert!(said.contains("1 of its samples are missing"), "{said}");
    let mut noise = Noise::new(6);
    let apart = rows.lines().map(|line| match line.rsplit_once(',') {
        Some((before, codes)) if codes != "ax" => format!("{before},{:.0}\n", 500.0 * noise.normal()),
        _ => format!("{line}\n"),
    });
    fs::write(&path, apart.collect::<String>()).unwrap();
    let said = calibrate(&file, &Silent).unwrap_err().to_string();
    assert!(said.contains("in no band"), "{said}");
}

//! Sines with a reference in the same file: an accelerometer on a shaker.

use super::simulated::Noise;
use kalmems_applications::ApplicationFile;
use kalmems_applications::calibration::{
    Calibration, CalibrationError, Certificate, GyroscopeCalibration, RecordOutcome, calibrate,
};
use kalmems_engines::progress::Silent;
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
const FREQUENCIES: [f64; 8] = [20.0, 40.0, 80.0, 160.0, 320.0, 430.0, 560.0, 720.0];
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
    let (mut all, mut of) = (0, 0);
    for (name, held) in held(100..300) {
        println!("{name}: {held} of 200");
        assert!(held >= 180, "{name}: {held} of 200");
        if !name.contains("bandwidth") && !name.contains("sensitivity") {
            (all, of) = (all + held, of + 200);
        }
    }
    let part = f64::from(all as u32) / f64::from(of);
    assert!((0.94..0.97).contains(&part), "{part}");
}

#[test]
fn a_turned_sign_a_distorted_shaker_and_a_range_that_ends_are_named_and_not_certified() {
    let refused = |shaken: Shaken, what: &str| {
        let found = shaken.calibrated(3).unwrap();
        let certificate = Certificate::of(&found);
        let failed = certificate.validity.iter().filter(|check| !check.passes);
        assert!(failed.clone().any(|check| check.what.contains(what)), "{what}: {:?}", certificate.validity);
        assert!(!certificate.valid);
    };
    refused(Shaken { scale: -1.013, ..SHAKEN }, "follows the reference");
    refused(Shaken { distortion: 0.1, ..SHAKEN }, "harmonic of the reference");
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

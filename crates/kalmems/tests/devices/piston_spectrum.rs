//! A drifting mirror: how it is followed, and what is left of a spectrum that is measured along it.

use crate::piston::{CASE, Case, FIVE, trajectory};
use crate::scene::write_columns;
use kalmems::applications::ApplicationFile;
use kalmems::applications::spectrum::SpectrumFile;
use kalmems::applications::spectrum::{
    Apodisation, dip_between, line_near, measure, path_weights, spectrum_at,
};
use kalmems::config::Experiment;
use kalmems::estimate::Trajectory;
use kalmems::progress::Silent;
use kalmems::results::{Metrics, Verdict};
use kalmems::rigs::published;
use kalmems::simulate::ComputedRecording;
use kalmems::workflow;
use std::f64::consts::{PI, TAU};
use std::path::Path;

const DRIFTING: Case = Case { drift: 0.2, duration_s: 2.0, ..CASE };
/// In m/s.
const RATE: f64 = 0.2 * 0.5e-3 / 60.0;

const THREE: &str = r#"
[[estimate.filter]]
name = "three"
method = "ekf"
process_noise = { amplitude = "3e-16 m^2/s", frequency = "1e-8 Hz^2/s" }
start = { amplitude = "0.5 mm", frequency = "500 Hz", phase = "0.7 rad", offset = "1 mm" }
start_sd = { amplitude = "1 um", frequency = "0.05 Hz", phase = "0.01 rad" }
"#;

/// Three states lag behind the drift by rate·σ0²/sd_A² with σ0 = 0.59 nm√s; five do not, and stay within 5 nm.
#[test]
fn three_states_lag_behind_a_drift_and_five_do_not() {
    let mut five = Vec::new();
    for seed in 1..=3 {
        let (outcome, metrics) = Case { seed, ..DRIFTING }.run("1 s", &format!("{FIVE}{THREE}"));
        let rms =
            |key: &str| metrics.estimators().find(|e| e.key == key).unwrap().values["position"].rmse * 1e9;
        five.push(rms("five"));
        let lag_of = |key: &str| {
            let trajectory = trajectory(&outcome, key);
            let amplitude = trajectory.state("amplitude").unwrap();
            let scored = trajectory.scored(1.0);
            let count = scored.len() as f64;
            let lag =
                scored.map(|k| 0.5e-3 + RATE * trajectory.time_s[k] - amplitude.mean[k]).sum::<f64>() / count;
            (lag, *amplitude.sd.last().unwrap())
        };
        let (lag, sd) = lag_of("three");
        let expected = RATE * (0.59e-9_f64 / sd).powi(2);
        println!(
            "seed {seed}: lag {:.1} nm, expected {:.1} nm; five states {:.2} nm rms",
            lag * 1e9,
            expected * 1e9,
            rms("five")
        );
        assert!((lag / expected - 1.0).abs() < 0.25, "{lag} {expected}");
        assert!(lag_of("five").0.abs() < 0.2 * lag);
        assert!(rms("three") > 4.0 * rms("five"));
    }
    assert!(five.iter().all(|rms| *rms <= 5.0), "{five:?}");
}

/// The readout's gain is 1e-4 higher than the filter is told: all distances are too small by that share, 106 nm rms, and the
/// mean NIS does not see it.
#[test]
fn a_wrong_gain_is_not_seen_by_the_filter() {
    let told = Case { duration_s: 1.0, ..CASE }.experiment("0.5 s", FIVE);
    let real = told.to_toml().unwrap().replace("109.3 fF", "109.31093 fF");
    let real = published().parse(&real, Path::new("piston.toml")).unwrap();
    let simulation = published().rig(&real).unwrap().simulate(&real).unwrap();
    let simulated = ComputedRecording::of(&*simulation, &Silent).unwrap();
    let outcome = workflow::estimate_computed(published(), &told, &simulated, &Silent).unwrap();
    let metrics = Metrics::of(&outcome);
    let five = metrics.estimators().next().unwrap();
    let errors = &five.values["position"];
    let expected = 1e-4 * (1e-3_f64.powi(2) + 0.5e-3_f64.powi(2) / 2.0).sqrt() * 1e9;
    assert!((errors.rmse * 1e9 / expected - 1.0).abs() < 0.05, "{} {expected}", errors.rmse * 1e9);
    assert!(errors.bias * 1e9 < -90.0);
    assert_eq!(five.verdict, Verdict::Consistent);
}

/// The true position in m.
fn truth(t: f64) -> f64 {
    1e-3 + (0.5e-3 + RATE * t) * (TAU * 500.0 * t + 0.7).cos()
}

/// Position between samples, from the states at the sample before.
fn followed(trajectory: &Trajectory, t: f64) -> f64 {
    let k = trajectory.time_s.partition_point(|s| *s <= t) - 1;
    let state = |name: &str| trajectory.state(name).unwrap().mean[k];
    let h = t - trajectory.time_s[k];
    let amplitude = state("amplitude") + h * state("amplitude_rate");
    state("offset") + amplitude * (state("phase") + TAU * state("frequency") * h).cos()
}

/// Lines at 2000 and 2010 per cm and a band at 1600 per cm, at a path difference in m.
fn light(x: f64) -> f64 {
    let band = (-(PI * 3e3 * x).powi(2)).exp() * (TAU * 160e3 * x).cos();
    (TAU * 200e3 * x).cos() + (TAU * 201e3 * x).cos() + 5.0 * band
}

/// 60 scans over 1 s: the detector is sampled at 2 MHz, and each scan goes from one turning point to the next.
#[test]
fn two_lines_are_kept_apart_along_the_estimate_and_lost_without() {
    let (outcome, _) = DRIFTING.run("0.5 s", FIVE);
    let estimate = trajectory(&outcome, "five");
    let turning = |n: u32| (PI * f64::from(n) - 0.7) / (TAU * 500.0);
    let nu: Vec<f64> = (0..=170).map(|i| 198.8e3 + 20.0 * f64::from(i)).collect();
    let settings = (Apodisation::NortonBeerMedium, 0.95e-3);
    let spectrum = |position: &dyn Fn(f64) -> f64| -> Vec<f64> {
        let mut sum = vec![0.0; nu.len()];
        for scan in 0..60 {
            // Every seventeenth half period from 0.5 s on.
            let (from, to) = (turning(520 + 17 * scan), turning(521 + 17 * scan));
            let times: Vec<f64> =
                (0..2000).map(|i| from + (to - from) * (f64::from(i) + 0.5) / 2000.0).collect();
            let value: Vec<f64> = times.iter().map(|t| light(2.0 * (truth(*t) - 1e-3))).collect();
            let x: Vec<f64> = times.iter().map(|t| 2.0 * (position(*t) - 1e-3)).collect();
            let weights = path_weights(&x);
            for (sum, nu) in sum.iter_mut().zip(&nu) {
                *sum += spectrum_at(*nu, &x, (&value, &weights), settings).re / 60.0;
            }
        }
        sum
    };
    let ideal = spectrum(&truth);
    let along = spectrum(&|t| followed(estimate, t));
    // What is known without a sensor: the motion as it began.
    let without = spectrum(&|t| 1e-3 + 0.5e-3 * (TAU * 500.0 * t + 0.7).cos());
    let peak = ideal.iter().copied().fold(0.0, f64::max);
    let distortion = |found: &[f64]| {
        let square: f64 = found.iter().zip(&ideal).map(|(f, i)| ((f - i) / peak).powi(2)).sum();
        (square / nu.len() as f64).sqrt()
    };
    let dip = |found: &[f64]| dip_between(&nu, found, [200e3, 201e3]).unwrap_or(0.0);
    println!(
        "distortion {:.2e} along the estimate, {:.2e} without",
        distortion(&along),
        distortion(&without)
    );
    println!(
        "dip {:.3} ideal, {:.3} along the estimate, {:.3} without",
        dip(&ideal),
        dip(&along),
        dip(&without)
    );
    assert!(distortion(&along) <= 2e-3);
    for line in [200e3, 201e3] {
        let at = |found: &[f64]| line_near(&nu, found, line, 300.0).unwrap().wavenumber_per_m;
        let shift = (at(&along) - at(&ideal)).abs() / 100.0;
        println!("line {line}: shift {shift:.1e} per cm");
        assert!(shift <= 0.01, "{shift}");
    }
    assert!((dip(&along) - dip(&ideal)).abs() < 0.01 && dip(&ideal) > 0.1);
    assert!(distortion(&without) > 0.1);
}

/// The readout's gain is 0.3 % higher than the filter is told. The mean NIS is 1 all the same and all distances are 3 µm
/// off; a line that is known to be at 2000 per cm, seen along the estimate, tells the scale, and with the reference distance that is
/// reported the errors are those of noise.
#[test]
fn a_known_line_removes_a_gain_error_that_the_filter_does_not_see() {
    const GAIN: f64 = 1.003;
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    for seed in 1..=3 {
        let told = Case { seed, duration_s: 0.4, ..CASE }.experiment("0.2 s", FIVE);
        let text = told.to_toml().unwrap();
        let real = text.replace("109.3 fF", &format!("{} fF", 109.3 * GAIN));
        let real = published().parse(&real, Path::new("piston.toml")).unwrap();
        let simulation = published().rig(&real).unwrap().simulate(&real).unwrap();
        let simulated = ComputedRecording::of(&*simulation, &Silent).unwrap();
        let estimate = |told: &Experiment| {
            let outcome = workflow::estimate_computed(published(), told, &simulated, &Silent).unwrap();
            let metrics = Metrics::of(&outcome);
            let five = metrics.estimators().next().unwrap();
            (outcome, five.verdict, five.values["position"].rmse * 1e9)
        };
        let (outcome, verdict, before) = estimate(&told);
        assert_eq!(verdict, Verdict::Consistent);
        let five = trajectory(&outcome, "five");
        let position = &five.state("position").unwrap().mean;
        write_columns(&path("estimate.csv"), &[("time_s", &five.time_s), ("position_m", position)]);
        let still = |t: &f64| 1e-3 + 0.5e-3 * (TAU * 500.0 * t + 0.7).cos();
        let truth: Vec<f64> = five.time_s.iter().map(still).collect();
        write_columns(&path("truth.csv"), &[("time_s", &five.time_s), ("position_m", &truth)]);
        std::fs::write(path("piston.toml"), &text).unwrap();
        // What the filter says of its amplitude is what the scale of the positions may be off by in these scans.
        let amplitude = five.state("amplitude").unwrap();
        let scale_sd = amplitude.sd.last().unwrap() / amplitude.mean.last().unwrap();
        let spectrum = format!(
            r#"
name = "laser"
experiment = "piston.toml"
[light]
zero_path = "1 mm"
rate = "2 MHz"
noise = 0.05
seed = {seed}
start = "0.2 s"
bursts = {{ duration = "4 ms", period = "39 ms", count = 5 }}
sources = [
    {{ wavenumber = "2000 1/cm", height = 1 }},
    {{ wavenumber = "1600 1/cm", width = "30 1/cm", height = 5 }},
]
trajectory = {{ file = "truth.csv", clock = {{ column = "time_s" }}, column = "position_m" }}
[path.trajectory]
file = "estimate.csv"
clock = {{ column = "time_s" }}
column = "position_m"
[transform]
apodisation = "norton_beer_medium"
phase = "none"
largest_path_difference = "0.95 mm"
band = {{ from = "1540 1/cm", to = "2030 1/cm" }}
zero_filling = 32
[[line]]
wavenumber = "2000 1/cm"
within = "12 1/cm"
known = "2000 1/cm"
[errors]
scale_sd = {scale_sd:e}
"#
        );
        let file = SpectrumFile::parse(&spectrum, &path("laser.toml")).unwrap();
        let outcome = measure(published(), &file, &Silent).unwrap();
        let found = outcome.recalibration.unwrap();
        let sd = found.scale_sd.unwrap();
        println!("seed {seed}: scale {:.7} ± {sd:.1e}, expected {GAIN}", found.scale);
        assert!((found.scale - GAIN).abs() < 4.0 * sd && sd < 2e-5, "{found:?}");
        let correction = outcome.correction.unwrap();
        assert_eq!(correction.was, "1 mm");
        let write = format!("{:.9} mm", correction.is_m * 1e3);
        let corrected =
            text.replace("reference_distance = \"1 mm\"", &format!("reference_distance = \"{write}\""));
        assert_ne!(corrected, text);
        let corrected = published().parse(&corrected, Path::new("piston.toml")).unwrap();
        let (_, verdict, after) = estimate(&corrected);
        println!("seed {seed}: {before:.0} nm rms before, {after:.1} nm after");
        assert_eq!(verdict, Verdict::Consistent);
        assert!((before / 3182.0 - 1.0).abs() < 0.05 && after < 15.0, "{before} {after}");
    }
}

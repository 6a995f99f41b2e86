//! Settings of filters with which a wrong answer once passed.

use crate::devices::{Device, Setting};
use kalmems::evaluate::Grade;
use kalmems::progress::Silent;
use kalmems::results::{Estimated, EstimatorMetrics, Metrics, SegmentMetrics, notices};
use kalmems::rigs::published;
use kalmems::workflow::estimate_computed;
use std::path::Path;

fn owned(settings: &[(&'static str, &str)]) -> Vec<Setting<'static>> {
    settings.iter().map(|(key, value)| (*key, (*value).to_owned())).collect()
}

/// Of the accelerometer by its first filter with these settings.
fn accelerometer(settings: &[(&'static str, &str)]) -> EstimatorMetrics {
    let told = owned(settings);
    let metrics: Metrics = Device::named("accelerometer").judged(&[], &told, 31).unwrap();
    metrics.estimators().next().unwrap().clone()
}

const MEMORY: (&str, &str) = ("estimate.filter.0.noise_memory", "\"50 ms\"");
const NO_SMOOTHER: (&str, &str) = ("estimate.filter.0.smooth", "false");

/// Innovations that are too large for the model are explained by a larger noise: their mean square shows nothing.
#[test]
fn a_wrong_model_does_not_pass_by_a_noise_that_is_found_while_filtering() {
    let right = accelerometer(&[MEMORY, NO_SMOOTHER]);
    assert!(right.passes(), "{:?}", right.grade);
    for wrong in [
        ("device.accelerometer.proof_mass.mass", "\"5.7e-9 kg\""),
        ("device.accelerometer.plates.gap", "\"2.0 um\""),
        ("device.accelerometer.feedback.bias", "\"0.22 V\""),
    ] {
        let found = accelerometer(&[MEMORY, NO_SMOOTHER, wrong]);
        assert!(!found.passes(), "{wrong:?}: {:?}", found.grade);
    }
}

/// A noise that is told far too strong makes a filter slow: its claim is kept, and its errors are larger than those of the right one.
#[test]
fn a_noise_that_is_told_a_hundred_times_too_strong_does_not_pass() {
    const NOISE: &str = "device.accelerometer.readout.noise_variance";
    for (told, passes) in [("\"1.952e-8 V^2\"", true), ("\"4.88e-7 V^2\"", false)] {
        let setting = owned(&[(NOISE, told)]);
        let (experiment, simulated) = Device::named("accelerometer").recorded(&[], &setting, 31);
        let outcome = estimate_computed(published(), &experiment, &simulated, &Silent).unwrap();
        let metrics = Metrics::of(&outcome);
        let first = metrics.estimators().next().unwrap();
        assert_eq!(first.passes(), passes, "{told}: {:?} {:?}", first.grade, first.consistency);
        let texts: Vec<String> = notices(&metrics).iter().map(|notice| notice.text.clone()).collect();
        let says = texts.iter().any(|text| text.contains("times as large as they are"));
        assert_eq!(says, !passes, "{texts:?}");
    }
}

/// The bank gives all weight to the nearest of its models, which claims as if it were right.
#[test]
fn a_bank_without_the_right_model_does_not_pass() {
    let states = "{ mass = { start_sd = \"15 %\" } }";
    let bank = [("estimate.filter.0.method", "\"bank\""), ("estimate.filter.0.states", states), NO_SMOOTHER];
    let right = accelerometer(&bank);
    assert!(right.passes(), "{:?}", right.grade);
    let far = [&bank[..], &[("device.accelerometer.proof_mass.mass", "\"6.5e-9 kg\"")]].concat();
    let found = accelerometer(&far);
    assert!(!found.passes(), "{:?}", found.grade);
}

/// The segment of the threshold example, with this done to its text.
fn threshold(change: impl Fn(String) -> String) -> SegmentMetrics {
    let path =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/threshold_scanner/as_published.toml");
    let text = change(std::fs::read_to_string(&path).unwrap());
    let experiment = published().parse(&text, &path).unwrap();
    let estimated = Estimated::of(published(), &experiment, Vec::new(), &Silent).unwrap();
    estimated.metrics.recordings[0].segments[0].clone()
}

fn rmse_deg(estimator: &EstimatorMetrics) -> f64 {
    estimator.errors.as_ref().unwrap().angle.rmse_deg
}

/// The comb's curve is wrong. A filter that believes the signal as it stands moves its gain by a third, and is 1.3° off.
#[test]
fn a_filter_with_a_wrong_curve_is_not_recommended() {
    let segment = threshold(|text| {
        let without = text.replace("signal_variance = \"0.2 V^2\"\n", "");
        assert_ne!(without, text);
        without
    });
    let led = segment.estimators.iter().find(|one| one.name == "Hybrid, led by the crossings").unwrap();
    assert!(rmse_deg(led) > 0.5, "{}", rmse_deg(led));
    assert!(led.grade >= Some(Grade::Doubtful), "{:?}", led.grade);
    assert_ne!(segment.likeliest.map(|likeliest| likeliest.key), Some(led.key.clone()));
}

#[test]
fn of_the_threshold_example_no_filter_is_preferred_to_a_better_one() {
    let segment = threshold(|text| text);
    for one in &segment.estimators {
        println!("{}: {:.4} deg, {:?}", one.name, rmse_deg(one), one.grade);
    }
    println!("{:?}", segment.likeliest);
    let best = segment.estimators.iter().map(rmse_deg).fold(f64::INFINITY, f64::min);
    if let Some(chosen) = segment.trusted() {
        let chosen = segment.estimators.iter().find(|one| one.key == chosen).unwrap();
        assert!(rmse_deg(chosen) < 1.05 * best, "{}: {} for {best}", chosen.name, rmse_deg(chosen));
    }
}

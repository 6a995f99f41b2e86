//! Devices that are described by their equations alone, on recordings that a program outside of this project simulated: the
//! example's `simulate.py`, whose constants are the truth here.

use kalmems::config::Experiment;
use kalmems::diagnose::likeliest;
use kalmems::evaluate::Grade;
use kalmems::progress::Silent;
use kalmems::results::{EstimatorMetrics, Metrics, summary_table};
use kalmems::rigs::published;
use kalmems::workflow;
use std::f64::consts::TAU;
use std::path::Path;

/// A parameter of a device: its name, what the experiment file states and what was simulated, in SI.
type Truth = (&'static str, f64, f64);

const COMB_RESONATOR: [Truth; 5] = [
    ("k", 4.7374, 4.7100),
    ("b", 3.0159e-7, 2.92e-7),
    ("hardening", 6.25e8, 6.40e8),
    ("force", 2.96e-9, 3.00e-9),
    ("amplifier_time", 4.0e-6, 4.10e-6),
];

const FORK_MASS: f64 = 6.6e-7;
const FORK_RATE: f64 = TAU * 32_755.0;
const TUNING_FORK: [Truth; 5] = [
    ("k", 27_966.9, FORK_MASS * FORK_RATE * FORK_RATE),
    ("b", 1.3586e-5, FORK_MASS * FORK_RATE / 9200.0),
    ("coupling", 9.2e-6, 9.00e-6),
    ("C_shunt", 1.2e-12, 1.25e-12),
    ("R_feedback", 22e6, 21.6e6),
];

const GYROSCOPE_MASS: f64 = 1e-8;
const ALONG_X: f64 = TAU * 10_000.0;
const ALONG_Y: f64 = TAU * 10_247.0;
const VIBRATING_GYROSCOPE: [Truth; 6] = [
    ("k_x", 39.44, GYROSCOPE_MASS * ALONG_X * ALONG_X),
    ("k_y", 41.50, GYROSCOPE_MASS * ALONG_Y * ALONG_Y),
    ("b_x", 1.2e-7, GYROSCOPE_MASS * ALONG_X / 5000.0),
    ("b_y", 6.8e-7, GYROSCOPE_MASS * ALONG_Y / 1000.0),
    ("quadrature", 5e-3, 6.6e-3),
    ("force", 3.9e-8, 4.0e-8),
];

const MIRROR_INERTIA: f64 = 3.4e-15;
const MIRROR_RATE: f64 = TAU * 483.0;
const THERMAL_MIRROR: [Truth; 7] = [
    ("k", 3.09e-8, MIRROR_INERTIA * MIRROR_RATE * MIRROR_RATE),
    ("b", 2.7e-13, MIRROR_INERTIA * MIRROR_RATE / 40.0),
    ("bending", 2.0e-3, 2.06e-3),
    ("G_actuator", 1.00e-4, 1.03e-4),
    ("G_frame", 2.00e-3, 1.90e-3),
    ("offset", 40e-3, 52e-3),
    ("offset_slope", 3.0e-3, 3.2e-3),
];

fn estimated(name: &str) -> Metrics {
    metrics_of(&example(name))
}

fn example(name: &str) -> Experiment {
    let path = Path::new("../../examples").join(name).join("experiment.toml");
    published().load(&path).unwrap_or_else(|e| panic!("{e}"))
}

fn metrics_of(experiment: &Experiment) -> Metrics {
    let outcome = workflow::estimate(published(), experiment, &Silent).unwrap_or_else(|e| panic!("{e}"));
    let metrics = Metrics::of(&outcome);
    println!("{}", summary_table(&metrics, true).to_text());
    metrics
}

fn of<'a>(metrics: &'a Metrics, key: &str) -> &'a EstimatorMetrics {
    metrics.estimators().find(|e| e.key == key).unwrap_or_else(|| panic!("no {key}"))
}

/// The root mean square error of a state, in SI.
fn rmse(estimator: &EstimatorMetrics, state: &str) -> f64 {
    estimator.values.get(state).unwrap_or_else(|| panic!("no {state}")).rmse
}

/// The filter with parameters passes and the one without does not: what is wrong in the file is not small.
fn only_the_filter_with_parameters_passes(metrics: &Metrics) {
    assert_eq!(of(metrics, "ekf_with_parameters").grade, Some(Grade::Passes));
    let without = of(metrics, "ekf").grade;
    assert!(matches!(without, Some(Grade::Failed | Grade::NoEstimate)), "{without:?}");
}

/// Each parameter that is a state ends within three of its standard deviations from the truth, and known five times better than
/// before.
fn parameters_are_found(metrics: &Metrics, truth: &[Truth]) {
    let parameters = &of(metrics, "ekf_with_parameters").parameters;
    assert_eq!(parameters.len(), truth.len());
    for (name, stated, simulated) in truth {
        let found = parameters.iter().find(|p| p.name == *name).unwrap_or_else(|| panic!("no {name}"));
        let deviation = if found.unit == "1" { simulated / stated - 1.0 } else { simulated - stated };
        let off = (found.end - deviation) / found.end_sd;
        println!("{name}: {:.4e} ± {:.1e}, in truth {deviation:.4e}: {off:.2} sd", found.end, found.end_sd);
        assert!(off.abs() < 3.0, "{name} is off by {off} of its standard deviations");
        assert!(found.end_sd < 0.2 * found.start_sd, "{name} is not found");
        assert!(found.fault.is_none(), "{name}: {:?}", found.fault);
    }
}

/// The noise of a sample is 1 mV at 0.2 V/µm, which is 5 nm.
#[test]
fn the_device_of_the_chapter_takes_forty_lines() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/comb_resonator/experiment.toml");
    let text = std::fs::read_to_string(file).unwrap();
    let lines = text.lines().filter(|line| !line.trim().is_empty() && !line.starts_with('#')).count();
    assert!(lines <= 40, "{lines}");
}

#[test]
fn the_comb_resonator_is_followed_below_the_noise_of_a_sample() {
    let metrics = estimated("comb_resonator");
    only_the_filter_with_parameters_passes(&metrics);
    parameters_are_found(&metrics, &COMB_RESONATOR);
    let [online, smoothed] =
        ["ekf_with_parameters", "ekf_with_parameters_smoothed"].map(|key| rmse(of(&metrics, key), "x"));
    // A filter that knew the device would be below 0.1 nm: what is left is the parameters, of which the first samples tell little.
    assert!(online < 0.5 * 5e-9 && smoothed < 0.1 * 5e-9, "{online:e} {smoothed:e}");
}

/// The noise of a sample is 50 µV behind 4.7 pF, which is 26 pm at 9 µC/m.
#[test]
fn the_tuning_fork_is_followed_through_its_feedthrough() {
    let metrics = estimated("tuning_fork");
    only_the_filter_with_parameters_passes(&metrics);
    parameters_are_found(&metrics, &TUNING_FORK);
    let error = rmse(of(&metrics, "ekf_with_parameters"), "x");
    assert!(error < 0.2 * 26e-12, "{error:e}");
}

/// The angular rate has an rms of 1 rad/s; the quadrature is as large as one of 5.25 rad/s, and stated a quarter too small.
#[test]
fn the_gyroscope_separates_the_angular_rate_from_its_quadrature() {
    let metrics = estimated("vibrating_gyroscope");
    only_the_filter_with_parameters_passes(&metrics);
    parameters_are_found(&metrics, &VIBRATING_GYROSCOPE);
    let [with, without] = ["ekf_with_parameters", "ekf"].map(|key| rmse(of(&metrics, key), "Omega"));
    assert!(with < 0.03 && without > 1.0, "{with} {without}");
}

/// The noise of a sample is 0.5 mV at 2.5 V/rad, which is 0.2 mrad.
#[test]
fn the_thermal_mirror_is_followed_though_its_bridge_feels_the_temperature() {
    let metrics = estimated("thermal_mirror");
    only_the_filter_with_parameters_passes(&metrics);
    parameters_are_found(&metrics, &THERMAL_MIRROR);
    let found = of(&metrics, "ekf_with_parameters");
    let error = rmse(found, "angle");
    assert!(error < 0.25 * 0.2e-3, "{error:e}");
    // No sensor sees the temperatures: they follow from the power and from what the frame does to the bridge.
    let [actuator, frame] = ["T_actuator", "T_frame"].map(|state| rmse(found, state));
    assert!(actuator < 0.1 && frame < 0.05, "{actuator} {frame}");
}

/// The actuator decays within 8 ms and nothing of it is random: over 1.2 s an inverse of its step would make 10⁶⁵ of what rounding leaves.
#[test]
fn the_thermal_mirror_is_smoothed_over_its_whole_recording() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/thermal_mirror/experiment.toml");
    let text = std::fs::read_to_string(&path).unwrap();
    let text = text
        .replace("skip = \"300 ms\"", "skip = \"20 ms\"")
        .replace("method = \"ekf\"", "method = \"ekf\"\nsmooth = true\nsmooth_lag = \"50 ms\"");
    let metrics = metrics_of(&published().parse(&text, &path).unwrap());
    let [filtered, smoothed, lagged] =
        ["", "_smoothed", "_lagged"].map(|answer| of(&metrics, &format!("ekf_with_parameters{answer}")));
    for answer in [smoothed, lagged] {
        assert!(answer.failure.is_none(), "{}: {:?}", answer.key, answer.failure);
        for state in ["angle", "T_actuator", "T_frame"] {
            println!(
                "{} {state}: {:e}, filtered {:e}",
                answer.key,
                rmse(answer, state),
                rmse(filtered, state)
            );
            // Of a temperature there is about one independent error: one in a hundred of its squares is above 6.6.
            let claim = answer.values[state].claim.unwrap();
            assert!(claim.mean_square < 6.6, "{} {state}: {claim:?}", answer.key);
        }
    }
    assert!(rmse(smoothed, "angle") < 0.4 * rmse(filtered, "angle"));
    assert!(rmse(lagged, "angle") < rmse(filtered, "angle"));
}

/// What `kalmems identify` does with an example: every parameter that its `[identify]` names is found from the recording alone, within
/// three and a half of its standard errors (of 23 numbers one is further away by chance once in a hundred times) and five times
/// better than it was known before; and with the numbers that are found the filter without parameters as states passes, which it did not before.
fn is_identified_from_its_recording_alone(name: &str, truth: &[Truth]) {
    let found = likeliest(published(), &example(name), &Silent).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(found.parameters.len(), truth.len());
    let metrics = metrics_of(&found.experiment);
    let states = &of(&metrics, "ekf_with_parameters").parameters;
    for (parameter, stated, simulated) in truth {
        let key = format!("parameters.{parameter}");
        let number = found.parameters.iter().find(|found| found.name == key).expect(parameter);
        let off = (number.value - simulated) / number.standard_error;
        println!(
            "{name} {parameter}: {:.6e} ± {:.1e}, simulated {simulated:.6e}: {off:.2} standard errors",
            number.value, number.standard_error
        );
        assert!(off.abs() < 3.5, "{parameter} is off by {off} standard errors");
        let state = states.iter().find(|state| state.name == *parameter).expect(parameter);
        let before = if state.unit == "1" { state.start_sd * stated.abs() } else { state.start_sd };
        assert!(number.standard_error < 0.2 * before, "{parameter} is not found");
    }
    assert_eq!(of(&metrics, "ekf").grade, Some(Grade::Passes));
}

#[test]
fn the_comb_resonator_is_identified_from_its_recording_alone() {
    is_identified_from_its_recording_alone("comb_resonator", &COMB_RESONATOR);
}

#[test]
fn the_tuning_fork_is_identified_from_its_recording_alone() {
    is_identified_from_its_recording_alone("tuning_fork", &TUNING_FORK);
}

#[test]
fn the_thermal_mirror_is_identified_from_its_recording_alone() {
    is_identified_from_its_recording_alone("thermal_mirror", &THERMAL_MIRROR);
}

#[test]
#[ignore = "slow: twenty seconds in a release build"]
fn slow_the_vibrating_gyroscope_is_identified_from_its_recording_alone() {
    is_identified_from_its_recording_alone("vibrating_gyroscope", &VIBRATING_GYROSCOPE);
}

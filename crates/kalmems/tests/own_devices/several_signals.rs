//! Several signals that correct one filter: all of them are in its likelihood, its mean NIS and its files.

use kalmems::config::Experiment;
use kalmems::estimate::SegmentEstimate;
use kalmems::progress::Silent;
use kalmems::recording::SampledRecording;
use kalmems::results::{Metrics, summary_text};
use kalmems::rigs::published;
use kalmems::workflow::estimate;
use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::path::Path;

/// A position that wanders, seen by an optical and a slower electrical sensor.
const STAGE: &str = r#"
name = "stage"
[device.equations]
states = { x = "m" }
derivative = { x = "0" }
parameters = { gain = "2 A/m", offset = "0.3 A" }
measure = { optical = "x in m", electrical = "gain*x + offset in A" }
noise = { optical = "0.04[m^2]", electrical = "0.25[A^2]", x = "9[m^2/s]" }
[[recording]]
role = "test"
file = "recording.csv"
clock = { column = "time_s" }
channels = { optical = "optical_m", electrical = "electrical_A" }
[estimate]
skip = "0 s"
[[estimate.filter]]
name = "Both"
method = "ekf"
gate = false
start = { x = "0 m" }
start_sd = { x = "1 m" }
"#;

const GAIN: f64 = 2.0;
const OFFSET: f64 = 0.3;
const ROWS: usize = 240;
const INTERVAL_S: f64 = 1e-3;

/// One measurement: its row, whether it is the electrical one, and its value.
type Measured = (usize, bool, f64);

/// Numbers of the standard normal distribution.
fn normal(state: &mut u64) -> f64 {
    let mut uniform = || {
        *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((*state >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
    };
    let (radius, angle) = ((-2.0 * uniform().ln()).sqrt(), TAU * uniform());
    radius * angle.cos()
}

/// The optical sensor lacks every third sample, the electrical one has every fourth, which are not all among those.
fn measured(electrical_is_off_by: f64) -> Vec<Measured> {
    let mut state = 7;
    let mut x = normal(&mut state);
    let mut all = Vec::new();
    for row in 0..ROWS {
        if row > 0 {
            x += (9.0 * INTERVAL_S).sqrt() * normal(&mut state);
        }
        if row % 3 != 0 {
            all.push((row, false, x + 0.2 * normal(&mut state)));
        }
        if row % 4 == 0 {
            all.push((row, true, GAIN * x + OFFSET + electrical_is_off_by + 0.5 * normal(&mut state)));
        }
    }
    all
}

fn written(all: &[Measured], folder: &Path) {
    let mut csv = "time_s,optical_m,electrical_A\n".to_owned();
    for row in 0..ROWS {
        let cell = |electrical: bool| {
            let of = all.iter().find(|(k, kind, _)| *k == row && *kind == electrical);
            of.map_or(String::new(), |(.., value)| format!("{value:?}"))
        };
        writeln!(csv, "{:?},{},{}", row as f64 * INTERVAL_S, cell(false), cell(true)).unwrap();
    }
    std::fs::write(folder.join("recording.csv"), csv).unwrap();
}

fn parsed(text: &str, folder: &Path) -> Experiment {
    published().parse(text, &folder.join("experiment.toml")).unwrap_or_else(|why| panic!("{why}"))
}

fn estimated(text: &str, folder: &Path) -> SegmentEstimate {
    let experiment = parsed(text, folder);
    let rig = published().rig(&experiment).unwrap();
    let layout = rig.layout(&experiment, 0).unwrap();
    let recording = SampledRecording::read(&folder.join("recording.csv"), &layout).unwrap();
    rig.estimate(&experiment, 0, &recording, &Silent).unwrap().swap_remove(0)
}

/// ln of the joint normal density of all measurements, from the covariance of the wandering position alone.
fn log_density(all: &[Measured]) -> f64 {
    let gain = |electrical: bool| if electrical { GAIN } else { 1.0 };
    let n = all.len();
    let mut factor = vec![vec![0.0; n]; n];
    for i in 0..n {
        for j in 0..=i {
            let ((k, a, _), (l, b, _)) = (all[i], all[j]);
            let wandered = 1.0 + 9.0 * INTERVAL_S * k.min(l) as f64;
            let noise = if i == j { if a { 0.25 } else { 0.04 } } else { 0.0 };
            let of_those_before: f64 = factor[i].iter().zip(&factor[j]).take(j).map(|(a, b)| a * b).sum();
            let left = gain(a) * gain(b) * wandered + noise - of_those_before;
            factor[i][j] = if i == j { left.sqrt() } else { left / factor[j][j] };
        }
    }
    let mut total = 0.0;
    let mut whitened = vec![0.0; n];
    for i in 0..n {
        let (_, electrical, value) = all[i];
        let of_those_before: f64 = factor[i].iter().zip(&whitened).take(i).map(|(a, b)| a * b).sum();
        let left = value - if electrical { OFFSET } else { 0.0 } - of_those_before;
        whitened[i] = left / factor[i][i];
        total -= 0.5 * (whitened[i].powi(2) + TAU.ln()) + factor[i][i].ln();
    }
    total
}

#[test]
fn the_likelihood_is_the_joint_density_of_all_signals() {
    let folder = tempfile::tempdir().unwrap();
    let all = measured(0.0);
    written(&all, folder.path());
    let joint = log_density(&all);
    // The gain as one model of a bank changes nothing where all models are the same.
    let bank = STAGE.replace(
        "method = \"ekf\"\ngate = false",
        "method = \"bank\"\ngate = false\nstates = { gain = { start_sd = \"1e-12\" } }",
    );
    for text in [STAGE, &bank] {
        let estimate = estimated(text, folder.path());
        let trajectory = &estimate.trajectories[0];
        let consistency = trajectory.consistency(0..trajectory.time_s.len()).unwrap();
        assert_eq!(consistency.updates, all.len());
        let error = consistency.log_likelihood - joint;
        assert!(error.abs() < 1e-6 * joint.abs(), "{} {joint}", consistency.log_likelihood);
    }
}

#[test]
fn a_signal_that_contradicts_the_device_is_in_the_mean_nis_and_named() {
    let folder = tempfile::tempdir().unwrap();
    // A change of the offset within the recording would be seen by its jump; this one is there from the beginning.
    written(&measured(3.0), folder.path());
    let outcome = estimate(published(), &parsed(STAGE, folder.path()), &Silent).unwrap();
    let metrics = Metrics::of(&outcome);
    let estimator = &metrics.recordings[0].segments[0].estimators[0];
    let [optical, electrical] = &estimator.by_signal[..] else { panic!("{:?}", estimator.by_signal) };
    assert_eq!((optical.signal.as_str(), electrical.signal.as_str()), ("optical", "electrical"));
    let total = estimator.consistency.unwrap();
    assert_eq!((optical.updates, electrical.updates, total.updates), (160, 60, 220));
    assert!(electrical.mean_nis > 5.0, "{electrical:?}");
    let pooled = (160.0 * optical.mean_nis + 60.0 * electrical.mean_nis) / 220.0;
    assert!((total.mean_nis - pooled).abs() < 1e-12 * pooled && !total.holds(), "{total:?}");
    let named = estimator.tests.iter().any(|test| test.signal.as_deref() == Some("electrical"));
    assert!(named, "{:?}", estimator.tests);
    // Each has a row of its own in the table that a run prints and that its report has.
    let table = summary_text(&metrics, false, 200);
    for signal in [optical, electrical] {
        let row = table.lines().find(|line| line.contains(&format!("signal {}", signal.signal)));
        let figures = [signal.mean_nis, signal.lower, signal.upper].map(|figure| format!("{figure:.3}"));
        assert!(row.is_some_and(|row| figures.iter().all(|figure| row.contains(figure))), "{table}");
    }
}

#[test]
fn filters_that_read_other_signals_are_not_compared_by_their_likelihoods() {
    let folder = tempfile::tempdir().unwrap();
    written(&measured(0.0), folder.path());
    let filter = &STAGE[STAGE.find("[[estimate.filter]]").unwrap()..];
    let second = filter.replace("Both", "Second");
    let optical = second.replace("method", "channels = [\"optical\"]\nmethod");
    for (other, is_compared) in [(&second, true), (&optical, false)] {
        let outcome = estimate(published(), &parsed(&format!("{STAGE}{other}"), folder.path()), &Silent);
        let metrics = Metrics::of(&outcome.unwrap());
        assert_eq!(metrics.recordings[0].segments[0].likeliest.is_some(), is_compared);
    }
}

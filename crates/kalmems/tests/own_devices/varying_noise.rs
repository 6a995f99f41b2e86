//! Noises whose sizes depend on the state: a filter takes them at its mean, a simulation at the true state.

use kalmems::config::Experiment;
use kalmems::estimate::Trajectory;
use kalmems::progress::Silent;
use kalmems::recording::SampledRecording;
use kalmems::rigs::published;
use kalmems::simulate::{ComputedRecording, described};
use std::path::Path;

/// A concentration that decays and is fed, whose fluctuations and whose readout's noise grow with it.
const CELL: &str = r#"
name = "cell"
[device.equations]
states = { x = "m" }
inputs = { feed = "m/s" }
interpolation = "hold"
parameters = { tau = "5 ms", dark = "1e-2 m^2", slope = "0.3", spread = "2e-2 m", warmth = "40 m/s" }
derivative = { x = "feed - x/tau" }
measure = { y = "x in m" }
[device.equations.noise]
y = "dark + (slope*x)^2"
x = "spread*abs(x)/tau + warmth*spread"
[simulate]
duration = "400 ms"
sampling_rate = "2 kHz"
integration_rate = "200 kHz"
seed = 1
start = { x = "2 m" }
[simulate.drive.inputs.feed.sine]
offset = "600 m/s"
amplitude = "500 m/s"
frequency = "20 Hz"
[estimate]
skip = "20 ms"
[[estimate.filter]]
name = "EKF"
method = "ekf"
gate = false
start = { x = "2 m" }
start_sd = { x = "0.5 m" }
"#;

const INTERVAL_S: f64 = 5e-4;
const TAU_S: f64 = 5e-3;

fn parsed(text: &str) -> Experiment {
    published().parse(text, Path::new("nowhere/experiment.toml")).unwrap_or_else(|why| panic!("{why}"))
}

fn recorded(text: &str) -> (Experiment, SampledRecording, ComputedRecording) {
    let experiment = parsed(text);
    let simulation = published().rig(&experiment).unwrap().simulate(&experiment).unwrap();
    let all = ComputedRecording::of(simulation.as_ref(), &Silent).unwrap();
    let experiment = described(&experiment, simulation.as_ref());
    let recording =
        all.recorded(&published().rig(&experiment).unwrap().layout(&experiment, 0).unwrap()).unwrap();
    (experiment, recording, all)
}

fn estimated(experiment: &Experiment, recording: &SampledRecording) -> Trajectory {
    let rig = published().rig(experiment).unwrap();
    rig.estimate(experiment, 0, recording, &Silent).unwrap().swap_remove(0).trajectories.swap_remove(0)
}

#[test]
fn a_filter_takes_each_noise_as_it_is_at_its_mean() {
    let (experiment, recording, all) = recorded(CELL);
    let columns = all.recorded_columns();
    let [feed, y] = ["feed_m_per_s", "y_m"]
        .map(|column| columns.iter().find(|(name, _)| *name == column).unwrap().1.clone());
    let trajectory = estimated(&experiment, &recording);
    // A scalar filter by hand: the decay and its noise over an interval are exact for a density that is held over it.
    let decay = (-INTERVAL_S / TAU_S).exp();
    let (mut x, mut p) = (2.0_f64, 0.25);
    for k in 0..y.len() {
        if k > 0 {
            let density = 2e-2 * x.abs() / TAU_S + 40.0 * 2e-2;
            p = decay * decay * p + density * 0.5 * TAU_S * (1.0 - decay * decay);
            x = decay * x + feed[k - 1] * TAU_S * (1.0 - decay);
        }
        let variance = 1e-2 + (0.3 * x).powi(2);
        let gain = p / (p + variance);
        x += gain * (y[k] - x);
        p *= 1.0 - gain;
        let [mean, sd] = [trajectory.states[0].mean[k], trajectory.states[0].sd[k]];
        assert!((mean - x).abs() < 1e-9 * p.sqrt(), "{k}: {mean} {x}");
        assert!((sd / p.sqrt() - 1.0).abs() < 1e-9, "{k}: {sd} {}", p.sqrt());
    }
}

#[test]
fn what_is_simulated_with_such_noises_is_claimed_by_a_filter_that_knows_them() {
    let held = CELL
        .replace("dark + (slope*x)^2", "dark + (slope*3[m])^2")
        .replace("spread*abs(x)/tau", "spread*3[m]/tau");
    let (mut knowing, mut not) = (0.0, 0.0);
    let (mut chance, mut count) = (0.0, 0);
    for seed in 100..140 {
        let seeded = |text: &str| text.replace("seed = 1", &format!("seed = {seed}"));
        let (experiment, recording, all) = recorded(&seeded(CELL));
        let truth = all.true_columns().swap_remove(1).1;
        let of = |trajectory: &Trajectory| -> Vec<f64> {
            let state = &trajectory.states[0];
            let each = state.mean.iter().zip(&state.sd).zip(&truth).skip(40);
            each.map(|((mean, sd), truth)| ((mean - truth) / sd).powi(2)).collect()
        };
        let errors = of(&estimated(&experiment, &recording));
        let mean = errors.iter().sum::<f64>() / errors.len() as f64;
        knowing += mean / 40.0;
        chance += mean * mean / 40.0;
        count += 1;
        let nis = estimated(&experiment, &recording).consistency(40..truth.len()).unwrap();
        let told = parsed(&seeded(&held));
        let simulation = published().rig(&told).unwrap().simulate(&told).unwrap();
        let told = described(&told, simulation.as_ref());
        not += estimated(&told, &recording).consistency(40..truth.len()).unwrap().mean_nis / 40.0;
        assert!((0.7..1.4).contains(&nis.mean_nis), "{seed}: {nis:?}");
    }
    // Of 40 runs, with the deviation that they show.
    let deviation = ((chance - knowing * knowing) / f64::from(count)).sqrt();
    assert!((knowing - 1.0).abs() < 4.0 * deviation + 0.05, "{knowing} {deviation}");
    assert!((not - 1.0).abs() > 0.1, "{not}");
}

#[test]
fn a_noise_that_vanishes_at_rest_and_one_that_is_exported_are_refused_with_the_reason() {
    let (experiment, recording, _) = recorded(CELL);
    let text = experiment.to_toml().unwrap().replace("dark + (slope*x)^2", "(slope*x)^2");
    let rig = published().rig(&experiment).unwrap();
    let refused = rig.estimate(&parsed(&text), 0, &recording, &Silent).unwrap_err().to_string();
    assert!(refused.contains("its size at rest is 0"), "{refused}");
}

//! Devices of one state, which have all that others have but a phase, and of as many states as there can be.

use crate::parts::{same_bits_in_a_stream, same_bits_in_parts};
use kalmems::config::Experiment;
use kalmems::diagnose::likeliest;
use kalmems::progress::Silent;
use kalmems::recording::SampledRecording;
use kalmems::rigs::published;
use kalmems::simulate::{ComputedRecording, described};
use std::fmt::Write as _;
use std::path::Path;

/// A voltage that follows its drive through one pole, and is measured with the drive in the signal.
const LAG: &str = r#"
name = "lag"
[device.equations]
states = { x = "V" }
inputs = { drive = "V" }
interpolation = "hold"
derivative = { x = "(drive - x)/tau" }
measure = { i = "drive - x in V" }
noise = { i = "1e-4[V^2]", x = "1e-2[V^2/s]" }
parameters = { tau = "1 ms" }
[simulate]
duration = "60 ms"
sampling_rate = "100 kHz"
integration_rate = "100 kHz"
seed = 4
start = { x = "0.2 V" }
[simulate.drive.inputs.drive.sine]
amplitude = "1 V"
frequency = "300 Hz"
[estimate]
skip = "5 ms"
"#;

fn filters(names: &[&str], further: &str) -> String {
    let mut text = LAG.to_owned();
    for name in names {
        let claims = if *name == "model" { "" } else { "start_sd = { x = \"0.3 V\" }\n" };
        let bandwidth = if *name == "luenberger" { "observer_bandwidth = \"50 Hz\"\n" } else { "" };
        write!(
            text,
            "[[estimate.filter]]\nname = \"{name}\"\nmethod = \"{name}\"\nstart = {{ x = \"0 V\" }}\n{claims}{bandwidth}{further}"
        )
        .unwrap();
    }
    text
}

fn simulated(text: &str) -> (Experiment, SampledRecording) {
    let experiment =
        published().parse(text, Path::new("nowhere/experiment.toml")).unwrap_or_else(|why| panic!("{why}"));
    let simulation = published().rig(&experiment).unwrap().simulate(&experiment).unwrap();
    let all = ComputedRecording::of(simulation.as_ref(), &Silent).unwrap();
    let experiment = described(&experiment, simulation.as_ref());
    let recording =
        all.recorded(&published().rig(&experiment).unwrap().layout(&experiment, 0).unwrap()).unwrap();
    (experiment, recording)
}

fn column(recording: &SampledRecording, name: &str) -> Vec<f64> {
    recording.column(name).unwrap().of(&recording.segments()[0]).to_vec()
}

/// Kalman's filter of one state and Rauch, Tung and Striebel's smoother in a few lines: the exact step of the pole under a held drive, and its
/// exact noise.
fn scalar_filter(recording: &SampledRecording) -> [Vec<[f64; 2]>; 2] {
    let (interval, tau, density, variance) = (1e-5_f64, 1e-3, 1e-2, 1e-4);
    let shrink = (-interval / tau).exp();
    let noise = density * tau / 2.0 * (1.0 - shrink * shrink);
    let (drive, seen) = (column(recording, "drive_V"), column(recording, "i_V"));
    let (mut x, mut p) = (0.0, 0.09);
    let (mut filtered, mut predicted) = (Vec::new(), Vec::new());
    for k in 0..seen.len() {
        if k > 0 {
            x = drive[k - 1] + (x - drive[k - 1]) * shrink;
            p = shrink * shrink * p + noise;
        }
        predicted.push([x, p]);
        let gain = -p / (p + variance);
        x += gain * (seen[k] - (drive[k] - x));
        p *= variance / (p + variance);
        filtered.push([x, p]);
    }
    let mut smoothed = filtered.clone();
    for k in (0..seen.len() - 1).rev() {
        let gain = filtered[k][1] * shrink / predicted[k + 1][1];
        smoothed[k][0] += gain * (smoothed[k + 1][0] - predicted[k + 1][0]);
        smoothed[k][1] += gain * gain * (smoothed[k + 1][1] - predicted[k + 1][1]);
    }
    [filtered, smoothed].map(|all| all.into_iter().map(|[mean, variance]| [mean, variance.sqrt()]).collect())
}

/// The recording as a file.
fn written(recording: &SampledRecording) -> String {
    let mut csv = "time_s,drive_V,i_V\n".to_owned();
    for (k, (drive, seen)) in column(recording, "drive_V").iter().zip(column(recording, "i_V")).enumerate() {
        writeln!(csv, "{:.5},{drive:e},{seen:e}", 1e-5 * k as f64).unwrap();
    }
    csv
}

#[test]
fn every_filter_of_one_state_is_that_of_a_few_lines() {
    let exact = ["ekf", "iterated_ekf", "ukf", "square_root_ekf", "square_root_ukf", "hybrid_ekf"];
    let others = ["model", "steady_state", "luenberger", "euler_ekf"];
    let (experiment, recording) = simulated(&filters(&[&exact[..], &others].concat(), ""));
    let rig = published().rig(&experiment).unwrap();
    let trajectories = rig.estimate(&experiment, 0, &recording, &Silent).unwrap().swap_remove(0).trajectories;
    let [expected, _] = scalar_filter(&recording);
    assert_eq!(trajectories.len(), exact.len() + others.len());
    for trajectory in &trajectories {
        let x = trajectory.state("x").unwrap();
        let settled = 2000..x.mean.len();
        let apart = |k: usize| (x.mean[k] - expected[k][0]).abs() / expected[k][1];
        let worst = |rows: std::ops::Range<usize>| rows.map(apart).fold(0.0_f64, f64::max);
        println!(
            "{}: {:.1e} of the claim, then {:.1e}",
            trajectory.key,
            worst(0..2000),
            worst(settled.clone())
        );
        let bound = match trajectory.key.as_str() {
            "model" | "luenberger" => continue,
            "steady_state" => 1e-9,
            // One step of Euler's method is off by h/(2·tau) of what the drive moves in a time constant.
            "euler_ekf" => 1.0,
            _ => {
                assert!(worst(0..2000) < 1e-9, "{}: {:e}", trajectory.key, worst(0..2000));
                let claim = |k: usize| (x.sd[k] / expected[k][1] - 1.0).abs();
                assert!((0..x.sd.len()).map(claim).fold(0.0_f64, f64::max) < 1e-9, "{}", trajectory.key);
                1e-9
            }
        };
        assert!(worst(settled.clone()) < bound, "{}: {:e}", trajectory.key, worst(settled));
    }
}

#[test]
fn one_state_is_smoothed_in_parts_and_in_a_stream() {
    let (experiment, recording) = simulated(&filters(&["ekf", "ukf"], "smooth = true\n"));
    let rig = published().rig(&experiment).unwrap();
    let trajectories = rig.estimate(&experiment, 0, &recording, &Silent).unwrap().swap_remove(0).trajectories;
    let [_, expected] = scalar_filter(&recording);
    for filter in ["ekf_smoothed", "ukf_smoothed"] {
        let x = trajectories.iter().find(|trajectory| trajectory.key == filter).unwrap().state("x").unwrap();
        for (k, [mean, sd]) in expected.iter().enumerate() {
            assert!((x.mean[k] - mean).abs() < 1e-9 * sd, "{filter}, {k}: {} {mean}", x.mean[k]);
            assert!((x.sd[k] / sd - 1.0).abs() < 1e-9, "{filter}, {k}: {} {sd}", x.sd[k]);
        }
    }
    same_bits_in_parts(&experiment, &recording, &[700, 4000]);

    // What a stream needs is the file.
    let folder = tempfile::tempdir().unwrap();
    let csv = written(&recording);
    std::fs::write(folder.path().join("recording.csv"), &csv).unwrap();
    let text = experiment.to_toml().unwrap().replace("smooth = true", "smooth_lag = \"0.1 ms\"")
        + "\n[stream]\nrate = \"100 kHz\"\n[stream.input.text]\ncolumns = [\"time_s\", \"drive_V\", \"i_V\"]\n";
    let experiment = published().parse(&text, &folder.path().join("experiment.toml")).unwrap();
    let rig = published().rig(&experiment).unwrap();
    let recording =
        SampledRecording::read(&folder.path().join("recording.csv"), &rig.layout(&experiment, 0).unwrap())
            .unwrap();
    same_bits_in_a_stream(&experiment, &recording, (csv.as_bytes(), 1000));
}

#[test]
fn the_time_constant_of_one_state_is_a_state_and_is_identified() {
    let further = "states = { tau = { start_sd = \"20 %\" } }\n";
    let text = filters(&["ekf", "consider_ekf"], further)
        .replace("duration = \"60 ms\"", "duration = \"100 ms\"")
        // What is simulated is driven between its samples too.
        .replace("interpolation = \"hold\"\n", "");
    let (experiment, recording) = simulated(&text);
    let told = experiment.to_toml().unwrap().replace("tau = \"1 ms\"", "tau = \"0.9 ms\"");
    let told = published().parse(&told, Path::new("nowhere/experiment.toml")).unwrap();
    let rig = published().rig(&told).unwrap();
    let trajectories = rig.estimate(&told, 0, &recording, &Silent).unwrap().swap_remove(0).trajectories;
    let tau = trajectories[0].state("tau").unwrap();
    let (mean, sd) = (*tau.mean.last().unwrap(), *tau.sd.last().unwrap());
    assert!(((1.0 + mean) * 0.9 - 1.0).abs() < 4.0 * sd * 0.9 && sd < 0.01, "{mean} {sd}");
    // What is considered and not estimated stays in the claim.
    let [estimated, considered] =
        [0, 1].map(|filter: usize| *trajectories[filter].state("x").unwrap().sd.last().unwrap());
    assert!(considered > 2.0 * estimated, "{considered} {estimated}");

    let folder = tempfile::tempdir().unwrap();
    let csv = written(&recording);
    std::fs::write(folder.path().join("recording.csv"), csv).unwrap();
    let text =
        experiment.to_toml().unwrap().replace("tau = \"1 ms\"", "tau = \"0.9 ms\"").replace(further, "");
    let text = format!("{text}\n[identify]\nparameters = [\"tau\"]\n");
    let experiment = published().parse(&text, &folder.path().join("experiment.toml")).unwrap();
    let found = likeliest(published(), &experiment, &Silent).unwrap();
    let of = &found.parameters[0];
    assert!((of.value - 1e-3).abs() < 4.0 * of.standard_error && of.standard_error < 1e-5, "{found:?}");
}

/// What a file says of a vector is written as its elements, so that what is found of one has a place.
#[test]
fn an_element_of_a_vector_of_parameters_is_identified() {
    let changes = [
        ("states = { x = \"V\" }", "states = { \"x[1..2]\" = \"V\" }"),
        ("interpolation = \"hold\"\n", ""),
        (
            "derivative = { x = \"(drive - x)/tau\" }",
            "derivative = { \"x[i=1..2]\" = \"(drive - x[i])/tau[i]\" }",
        ),
        ("drive - x in V", "x[1] - 2*x[2] in V"),
        ("{ i = \"1e-4[V^2]\", x = \"1e-2[V^2/s]\" }", "{ i = \"1e-4[V^2]\" }"),
        ("{ tau = \"1 ms\" }", "{ \"tau[1]\" = \"1 ms\", \"tau[2]\" = \"0.3 ms\" }"),
        ("start = { x = \"0.2 V\" }", "start = { \"x[1..2]\" = \"0.2 V\" }"),
    ];
    let filter = "[[estimate.filter]]\nname = \"EKF\"\nmethod = \"ekf\"\nstart = {}\nstart_sd = { \"x[1..2]\" = \"0.3 V\" }\n";
    let text = changes.iter().fold(format!("{LAG}{filter}"), |text, (from, to)| {
        assert!(text.contains(from), "{from}");
        text.replace(from, to)
    });
    let (experiment, recording) = simulated(&text);
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("recording.csv"), written(&recording)).unwrap();
    let told = experiment.to_toml().unwrap().replace("tau_2 = \"0.3 ms\"", "tau_2 = \"0.33 ms\"");
    assert!(told.contains("0.33 ms"), "{told}");
    let told = format!("{told}\n[identify]\nparameters = [\"tau_2\"]\n");
    let experiment = published().parse(&told, &folder.path().join("experiment.toml")).unwrap();
    let found = likeliest(published(), &experiment, &Silent).unwrap();
    let of = &found.parameters[0];
    assert!((of.value - 3e-4).abs() < 4.0 * of.standard_error && of.standard_error < 1e-5, "{found:?}");
    assert!(!found.experiment.to_toml().unwrap().contains("0.33 ms"));
}

/// Twelve masses between springs, written as vectors, of which three are seen.
const CHAIN: &str = r#"
name = "chain"
[device.equations]
states = { "x[1..12]" = "um", "v[1..12]" = "um/s" }
parameters = { w = "2000 rad/s", "b[1..12]" = "60 1/s" }
measure = { near = "x[2] in um", all = "sum(i = 1..12, x[i]) in um", far = "x[9] - x[8] in um" }
noise = { near = "1e-6[um^2]", all = "1e-5[um^2]", far = "1e-6[um^2]", "v[1..12]" = "1e2[um^2/s^3]" }
[device.equations.derivative]
"x[i=1..12]" = "v[i]"
"v[1]" = "w^2*(x[2] - 2*x[1]) - b[1]*v[1]"
"v[i=2..11]" = "w^2*(x[i-1] - 2*x[i] + x[i+1]) - b[i]*v[i]"
"v[12]" = "w^2*(x[11] - 2*x[12]) - b[12]*v[12]"
[simulate]
duration = "60 ms"
sampling_rate = "50 kHz"
integration_rate = "200 kHz"
seed = 3
start = { x_3 = "1 um" }
[simulate.drive.inputs]
[estimate]
skip = "10 ms"
[[estimate.filter]]
name = "EKF"
method = "ekf"
start = {}
start_sd = { "x[1..12]" = "0.5 um", "v[1..12]" = "1 mm/s" }
smooth = true
[[estimate.filter]]
name = "root"
method = "square_root_ekf"
start = {}
start_sd = { "x[1..12]" = "0.5 um", "v[1..12]" = "1 mm/s" }
"#;

#[test]
fn a_chain_of_twenty_four_states_is_simulated_estimated_and_smoothed() {
    let (experiment, recording) = simulated(CHAIN);
    let rig = published().rig(&experiment).unwrap();
    let trajectories = rig.estimate(&experiment, 0, &recording, &Silent).unwrap().swap_remove(0).trajectories;
    for trajectory in trajectories.iter().filter(|trajectory| !trajectory.key.ends_with("_smoothed")) {
        assert_eq!(trajectory.states.len(), 24, "{}", trajectory.key);
        let nis = trajectory.consistency(trajectory.scored(10e-3)).unwrap().mean_nis;
        assert!((0.9..1.1).contains(&nis), "{}: {nis}", trajectory.key);
    }
    // A covariance and its root are the same filter, and what is smoothed claims less.
    let state = |key: &str, name: &str| {
        trajectories.iter().find(|trajectory| trajectory.key == key).unwrap().state(name).unwrap().clone()
    };
    for k in [1, 6, 12] {
        let (a, b) = (state("ekf", &format!("x_{k}")), state("root", &format!("x_{k}")));
        let smoothed = state("ekf_smoothed", &format!("x_{k}"));
        for row in (0..a.mean.len()).step_by(97) {
            assert!((a.mean[row] - b.mean[row]).abs() < 1e-5 * a.sd[row], "{k} {row}");
            assert!(smoothed.sd[row] <= a.sd[row] * (1.0 + 1e-9), "{k} {row}");
        }
    }
    // A state more, and a filter that is not compiled for so many, are refused with what there is.
    let refused = |text: &str| {
        let (experiment, recording) = simulated(text);
        let estimated = published().rig(&experiment).unwrap().estimate(&experiment, 0, &recording, &Silent);
        estimated.map(|_| ()).map_err(|why| why.to_string())
    };
    let more = CHAIN.replace("start = {}\n", "start = {}\nstates = { w = { start_sd = \"1 %\" } }\n");
    assert!(refused(&more).unwrap_err().contains("24"), "{:?}", refused(&more));
    let other = refused(&CHAIN.replace("square_root_ekf", "ukf")).unwrap_err();
    assert!(other.contains("would have 24 states; there are filters of 1 to 12 by every method"), "{other}");
    let from_signal = refused(&CHAIN.replace("start = {}\n", "")).unwrap_err();
    assert!(from_signal.contains("at most 12; state `start` and `start_sd`"), "{from_signal}");
}

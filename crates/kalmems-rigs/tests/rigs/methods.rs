//! Every method of estimation with every published device: accepted and right, or refused for a reason of physics.
//!
//! Right is what stays close to the extended Kalman filter of the same device, whose own tests compare it with the truth, and
//! what says the same, to the last bit, of a recording that is taken in parts.

use kalmems_engines::config::Experiment;
use kalmems_engines::estimate::{SegmentEstimate, SegmentPart};
use kalmems_engines::progress::Silent;
use kalmems_engines::recording::{SampledRecording, Segment};
use kalmems_rigs::published;
use std::fmt::Write as _;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use toml::{Table, Value};

/// All words of a filter's `method`.
const METHODS: [&str; 15] = [
    "model",
    "ekf",
    "ukf",
    "square_root_ekf",
    "square_root_ukf",
    "iterated_ekf",
    "euler_ekf",
    "hybrid_ekf",
    "consider_ekf",
    "bank",
    "steady_state",
    "kalman_bucy",
    "luenberger",
    "lock_in",
    "direct_inversion",
];

/// A device, an example of it, and what its filters are started with.
struct Device {
    name: &'static str,
    file: &'static str,
    /// The state that the device is for.
    state: &'static str,
    start: &'static str,
    start_sd: &'static str,
    /// Parameters as states, for methods that ask for them.
    states: &'static str,
    /// Process noise that covers what Euler's method leaves out, where that of the example does not.
    euler: &'static str,
    /// What the example has wrong on purpose, and what is right. A lock-in takes the sensor as it is told, and a loop of 40 Hz
    /// follows a resonance that is 5 Hz off with an error of 0.12 rad: both are compared where they are told right.
    corrected: &'static [[&'static str; 2]],
    /// By how much of its root mean square a method may be off the extended filter.
    close: f64,
    /// The methods that its physics does not allow.
    refused: &'static [&'static str],
}

const DEVICES: [Device; 7] = [
    Device {
        name: "shared scanner",
        file: "shared_scanner/true_stiffness.toml",
        state: "angle",
        start: r#"{ angle = "0.05 rad", rate = "0 rad/s" }"#,
        start_sd: r#"{ angle = "0.15 rad", rate = "15e3 rad/s" }"#,
        states: r#"{ stiffness = { start_sd = "0.1 %" } }"#,
        euler: "",
        corrected: &[],
        close: 0.03,
        refused: &["direct_inversion"],
    },
    Device {
        name: "two axes",
        file: "shared_scanner/two_axes.toml",
        state: "angle_x",
        start: r#""from_signal""#,
        start_sd: "",
        states: r#"{ stiffness_x = { start_sd = "0.1 %" } }"#,
        euler: "process_noise = { angular_acceleration_x = \"1e9 rad^2/s^3\", angular_acceleration_y = \"1e9 rad^2/s^3\" }\n",
        corrected: &[],
        close: 0.03,
        refused: &["direct_inversion"],
    },
    Device {
        name: "threshold scanner",
        file: "threshold_scanner/as_published.toml",
        state: "angle",
        start: r#"{ angle = "-0.102 rad", rate = "413 rad/s" }"#,
        start_sd: r#"{ angle = "5 mrad", rate = "20 rad/s" }"#,
        states: r#"{ natural_frequency = { start_sd = "0.1 %" } }"#,
        euler: "",
        corrected: &[
            ["629.6 Hz", "624.6 Hz"],
            ["7.7 mrad", "3.7 mrad"],
            ["3.1 mV s/rad", "2.82 mV s/rad"],
            ["54.5 1/rad", "76 1/rad"],
        ],
        close: 0.05,
        refused: &["direct_inversion"],
    },
    Device {
        name: "accelerometer",
        file: "accelerometer/experiment.toml",
        state: "acceleration",
        start: r#"{ displacement = "0 m", velocity = "0 m/s", acceleration = "0 m/s^2", jerk = "0 m/s^3" }"#,
        start_sd: r#"{ displacement = "10 nm", velocity = "10 um/s", acceleration = "1 gn", jerk = "314 gn/s" }"#,
        states: r#"{ mass = { start_sd = "1 %" } }"#,
        euler: "",
        corrected: &[],
        close: 0.25,
        refused: &["lock_in"],
    },
    Device {
        name: "micro-stage",
        file: "micro_stage/as_published.toml",
        state: "angle",
        start: r#""from_signal""#,
        start_sd: r#"{ angle = "50 urad", rate = "1 rad/s" }"#,
        states: r#"{ natural_frequency = { start_sd = "0.1 %" } }"#,
        euler: "",
        corrected: &[],
        close: 0.03,
        refused: &["direct_inversion"],
    },
    Device {
        name: "piston mirror",
        file: "piston_mirror/experiment.toml",
        state: "position",
        start: r#""from_signal""#,
        start_sd: "",
        states: r#"{ gain = { start_sd = "0.1 %" } }"#,
        euler: "",
        corrected: &[],
        close: 5e-4,
        refused: &[],
    },
    Device {
        name: "own equations",
        file: "comb_resonator/simulation.toml",
        state: "x",
        start: r#"{ x = "0 m", v = "0 m/s" }"#,
        start_sd: r#"{ x = "0.5 um", v = "30 mm/s" }"#,
        states: r#"{ k = { start_sd = "0.1 %" } }"#,
        // What Euler's method adds to the velocity of 0.3 m/s in a step of 2 us: 0.8 %.
        euler: "process_noise = { v = \"3 m^2/s^3\" }\n",
        // What a lock-in has to know beside the equations.
        corrected: &[[
            "[device.equations.measure]",
            "[device.equations.oscillation]\nof = \"x\"\n\n[device.equations.measure]",
        ]],
        close: 0.05,
        refused: &["direct_inversion"],
    },
];

fn example(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples").join(file)
}

/// The text of the example with one filter of this method, or why the rig refuses it.
fn with_method(device: &Device, text: &str, method: &str) -> String {
    let mut file: Table = text.parse().unwrap();
    let mut filter = format!("name = \"{method}\"\nmethod = \"{method}\"\n");
    let claims = !["model", "lock_in", "direct_inversion"].contains(&method);
    if !["lock_in", "direct_inversion"].contains(&method) {
        writeln!(filter, "start = {}", device.start).unwrap();
    }
    if claims && !device.start_sd.is_empty() {
        writeln!(filter, "start_sd = {}", device.start_sd).unwrap();
    }
    if ["consider_ekf", "bank"].contains(&method) {
        writeln!(filter, "states = {}", device.states).unwrap();
    }
    if method == "euler_ekf" {
        filter.push_str(device.euler);
    }
    if method == "luenberger" {
        // A loop on the mean over the cycles of the motion is much slower than they are.
        let bandwidth = match device.name {
            "piston mirror" => "5 Hz",
            "threshold scanner" => "40 Hz",
            _ => "600 Hz",
        };
        writeln!(filter, "observer_bandwidth = \"{bandwidth}\"").unwrap();
    }
    // One gain for all times is for one signal.
    if device.name == "micro-stage" && ["luenberger", "steady_state", "kalman_bucy"].contains(&method) {
        filter.push_str("channels = [\"1A\"]\n");
    }
    let estimate = file["estimate"].as_table_mut().unwrap();
    estimate.insert("filter".into(), Value::Array(vec![Value::Table(filter.parse().unwrap())]));
    toml::to_string(&file).unwrap()
}

/// The example's text with a recording that it simulates, where it has none.
fn with_recording(device: &Device, folder: &Path) -> (String, PathBuf) {
    let path = example(device.file);
    let text = std::fs::read_to_string(&path).unwrap();
    if text.contains("[[recording]]") {
        return (text, path);
    }
    let experiment = published().parse(&text, &path).unwrap();
    let simulation = published().rig(&experiment).unwrap().simulate(&experiment).unwrap();
    let mut csv = String::from("time_s");
    let mut channels = String::new();
    for channel in simulation.recorded() {
        write!(csv, ",{}", channel.column).unwrap();
        write!(channels, "{} = \"{}\", ", channel.meaning, channel.column).unwrap();
    }
    csv.push('\n');
    simulation
        .run(&mut |sample| {
            write!(csv, "{:.9}", sample.time_s).unwrap();
            sample.recorded.iter().for_each(|value| write!(csv, ",{value:e}").unwrap());
            csv.push('\n');
            ControlFlow::Continue(())
        })
        .unwrap();
    std::fs::write(folder.join("recording.csv"), csv).unwrap();
    let recording = format!(
        "\n[[recording]]\nrole = \"test\"\nfile = \"recording.csv\"\nclock = {{ column = \"time_s\" }}\nchannels = {{ {} }}\n",
        channels.trim_end_matches(", ")
    );
    (text + &recording, folder.join("experiment.toml"))
}

pub(super) fn estimate(experiment: &Experiment) -> Result<SegmentEstimate, String> {
    let rig = published().rig(experiment).map_err(|why| why.to_string())?;
    let wanted = rig.wanted(experiment).map_err(|why| why.to_string())?;
    let index = wanted[0];
    let file = experiment.resolve(&experiment.recording(index).unwrap().file);
    let recording = SampledRecording::read(&file, &rig.layout(experiment, index).unwrap()).unwrap();
    let mut found = rig.estimate(experiment, index, &recording, &Silent).map_err(|why| why.to_string())?;
    let found = found.remove(0);
    let bits = |values: &[f64]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
    let parts = in_parts(experiment, (index, &recording), &found.segment);
    for (state, of_parts) in found.trajectories[0].states.iter().zip(parts) {
        let key = &found.trajectories[0].key;
        assert_eq!(bits(&state.mean), bits(&of_parts), "{} {key} in parts", state.name);
    }
    Ok(found)
}

/// Rows of a part, where a rig does not need more of them at once.
const PART: usize = 4_999;

/// The states of the first answer over a segment that is taken in parts.
fn in_parts(
    experiment: &Experiment,
    (index, recording): (usize, &SampledRecording),
    segment: &Segment,
) -> Vec<Vec<f64>> {
    let rig = published().rig(experiment).unwrap();
    let mut estimator = rig.estimator(experiment, index, &Silent).unwrap();
    let around = estimator.around(segment.time.interval_s().unwrap());
    let (rows, mut all, mut from) = (segment.time.len(), Vec::new(), 0);
    while from < rows {
        let end = if from == 0 { around.head.max(PART) } else { from + PART };
        let end = if end + around.after >= rows { rows } else { end };
        let there = from.saturating_sub(around.before)..(end + around.after).min(rows);
        let part = SegmentPart {
            recording,
            segment: &segment.part(&there),
            fresh: from - there.start..end - there.start,
            begins: from == 0,
            ends: end == rows,
        };
        let states = estimator.take(&part).unwrap().trajectories.swap_remove(0).states;
        all.resize(states.len(), Vec::new());
        all.iter_mut().zip(states).for_each(|(all, state): (&mut Vec<f64>, _)| all.extend(state.mean));
        from = end;
    }
    all
}

/// The state that the device is for, where the filter has settled.
fn settled(device: &Device, estimate: &SegmentEstimate) -> Vec<f64> {
    let trajectory = &estimate.trajectories[0];
    assert!(trajectory.failure.is_none(), "{}: {:?}", device.name, trajectory.failure);
    let from = trajectory.time_s.partition_point(|t| *t < estimate.from_s());
    trajectory.state(device.state).unwrap().mean[from..].to_vec()
}

/// The root mean square of what it claims of that state, where it has settled.
fn claimed(device: &Device, estimate: &SegmentEstimate) -> f64 {
    let trajectory = &estimate.trajectories[0];
    let from = trajectory.time_s.partition_point(|t| *t < estimate.from_s());
    root_mean_square(&trajectory.state(device.state).unwrap().sd[from..])
}

fn root_mean_square(values: &[f64]) -> f64 {
    (values.iter().map(|x| x * x).sum::<f64>() / values.len() as f64).sqrt()
}

/// What a method says of the example with this text.
fn found(device: &Device, (text, path): (&str, &Path), method: &str) -> Result<SegmentEstimate, String> {
    let text = with_method(device, text, method);
    published().parse(&text, path).map_err(|why| why.to_string()).and_then(|e| estimate(&e))
}

#[test]
fn every_method_is_right_with_every_device_or_refused_for_a_reason() {
    let folder = tempfile::tempdir().unwrap();
    let mut accepted = 0;
    let (mut table, mut problems) = (String::new(), Vec::new());
    for device in &DEVICES {
        let (text, path) = with_recording(device, folder.path());
        let of = |text: &str, method: &str| found(device, (text, &path), method);
        let correct = |text: String, [wrong, right]: &[&str; 2]| text.replace(wrong, right);
        let corrected = device.corrected.iter().fold(text.clone(), correct);
        for method in METHODS {
            let text = if ["lock_in", "luenberger"].contains(&method) { &corrected } else { &text };
            let ekf = settled(device, &of(text, "ekf").unwrap());
            let size = root_mean_square(&ekf);
            match (of(text, method), !device.refused.contains(&method)) {
                (Ok(found), true) => {
                    accepted += 1;
                    let found = settled(device, &found);
                    let apart: Vec<f64> =
                        ekf.iter().zip(&found).map(|(a, b)| a - b).filter(|x| x.is_finite()).collect();
                    assert!(apart.len() > ekf.len() / 2, "{} {method}", device.name);
                    let off = root_mean_square(&apart) / size;
                    writeln!(table, "{:18} {method:16} {off:.2e}", device.name).unwrap();
                    let close = match (method, device.name) {
                        // Knows nothing of where the motion is.
                        ("model", _) => f64::INFINITY,
                        // Adds energy at every step.
                        ("euler_ekf", _) => 0.2,
                        // Takes the motion to be steady within a window: a decay of 4 % in a cycle leaves 1.2 %.
                        ("lock_in", _) => device.close.min(0.02),
                        // Takes the mass to follow at once: at 10 Hz, on a spring of 241 Hz with so much damping, 41 mrad late.
                        ("direct_inversion", "accelerometer") => 0.045,
                        // Holds each sample for the 6.4 us until the next: late by half of that, 35 mrad of the motion.
                        ("kalman_bucy", "micro-stage") => 0.04,
                        _ => device.close,
                    };
                    if off >= close {
                        problems.push(format!("{} {method}: off by {off:.2e}", device.name));
                    }
                }
                (Err(why), false) => {
                    writeln!(table, "{:18} {method:16} {}", device.name, why.lines().last().unwrap())
                        .unwrap();
                    if !why.contains("estimate.filter[0]") {
                        problems.push(format!("{} {method}: {why}", device.name));
                    }
                }
                (Ok(_), false) => problems.push(format!("{} takes {method}", device.name)),
                (Err(why), true) => problems.push(format!("{} refuses {method}: {why}", device.name)),
            }
        }
    }
    println!("{table}{accepted} of {}", DEVICES.len() * METHODS.len());
    assert!(problems.is_empty(), "{problems:#?}");
    assert_eq!(accepted, 99);
}

/// Those that a device has and its methods take, from a start that the signal tells: how far each is off the extended filter that is told
/// its start, where both have settled.
fn started_from_the_signal(methods: &[&str], folder: &Path) -> Vec<String> {
    let mut problems = Vec::new();
    for device in &DEVICES {
        let (text, path) = with_recording(device, folder);
        let correct = |text: String, [wrong, right]: &[&str; 2]| text.replace(wrong, right);
        let text = device.corrected.iter().fold(text, correct);
        let ekf = settled(device, &found(device, (&text, &path), "ekf").unwrap());
        let unstated = Device { start: "\"from_signal\"", start_sd: "", ..*device };
        for method in methods.iter().filter(|method| !device.refused.contains(method)) {
            match found(&unstated, (&text, &path), method) {
                Ok(found) => {
                    let found = settled(device, &found);
                    let apart: Vec<f64> = ekf.iter().zip(&found).map(|(a, b)| a - b).collect();
                    let off = root_mean_square(&apart) / root_mean_square(&ekf);
                    println!("{:18} {method:16} {off:.2e}", device.name);
                    let close = if *method == "euler_ekf" { 0.2 } else { device.close };
                    if off.is_nan() || (*method != "model" && off >= close) {
                        problems.push(format!("{} {method}: off by {off:.2e}", device.name));
                    }
                }
                Err(why) => problems.push(format!("{} refuses {method}: {why}", device.name)),
            }
        }
    }
    problems
}

#[test]
fn a_start_from_the_signal_needs_no_deviation_with_any_device() {
    let folder = tempfile::tempdir().unwrap();
    let problems = started_from_the_signal(&["ekf"], folder.path());
    assert!(problems.is_empty(), "{problems:#?}");
}

#[test]
#[ignore = "slow: every method with every device"]
fn slow_every_method_starts_from_the_signal() {
    let folder = tempfile::tempdir().unwrap();
    let with_a_start: Vec<&str> =
        METHODS.into_iter().filter(|method| !["lock_in", "direct_inversion"].contains(method)).collect();
    let problems = started_from_the_signal(&with_a_start, folder.path());
    assert!(problems.is_empty(), "{problems:#?}");
}

/// A settled gain claims what the extended filter claims once it has settled, where the motion is steady.
#[test]
fn a_gain_that_turns_with_the_swing_claims_what_the_filter_settles_at() {
    let folder = tempfile::tempdir().unwrap();
    for device in DEVICES.iter().filter(|device| ["shared scanner", "two axes"].contains(&device.name)) {
        let (text, path) = with_recording(device, folder.path());
        let of = |method: &str| claimed(device, &found(device, (&text, &path), method).unwrap());
        let ekf = of("ekf");
        for method in ["steady_state", "kalman_bucy"] {
            let ratio = of(method) / ekf;
            println!("{} {method}: {ratio:.4}", device.name);
            assert!((ratio - 1.0).abs() < 0.05, "{} {method}: {ratio}", device.name);
        }
    }
}

/// With a parallel plate a gain that is off moves the position and shows in no innovation: a filter that considers the gain
/// claims as much as a wrong gain does to the extended filter, and so do models with other gains, none of which the signal
/// prefers.
#[test]
fn what_a_gain_does_to_the_position_is_in_what_filters_of_uncertain_gains_claim() {
    let device = DEVICES.iter().find(|device| device.name == "piston mirror").unwrap();
    let (text, path) = with_recording(device, Path::new("."));
    let of = |text: &str, method: &str| found(device, (text, &path), method).unwrap();
    let right = of(&text, "ekf");
    // Off by the 0.1 % that the filters are told.
    let wrong = of(&text.replace("109.3 fF", "109.4093 fF"), "ekf");
    let apart: Vec<f64> =
        settled(device, &right).iter().zip(settled(device, &wrong)).map(|(a, b)| a - b).collect();
    let apart = root_mean_square(&apart);
    assert!(claimed(device, &right) < 0.02 * apart);
    // Of models at 0 and at both sides, equally likely, the variance is two thirds of that of either side.
    for (method, share) in [("consider_ekf", 1.0), ("bank", (2.0_f64 / 3.0).sqrt())] {
        let ratio = claimed(device, &of(&text, method)) / (share * apart);
        println!("{method}: {ratio:.4} of {apart:.2e} m");
        assert!((ratio - 1.0).abs() < 0.02, "{method}: {ratio}");
    }
}

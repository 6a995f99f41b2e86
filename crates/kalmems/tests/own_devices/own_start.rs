//! A device of one's own whose filters start from the signal.

use crate::parts::same_bits_in_parts;
use kalmems::config::Experiment;
use kalmems::estimate::Trajectory;
use kalmems::progress::Silent;
use kalmems::recording::SampledRecording;
use kalmems::results::Metrics;
use kalmems::rigs::published;
use kalmems::simulate::{ComputedRecording, WhiteNoise, described};
use kalmems::workflow::{Outcome, estimate_computed};
use std::fmt::Write as _;
use std::path::Path;

/// The comb resonator of the example with other filters.
fn comb(filters: &str) -> String {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/comb_resonator/simulation.toml");
    let text = std::fs::read_to_string(file).unwrap();
    let before = text.split("[estimate]").next().unwrap();
    format!("{before}[estimate]\nskip = \"1 ms\"\n{filters}")
}

const FROM_SIGNAL: &str = "[[estimate.filter]]\nname = \"EKF\"\nmethod = \"ekf\"\nstart = \"from_signal\"\n";

fn parse(text: &str) -> Result<Experiment, String> {
    published().parse(text, Path::new("nowhere/experiment.toml")).map_err(|error| error.to_string())
}

/// A simulated recording, and the experiment that describes it.
fn simulated(text: &str) -> (Experiment, ComputedRecording) {
    let experiment = parse(text).unwrap_or_else(|error| panic!("{error}\n{text}"));
    let simulation = published().rig(&experiment).unwrap().simulate(&experiment).unwrap();
    let all = ComputedRecording::of(simulation.as_ref(), &Silent).unwrap();
    (described(&experiment, simulation.as_ref()), all)
}

fn outcome(text: &str) -> Result<Outcome, String> {
    let (experiment, all) = simulated(text);
    estimate_computed(published(), &experiment, &all, &Silent).map_err(|error| error.to_string())
}

fn recording(experiment: &Experiment, all: &ComputedRecording) -> SampledRecording {
    all.recorded(&published().rig(experiment).unwrap().layout(experiment, 0).unwrap()).unwrap()
}

/// The filters' trajectories, each with the true states at its first row.
fn trajectories(text: &str) -> Vec<Trajectory> {
    let (experiment, all) = simulated(text);
    let rig = published().rig(&experiment).unwrap();
    let mut estimates = rig.estimate(&experiment, 0, &recording(&experiment, &all), &Silent).unwrap();
    estimates.swap_remove(0).trajectories
}

/// How many standard deviations x, v and the output of the amplifier are off at the first sample, for a start by chance.
fn off(seed: u64) -> [f64; 3] {
    let mut chance = WhiteNoise::new(seed, 77);
    // From a tenth of the motion at resonance to all of it.
    let (size, phase) = (1e-6 + 14e-6 * chance.uniform(), std::f64::consts::TAU * chance.uniform());
    let (x, v) = (size * phase.cos(), size * 6.28e4 * phase.sin());
    let output = 0.2e6 * x * chance.uniform();
    let text =
        comb(FROM_SIGNAL).replace("seed = 1", &format!("seed = {seed}")).replace("40 ms", "4 ms").replace(
            "start = { x = \"0 m\", v = \"0 m/s\" }\n\n",
            &format!("start = {{ x = \"{x:e} m\", v = \"{v:e} m/s\", output = \"{output:e} V\" }}\n\n"),
        );
    assert!(text.contains("output = \""), "{text}");
    let trajectory = &trajectories(&text)[0];
    // The samples that told the start are not used a second time.
    assert!(trajectory.counts.for_start > 100, "{:?}", trajectory.counts);
    let error = |name: &str, truth: f64| {
        let state = trajectory.state(name).unwrap();
        (state.mean[0] - truth) / state.sd[0]
    };
    [error("x", x), error("v", v), error("output", output)]
}

/// Seeds that nothing was chosen by. For each state the sum of 60 squares follows the χ² law of 60 degrees: 99.8 % lie within
/// 31.7 … 99.6. Of 60 intervals of 95 %, 51 or more hold the truth (99.8 %).
#[test]
fn the_start_of_a_driven_resonator_is_found_as_well_as_it_is_claimed() {
    let all: Vec<[f64; 3]> = (5000..5060).map(off).collect();
    for state in 0..3 {
        let sum: f64 = all.iter().map(|off| off[state] * off[state]).sum();
        let within = all.iter().filter(|off| off[state].abs() < 1.96).count();
        println!("state {state}: sum of squares {sum:.1} of 60, {within} of 60 within 95 %");
        assert!((31.7..99.6).contains(&sum), "{state}: {sum}");
        assert!(within >= 51, "{state}: {within}");
    }
}

#[test]
fn every_filter_goes_on_from_a_start_from_the_signal() {
    let mut filters = "process_noise = { v = \"1e-7 m^2/s^3\" }\n".to_owned();
    let methods = ["model", "ekf", "ukf", "square_root_ekf", "square_root_ukf", "iterated_ekf", "hybrid_ekf"];
    for method in methods {
        filters += &FROM_SIGNAL.replace("EKF", method).replace("\"ekf\"", &format!("\"{method}\""));
    }
    filters += &FROM_SIGNAL.replace("EKF", "with k");
    filters += "states = { k = { start_sd = \"0.5 %\" } }\nsmooth = true\n";
    let text = comb(&filters).replace("start = { x = \"0 m\"", "start = { x = \"-8 um\"");
    let outcome = outcome(&text).unwrap();
    let segment = &outcome.recordings[0].segments[0];
    let trajectories = &segment.estimate.trajectories;
    assert_eq!(trajectories.len(), methods.len() + 2);
    for (trajectory, errors) in trajectories.iter().zip(&segment.values) {
        let of = &errors["x"];
        // The motion is 10 um wide.
        assert!(of.rmse < 2e-8, "{}: {:e}", trajectory.key, of.rmse);
        if trajectory.key == "model" {
            assert_eq!(trajectory.counts.for_start, 0);
            continue;
        }
        assert!(of.within_three_sigma.unwrap() > 0.98, "{}: {:?}", trajectory.key, of.within_three_sigma);
        let nis = trajectory.consistency(trajectory.scored(1e-3)).unwrap().mean_nis;
        assert!((0.95..1.05).contains(&nis), "{}: {nis}", trajectory.key);
    }
}

#[test]
fn a_recording_in_parts_starts_from_its_signal_to_the_last_bit() {
    let filters = format!("process_noise = {{ v = \"1e-7 m^2/s^3\" }}\n{FROM_SIGNAL}");
    let (experiment, all) = simulated(&comb(&filters));
    same_bits_in_parts(&experiment, &recording(&experiment, &all), &[1000, 7000]);
}

/// A resonator that is measured by the square of its motion, with a state that nothing depends on.
const SQUARE: &str = r#"
name = "square"
[device.equations]
states = { x = "m", v = "m/s", hidden = "K" }
[device.equations.derivative]
x = "v"
v = "-(6283[rad/s])^2*x - 20[1/s]*v"
hidden = "0[K/s]"
[device.equations.measure]
signal = "(1[V/um^2])*x^2 in V"
[device.equations.noise]
signal = "1e-6[V^2]"
[simulate]
duration = "20 ms"
sampling_rate = "100 kHz"
integration_rate = "100 kHz"
start = { x = "1.3 um", v = "2 mm/s", hidden = "300 K" }
[simulate.drive.inputs]
[estimate]
skip = "10 ms"
"#;

#[test]
fn a_start_that_the_signal_does_not_determine_is_reported_with_what_to_write() {
    // Its noise is a thousandth of what there is.
    let mut filtered = comb(FROM_SIGNAL).replace("40 ms", "4 ms");
    filtered = filtered.replace("sensitivity*x in V", "sensitivity*0*x in V");
    let cases = [
        ("a state that nothing depends on", format!("{SQUARE}{FROM_SIGNAL}")),
        ("a signal that shows no motion", filtered),
    ];
    let mut told = String::new();
    for (what, text) in cases {
        writeln!(told, "{what}:\n{}\n", outcome(&text).map(|_| ()).expect_err(what)).unwrap();
    }
    insta::assert_snapshot!(told);
    // What is asked for helps.
    let sd = "start_sd = { hidden = \"20 K\" }\n";
    let both = format!("{SQUARE}{FROM_SIGNAL}{sd}");
    // The sign that a square hides is arbitrary.
    assert_eq!(
        Metrics::of(&outcome(&both).unwrap()).recordings[0].segments[0].arbitrary.signs,
        ["x", "hidden"]
    );
    let linear = both.replace("(1[V/um^2])*x^2", "(1[V/um])*x");
    let outcome = outcome(&linear).unwrap();
    let trajectory = &outcome.recordings[0].segments[0].estimate.trajectories[0];
    assert!((trajectory.state("hidden").unwrap().sd[0] - 20.0).abs() < 1e-6);
    assert!(trajectory.state("x").unwrap().sd[0] < 1e-9);
}

/// A free oscillation whose resonance is a state, behind a lag of the readout.
const LAGGED: &str = r#"
name = "lagged"
[device.equations]
states = { x = "m", v = "m/s", f0 = "Hz" }
[device.equations.derivative]
x = "v"
v = "-(2*pi*f0)^2*x - 200[1/s]*v"
f0 = "0[Hz/s]"
[device.equations.lag]
output = { of = "(1[V/um])*x in V", time = "4[us]" }
[device.equations.measure]
signal = "output in V"
[device.equations.noise]
signal = "1e-6[V^2]"
f0 = "1[Hz^2/s]"
[simulate]
duration = "20 ms"
sampling_rate = "500 kHz"
integration_rate = "2 MHz"
start = { x = "1.3 um", v = "20 mm/s", f0 = "10.02 kHz" }
[simulate.drive.inputs]
[estimate]
skip = "5 ms"
"#;

#[test]
fn a_resonance_that_is_a_state_is_the_motion_and_not_the_pole_of_a_lag() {
    let about = "start_about = { f0 = \"10 kHz\" }\nstart_sd = { f0 = \"50 Hz\" }\n";
    let (experiment, all) = simulated(&format!("{LAGGED}{FROM_SIGNAL}{about}"));
    let rig = published().rig(&experiment).unwrap();
    let estimate =
        rig.estimate(&experiment, 0, &recording(&experiment, &all), &Silent).unwrap().swap_remove(0);
    assert!((estimate.motion.frequency_hz / 1e4 - 1.0).abs() < 1e-3, "{}", estimate.motion.frequency_hz);
    let trajectory = &estimate.trajectories[0];
    // Some cycles of 50 samples tell the start, and none of them is used twice.
    assert!((1..2000).contains(&trajectory.counts.for_start), "{:?}", trajectory.counts);
    assert!(trajectory.lock.held(), "{:?}", trajectory.lock);
    let f0 = trajectory.state("f0").unwrap();
    for k in [0, trajectory.time_s.len() - 1] {
        assert!((f0.mean[k].abs() - 10_020.0).abs() < 5.0 * f0.sd[k], "{}: {} ± {}", k, f0.mean[k], f0.sd[k]);
    }
    assert!(f0.sd.last().unwrap() < &5.0);
    let nis = trajectory.consistency(trajectory.scored(5e-3)).unwrap().mean_nis;
    assert!((0.95..1.05).contains(&nis), "{nis}");
}

//! A device of one's own whose signal has what the rate of its drive makes of it, and quantities that follow from its states and its drive.

use crate::own_inputs::Rows;
use crate::parts::same_bits_in_parts;
use kalmems::config::Experiment;
use kalmems::progress::Silent;
use kalmems::recording::SampledRecording;
use kalmems::rigs::published;
use kalmems::simulate::{ComputedRecording, described};
use kalmems::workflow::{Outcome, estimate_computed};
use std::f64::consts::TAU;
use std::path::Path;

/// A plate on a spring whose pick-up current has the drive's displacement current through a stray capacitance in it.
const PLATE: &str = r#"
name = "plate"
[device.equations]
states = { x = "um", v = "m/s" }
inputs = { drive = "V" }
[device.equations.parameters]
m = "1e-9 kg"
k = "0.0394784176 N/m" # 1 kHz
b = "6.2832e-8 N s/m" # a quality factor of 100
force_per_volt = "2 nN/V"
bias_slope = "2 uA s/m"
stray = "0.4 pF"
[device.equations.derivative]
x = "v"
v = "(force_per_volt*drive - b*v - k*x)/m"
[device.equations.measure]
current = "bias_slope*v + stray*ddt(drive) in nA"
[device.equations.quantities]
energy = "0.5*m*v^2 + 0.5*k*x^2 in J"
twice = "2*x in um"
push = "force_per_volt*drive - k*x in nN"
[device.equations.noise]
current = "1e-22[A^2]"
v = "1e-10[m^2/s^3]"
[simulate]
duration = "60 ms"
sampling_rate = "100 kHz"
integration_rate = "400 kHz"
start = { x = "0.2 um", v = "0 m/s" }
seed = 1
[estimate]
skip = "5 ms"
[[estimate.filter]]
name = "EKF"
method = "ekf"
start = { x = "0 um", v = "0 m/s" }
start_sd = { x = "1 um", v = "5 mm/s" }
smooth = true
smooth_lag = "0.4 ms"
[[estimate.filter]]
name = "Stray"
method = "ekf"
states = { stray = { start_sd = "30 %" } }
start = { x = "0 um", v = "0 m/s" }
start_sd = { x = "1 um", v = "5 mm/s" }
"#;

const SINE: &str = "[simulate.drive.sine]\noffset = \"1 V\"\namplitude = \"3 V\"\nfrequency = \"900 Hz\"\n";

fn parse(text: &str) -> Experiment {
    let parsed = published().parse(text, Path::new("nowhere/experiment.toml"));
    parsed.unwrap_or_else(|error| panic!("{error}\n{text}"))
}

fn simulated(text: &str) -> (Experiment, ComputedRecording) {
    let experiment = parse(text);
    let simulation = published().rig(&experiment).unwrap().simulate(&experiment).unwrap();
    let all = ComputedRecording::of(simulation.as_ref(), &Silent).unwrap();
    (described(&experiment, simulation.as_ref()), all)
}

fn outcome(text: &str) -> Outcome {
    let (experiment, all) = simulated(text);
    estimate_computed(published(), &experiment, &all, &Silent).unwrap()
}

#[test]
fn a_simulated_signal_has_the_rate_of_the_drive_and_the_truth_the_quantities() {
    let text = format!("{}{SINE}", PLATE.replace("seed = 1\n", "seed = 1\nnoise = false\n"));
    let rows = Rows::of(&text, Path::new("nowhere"));
    for (time_s, recorded, truth) in &rows.samples {
        let ([drive, current], [x, v, energy, twice, push]) =
            (recorded[..].try_into().unwrap(), truth[..].try_into().unwrap());
        let (sine, cosine) = (TAU * 900.0 * time_s).sin_cos();
        assert!((drive - 1.0 - 3.0 * sine).abs() < 1e-9, "{drive}");
        let expected = 2e-6 * v + 0.4e-12 * 3.0 * TAU * 900.0 * cosine;
        assert!(
            (current - expected).abs() < 1e-12 * 1e-8_f64.max(expected.abs()) + 1e-20,
            "{current:e} {expected:e}"
        );
        let stored = 0.5e-9 * v * v + 0.5 * 0.039_478_417_6 * x * x;
        assert!(
            (energy - stored).abs() <= 1e-12 * stored && twice == 2.0 * x,
            "{energy:e} {stored:e} {twice} {x}"
        );
        assert!((push - (2e-9 * drive - 0.039_478_417_6 * x)).abs() < 1e-22, "{push:e}");
    }
}

#[test]
fn what_the_rate_of_the_drive_makes_of_the_signal_is_known_to_a_filter() {
    let outcome = outcome(&format!("{PLATE}{SINE}"));
    let segment = &outcome.recordings[0].segments[0].estimate;
    for trajectory in &segment.trajectories {
        let after = trajectory.time_s.iter().position(|t| *t > 5e-3).unwrap();
        let nis: Vec<f64> = trajectory.nis[after..].iter().copied().filter(|nis| nis.is_finite()).collect();
        let mean = nis.iter().sum::<f64>() / nis.len() as f64;
        let bound = 4.0 * (2.0 / nis.len() as f64).sqrt();
        assert!((mean - 1.0).abs() < bound, "{}: {mean} ± {bound}", trajectory.key);
    }
    let stray = segment.trajectories.iter().find(|found| found.key == "stray").unwrap();
    let stray = stray.state("stray").unwrap();
    let (found, sd) = (stray.mean.last().unwrap(), stray.sd.last().unwrap());
    assert!(*sd < 0.01 && found.abs() < 4.0 * sd, "{found} ± {sd}");
}

#[test]
fn quantities_follow_from_the_states_with_their_uncertainty() {
    let outcome = outcome(&format!("{PLATE}{SINE}"));
    let keys = outcome.recordings[0].segments[0].estimate.trajectories.iter().map(|found| &*found.key);
    assert_eq!(keys.collect::<Vec<_>>(), ["ekf", "ekf_smoothed", "ekf_lagged", "stray"]);
    for trajectory in &outcome.recordings[0].segments[0].estimate.trajectories {
        let of = |name: &str| trajectory.state(name).unwrap();
        let (x, v, twice, energy, push) = (of("x"), of("v"), of("twice"), of("energy"), of("push"));
        assert_eq!((twice.unit, energy.unit), ("m", "J"));
        for k in 1000..x.mean.len() {
            assert!(
                (twice.mean[k] - 2.0 * x.mean[k]).abs() < 1e-20 && (twice.sd[k] / x.sd[k] - 2.0).abs() < 1e-9
            );
            // The drive of its own sample, which nothing is uncertain of.
            let drive = 1.0 + 3.0 * (TAU * 900.0 * trajectory.time_s[k]).sin();
            let force = 2e-9 * drive - 0.039_478_417_6 * x.mean[k];
            assert!((push.mean[k] - force).abs() < 1e-16, "{}: {} {force}", trajectory.key, push.mean[k]);
            assert!((push.sd[k] / x.sd[k] / 0.039_478_417_6 - 1.0).abs() < 1e-9);
            let (force, momentum) = (0.039_478_417_6 * x.mean[k], 1e-9 * v.mean[k]);
            let stored = 0.5 * (force * x.mean[k] + momentum * v.mean[k]);
            assert!((energy.mean[k] - stored).abs() < 1e-9 * stored);
            // Between both variances apart, and alike in full.
            let parts = [(force * x.sd[k]).abs(), (momentum * v.sd[k]).abs()];
            let (least, most) = ((parts[0] - parts[1]).abs(), parts[0] + parts[1]);
            assert!(
                (0.999 * least..=1.001 * most).contains(&energy.sd[k]),
                "{k}: {least} {} {most}",
                energy.sd[k]
            );
        }
    }
    // The truth of the simulation knows them, so that their errors are judged.
    for name in ["energy", "push"] {
        let errors = outcome.recordings[0].segments[0].values[0].get(name).unwrap();
        assert!(errors.within_three_sigma.is_some_and(|share| share > 0.97), "{name}: {errors:?}");
    }
}

#[test]
fn rates_and_quantities_are_the_same_in_parts() {
    let (experiment, all) = simulated(&format!("{PLATE}{SINE}"));
    let layout = published().rig(&experiment).unwrap().layout(&experiment, 0).unwrap();
    let recording: SampledRecording = all.recorded(&layout).unwrap();
    same_bits_in_parts(&experiment, &recording, &[700, 5000]);
}

#[test]
fn a_drive_that_jumps_has_no_rate() {
    let square = "[simulate.drive.square]\nlow = \"0 V\"\nhigh = \"3 V\"\nfrequency = \"900 Hz\"\nduty_cycle = \"50 %\"\n";
    let experiment = parse(&format!("{PLATE}{square}"));
    let refused = published().rig(&experiment).unwrap().simulate(&experiment).err().unwrap().to_string();
    assert!(refused.contains("the time derivative of `drive`, and this drive jumps"), "{refused}");
}

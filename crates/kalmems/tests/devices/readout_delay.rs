//! A readout that is late by a constant time: simulated, estimated, and through the circuit whose high-pass
//! makes it late.

use crate::scanner::{Simulated, TRUTH, WIDE, errors, estimate, filter, quartiles};
use kalmems::evaluate::{Accuracy, MotionErrors, ReferenceMotion};
use kalmems::rigs::published;
use std::ops::ControlFlow;
use std::path::Path;

const DRIVE_HZ: f64 = 31_350.0;
const DELAY_S: f64 = 1.16e-6;
/// The delay in degrees of the motion's cycle.
const LATE_DEG: f64 = 360.0 * 0.5 * DRIVE_HZ * DELAY_S;
const DELAY: &str = "delay = \"1.16 us\"";

/// From the start near the steady motion.
const STEADY: (&str, &str) = ("angle = \"1e-4 rad\"", "angle = \"0.1554 rad\"");

/// An example with its text changed.
fn example(name: &str, replaced: &[(&str, &str)]) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/shared_scanner").join(name);
    let mut text = std::fs::read_to_string(path).unwrap();
    for (from, to) in replaced {
        assert!(text.contains(from), "{from}");
        text = text.replace(from, to);
    }
    text
}

/// What `kalmems simulate` would record.
fn simulated(toml: &str, motion_hz: f64) -> Simulated {
    let experiment = published().parse(toml, Path::new("simulation.toml")).unwrap_or_else(|e| panic!("{e}"));
    let simulation = published().rig(&experiment).unwrap().simulate(&experiment).unwrap();
    let (mut drive_v, mut signal) = (Vec::new(), Vec::new());
    let (mut time_s, mut angle, mut rate) = (Vec::new(), Vec::new(), Vec::new());
    simulation
        .run(&mut |sample| {
            drive_v.push(sample.recorded[0]);
            signal.push(sample.recorded[1]);
            time_s.push(sample.time_s);
            angle.push(sample.truth[0]);
            rate.push(sample.truth[1]);
            ControlFlow::Continue(())
        })
        .unwrap();
    let accuracy = Accuracy::default();
    let reference = ReferenceMotion { states: ["angle", "rate"], time_s, angle, rate: Some(rate), accuracy };
    Simulated { drive_v, signal, reference, motion_hz }
}

/// The same file with other filters, on the recording.
fn told(toml: &str, skip_s: f64, filters: &str) -> String {
    let device = &toml[..toml.find("[simulate]").unwrap()];
    format!(
        "{device}[[recording]]\nrole = \"test\"\nfile = \"recording.csv\"\nclock = {{ column = \"time_s\" }}\n\
         channels = {{ drive = \"drive_V\", signal = \"cap_V\" }}\n[estimate]\nskip = \"{skip_s:e} s\"\n\
         process_noise = {{ angular_acceleration = \"1e8 rad^2/s^3\" }}\n{filters}"
    )
}

/// Each filter's key and errors.
fn reached(simulated: &Simulated, toml: &str, skip_s: f64) -> Vec<(String, MotionErrors)> {
    let estimated = estimate(simulated, &TRUTH, toml);
    let of = |t: &kalmems::estimate::Trajectory| {
        assert!(t.failure.is_none(), "{}: {:?}", t.key, t.failure);
        (t.key.clone(), errors(simulated, t, skip_s))
    };
    estimated.trajectories.iter().map(of).collect()
}

fn phase_deg(errors: &MotionErrors) -> f64 {
    errors.peak_phase_rmse_deg.unwrap()
}

/// The scanner in steady motion, read at once or late, without a circuit.
fn plain(delay: &str, rest: &[(&str, &str)]) -> String {
    let variance = "noise_variance = \"1.92e-4 V^2\"";
    let readout = format!("{variance}\n{delay}\n#");
    let mut replaced = vec![(variance, readout.as_str()), ("duration = \"60 ms\"", "duration = \"24 ms\"")];
    replaced.extend(rest);
    example("simulation.toml", &replaced)
}

/// By whole steps: the signal of then, to rounding. By a part of one: that of a simulation whose steps it fits.
#[test]
fn a_simulation_is_late_by_its_delay() {
    let quiet = [("seed = 1", "seed = 1\nnoise = false"), ("24 ms", "1 ms"), STEADY];
    let signal = |delay: &str, rest: &[(&str, &str)]| {
        simulated(&plain(delay, &[&quiet[..], rest].concat()), 0.5 * DRIVE_HZ).signal
    };
    let at_once = signal("", &[]);
    let late = signal("delay = \"2 us\"", &[]);
    assert_eq!(late.len(), at_once.len());
    // Before the first sample the device was held where it starts.
    assert!((late[0] - at_once[0]).abs() < 1e-12 && (late[1] - at_once[0]).abs() < 1e-12);
    assert!((2..late.len()).all(|k| (late[k] - at_once[k - 2]).abs() < 1e-12));
    let fine = [("\"1 MHz\"", "\"25 MHz\""), ("\"10 MHz\"", "\"25 MHz\"")];
    let (between, fine) = (signal(DELAY, &[]), signal("", &fine));
    let worst = (2..between.len()).map(|k| (between[k] - fine[25 * k - 29]).abs()).fold(0.0, f64::max);
    println!("{worst:.1e} V");
    assert!(worst < 1e-7, "{worst:e}");
    let moved = (2..between.len()).map(|k| (between[k] - at_once[k]).abs()).fold(0.0, f64::max);
    assert!(moved > 0.1, "{moved}");
}

/// Told of it, filters are right; not told, one that follows its signal is as late as the signal is.
#[test]
fn every_filter_heeds_the_delay() {
    let toml = plain(DELAY, &[STEADY]);
    let recorded = simulated(&toml, 0.5 * DRIVE_HZ);
    let skip_s = 8e-3;
    let parameters = "states = { gain = { start_sd = \"1 %\" }, offset = { start_sd = \"10 mV\" } }\n";
    let filters = [
        filter("ekf", "ekf", WIDE),
        filter("ukf", "ukf", WIDE),
        filter("root", "square_root_ukf", WIDE),
        filter("parameters", "ekf", &format!("{WIDE}{parameters}")),
        "[[estimate.filter]]\nname = \"lock\"\nmethod = \"lock_in\"\n".to_owned(),
    ];
    let with = reached(&recorded, &told(&toml, skip_s, &filters.concat()), skip_s);
    let without = reached(&recorded, &told(&plain("", &[STEADY]), skip_s, &filters.concat()), skip_s);
    for ((key, with), (_, without)) in with.iter().zip(&without) {
        println!("{key}: phase {:.3} deg, not told {:.3} deg", phase_deg(with), phase_deg(without));
        assert!(phase_deg(with) < 0.6, "{key}");
        assert!((phase_deg(without) - LATE_DEG).abs() < 0.8, "{key}");
    }
}

/// A recording made by the circuit, and what filters of q = 1e8 and q = 1e4 make of it: phase in degrees of
/// poles with delay, then poles alone.
fn through_the_circuit(seed: u64, drive_hz: f64) -> [[f64; 2]; 2] {
    let (seed, frequency) = (format!("seed = {seed}"), format!("frequency = \"{drive_hz} Hz\""));
    let toml = example(
        "circuit.toml",
        &[
            ("seed = 1", &seed),
            ("duration = \"4 ms\"", "duration = \"16 ms\""),
            ("frequency = \"31.35 kHz\"", &frequency),
        ],
    );
    let recorded = simulated(&toml, 0.5 * drive_hz);
    let staged = "start_sd = { angle = \"0.15 rad\", rate = \"15e3 rad/s\", demodulator = \"0.5 V\" }\n\
                  demodulator = true\n";
    let trusting = "process_noise = { angular_acceleration = \"1e4 rad^2/s^3\" }\n";
    let filters = filter("follows", "ekf", staged) + &filter("trusts", "ekf", &format!("{staged}{trusting}"));
    let skip_s = 8e-3;
    [DELAY, ""].map(|delay| {
        let toml = told(&toml.replace(DELAY, delay), skip_s, &filters);
        let reached = reached(&recorded, &toml, skip_s);
        [phase_deg(&reached[0].1), phase_deg(&reached[1].1)]
    })
}

#[test]
fn poles_and_delay_fit_the_circuit_where_poles_alone_are_late() {
    let [with, without] = through_the_circuit(1, DRIVE_HZ);
    println!("phase of q = 1e8, 1e4: {with:.3?} deg, without the delay {without:.3?} deg");
    assert!(with[0] < 0.1 * without[0], "{with:?} {without:?}");
    assert!(with[1] < 0.5 * without[1] && with[1] < 0.38, "{with:?} {without:?}");
}

#[test]
#[ignore = "some minutes"]
fn slow_poles_and_delay_over_frequencies_and_seeds() {
    for drive_hz in [31_300.0, 31_350.0, 31_400.0] {
        let all: Vec<[[f64; 2]; 2]> = (1..=10).map(|seed| through_the_circuit(seed, drive_hz)).collect();
        for (i, q) in ["1e8", "1e4"].into_iter().enumerate() {
            let [with, without] =
                [0, 1].map(|told| quartiles(&all.iter().map(|r| r[told][i]).collect::<Vec<_>>()));
            println!(
                "{drive_hz} Hz, q = {q}: phase {with:.3?} deg, without the delay {without:.3?} deg (quartiles of 10 seeds)"
            );
            assert!(with[2] < 0.5 * without[0], "{with:?} {without:?}");
        }
    }
}

#[test]
fn a_delay_that_cannot_be_heeded_is_refused() {
    let said = |toml: &str| {
        let experiment = match published().parse(toml, Path::new("experiment.toml")) {
            Err(error) => return error.to_string(),
            Ok(experiment) => experiment,
        };
        match published().rig(&experiment).unwrap().simulate(&experiment) {
            Err(error) => error.to_string(),
            Ok(_) => "accepted".to_owned(),
        }
    };
    let long = said(&plain("delay = \"9 us\"", &[]));
    assert!(long.contains("readout.delay: ") && long.contains("at most `8.03 us`"), "{long}");
    let variance = "noise_variance = \"1.92e-4 V^2\"";
    let two = said(&example("two_axes.toml", &[(variance, &format!("{variance}\n{DELAY}\n#"))]));
    assert!(two.contains("a scanner with two axes is read without a delay"), "{two}");
    assert!(published().parse(&plain("delay = \"-1 us\"", &[]), Path::new("e.toml")).is_err());
}

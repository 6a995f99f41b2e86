//! States that are set at once where an expression passes zero: bounces, switches and backlash.

use crate::parts::same_bits_in_parts;
use kalmems::config::Experiment;
use kalmems::estimate::Trajectory;
use kalmems::progress::Silent;
use kalmems::recording::SampledRecording;
use kalmems::rigs::published;
use kalmems::simulate::{ComputedRecording, described};
use std::path::Path;

/// A plate on a spring that bounces off a stop at half of its amplitude, driven so that it goes on.
const BOUNCER: &str = r#"
name = "bouncer"
[device.equations]
states = { x = "um", v = "m/s" }
inputs = { drive = "V" }
derivative = { x = "v", v = "-w^2*x - damping*v + push*drive" }
measure = { signal = "x in um" }
noise = { signal = "1e-16[m^2]", v = "1e-3[m^2/s^3]" }
[device.equations.parameters]
w = "6000 1/s"
damping = "200 1/s"
push = "60 m/s^2/V"
stop = "-0.8 um"
restitution = "0.6"
[device.equations.when]
bounce = { falls = "x - stop", set = { v = "-restitution*v" } }
[simulate]
duration = "60 ms"
sampling_rate = "50 kHz"
integration_rate = "500 kHz"
seed = 1
start = { x = "1.5 um", v = "0 m/s" }
[simulate.drive.sine]
offset = "0 V"
amplitude = "1 V"
frequency = "1 kHz"
[estimate]
skip = "5 ms"
[[estimate.filter]]
name = "EKF"
method = "ekf"
start = { x = "1.5 um", v = "0 m/s" }
start_sd = { x = "0.05 um", v = "0.2 mm/s" }
"#;

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

fn truth(all: &ComputedRecording, column: &str) -> Vec<f64> {
    let columns = all.true_columns();
    columns.into_iter().find(|(name, _)| *name == column).unwrap().1
}

#[test]
fn a_ball_bounces_where_arithmetic_says() {
    // Free fall from 1 m onto a floor: each bounce takes 0.8 of the speed, and lasts twice the speed over g.
    let text = r#"
name = "ball"
[device.equations]
states = { x = "m", v = "m/s" }
derivative = { x = "v", v = "-g" }
parameters = { g = "9.81 m/s^2" }
measure = { height = "x in m" }
noise = { height = "1e-6[m^2]" }
when = { bounce = { falls = "x", set = { v = "-0.8*v" } } }
[simulate]
duration = "2.2 s"
sampling_rate = "37 Hz"
integration_rate = "37 Hz"
noise = false
seed = 1
start = { x = "1 m", v = "0 m/s" }
[simulate.drive.inputs]
[estimate]
skip = "0 s"
[[estimate.filter]]
name = "EKF"
method = "ekf"
start = { x = "1 m", v = "0 m/s" }
start_sd = { x = "1 cm", v = "1 mm/s" }
"#;
    let (.., all) = recorded(text);
    let (time, x) = (all.true_columns().swap_remove(0).1, truth(&all, "x_m"));
    let g = 9.81_f64;
    let mut bounces = vec![((2.0 / g).sqrt(), 0.8 * (2.0 * g).sqrt())];
    while let Some((at, speed)) = bounces.last().copied().filter(|(at, _)| *at < 2.2) {
        bounces.push((at + 2.0 * speed / g, 0.8 * speed));
    }
    for (t, x) in time.iter().zip(&x) {
        let last = bounces.iter().rev().find(|(at, _)| at <= t);
        let height = last.map_or(1.0 - 0.5 * g * t * t, |(at, speed)| {
            let since = t - at;
            speed * since - 0.5 * g * since * since
        });
        assert!((height - x).abs() < 1e-11, "{t}: {x} {height}");
    }
}

#[test]
fn a_thermostat_switches_with_its_hysteresis() {
    // Between 19 and 21 degrees: heats with 30 K as its goal, cools towards 10, both with a time constant of 1 s.
    let text = r#"
name = "thermostat"
[device.equations]
states = { T = "K", on = "1" }
derivative = { T = "(cold + on*heat - T)/tau", on = "0" }
parameters = { cold = "10 K", heat = "20 K", tau = "1 s" }
measure = { thermometer = "T in K" }
noise = { thermometer = "1e-4[K^2]" }
[device.equations.when]
warm = { rises = "T - 21[K]", set = { on = "0" } }
cool = { falls = "T - 19[K]", set = { on = "1" } }
[simulate]
duration = "20 s"
sampling_rate = "7 Hz"
integration_rate = "70 Hz"
noise = false
seed = 1
start = { T = "19 K", on = "1" }
[simulate.drive.inputs]
[estimate]
skip = "0 s"
[[estimate.filter]]
name = "EKF"
method = "ekf"
start = { T = "19 K", on = "1" }
start_sd = { T = "1 K", on = "0" }
"#;
    let (.., all) = recorded(text);
    let (time, temperature) = (all.true_columns().swap_remove(0).1, truth(&all, "T_K"));
    let (heats, cools) = ((11.0_f64 / 9.0).ln(), (11.0_f64 / 9.0).ln());
    for (t, found) in time.iter().zip(&temperature) {
        let phase = t % (heats + cools);
        let wanted =
            if phase < heats { 30.0 - 11.0 * (-phase).exp() } else { 10.0 + 11.0 * (-(phase - heats)).exp() };
        assert!((wanted - found).abs() < 1e-7, "{t}: {found} {wanted}");
    }
}

#[test]
fn a_load_follows_its_motor_with_backlash() {
    // The load stands until the motor has gone through the play on either side, and goes with it then.
    let text = r#"
name = "gear"
[device.equations]
states = { motor = "mm", rate = "mm/s", load = "mm", engaged = "1" }
derivative = { motor = "rate", rate = "-w^2*motor", load = "engaged*rate", engaged = "0" }
parameters = { w = "100 1/s", play = "0.3 mm" }
measure = { encoder = "load in mm" }
noise = { encoder = "1e-12[m^2]" }
[device.equations.when]
pushed_up = { rises = "(1 - engaged)*(motor - load - play)", set = { engaged = "1" } }
pushed_down = { falls = "(1 - engaged)*(motor - load + play)", set = { engaged = "1" } }
turns = { crosses = "rate", set = { engaged = "0" } }
[simulate]
duration = "0.3 s"
sampling_rate = "1 kHz"
integration_rate = "10 kHz"
noise = false
seed = 1
start = { motor = "0 mm", rate = "100 mm/s", load = "0 mm", engaged = "0" }
[simulate.drive.inputs]
[estimate]
skip = "0 s"
[[estimate.filter]]
name = "EKF"
method = "ekf"
start = { motor = "0 mm", rate = "100 mm/s", load = "0 mm", engaged = "0" }
start_sd = { motor = "1 um", rate = "0.1 mm/s", load = "1 um" }
"#;
    let (.., all) = recorded(text);
    let (time, load) = (all.true_columns().swap_remove(0).1, truth(&all, "load_m"));
    // The play operator: never farther from the motor than the play.
    let mut wanted = 0.0;
    let mut before_s = 0.0;
    for (t, found) in time.iter().zip(&load) {
        for part in 1..=2000 {
            let at = before_s + (t - before_s) * f64::from(part) / 2000.0;
            let motor = 1e-3 * (100.0 * at).sin();
            wanted = f64::clamp(wanted, motor - 3e-4, motor + 3e-4);
        }
        before_s = *t;
        assert!((wanted - found).abs() < 1e-9, "{t}: {found} {wanted}");
    }
}

/// The mean square of errors over claims of both states behind the settling time.
fn normalized(trajectory: &Trajectory, all: &ComputedRecording) -> f64 {
    let (mut sum, mut count) = (0.0, 0);
    for (state, column) in trajectory.states.iter().zip(["x_m", "v_m_per_s"]) {
        for ((mean, sd), truth) in state.mean.iter().zip(&state.sd).zip(truth(all, column)).skip(250) {
            sum += ((mean - truth) / sd).powi(2);
            count += 1;
        }
    }
    sum / f64::from(count)
}

#[test]
fn a_filter_claims_what_its_errors_are_through_hundreds_of_bounces() {
    let (mut of_all, mut squares) = (0.0, 0.0);
    let (seeds, mut nis) = (200..212, 0.0);
    for seed in seeds.clone() {
        let (experiment, recording, all) = recorded(&BOUNCER.replace("seed = 1", &format!("seed = {seed}")));
        let rig = published().rig(&experiment).unwrap();
        let trajectory = rig
            .estimate(&experiment, 0, &recording, &Silent)
            .unwrap()
            .swap_remove(0)
            .trajectories
            .swap_remove(0);
        let found = normalized(&trajectory, &all);
        of_all += found / 12.0;
        squares += found * found / 12.0;
        nis += trajectory.consistency(250..trajectory.time_s.len()).unwrap().mean_nis / 12.0;
    }
    let deviation = ((squares - of_all * of_all) / 12.0).sqrt();
    assert!((of_all - 1.0).abs() < 4.0 * deviation + 0.1, "{of_all} {deviation}");
    assert!((nis - 1.0).abs() < 0.03, "{nis}");
}

#[test]
fn resets_are_the_same_in_parts() {
    let (experiment, recording, _) = recorded(BOUNCER);
    same_bits_in_parts(&experiment, &recording, &[700, 1900]);
}

#[test]
fn a_filter_without_the_bounce_loses_the_motion() {
    let (experiment, recording, all) = recorded(BOUNCER);
    let without = experiment.to_toml().unwrap().replace("restitution*v", "v").replace("-v", "v");
    assert!(without.contains("v = \"v\""), "{without}");
    let experiment = parsed(&without);
    let rig = published().rig(&experiment).unwrap();
    let trajectory =
        rig.estimate(&experiment, 0, &recording, &Silent).unwrap().swap_remove(0).trajectories.swap_remove(0);
    let found = normalized(&trajectory, &all);
    assert!(found.is_nan() || found > 2.0, "{found}");
}

#[test]
fn what_is_wrong_of_a_reset_is_named() {
    let refused = |from: &str, to: &str| {
        let text = BOUNCER.replace(from, to);
        assert_ne!(text, BOUNCER);
        published().parse(&text, Path::new("nowhere/experiment.toml")).unwrap_err().to_string()
    };
    let both = refused("falls = \"x - stop\",", "falls = \"x - stop\", rises = \"x\",");
    assert!(both.contains("write one of `rises`, `falls` and `crosses`"), "{both}");
    let unit = refused("v = \"-restitution*v\"", "v = \"x\"");
    assert!(unit.contains("m/s"), "{unit}");
    let unknown = refused("set = { v", "set = { w");
    assert!(unknown.contains("a state, which a reset sets"), "{unknown}");
    let driven = refused("x - stop", "x - stop*drive/1[V]");
    assert!(driven.contains("depends on an input"), "{driven}");
    let resting = refused("x - stop", "stop");
    assert!(resting.contains("does not depend on a state"), "{resting}");
}

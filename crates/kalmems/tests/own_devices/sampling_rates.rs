//! Filters that are told what is true, at several sampling rates: their verdicts, their errors against their claims, and what their steps cost.

use super::step_errors::{
    Between, Device, accelerometer, ring, scanner, stage, stiffening, stiffening_of_known_resonance, thermal,
    whole,
};
use kalmems::evaluate::Grade;
use kalmems::progress::Silent;
use kalmems::results::{Metrics, notices};
use kalmems::rigs::published;
use kalmems::simulate::WhiteNoise;
use kalmems::workflow;
use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::fmt::Arguments;

/// What a right filter is told by its verdict in one run.
struct Judged {
    grade: Grade,
    step_error: f64,
    /// Whether the error of its steps is said.
    is_said: bool,
    mean_squares: Vec<f64>,
}

/// The true motion begins where the filter's claim of its start has it at random. States of which nothing is random have one error in a run, and are
/// left out.
fn judged<const N: usize, const M: usize>(
    device: &Device<N, M>,
    samples: usize,
    seed: u64,
    without: &[&str],
) -> Judged {
    judged_with(device, samples, seed, (without, ""))
}

/// The same with further lines of the filter.
fn judged_with<const N: usize, const M: usize>(
    device: &Device<N, M>,
    samples: usize,
    seed: u64,
    (without, lines): (&[&str], &str),
) -> Judged {
    let folder = tempfile::tempdir().unwrap();
    let mut chance = WhiteNoise::new(seed, 6);
    let start = std::array::from_fn(|i| device.start[i] + device.start_sd[i] * chance.sample());
    device.record_from(start, folder.path(), samples, seed);
    let outcome =
        workflow::estimate(published(), &device.experiment(folder.path(), &[lines]), &Silent).unwrap();
    let metrics = Metrics::of(&outcome);
    let one = metrics.estimators().next().unwrap();
    let grade = one.grade.unwrap();
    if grade > Grade::PassesWithRemarks {
        println!("{:?}", notices(&metrics));
    }
    let is_said = notices(&metrics).iter().any(|notice| notice.topic == "step");
    let of_states = one.values.iter().filter(|(name, _)| !without.contains(*name));
    Judged {
        grade,
        step_error: one.step_errors.map_or(0.0, |errors| errors.error),
        is_said,
        mean_squares: of_states.filter_map(|(_, value)| Some(value.claim?.mean_square)).collect(),
    }
}

/// An error of the steps above a twentieth of the claim is said; above a fifth the answer would be doubtful.
fn assert_small(one: &Judged, of: Arguments) {
    let is_small = one.step_error < 0.05 || (one.is_said && one.step_error < 0.2);
    assert!(is_small, "{of}: {}", one.step_error);
    if one.step_error >= 0.05 {
        println!("{of}: an error of the steps of {:.3} of the claim is said", one.step_error);
    }
}

/// Holds right filters at each rate against their claims; of so many samples in a cycle and with a seed, what several of them are told.
fn hold_at_every_rate(seeds: u64, of: impl Fn(f64, u64) -> Vec<(&'static str, Judged)>) {
    let (mut doubted, mut runs) = (0, 0);
    for per_cycle in [20.0, 26.0, 32.0, 64.0, 200.0] {
        let mut squares: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
        for seed in 1000..1000 + seeds {
            for (name, one) in of(per_cycle, seed) {
                runs += 1;
                doubted += usize::from(one.grade > Grade::PassesWithRemarks);
                assert_small(&one, format_args!("{name}, {per_cycle} a cycle"));
                squares.entry(name).or_default().extend(one.mean_squares);
            }
        }
        for (name, squares) in squares {
            let mean = squares.iter().sum::<f64>() / squares.len() as f64;
            println!("{name}, {per_cycle} samples in a cycle: mean square error {mean:.3} of the claimed");
            assert!((0.8..1.3).contains(&mean), "{name}, {per_cycle}: {mean}");
        }
    }
    println!("{doubted} of {runs} right filters doubted");
    assert!(doubted * 50 <= runs, "{doubted} of {runs}");
}

#[test]
#[ignore = "slow: ten minutes on two processors in a release build"]
fn slow_right_filters_hold_at_every_sampling_rate() {
    hold_at_every_rate(10, |per_cycle, seed| {
        let samples = |cycles: f64| whole(cycles * per_cycle);
        vec![
            ("scanner", judged(&scanner(per_cycle, 1e4, between(per_cycle)), samples(700.0), seed, &[])),
            (
                "resonance known",
                judged(&stiffening_of_known_resonance(20e3 * per_cycle), samples(1000.0), seed, &[]),
            ),
            ("resonance a state", judged(&stiffening(20e3 * per_cycle), samples(1000.0), seed, &[])),
            ("ring", judged(&Device { rate_hz: 7.5e3 * per_cycle, ..ring() }, samples(900.0), seed, &[])),
        ]
    });
}

#[test]
#[ignore = "slow: ten minutes on two processors in a release build"]
fn slow_right_filters_of_further_devices_hold_at_every_sampling_rate() {
    hold_at_every_rate(6, |per_cycle, seed| {
        let samples = |cycles: f64| whole(cycles * per_cycle);
        let at = |cycle_hz: f64| cycle_hz * per_cycle;
        let stage = Device { rate_hz: at(1714.5), substeps: whole(800.0 / per_cycle), ..stage() };
        let thermal = Device { rate_hz: at(480.0), substeps: whole(800.0 / per_cycle), ..thermal() };
        vec![
            ("comb resonator", judged(&comb_resonator(per_cycle), samples(800.0), seed, &[])),
            ("tuning fork", judged(&tuning_fork(per_cycle), samples(1500.0), seed, &[])),
            ("vibrating gyroscope", judged(&vibrating_gyroscope(per_cycle), samples(1000.0), seed, &[])),
            ("thermal mirror", judged(&thermal, samples(500.0), seed, &["T", "F"])),
            // 4.5 kHz is the rate of its mass and its spring, which the film damps over the critical.
            ("accelerometer", judged(&accelerometer(at(4.5e3)), samples(700.0), seed, &[])),
            ("micro-stage", judged(&stage, samples(300.0), seed, &[])),
            ("piston mirror", judged(&piston_mirror(per_cycle), samples(400.0), seed, &[])),
            ("threshold", judged(&threshold(per_cycle), samples(300.0), seed, &[])),
            // Pulled in, at its contact and let go, once each.
            ("contact switch", judged(&contact_switch(per_cycle), samples(80.0), seed, &[])),
        ]
    });
}

/// The same filter, which begins with another resonance than the true one, at random as it claims, and finds it as a state: a number of the text with
/// its value and its unit.
fn judged_unknown<const N: usize, const M: usize>(
    device: Device<N, M>,
    [name, value, unit]: [&str; 3],
    (samples, seed): (usize, u64),
) -> Judged {
    let true_value: f64 = value.parse().unwrap();
    let sd = 5e-4 * true_value;
    let begins = true_value + sd * WhiteNoise::new(seed, 11).sample();
    let stated = |value: &str| format!("{name} = \"{value} {unit}\"");
    let text = device.text.replace(&stated(value), &stated(&begins.to_string()));
    assert_ne!(text, device.text, "{name} is not in the text");
    let lines = format!("states = {{ {name} = {{ start_sd = \"{sd:e} {unit}\" }} }}");
    judged_with(&Device { text, ..device }, samples, seed, (&[], &lines))
}

#[test]
#[ignore = "slow: three minutes on two processors in a release build"]
fn slow_right_filters_that_find_their_resonance_hold_at_every_sampling_rate() {
    let [comb, fork] = [["k", "4.7374", "N/m"], ["k", "27966.9", "N/m"]];
    let [gyroscope, rest] = [["k", "39.44", "N/m"], ["w", "3924.477", "1/s"]];
    let plate = (TAU * 1714.5).to_string();
    let [spring, plate] = [["k", "1.1e-4", "N m/rad"], ["w", &plate, "rad/s"]];
    hold_at_every_rate(6, |per_cycle, seed| {
        let run = |cycles: f64| (whole(cycles * per_cycle), seed);
        let stage = Device { rate_hz: 1714.5 * per_cycle, substeps: whole(800.0 / per_cycle), ..stage() };
        vec![
            ("scanner", judged_unknown(scanner(per_cycle, 1e4, between(per_cycle)), spring, run(700.0))),
            ("comb resonator", judged_unknown(comb_resonator(per_cycle), comb, run(800.0))),
            ("tuning fork", judged_unknown(tuning_fork(per_cycle), fork, run(1500.0))),
            ("vibrating gyroscope", judged_unknown(vibrating_gyroscope(per_cycle), gyroscope, run(1000.0))),
            ("micro-stage", judged_unknown(stage, plate, run(300.0))),
            ("threshold", judged_unknown(threshold(per_cycle), rest, run(300.0))),
        ]
    });
}

/// Holds right filters of each length against their claims; the steps are planned once, and watched to the end.
fn hold_over_every_length(
    lengths: [(usize, u64); 4],
    of: impl Fn(usize, u64) -> Vec<(&'static str, Judged)>,
) {
    let (mut squares, mut doubted, mut runs) = (Vec::new(), 0, 0);
    for (samples, seeds) in lengths {
        for seed in 2000..2000 + seeds {
            for (name, one) in of(samples, seed) {
                runs += 1;
                doubted += usize::from(one.grade > Grade::PassesWithRemarks);
                assert_small(&one, format_args!("{name}, {samples} samples"));
                println!("{name}, {samples} samples: {:?}", one.mean_squares);
                squares.extend(one.mean_squares);
            }
        }
    }
    let mean = squares.iter().sum::<f64>() / squares.len() as f64;
    println!("mean square error {mean:.3} of the claimed in {runs} runs, of which {doubted} are doubted");
    assert!((0.8..1.3).contains(&mean) && doubted * 50 <= runs, "{mean}, {doubted} of {runs}");
}

/// Judged from four cycles of 64 samples on, so that a thousand samples suffice.
fn judged_soon<const N: usize, const M: usize>(
    device: Device<N, M>,
    (samples, seed): (usize, u64),
    without: &[&str],
) -> Judged {
    judged(&Device { skip_s: 256.0 / device.rate_hz, ..device }, samples, seed, without)
}

#[test]
#[ignore = "slow: five minutes on two processors in a release build"]
fn slow_right_filters_hold_over_every_length() {
    hold_over_every_length([(1000, 20), (10_000, 6), (1_000_000, 1), (3_000_000, 1)], |samples, seed| {
        let of = |per_cycle: f64| {
            let known = stiffening_of_known_resonance(20e3 * per_cycle);
            let run = (samples, seed);
            [
                ("scanner", judged_soon(scanner(per_cycle, 1e4, Between::AsItIs), run, &[])),
                ("resonance known", judged_soon(known, run, &[])),
                ("resonance a state", judged_soon(stiffening(20e3 * per_cycle), run, &[])),
            ]
        };
        [26.0, 64.0].into_iter().flat_map(of).collect()
    });
}

#[test]
#[ignore = "slow: fifteen minutes on two processors in a release build"]
fn slow_right_filters_of_further_devices_hold_over_every_length() {
    const PER_CYCLE: f64 = 64.0;
    let stage = || Device { rate_hz: 1714.5 * PER_CYCLE, substeps: 13, ..stage() };
    let thermal = || Device { rate_hz: 480.0 * PER_CYCLE, substeps: 13, ..thermal() };
    hold_over_every_length([(1000, 10), (10_000, 3), (1_000_000, 1), (3_000_000, 1)], |samples, seed| {
        let run = (samples, seed);
        vec![
            ("ring", judged_soon(Device { rate_hz: 7.5e3 * PER_CYCLE, ..ring() }, run, &[])),
            ("comb resonator", judged_soon(comb_resonator(PER_CYCLE), run, &[])),
            ("tuning fork", judged_soon(tuning_fork(PER_CYCLE), run, &[])),
            ("vibrating gyroscope", judged_soon(vibrating_gyroscope(PER_CYCLE), run, &[])),
            ("thermal mirror", judged_soon(thermal(), run, &["T", "F"])),
            ("accelerometer", judged_soon(accelerometer(4.5e3 * PER_CYCLE), run, &[])),
            ("micro-stage", judged_soon(stage(), run, &[])),
            ("piston mirror", judged_soon(piston_mirror(PER_CYCLE), run, &[])),
            ("threshold", judged_soon(threshold(PER_CYCLE), run, &[])),
            ("contact switch", judged_soon(contact_switch(PER_CYCLE), run, &[])),
        ]
    });
}

/// The polynomial through six samples of the drive alone makes errors of 1.4 times the claim at 20 samples in a cycle, as `inspect` says.
fn between(per_cycle: f64) -> Between {
    if per_cycle < 26.0 { Between::AlongItsSine } else { Between::AsItIs }
}

fn interpolation(per_cycle: f64) -> &'static str {
    if per_cycle < 26.0 { "sine" } else { "quintic" }
}

/// A comb resonator whose spring hardens, behind an amplifier with a lag.
fn comb_resonator(per_cycle: f64) -> Device<3, 1> {
    let text = r#"
[device.equations]
states = { x = "m", v = "m/s", passed = "V" }
inputs = { drive = "V" }
interpolation = "BETWEEN"
measure = { signal0 = "passed in V" }
noise = { signal0 = "1e-6[V^2]", v = "2*4.0453e-21[J]*b/m^2" }
parameters = { m = "1.2e-9 kg", k = "4.7374 N/m", b = "3.0159e-7 N s/m" }
[device.equations.derivative]
x = "v"
v = "(2.96e-9[N/V^2]*drive^2 - b*v - k*x*(1 + 6.25e8[1/m^2]*x^2))/m"
passed = "(0.2[V/um]*x - passed)/4e-6[s]"
"#;
    Device {
        text: text.replace("BETWEEN", interpolation(per_cycle)),
        states: ["x", "v", "passed"],
        units: ["m", "m/s", "V"],
        rate: Box::new(|[x, v, passed], u| {
            let spring = 4.7374 * x * (1.0 + 6.25e8 * x * x);
            let force = 2.96e-9 * u * u - 3.0159e-7 * v - spring;
            [*v, force / 1.2e-9, (0.2e6 * x - passed) / 4e-6]
        }),
        read: Box::new(|[_, _, passed]| [*passed]),
        noise: [0.0, 2.0 * 4.0453e-21 * 3.0159e-7 / 1.2e-9_f64.powi(2), 0.0],
        sample_sd: [1e-3],
        start: [0.0; 3],
        start_sd: [1e-7, 6e-3, 2e-2],
        drive: Box::new(|t| 10.0 + 2.0 * (TAU * 10e3 * t).sin()),
        is_driven: true,
        between: between(per_cycle),
        rate_hz: 10e3 * per_cycle,
        substeps: whole(1600.0 / per_cycle),
        skip_s: 6e-3,
    }
}

/// A tuning fork behind a charge amplifier, in a gas that makes a hundred times as much noise as its damping does.
fn tuning_fork(per_cycle: f64) -> Device<3, 1> {
    let text = r#"
[device.equations]
states = { x = "m", v = "m/s", passed = "C" }
inputs = { drive = "V" }
interpolation = "BETWEEN"
measure = { signal0 = "-(coupling*x - passed)/4.7[pF] in V" }
noise = { signal0 = "2.5e-9[V^2]", v = "2.5e-11[m^2/s^3]" }
parameters = { m = "6.6e-7 kg", k = "27966.9 N/m", coupling = "9.2e-6 C/m" }
[device.equations.derivative]
x = "v"
v = "(coupling*drive - 1.3586e-5[N s/m]*v - k*x)/m"
passed = "(coupling*x - passed)/1.034e-4[s]"
"#;
    Device {
        text: text.replace("BETWEEN", interpolation(per_cycle)),
        states: ["x", "v", "passed"],
        units: ["m", "m/s", "C"],
        rate: Box::new(|[x, v, passed], u| {
            let force = 9.2e-6 * u - 1.3586e-5 * v - 27966.9 * x;
            [*v, force / 6.6e-7, (9.2e-6 * x - passed) / 1.034e-4]
        }),
        read: Box::new(|[x, _, passed]| [-(9.2e-6 * x - passed) / 4.7e-12]),
        noise: [0.0, 2.5e-11, 0.0],
        sample_sd: [5e-5],
        start: [0.0; 3],
        start_sd: [1e-10, 2e-5, 1e-15],
        drive: Box::new(|t| 0.01 * (TAU * 32_762.0 * t).sin()),
        is_driven: true,
        between: between(per_cycle),
        rate_hz: 32_762.0 * per_cycle,
        substeps: whole(1600.0 / per_cycle),
        skip_s: 10e-3,
    }
}

/// Two modes that a rate of rotation couples, which is a state with its own bandwidth.
fn vibrating_gyroscope(per_cycle: f64) -> Device<6, 2> {
    let text = r#"
[device.equations]
states = { Omega = "rad/s", alpha = "rad/s^2", x = "m", v = "m/s", y = "m", w = "m/s" }
inputs = { drive = "V" }
interpolation = "BETWEEN"
measure = { signal0 = "0.2[V/um]*x in V", signal1 = "10[V/um]*y in V" }
parameters = { m = "1e-8 kg", k = "39.44 N/m", bandwidth = "125.66 rad/s" }
[device.equations.derivative]
x = "v"
v = "(3.9e-8[N/V]*drive - 1.2e-7[N s/m]*v - k*x - 5e-3[N/m]*y)/m + 2*Omega*w"
y = "w"
w = "(-6.8e-7[N s/m]*w - 41.5[N/m]*y - 5e-3[N/m]*x)/m - 2*Omega*v"
Omega = "alpha"
alpha = "-bandwidth^2*Omega - 2*bandwidth*alpha"
[device.equations.noise]
v = "2*4.0453e-21[J]*1.2e-7[N s/m]/m^2"
w = "2*4.0453e-21[J]*6.8e-7[N s/m]/m^2"
alpha = "4*bandwidth^3*1[rad^2/s^2]"
signal0 = "1e-6[V^2]"
signal1 = "9e-8[V^2]"
"#;
    let thermal = |damping: f64| 2.0 * 4.0453e-21 * damping / 1e-16;
    Device {
        text: text.replace("BETWEEN", interpolation(per_cycle)),
        states: ["Omega", "alpha", "x", "v", "y", "w"],
        units: ["rad/s", "rad/s^2", "m", "m/s", "m", "m/s"],
        rate: Box::new(|[turning, change, x, v, y, w], u| {
            let of_drive = 3.9e-8 * u - 1.2e-7 * v - 39.44 * x - 5e-3 * y;
            let of_sense = -6.8e-7 * w - 41.5 * y - 5e-3 * x;
            let (b, coriolis) = (125.66, 2.0 * turning);
            let settles = -b * b * turning - 2.0 * b * change;
            [*change, settles, *v, of_drive / 1e-8 + coriolis * w, *w, of_sense / 1e-8 - coriolis * v]
        }),
        read: Box::new(|[_, _, x, _, y, _]| [2e5 * x, 1e7 * y]),
        noise: [0.0, 4.0 * 125.66_f64.powi(3), 0.0, thermal(1.2e-7), 0.0, thermal(6.8e-7)],
        sample_sd: [1e-3, 3e-4],
        start: [0.0, 0.0, -4e-6, 0.0, 0.0, 0.0],
        start_sd: [1.0, 125.66, 1e-7, 6e-3, 2e-8, 1.3e-3],
        drive: Box::new(|t| (TAU * 9995.0 * t).sin()),
        is_driven: true,
        between: between(per_cycle),
        rate_hz: 9995.0 * per_cycle,
        substeps: whole(1600.0 / per_cycle),
        skip_s: 20e-3,
    }
}

/// A plate whose distance swings, with amplitude, frequency and phase as states.
fn piston_mirror(per_cycle: f64) -> Device<5, 1> {
    let text = r#"
[device.equations]
states = { A = "m", f = "Hz", phi = "rad", d0 = "m", A_rate = "m/s" }
let = { near = "1[mm]/(d0 + A*cos(phi))" }
derivative = { A = "A_rate", f = "0", phi = "2*pi*f", d0 = "0", A_rate = "0" }
measure = { signal0 = "1[V/pF]*(3[fF] + 100[fF]*near + 9.3[fF]*near^2) in V" }
cyclic = { phi = "2*pi" }
noise = { f = "1e-4[Hz^2/s]", d0 = "1e-13[m^2/s]", A_rate = "1e-9[m^2/s^3]", signal0 = "1e-10[V^2]" }
"#;
    Device {
        text: text.to_owned(),
        states: ["A", "f", "phi", "d0", "A_rate"],
        units: ["m", "Hz", "rad", "m", "m/s"],
        rate: Box::new(|x, _| [x[4], 0.0, TAU * x[1], 0.0, 0.0]),
        read: Box::new(|[amplitude, _, phase, distance, _]| {
            let near = 1e-3 / (distance + amplitude * phase.cos());
            [3e-3 + 0.1 * near + 9.3e-3 * near * near]
        }),
        noise: [0.0, 1e-4, 0.0, 1e-13, 1e-9],
        sample_sd: [1e-5],
        start: [0.5e-3, 500.0, 0.7, 1e-3, 0.0],
        start_sd: [1e-7, 0.01, 1e-3, 1e-7, 1e-6],
        drive: Box::new(|_| 0.0),
        is_driven: false,
        between: Between::Held,
        rate_hz: 500.0 * per_cycle,
        substeps: 16,
        skip_s: 40e-3,
    }
}

/// A switch that is pulled in, bounces off its contact as off a spring, and is let go.
fn contact_switch(per_cycle: f64) -> Device<2, 1> {
    let text = r#"
[device.equations]
states = { x = "m", v = "m/s" }
inputs = { drive = "V" }
interpolation = "hold"
let = { w = "251327.412[1/s]", contact = "if(x > 1.2[um], 8000[N/m]*(x - 1.2[um]), 0[N])" }
measure = { signal0 = "1[V/fF]*1.7708e-19[F m]/(2[um] - x) in V" }
noise = { v = "1e-3[m^2/s^3]", signal0 = "0.09[V^2]" }
[device.equations.derivative]
x = "v"
v = "-w/3*v - w^2*x + 1.7708e-19[F m]*drive^2/(4e-10[kg]*(2[um] - x)^2) - contact/2e-10[kg]"
"#;
    Device {
        text: text.to_owned(),
        states: ["x", "v"],
        units: ["m", "m/s"],
        rate: Box::new(|[x, v], u| {
            let (w, gap) = (251_327.412, 2e-6 - x);
            let contact = 8000.0 * (x - 1.2e-6).max(0.0);
            let pull = 1.7708e-19 * u * u / (2.0 * gap * gap);
            [*v, (pull - contact) / 2e-10 - w / 3.0 * v - w * w * x]
        }),
        read: Box::new(|[x, _]| [1.7708e-4 / (2e-6 - x)]),
        noise: [0.0, 1e-3],
        sample_sd: [0.3],
        start: [0.0; 2],
        start_sd: [1e-9, 1e-3],
        drive: Box::new(|t| if t < 1e-3 { 22.0 } else { 0.0 }),
        is_driven: true,
        between: Between::Held,
        rate_hz: 40e3 * per_cycle,
        substeps: whole(20_000.0 / per_cycle),
        skip_s: 2e-5,
    }
}

/// A mirror in resonance that is read by a comb at a threshold.
fn threshold(per_cycle: f64) -> Device<2, 1> {
    let text = r#"
[device.equations]
states = { theta = "rad", omega = "rad/s" }
inputs = { drive = "V" }
interpolation = "BETWEEN"
let = { form = "1/(1 + exp(-76*(theta - 0.0037)))" }
derivative = { theta = "omega", omega = "-0.0132*w*omega - w^2*theta + 600[rad/s^2/V]*drive" }
measure = { signal0 = "2.82[mV s/rad]*form*omega + 1[mV] in V" }
noise = { omega = "1e3[rad^2/s^3]", signal0 = "1e-6[V^2]" }
parameters = { w = "3924.477 1/s" }
"#;
    Device {
        text: text.replace("BETWEEN", interpolation(per_cycle)),
        states: ["theta", "omega"],
        units: ["rad", "rad/s"],
        rate: Box::new(|[angle, rate], u| {
            let w = 3924.477;
            [*rate, -0.0132 * w * rate - w * w * angle + 600.0 * u]
        }),
        read: Box::new(|[angle, rate]| [2.82e-3 * rate / (1.0 + (-76.0 * (angle - 3.7e-3)).exp()) + 1e-3]),
        noise: [0.0, 1e3],
        sample_sd: [1e-3],
        start: [-0.088, 0.0],
        start_sd: [1e-3, 4.0],
        drive: Box::new(|t| 30.0 * (TAU * 624.6 * t).sin()),
        is_driven: true,
        between: between(per_cycle),
        rate_hz: 624.6 * per_cycle,
        substeps: whole(1600.0 / per_cycle),
        skip_s: 20e-3,
    }
}

//! Filters that are told what is true, at several sampling rates: their verdicts, their errors against their claims, and what their steps cost.

use super::further_devices::{
    between, comb_resonator, contact_switch, piston_mirror, threshold, tuning_fork, vibrating_gyroscope,
};
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

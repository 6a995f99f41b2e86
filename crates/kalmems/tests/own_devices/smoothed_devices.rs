//! Smoothed answers of right filters: never worse than the filters' beyond chance, and covered as they claim, by simulators that share no code.

use super::further_devices::{
    between, comb_resonator, contact_switch, piston_mirror, threshold, tuning_fork, vibrating_gyroscope,
};
use super::step_errors::{Device, accelerometer, ring, scanner, stiffening, whole};
use kalmems::progress::Silent;
use kalmems::rigs::published;
use kalmems::simulate::WhiteNoise;
use kalmems::workflow;

/// What a filter and its smoother say of one sample of a state: the errors of both in standard deviations that they claim, and that of the
/// smoother in those of the filter.
struct SmoothedState {
    filtered: f64,
    smoothed: f64,
    by_filter: f64,
}

/// Of each state, at another place behind the start in each run.
fn smoothed<const N: usize, const M: usize>(
    device: &Device<N, M>,
    samples: usize,
    seed: u64,
) -> Vec<SmoothedState> {
    let folder = tempfile::tempdir().unwrap();
    let mut chance = WhiteNoise::new(seed, 6);
    let start = std::array::from_fn(|i| device.start[i] + device.start_sd[i] * chance.sample());
    device.record_from(start, folder.path(), samples, seed);
    let experiment = device.experiment(folder.path(), &["smooth = true"]);
    let outcome = workflow::estimate(published(), &experiment, &Silent).unwrap();
    let [filter, smoother] = &outcome.recordings[0].segments[0].estimate.trajectories[..] else {
        panic!("a filter and its smoother")
    };
    assert!(smoother.failure.is_none(), "{:?}", smoother.failure);
    let truth = std::fs::read_to_string(folder.path().join("reference.csv")).unwrap();
    let place = samples / 20 + (usize::try_from(seed).unwrap() * 7919) % (samples * 9 / 10);
    let row: Vec<f64> =
        truth.lines().nth(place + 1).unwrap().split(',').map(|cell| cell.parse().unwrap()).collect();
    assert!((row[0] - filter.time_s[place]).abs() < 1e-9);
    let of_state = |i: usize| {
        let (before, after) = (&filter.states[i], &smoother.states[i]);
        let [was, is] = [before, after].map(|state| state.mean[place] - row[i + 1]);
        let (sd, least) = (before.sd[place], after.sd[place]);
        // A phase is known but for turns.
        let known = sd > 0.0 && least > 0.0 && device.states[i] != "phi";
        known.then(|| SmoothedState { filtered: was / sd, smoothed: is / least, by_filter: is / sd })
    };
    (0..N).filter_map(of_state).collect()
}

/// The runs of a device by a seed.
type SmoothedBySeed = Box<dyn Fn(u64) -> Vec<SmoothedState>>;

fn devices() -> Vec<(&'static str, SmoothedBySeed)> {
    const PER_CYCLE: f64 = 32.0;
    let samples = |cycles: f64| whole(cycles * PER_CYCLE);
    vec![
        (
            "scanner",
            Box::new(move |seed| {
                smoothed(&scanner(PER_CYCLE, 1e4, between(PER_CYCLE)), samples(700.0), seed)
            }),
        ),
        (
            "resonance a state",
            Box::new(move |seed| smoothed(&stiffening(20e3 * PER_CYCLE), samples(1000.0), seed)),
        ),
        (
            "ring",
            Box::new(move |seed| {
                smoothed(&Device { rate_hz: 7.5e3 * PER_CYCLE, ..ring() }, samples(900.0), seed)
            }),
        ),
        ("comb resonator", Box::new(move |seed| smoothed(&comb_resonator(PER_CYCLE), samples(800.0), seed))),
        ("tuning fork", Box::new(move |seed| smoothed(&tuning_fork(PER_CYCLE), samples(1500.0), seed))),
        (
            "vibrating gyroscope",
            Box::new(move |seed| smoothed(&vibrating_gyroscope(PER_CYCLE), samples(1000.0), seed)),
        ),
        (
            "accelerometer",
            Box::new(move |seed| smoothed(&accelerometer(4.5e3 * PER_CYCLE), samples(700.0), seed)),
        ),
        ("piston mirror", Box::new(move |seed| smoothed(&piston_mirror(PER_CYCLE), samples(400.0), seed))),
        ("threshold", Box::new(move |seed| smoothed(&threshold(PER_CYCLE), samples(300.0), seed))),
        ("contact switch", Box::new(move |seed| smoothed(&contact_switch(PER_CYCLE), samples(80.0), seed))),
    ]
}

/// Mean and its standard deviation.
fn mean_of(numbers: &[f64]) -> (f64, f64) {
    let n = numbers.len() as f64;
    let mean = numbers.iter().sum::<f64>() / n;
    (mean, (numbers.iter().map(|one| (one - mean).powi(2)).sum::<f64>() / n / n).sqrt())
}

#[test]
#[ignore = "slow: ten minutes on two processors in a release build"]
fn slow_smoothed_answers_are_no_worse_than_the_filters_and_covered_as_claimed() {
    const RUNS: u64 = 20;
    let (mut within, mut of_all, mut gains) = (0, 0, Vec::new());
    for (name, run) in devices() {
        let states: Vec<SmoothedState> = (1100..1100 + RUNS).flat_map(run).collect();
        let inside = states.iter().filter(|state| state.smoothed.abs() < 1.96).count();
        let gains_of_device: Vec<f64> =
            states.iter().map(|state| state.by_filter.powi(2) - state.filtered.powi(2)).collect();
        let [(before, _), (after, _)] =
            [|state: &SmoothedState| state.filtered, |state: &SmoothedState| state.by_filter]
                .map(|of| mean_of(&states.iter().map(|state| of(state).powi(2)).collect::<Vec<_>>()));
        println!(
            "{name}: {inside} of {} within 95 %, mean squares {before:.3} filtered and {after:.3} smoothed",
            states.len()
        );
        // States of a run err together: no more is known than of so many runs.
        let covered = inside as f64 / states.len() as f64;
        let chance = (0.95 * 0.05 / RUNS as f64).sqrt();
        assert!(covered > 0.95 - 4.0 * chance, "{name}: {covered}");
        let (mean, deviation) = mean_of(&gains_of_device);
        assert!(
            mean < 4.0 * deviation * (states.len() as f64 / RUNS as f64).sqrt(),
            "{name}: {mean} ± {deviation}"
        );
        (within, of_all) = (within + inside, of_all + states.len());
        gains.extend(gains_of_device);
    }
    let (mean, deviation) = mean_of(&gains);
    println!(
        "{within} of {of_all} within 95 %; square of smoothed minus filtered {mean:.3} ± {deviation:.3}"
    );
    assert!((0.91..0.99).contains(&(within as f64 / of_all as f64)), "{within} of {of_all}");
    assert!(mean < 0.0, "{mean} ± {deviation}");
}

//! Detections as the filters are told of them: how certain they are, and those that are none, at random times.
#![allow(clippy::cast_possible_truncation)] // seeds and places: small

use super::bench::{ClosedFormDecay, INTERVAL_S, SAMPLES, ThresholdBench, crossings, errors, follow};
use crate::config::CrossingTiming;
use crate::progress::Silent;
use kalmems_rigs::crossings::{CrossingReading, LevelCrossing};
use rand_pcg::Pcg64;
use rand_pcg::rand_core::Rng;

/// How many are made up.
const FALSE: usize = 60;
const FILTERS: [&str; 3] = ["hybrid", "hybrid, resonance", "hybrid, resonance and gain"];

/// Of one filter: its errors in rad without them, with them behind the gate, and with them believed; and how many crossings
/// it was told of and refused, without and with them.
type DetectionEffect = ([f64; 3], [(usize, usize); 2]);

/// What they do to each filter, behind a gate of four standard deviations and without one.
fn harm(seed: u64) -> [DetectionEffect; 3] {
    let bench = ThresholdBench::new().unwrap();
    let settings = bench.settings_for(bench.device, &FILTERS);
    let decay = ClosedFormDecay::of(&bench.device, ClosedFormDecay::phase(seed as usize));
    let signal = decay.recorded(bench.device.noise_variance.sqrt(), seed);
    let found = crossings(&settings, &decay, &signal).unwrap();
    let mut chance = Pcg64::new(seed.into(), 9);
    let mut below = |count: usize| (chance.next_u64() % count as u64) as usize;
    // Made of those that a filter is told: a detection beside which the signal has no zero tells it nothing.
    let told: Vec<_> =
        found.iter().filter(|crossing| crossing.at(CrossingTiming::ZeroCrossing).is_some()).collect();
    let made_up = (0..FALSE).map(|_| {
        let original = told[below(told.len())];
        moved(original, below(SAMPLES - 1000))
    });
    let with_false: Vec<_> = made_up.chain(found.iter().copied()).collect();
    let run = |told: &[_], gate_nis: f64| {
        let mut settings = settings.clone();
        for filter in &mut settings.filters {
            filter.threshold.as_mut().unwrap().gate_nis = Some(gate_nis);
        }
        follow(&settings, &decay, (&signal, told), seed, &Silent).unwrap()
    };
    let runs = [run(&found, 16.0), run(&with_false, 16.0), run(&with_false, f64::INFINITY)];
    let counts = |i: usize, run: usize| {
        let counts = runs[run][i].counts;
        (counts.crossings, counts.crossings_refused)
    };
    std::array::from_fn(|i| {
        (std::array::from_fn(|run| errors(&runs[run][i], &decay)[4]), [counts(i, 0), counts(i, 1)])
    })
}

/// A crossing as it would be at another sample.
fn moved(crossing: &LevelCrossing, sample: usize) -> LevelCrossing {
    let by_s = sample as f64 * INTERVAL_S - crossing.sample.time_s;
    let moved = |instant: CrossingReading| CrossingReading { time_s: instant.time_s + by_s, ..instant };
    LevelCrossing {
        sample: moved(crossing.sample),
        parabola: moved(crossing.parabola),
        zero: crossing.zero.map(moved),
        fallback: crossing.fallback.map(moved),
        index: sample,
        known_at: crossing.known_at - crossing.index + sample,
    }
}

#[test]
fn sixty_false_detections_at_random_times_do_no_harm_behind_a_gate() {
    for seed in 0..2 {
        check(seed);
    }
}

#[test]
#[ignore = "20 recordings; run with --release"]
fn slow_sixty_false_detections_do_no_harm_in_any_of_20_recordings() {
    for seed in 0..20 {
        check(seed);
    }
}

/// The standard deviation that a filter is told for the angle at a zero crossing is that of its errors, in all four
/// quarters; on the way up and on the way down there is a bias beside it, the larger the more the curve bends while it is
/// passed.
#[test]
fn zero_crossings_scatter_with_the_claimed_variance() {
    let bench = ThresholdBench::new().unwrap();
    let settings = bench.settings_for(bench.device, &[]);
    // Of each quarter and direction: count, sum, sum of squares, sum of what was told.
    let mut sums = [[[0.0; 4]; 2]; 4];
    for seed in 0..24 {
        let decay = ClosedFormDecay::of(&bench.device, ClosedFormDecay::phase(seed as usize));
        let signal = decay.recorded(bench.device.noise_variance.sqrt(), seed);
        for crossing in crossings(&settings, &decay, &signal).unwrap() {
            let Some(instant) = crossing.at(CrossingTiming::ZeroCrossing) else { continue };
            let up = decay.angle_at(instant.time_s + 1e-6) > decay.angle_at(instant.time_s - 1e-6);
            for miss in decay.misses(&bench.device, [instant.time_s]) {
                let terms = [1.0, miss.angle, miss.angle.powi(2), instant.angle_variance];
                let sum = &mut sums[miss.quarter][usize::from(up)];
                sum.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
            }
        }
    }
    for (quarter, directions) in sums.into_iter().enumerate() {
        let (mut count, mut squares, mut told) = (0.0, 0.0, 0.0);
        for [n, sum, square, variance] in directions {
            println!("quarter {quarter}: bias {:.2e} rad of {n}", sum / n);
            assert!((sum / n).abs() < 0.35e-3, "{quarter}: {}", sum / n);
            (count, squares, told) = (count + n, squares + square - sum * sum / n, told + variance);
        }
        let (seen, told) = ((squares / count).sqrt(), (told / count).sqrt());
        println!("quarter {quarter}: {seen:.2e} rad, told {told:.2e}");
        assert!((told / seen - 1.0).abs() < 0.15, "{quarter}: {seen} {told}");
    }
}

fn check(seed: u64) {
    for (name, ([clean, gated, believed], [before, with])) in FILTERS.iter().zip(harm(seed)) {
        println!(
            "seed {seed}, {name}: {:.3} mrad, gated {:.3}, believed {:.3}; refused {} of {}, before {} of {}",
            1e3 * clean,
            1e3 * gated,
            1e3 * believed,
            with.1,
            with.0,
            before.1,
            before.0
        );
        assert_eq!(with.0, before.0 + FALSE);
        assert!(gated <= 1.2 * clean, "{seed} {name}: {gated} {clean}");
        assert!(believed > 2.0 * clean, "{seed} {name}: {believed} {clean}");
    }
}

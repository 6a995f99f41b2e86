//! How often the intervals of a calibration under vibration hold what was put in.

use super::coverage::assert_95_of_100;
use super::refusals::{SHAKEN, Shaken, UPRIGHT, falling_with_frequency, oblique, shaken};
use super::simulated::Noise;
use kalmems_applications::calibration::UncertainEstimate;
use std::collections::BTreeMap;

/// What all scale factors of a record are off by, one standard deviation.
const SCATTER: f64 = 3e-4;

/// The same records with a scatter from record to record.
fn scattered(records: Vec<Shaken>, seed: u64) -> Vec<Shaken> {
    let mut noise = Noise::new(seed);
    let each =
        records.into_iter().map(|own| Shaken { gain: own.gain * (1.0 + SCATTER * noise.normal()), ..own });
    each.collect()
}

fn count(held: &mut BTreeMap<String, usize>, name: String, found: &UncertainEstimate, truth: f64) {
    let [low, high] = found.interval;
    assert!(low < found.value && found.value < high, "{name}: {found:?}");
    *held.entry(name).or_default() += usize::from(low <= truth && truth <= high);
}

/// All nine entries by 24 records about four directions.
fn matrices_held(seeds: std::ops::Range<u64>) -> BTreeMap<String, usize> {
    let mut held = BTreeMap::new();
    for seed in seeds {
        let records = scattered([oblique(), oblique()].into_iter().flatten().collect(), seed);
        let found = shaken(UPRIGHT, &records, "", seed);
        let result = &found.results[0];
        for (k, truth) in UPRIGHT.into_iter().flatten().enumerate() {
            let entry = result.matrix[k / 3][k % 3].unwrap();
            count(&mut held, format!("k_{}{}", k / 3, k % 3), &entry, truth);
        }
    }
    held
}

/// The scale factor at each of five frequencies by four records.
fn frequencies_held(seeds: std::ops::Range<u64>) -> BTreeMap<String, usize> {
    let mut held = BTreeMap::new();
    for seed in seeds {
        let found = shaken(UPRIGHT, &scattered(falling_with_frequency(4), seed), "", seed);
        let result = &found.results[0];
        assert_eq!(result.by_frequency.len(), 5, "{:?}", result.withheld);
        for (at, true_gain) in result.by_frequency.iter().zip([1.0, 0.98, 0.96, 0.94, 0.92]) {
            let name = format!("{:.0} Hz", at.frequency_hz);
            count(&mut held, name, &at.scale_factor, true_gain * UPRIGHT[1][1]);
        }
    }
    held
}

/// One scale factor by four records of one frequency.
fn factors_held(seeds: std::ops::Range<u64>) -> BTreeMap<String, usize> {
    let mut held = BTreeMap::new();
    for seed in seeds {
        let found = shaken(UPRIGHT, &scattered((0..4).map(|_| SHAKEN).collect(), seed), "", seed);
        count(&mut held, "k_11".to_owned(), &found.results[0].scale_factor, UPRIGHT[1][1]);
    }
    held
}

/// Four or fewer of eight come once in 2700 times for one number.
#[test]
fn vibrations_give_a_matrix_and_scale_factors_by_frequency_with_intervals() {
    for held in [matrices_held(0..8), frequencies_held(0..8)] {
        assert!(held.values().all(|held| *held >= 5), "{held:?}");
    }
}

#[test]
#[ignore = "1200 records; cargo test -p kalmems-applications --test inertial -- --ignored slow_"]
fn slow_intervals_by_vibrations_hold_95_of_100() {
    assert_95_of_100("one frequency", factors_held(1000..1400), 400);
    assert_95_of_100("all nine entries", matrices_held(1000..1400), 400);
    assert_95_of_100("by frequency", frequencies_held(1000..1400), 400);
}

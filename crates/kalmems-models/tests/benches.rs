//! What the benches compare computes the same.

// The generic filters, the ones by hand and those of other crates, as the benches run them.
#[path = "../benches/by_hand/mod.rs"]
mod by_hand;
#[path = "../benches/cases/mod.rs"]
mod cases;
#[path = "../benches/peers/mod.rs"]
mod peers;
#[path = "../benches/system/mod.rs"]
mod system;

use kalmems_core::{FilterError, Nodes, Scalar};
use system::{Outcome, Run, System};

/// Samples: more than the filter remembers.
const LENGTH: usize = 3000;

/// All that a filter says, each number with its natural scale.
fn numbers<T: Scalar + Into<f64>>(outcome: &Outcome<T>, with_innovations: bool) -> Vec<(f64, f64)> {
    let [p00, p10, p11] = outcome.covariance.map(Into::into);
    let (d0, d1) = (p00.sqrt(), p11.sqrt());
    let mean: [f64; 2] = outcome.mean.map(Into::into);
    let mut numbers = vec![(mean[0], d0), (mean[1], d1), (p00, p00), (p10, d0 * d1), (p11, p11)];
    if with_innovations {
        let said = outcome.innovations.expect("the filter gives its innovations");
        let (s, nis) = (said.variance.into(), said.nis.into());
        numbers.extend([(said.residual.into(), s.sqrt()), (s, s), (nis, nis)]);
    }
    numbers
}

/// Runs two filters and compares all that they say, relative to its scale.
fn assert_equal<T: Scalar + Into<f64>>(name: &str, system: &System<T>, runs: [Run<T>; 2], tolerance: f64) {
    let outcomes = runs.map(|run| run(system).expect("no filter refuses a step"));
    let with_innovations = outcomes.iter().all(|outcome| outcome.innovations.is_some());
    let [left, right] = outcomes.map(|outcome| numbers(&outcome, with_innovations));
    for ((a, scale), (b, _)) in left.into_iter().zip(right) {
        assert!((a - b).abs() <= tolerance * scale, "{name}: {a:e} and {b:e}, scale {scale:e}");
    }
}

fn assert_all_equal<T: Scalar + Into<f64>>(tolerance: f64) {
    let system = System::<T>::simulated(LENGTH);
    for comparison in cases::comparisons::<T>(0.0) {
        for case in &comparison.others {
            let name = format!("{}, {}", comparison.name, case.name);
            assert_equal(&name, &system, [comparison.run, case.run], tolerance);
        }
    }
}

#[test]
fn generic_filters_are_the_ones_by_hand() {
    assert_all_equal::<f64>(1e-12);
}

/// Single precision rounds to 6e-8, and one standard deviation of the angle is a hundredth of the angle.
#[test]
fn generic_filters_are_the_ones_by_hand_in_single_precision() {
    assert_all_equal::<f32>(1e-3);
}

/// A filter that checks less would be a fast one.
#[test]
fn filters_by_hand_refuse_what_generic_ones_refuse() {
    for bad in [f64::NAN, f64::INFINITY] {
        let mut measured = System::<f64>::simulated(LENGTH);
        (measured.samples[7].signal, measured.held[7].signal) = (bad, bad);
        let mut driven = System::<f64>::simulated(LENGTH);
        driven.samples[7].drive = Nodes::held(bad);
        driven.held[7].torque = bad;
        for (system, error) in
            [(measured, FilterError::NonFiniteMeasurement), (driven, FilterError::NonFiniteState)]
        {
            for comparison in cases::comparisons::<f64>(0.0) {
                for run in comparison.runs() {
                    assert_eq!(run(&system).err(), Some(error), "{}, {bad}", comparison.name);
                }
            }
        }
    }
}

fn assert_fixed_gain_is_the_same_to_the_bit<T: Scalar + Into<f64>>() {
    let system = System::<T>::simulated(LENGTH);
    let comparison = cases::fixed_gain_filters::<T>();
    for case in &comparison.others {
        assert_equal(comparison.name, &system, [comparison.run, case.run], 0.0);
    }
}

/// Both compute the same operations in the same order.
#[test]
fn fixed_gain_is_the_one_by_hand_to_the_bit() {
    assert_fixed_gain_is_the_same_to_the_bit::<f64>();
    assert_fixed_gain_is_the_same_to_the_bit::<f32>();
}

/// Or the comparison would be of something useless. The mean of `LENGTH` squares of standard normal numbers deviates
/// from 1 by √(2/3000) = 0.026; the readout's curvature over the swing adds to it.
#[test]
fn fixed_gain_follows_the_mirror_that_is_held() {
    let system = System::<f64>::simulated(LENGTH);
    let outcome = (cases::fixed_gain_filters::<f64>().run)(&system).expect("no step is refused");
    let nis = outcome.innovations.expect("the filter gives its innovations").nis / LENGTH as f64;
    assert!((nis - 1.0).abs() < 0.1, "the normalised innovations squared are {nis} on average");
}

/// P − K·H·P loses some digits where P is much larger than R, at the start.
#[test]
fn other_crates_give_the_same_estimate() {
    let system = System::<f64>::simulated(LENGTH);
    let ours: Run<f64> = |s| cases::follow(cases::ekf(s), s, &s.euler(), |d| d.start);
    assert_equal("nalgebra", &system, [ours, peers::nalgebra], 1e-12);
    assert_equal("adskalman", &system, [ours, peers::adskalman], 1e-12);
    assert_equal("kfilter", &system, [ours, peers::kfilter], 1e-9);
    assert_equal("minikalman", &system, [ours, peers::minikalman], 1e-9);
}

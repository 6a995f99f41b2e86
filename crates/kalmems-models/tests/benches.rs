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

use kalmems_core::Scalar;
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

fn assert_all_equal<T: Scalar<Mask = bool> + Into<f64>>(tolerance: f64) {
    let system = System::<T>::simulated(LENGTH);
    for comparison in cases::comparisons::<T>(0.0) {
        for case in &comparison.others {
            let name = format!("{}, {}", comparison.name, case.name);
            assert_equal(&name, &system, [comparison.by_hand, case.run], tolerance);
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

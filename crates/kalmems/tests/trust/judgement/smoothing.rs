//! The grade of a smoothed answer: by how much it changes that of its filter.

use super::{EKF, LAG, filters, usual};
use kalmems::estimate::TrajectoryKind;
use kalmems::evaluate::{Grade, InnovationTest};

/// What the test of the smoother's changes finds, and whether filter and smoother pass.
fn smoothed(text: &str, seed: u64) -> (f64, [bool; 2]) {
    let folder = usual(4000, seed);
    let all = filters(text, &folder);
    let [filter, smoother] = &all[..] else { panic!("{} answers", all.len()) };
    assert!(smoother.kind == TrajectoryKind::Smoothed);
    assert!(filter.tests.iter().all(|found| found.test != InnovationTest::Smoothing));
    let found = smoother.tests.iter().find(|found| found.test == InnovationTest::Smoothing).unwrap();
    (found.size, [filter, smoother].map(|one| one.grade < Some(Grade::Doubtful)))
}

fn told(settings: &str) -> String {
    format!("{LAG}{EKF}{settings}")
}

#[test]
fn smoothed_answers_of_right_filters_pass_and_change_as_much_as_they_claim() {
    for settings in ["smooth = true\n", "smooth_lag = \"0.4 ms\"\n"] {
        let (mut sum, seeds) = (0.0, 20);
        for seed in 0..seeds {
            let (size, passes) = smoothed(&told(settings), 900 + seed);
            assert_eq!(passes, [true; 2], "{settings} {seed} {size}");
            sum += size;
        }
        let mean = sum / 20.0;
        assert!((mean - 1.0).abs() < 0.1, "{settings} {mean}");
    }
}

#[test]
fn a_smoother_that_is_told_a_tenth_of_the_wandering_changes_more_than_it_claims() {
    let text = told("smooth = true\n").replace("q = \"1e-2 V^2/s\"", "q = \"1e-4 V^2/s\"");
    for seed in 0..5 {
        let (size, passes) = smoothed(&text, 950 + seed);
        assert!(size > 1.69 && passes == [false; 2], "{seed} {size} {passes:?}");
    }
}

#[test]
#[ignore = "500 recordings"]
fn slow_smoothed_answers_of_right_filters_pass_in_500_recordings() {
    let (mut doubted, mut sizes) = (0, Vec::new());
    for seed in 0..250 {
        for settings in ["smooth = true\n", "smooth_lag = \"0.4 ms\"\n"] {
            let (size, [_, passes]) = smoothed(&told(settings), 2000 + seed);
            doubted += usize::from(!passes);
            sizes.push(size);
        }
    }
    sizes.sort_by(f64::total_cmp);
    println!("{doubted} of 500 doubted; sizes {:?}", [0, 25, 250, 474, 499].map(|k| sizes[k]));
    assert!(doubted <= 1, "{doubted}");
}

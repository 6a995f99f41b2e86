//! Whether the filters of the scanner are as good as they say, over many runs.

use crate::chance::{binomial_interval, minus};
use crate::devices::{Device, demodulated, scanner};
use crate::follow::{correct, takes_all};
use crate::recording::{Noise, Recording, SAMPLES, simulate};
use kalmems_core::consistency::nees;
use kalmems_core::{Covariance, Ekf, Filter, SigmaPoints, SquareRootEkf, Ukf};

/// The 95 % quantile of χ² with two degrees of freedom, −2·ln 0.05.
const CHI2_2: f64 = 5.991_464_547_107_98;
const RUNS: u64 = 200;

/// Whether the NEES at the end of a run is above the quantile: of the extended, the unscented and the square-root
/// filter.
fn exceeds(seed: u64) -> [bool; 3] {
    let device = scanner::<f64, _, 1>(demodulated());
    let recording = simulate(&device, seed, Noise::Gaussian);
    let (mean, covariance) = (device.start.0, Covariance::from_standard_deviations(device.start.1));
    [
        at_end(Ekf::new(mean, covariance), &device, &recording),
        at_end(Ukf::new(mean, covariance, SigmaPoints::standard()), &device, &recording),
        at_end(SquareRootEkf::new(mean, covariance), &device, &recording),
    ]
}

/// Whether it is for one filter.
fn at_end<F: Filter<f64, 2>>(
    mut filter: F,
    device: &impl Device<f64, 2, 1>,
    recording: &Recording<2, 1>,
) -> bool {
    for (sample, y) in recording.signal.iter().enumerate() {
        if sample > 0 {
            device.advance(&mut filter, sample).unwrap();
        }
        correct(device, &mut filter, y, &takes_all()).unwrap();
    }
    nees(&minus(&recording.truth[SAMPLES - 1], filter.mean()), &filter.covariance()) > CHI2_2
}

/// How many of 200 runs exceed it.
fn exceedances(first_seed: u64) -> [usize; 3] {
    let mut counts = [0; 3];
    for seed in first_seed..first_seed + RUNS {
        for (count, exceeds) in counts.iter_mut().zip(exceeds(seed)) {
            *count += usize::from(exceeds);
        }
    }
    counts
}

#[test]
fn nees_exceeds_its_quantile_as_often_as_it_should() {
    let (low, high) = binomial_interval(200, 0.05, 1e-3);
    let counts = exceedances(0);
    assert!(counts.iter().all(|count| (low..=high).contains(count)), "{counts:?} not in {low}..={high}");
}

/// That the test above does not pass by its seeds.
#[test]
#[ignore = "long: `.ci/run --all` runs it"]
fn long_nees_exceedances_over_many_seeds() {
    let (low, high) = binomial_interval(200, 0.05, 1e-3);
    let blocks: Vec<_> = (0..40).map(|block| exceedances(1_000_000 + RUNS * block)).collect();
    println!("{blocks:?}");
    assert!(blocks.iter().flatten().all(|count| (low..=high).contains(count)));
    // All 8000 together.
    let (low, high) = binomial_interval(8000, 0.05, 1e-3);
    for filter in 0..3 {
        let total = blocks.iter().map(|counts| counts[filter]).sum();
        assert!((low..=high).contains(&total), "{total} not in {low}..={high}");
    }
}

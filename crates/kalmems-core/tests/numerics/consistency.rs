//! The statistics of consistency against dense formulas and printed values, and whether right filters pass
//! and wrong ones fail.

use crate::chance::{Chance, binomial_interval, minus, plus, spread};
use kalmems_core::consistency::{Consistency, nees};
use kalmems_core::{
    Covariance, Ekf, Filter, Innovation, Kalman, LinearMeasurement, LinearProcess, Mat, Measurement, Nodes,
    NoiseDensity, Over, Process,
};
use nalgebra::{SMatrix, SVector};

/// 95 % quantiles of χ² (NIST/SEMATECH e-Handbook of Statistical Methods, 1.3.6.7.4).
const CHI2_2: f64 = 5.991;
const CHI2_10: f64 = 18.307;

/// An innovation of two components, made by a filter that knows nothing of the one before.
fn innovation<const M: usize>(y: [f64; M], s: &Covariance<f64, M>) -> Innovation<f64, M> {
    let seen = LinearMeasurement { matrix: Mat::<f64, M, M>::identity() };
    Ekf::new([0.0; M], Covariance::zero()).update(&seen, &y, s).unwrap()
}

#[test]
fn against_dense_formulas() {
    let mut chance = Chance::new(1);
    let s = Covariance::from_lower(Mat([[2.0, 0.0], [0.7, 0.5]]));
    let dense = SMatrix::<f64, 2, 2>::new(2.0, 0.7, 0.7, 0.5);
    let l = dense.cholesky().unwrap().l();
    // Correlated in time on purpose, so that nothing is near zero; 7 of 60 missing.
    let mut consistency = Consistency::<f64, 2, 4>::new();
    let mut series: Vec<Option<SVector<f64, 2>>> = Vec::new();
    let (mut y, mut log_likelihood) = ([0.0; 2], 0.0);
    for k in 0..60 {
        y = plus([0.8 * y[0] + 0.1, 0.5 * y[1]], chance.vector(&s));
        if k % 9 == 5 {
            consistency.miss();
            series.push(None);
        } else {
            consistency.add(&innovation(y, &s));
            series.push(l.solve_lower_triangular(&SVector::from(y)));
            let square = series[k].unwrap().norm_squared();
            log_likelihood -= 0.5 * (2.0 * std::f64::consts::TAU.ln() + dense.determinant().ln() + square);
        }
    }
    let seen: Vec<_> = series.iter().flatten().collect();
    let n = seen.len() as f64;
    let energy: f64 = seen.iter().map(|z| z.norm_squared()).sum();
    approx::assert_relative_eq!(consistency.samples(), n);
    approx::assert_relative_eq!(consistency.mean_nis(), energy / n, max_relative = 1e-13);
    approx::assert_relative_eq!(consistency.mean_nis_deviation(), (4.0 / n).sqrt(), max_relative = 1e-15);
    approx::assert_relative_eq!(consistency.log_likelihood(), log_likelihood, max_relative = 1e-13);
    let mean = seen.iter().copied().sum::<SVector<f64, 2>>() / n;
    for i in 0..2 {
        approx::assert_relative_eq!(consistency.mean()[i], mean[i], max_relative = 1e-12);
    }
    let mut statistic = 0.0;
    for lag in 1..=4 {
        let pairs: Vec<f64> = (lag..60).filter_map(|k| Some(series[k]?.dot(&series[k - lag]?))).collect();
        let correlation = pairs.iter().sum::<f64>() / energy;
        approx::assert_relative_eq!(
            consistency.autocorrelations()[lag - 1],
            correlation,
            max_relative = 1e-12
        );
        // The variance of a sum of products of white numbers, over that of their energy.
        statistic += correlation.powi(2) / (2.0 * pairs.len() as f64 / (2.0 * n * (2.0 * n + 2.0)));
    }
    let whiteness = consistency.ljung_box();
    approx::assert_relative_eq!(whiteness.statistic, statistic, max_relative = 1e-12);
    assert_eq!(whiteness.degrees_of_freedom, 4.0);
}

#[test]
fn ljung_box_as_statsmodels_has_it() {
    // Ten numbers with mean zero. statsmodels 0.15.0: acorr_ljungbox(y, lags=[3]) and tsa.stattools.acf(y,
    // nlags=3).
    let y = [0.3, -1.2, 0.8, 1.5, -0.4, -0.9, 0.1, 0.7, -1.1, 0.2];
    let mut consistency = Consistency::<f64, 1, 3>::new();
    for y in y {
        consistency.add(&innovation([y], &Covariance::from_variances([1.0])));
    }
    let printed = [-0.191_876_750_700_280_07, -0.542_016_806_722_688_9, 0.152_661_064_425_770_32];
    approx::assert_relative_eq!(
        consistency.ljung_box().statistic,
        5.297_143_600_670_891,
        max_relative = 1e-12
    );
    for (found, printed) in consistency.autocorrelations().iter().zip(printed) {
        approx::assert_relative_eq!(*found, printed, max_relative = 1e-12);
    }
    approx::assert_relative_eq!(consistency.autocorrelation_band(), 0.619_795_03, max_relative = 1e-8);
}

#[test]
fn few_samples_have_few_lags() {
    let mut consistency = Consistency::<f64, 1, 5>::new();
    for _ in 0..3 {
        consistency.add(&innovation([1.0], &Covariance::from_variances([1.0])));
    }
    let whiteness = consistency.ljung_box();
    // ρ₁ = 2/3 and ρ₂ = 1/3: 3·5·(4/9/2 + 1/9/1).
    assert_eq!(whiteness.degrees_of_freedom, 2.0);
    approx::assert_relative_eq!(whiteness.statistic, 5.0, max_relative = 1e-15);
}

#[test]
fn a_long_sum_in_f32_keeps_its_small_terms() {
    let mut consistency = Consistency::<f32, 1, 1>::new();
    let seen = LinearMeasurement { matrix: Mat([[1.0_f32]]) };
    let one = Ekf::new([0.0_f32], Covariance::zero())
        .update(&seen, &[1.0], &Covariance::from_variances([1.0]))
        .unwrap();
    // A plain sum of ones in f32 ends at 2²⁴.
    let n = (1 << 24) + 1_000_000;
    for _ in 0..n {
        consistency.add(&one);
    }
    assert_eq!(consistency.samples(), n as f32);
    assert_eq!(consistency.mean_nis(), 1.0);
    let likelihood = -0.5 * (std::f32::consts::TAU.ln() + 1.0);
    assert!((consistency.log_likelihood_per_sample() - likelihood).abs() < 1e-6);
}

#[test]
fn white_innovations_are_rarely_called_coloured() {
    // 2000 sequences of 200: 5 % alarms within the 99.9 % interval of their count.
    let (low, high) = binomial_interval(2000, 0.05, 1e-3);
    let mut alarms = 0;
    let mut nis = Vec::new();
    for seed in 0..2000 {
        let mut chance = Chance::new(seed);
        let mut consistency = Consistency::<f64, 1, 10>::new();
        for _ in 0..200 {
            consistency.add(&innovation([2.0 * chance.gaussian()], &Covariance::from_variances([4.0])));
        }
        alarms += usize::from(consistency.ljung_box().statistic > CHI2_10);
        nis.push((consistency.mean_nis() - 1.0) / consistency.mean_nis_deviation());
    }
    assert!((low..=high).contains(&alarms), "{alarms} not in {low}..={high}");
    // The stated standard deviation of the mean NIS is its own: within 4 standard errors, 1/√(2·2000) each.
    let (mean, deviation) = spread(&nis);
    assert!(mean.abs() < 4.0 / 2000_f64.sqrt(), "{mean}");
    assert!((deviation - 1.0).abs() < 4.0 / 4000_f64.sqrt() + 0.02, "{deviation}");
}

/// A resonator of 1 kHz and quality 50, sampled at 20 kHz, in units of its motion: position and velocity/ω.
fn resonator(frequency: f64) -> LinearProcess<f64, 2, 0> {
    let w = std::f64::consts::TAU * frequency;
    let density = NoiseDensity::none().on::<1>(1.0);
    LinearProcess::exact(&Mat([[0.0, w], [-w, -w / 50.0]]), &Mat::zero(), &density, 1.0 / 20_000.0)
}

const POSITION: LinearMeasurement<f64, 2, 1> = LinearMeasurement { matrix: Mat([[1.0, 0.0]]) };

/// One recording of the 1 kHz resonator, filtered as one of `frequency`; the squared error at the end.
fn follow(frequency: f64, seed: u64, samples: usize) -> (Consistency<f64, 1, 10>, f64) {
    let (truth, model) = (resonator(1000.0), resonator(frequency));
    let (start, r) = (Covariance::from_variances([1e-2; 2]), Covariance::from_variances([1e-4]));
    let mut chance = Chance::new(seed);
    let mut x = chance.vector(&start);
    let mut filter = Kalman::new([0.0; 2], start);
    let mut consistency = Consistency::new();
    for _ in 0..samples {
        x = plus(truth.step(&x, &[]), chance.vector(truth.noise.covariance()));
        filter.predict(&model, &[]).unwrap();
        let y = [x[0] + chance.gaussian() * 1e-2];
        consistency.add(&filter.update(&POSITION, &y, &r).unwrap());
    }
    (consistency, nees(&minus(&x, filter.mean()), filter.covariance()))
}

#[test]
fn a_wrong_resonance_is_seen_by_whiteness() {
    // The right one passes as often as it should, one that is 10 % off never does.
    let right = (0..200).filter(|seed| follow(1000.0, *seed, 2000).0.ljung_box().statistic > CHI2_10).count();
    let (low, high) = binomial_interval(200, 0.05, 1e-3);
    assert!((low..=high).contains(&right), "{right}");
    let wrong = (0..200).filter(|seed| follow(1100.0, *seed, 2000).0.ljung_box().statistic > CHI2_10).count();
    assert_eq!(wrong, 200);
}

/// A pendulum with a torque that is white, and its horizontal position as seen.
struct Pendulum {
    noise: kalmems_core::ProcessNoise<f64, 2>,
}
impl Process<f64, 2> for Pendulum {
    type Input = Nodes<()>;
    fn step<S: Over<f64>>(&self, x: &[S; 2], _: &Nodes<()>) -> [S; 2] {
        // Semi-implicit Euler: an exact map of its own, which truth and filter share.
        let rate = x[1] - x[0].sin() * 0.05;
        [x[0] + rate * 0.05, rate]
    }
    fn noise(&self) -> &kalmems_core::ProcessNoise<f64, 2> {
        &self.noise
    }
}
struct Horizontal;
impl Measurement<f64, 2, 1> for Horizontal {
    fn predict<S: Over<f64>>(&self, x: &[S; 2]) -> [S; 1] {
        [x[0].sin()]
    }
}

/// NEES of a pendulum swinging by 0.5 rad, where sin θ is 4 % short of θ.
fn pendulum(seed: u64) -> f64 {
    let process = Pendulum { noise: Covariance::from_variances([1e-8, 1e-6]).into() };
    let start = Covariance::from_standard_deviations([0.02, 0.02]);
    let r = Covariance::from_standard_deviations([0.02]);
    let mut chance = Chance::new(seed);
    let mut x = plus([0.5, 0.0], chance.vector(&start));
    let mut filter = Ekf::new([0.5, 0.0], start);
    for _ in 0..300 {
        let input = Nodes::held(());
        x = plus(process.step(&x, &input), chance.vector(process.noise.covariance()));
        filter.predict(&process, &input).unwrap();
        let y = [Horizontal.predict(&x)[0] + 0.02 * chance.gaussian()];
        filter.update(&Horizontal, &y, &r).unwrap();
    }
    nees(&minus(&x, filter.mean()), &filter.covariance())
}

/// How many of 200 runs have a NEES above the 95 % quantile.
fn exceedances(first_seed: u64, run: impl Fn(u64) -> f64) -> usize {
    (first_seed..first_seed + 200).filter(|seed| run(*seed) > CHI2_2).count()
}

#[test]
fn nees_exceeds_its_quantile_as_often_as_it_should() {
    let (low, high) = binomial_interval(200, 0.05, 1e-3);
    assert_eq!((low, high), (2, 21)); // as scipy.stats.binom.ppf([0.0005, 0.9995], 200, 0.05)
    let linear = exceedances(0, |seed| follow(1000.0, seed, 200).1);
    let nonlinear = exceedances(0, pendulum);
    assert!((low..=high).contains(&linear), "linear {linear}");
    assert!((low..=high).contains(&nonlinear), "nonlinear {nonlinear}");
}

#[test]
#[ignore = "40 times the runs: shows that the test above does not pass by its seeds"]
fn nees_exceedances_over_many_seeds() {
    let (low, high) = binomial_interval(200, 0.05, 1e-3);
    let counts: Vec<(usize, usize)> = (0..40)
        .map(|block| {
            let first = 1_000_000 + 200 * block;
            (exceedances(first, |seed| follow(1000.0, seed, 200).1), exceedances(first, pendulum))
        })
        .collect();
    println!("{counts:?}");
    let outside = counts.iter().filter(|c| !(low..=high).contains(&c.0) || !(low..=high).contains(&c.1));
    assert_eq!(outside.count(), 0);
    // All 8000 together, each.
    let (low, high) = binomial_interval(8000, 0.05, 1e-3);
    let totals = counts.iter().fold((0, 0), |t, c| (t.0 + c.0, t.1 + c.1));
    assert!((low..=high).contains(&totals.0) && (low..=high).contains(&totals.1), "{totals:?}");
}

#[test]
fn nees_of_a_bad_covariance_is_no_number() {
    let singular = Covariance::from_lower(Mat([[1.0_f64, 0.0], [1.0, 1.0]]));
    assert!(nees(&[1.0, 1.0], &singular).is_nan());
    // A dense one.
    let p = Covariance::from_lower(Mat([[3.0, 0.0, 0.0], [1.0, 2.0, 0.0], [-0.5, 0.3, 1.0]]));
    let full = SMatrix::<f64, 3, 3>::from_fn(|i, j| p.get(i, j));
    let e = SVector::from([1.0, -2.0, 0.5]);
    let expected = (e.transpose() * full.try_inverse().unwrap() * e)[0];
    approx::assert_relative_eq!(nees(&[1.0, -2.0, 0.5], &p), expected, max_relative = 1e-13);
}

//! What fewer corrections cost: every k-th sample, and on need. Run with `--nocapture` for the tables.

use crate::chance::{Chance, minus, plus, spread};
use core::num::NonZeroU32;
use kalmems_core::consistency::nees;
use kalmems_core::update::{Decimation, OnNeed, SteadyDecimation};
use kalmems_core::{
    Covariance, Dynamics, Ekf, Filter, Kalman, LinearMeasurement, LinearProcess, Mat, Measurement, Nodes,
    NoiseDensity, Over, Process, Rk4, Scalar,
};

/// Seeds of each experiment.
const SEEDS: u64 = 30;

fn times(k: u32) -> NonZeroU32 {
    NonZeroU32::new(k).unwrap()
}

/// A resonator of 1 kHz and quality 50 that is driven by noise alone, sampled at 50 kHz; position and
/// velocity/ω.
fn resonator() -> LinearProcess<f64, 2, 0> {
    let w = std::f64::consts::TAU * 1000.0;
    let density = NoiseDensity::none().on::<1>(20.0);
    LinearProcess::exact(&Mat([[0.0, w], [-w, -w / 50.0]]), &Mat::zero(), &density, 2e-5)
}

const POSITION: LinearMeasurement<f64, 2, 1> = LinearMeasurement { matrix: Mat([[1.0, 0.0]]) };

/// What one way of filtering comes to over all seeds.
struct Outcome {
    /// The mean square error of the first state, by seed.
    squares: Vec<f64>,
    /// The share of samples that were used.
    used: f64,
    /// The mean of NEES over two states, by seed.
    nees: Vec<f64>,
}

impl Outcome {
    /// RMSE over all seeds.
    fn rmse(&self) -> f64 {
        spread(&self.squares).0.sqrt()
    }
}

fn print(name: &str, value: f64, outcome: &Outcome) {
    let (nees, of_seeds) = spread(&outcome.nees);
    let (mean, by_seed) = spread(&outcome.squares);
    let deviation = by_seed / (SEEDS as f64).sqrt() / (2.0 * mean.sqrt());
    println!(
        "{name} {value:4}: used {:6.2} %, RMSE {:.5} ± {deviation:.5}, NEES {nees:.3} ± {:.3}",
        100.0 * outcome.used,
        outcome.rmse(),
        of_seeds / (SEEDS as f64).sqrt(),
    );
}

/// The mean NEES of a filter that is right is 2, within what seeds make of it.
fn honest(outcome: &Outcome) -> bool {
    let (mean, deviation) = spread(&outcome.nees);
    (mean - 2.0).abs() < 5.0 * deviation / (outcome.nees.len() as f64).sqrt()
}

/// One way through 20 000 samples of the resonator, the first 2000 not judged.
fn on_resonator(mut correct: impl FnMut(&mut Kalman<f64, 2>, f64) -> bool) -> Outcome {
    let (process, start) = (resonator(), Covariance::from_variances([0.1; 2]));
    let mut outcome = Outcome { squares: Vec::new(), used: 0.0, nees: Vec::new() };
    for seed in 0..SEEDS {
        let mut chance = Chance::new(seed);
        let mut x = chance.vector(&start);
        let mut filter = Kalman::new([0.0; 2], start);
        let (mut square, mut total, mut used) = (0.0, 0.0, 0);
        for k in 0..20_000 {
            x = plus(process.step(&x, &[]), chance.vector(process.noise.covariance()));
            filter.predict(&process, &[]).unwrap();
            let y = x[0] + 0.1 * chance.gaussian();
            let taken = correct(&mut filter, y);
            if k >= 2000 {
                let error = minus(&x, filter.mean());
                square += error[0].powi(2) / 18_000.0;
                total += nees(&error, filter.covariance()) / 18_000.0;
                used += u32::from(taken);
            }
        }
        outcome.squares.push(square);
        outcome.nees.push(total);
        outcome.used += f64::from(used) / 18_000.0 / SEEDS as f64;
    }
    outcome
}

/// Corrections at every k-th sample.
fn decimated(k: u32) -> Outcome {
    let (mut decimation, r) = (Decimation::every(times(k)), Covariance::from_variances([1e-2]));
    on_resonator(|filter, y| {
        let due = decimation.due();
        if due {
            filter.update(&POSITION, &[y], &r).unwrap();
        }
        due
    })
}

#[test]
fn decimation_increases_the_error_as_the_riccati_recursion_predicts() {
    let r = Covariance::from_variances([1e-2]);
    let mut last = 0.0;
    for k in [1, 2, 5, 10, 20] {
        let outcome = decimated(k);
        print("every", f64::from(k), &outcome);
        let steady = SteadyDecimation::of(&resonator(), &POSITION, &r, times(k), 1e-12).unwrap();
        println!("           Riccati RMSE {:.5}", steady.mean.get(0, 0).sqrt());
        // Within five standard errors of the mean over the seeds.
        let (mean, deviation) = spread(&outcome.squares);
        let error = deviation / (SEEDS as f64).sqrt();
        assert!((mean - steady.mean.get(0, 0)).abs() < 5.0 * error, "{k}: {mean} ± {error}");
        assert!((outcome.used - 1.0 / f64::from(k)).abs() < 1e-3);
        assert!(honest(&outcome), "{k}: {:?}", spread(&outcome.nees));
        // More than five standard errors worse than with more samples.
        assert!(mean - 5.0 * error > last, "{k}: {mean} ± {error} against {last}");
        last = mean;
        // The corrected sample is better than the mean, and the one before a correction worse.
        let [after, mean, before] = [steady.after, steady.mean, steady.before].map(|p| p.get(0, 0));
        assert!(after <= mean && mean <= before);
    }
}

/// The period has 50 samples. One in 25 always sees the same phase, and never the other.
#[test]
fn decimation_by_half_the_period_is_worse_than_by_more() {
    let steady = |k| {
        let r = Covariance::from_variances([1e-2]);
        SteadyDecimation::of(&resonator(), &POSITION, &r, times(k), 1e-12).unwrap().mean.get(0, 0).sqrt()
    };
    let (half, more) = (decimated(25), decimated(30));
    print("every", 25.0, &half);
    print("every", 30.0, &more);
    println!("           Riccati RMSE {:.5} and {:.5}", steady(25), steady(30));
    assert!(steady(25) > 1.5 * steady(30) && half.rmse() > 1.5 * more.rmse());
    assert!(honest(&half) && honest(&more));
}

#[test]
fn the_steady_state_solves_the_riccati_equation() {
    // Against the residual of the equation itself over k steps, with dense matrices.
    let process = resonator();
    let dense = |m: &Mat<f64, 2, 2>| nalgebra::Matrix2::from_fn(|i, j| m[(i, j)]);
    let (f, q) = (dense(&process.transition), dense(&process.noise.covariance().to_full()));
    let h = nalgebra::RowVector2::new(1.0, 0.0);
    for k in [1, 3, 12] {
        let r = Covariance::from_variances([1e-2]);
        let steady = SteadyDecimation::of(&process, &POSITION, &r, times(k), 1e-14).unwrap();
        let mut p = dense(&steady.after.to_full());
        let mut total = nalgebra::Matrix2::zeros();
        for step in 1..=k {
            p = f * p * f.transpose() + q;
            if step < k {
                total += p;
            }
        }
        assert!((p - dense(&steady.before.to_full())).norm() < 1e-12 * p.norm());
        let after =
            p - p * h.transpose() * (h * p * h.transpose()).add_scalar(1e-2).try_inverse().unwrap() * h * p;
        assert!((after - dense(&steady.after.to_full())).norm() < 1e-10 * after.norm());
        let mean = (total + after) / f64::from(k);
        assert!((mean - dense(&steady.mean.to_full())).norm() < 1e-10 * mean.norm());
    }
    // A level that walks unseen has none.
    let walk = LinearProcess::<f64, 1, 0> {
        transition: Mat::identity(),
        input: Mat::zero(),
        noise: Covariance::from_variances([1.0]).into(),
    };
    let blind = LinearMeasurement { matrix: Mat([[0.0]]) };
    let r = Covariance::from_variances([1.0]);
    assert!(SteadyDecimation::of(&walk, &blind, &r, times(1), 1e-9).is_err());
}

/// A scanner's mirror: a resonator of 15.6 kHz whose angle is read through a Gaussian comb, as its
/// capacitance.
#[derive(Clone, Copy)]
struct Scanner;
impl<T: Scalar> Dynamics<T, 2> for Scanner {
    type Input = T;
    fn derivative<S: Over<T>>(&self, x: &[S; 2], torque: &T) -> [S; 2] {
        // Velocity in units of ω·rad, so that both states are of one size.
        let w = T::of(98_000.0);
        [x[1] * w, S::lift(*torque) - x[0] * w - x[1] * (w * T::of(0.005))]
    }
}
/// exp(−θ²/0.2²).
struct Comb;
impl<T: Scalar> Measurement<T, 2, 1> for Comb {
    fn predict<S: Over<T>>(&self, x: &[S; 2]) -> [S; 1] {
        [(-(x[0] * T::of(5.0)).sq()).exp()]
    }
    fn depends(_: usize, j: usize) -> bool {
        j == 0
    }
}

/// One way through 6000 samples of the scanner swinging by about 0.15 rad at 1 MHz, the first 1000 not
/// judged.
fn on_scanner(mut correct: impl FnMut(&mut Ekf<f64, 2>, f64) -> bool) -> Outcome {
    let noise = NoiseDensity::none().on::<1>(2e-2);
    let process = Rk4::new(Scanner, 1e-6, &noise, (&[0.0, 0.0], &0.0));
    let start = Covariance::from_standard_deviations([5e-3, 5e-3]);
    let mut outcome = Outcome { squares: Vec::new(), used: 0.0, nees: Vec::new() };
    for seed in 0..SEEDS {
        let mut chance = Chance::new(seed);
        let mut x = plus([0.15, 0.0], chance.vector(&start));
        let mut filter = Ekf::new([0.15, 0.0], start);
        let (mut square, mut total, mut used) = (0.0, 0.0, 0);
        for k in 0..6000 {
            // A torque in phase with the velocity keeps it swinging.
            let torque = |half: f64| -73.5 * f64::sin(0.098 * (f64::from(k) + half));
            let drive = Nodes { start: torque(0.0), middle: torque(0.5), end: torque(1.0) };
            x = plus(process.step(&x, &drive), chance.vector(process.noise().covariance()));
            filter.predict(&process, &drive).unwrap();
            let taken = correct(&mut filter, Comb.predict(&x)[0] + 0.02 * chance.gaussian());
            if k >= 1000 {
                let error = minus(&x, filter.mean());
                square += error[0].powi(2) / 5000.0;
                total += nees(&error, &filter.covariance()) / 5000.0;
                used += u32::from(taken);
            }
        }
        outcome.squares.push(square);
        outcome.nees.push(total);
        outcome.used += f64::from(used) / 5000.0 / SEEDS as f64;
    }
    outcome
}

#[test]
fn fewer_corrections_of_the_scanner_cost_accuracy_and_not_honesty() {
    let r = Covariance::from_variances([4e-4]);
    let mut decimated = Vec::new();
    for k in [1, 2, 4, 8, 16] {
        let mut decimation = Decimation::every(times(k));
        let outcome = on_scanner(|filter, y| {
            let due = decimation.due();
            if due {
                filter.update(&Comb, &[y], &r).unwrap();
            }
            due
        });
        print("every  ", f64::from(k), &outcome);
        decimated.push(outcome);
    }
    let mut on_need = Vec::new();
    for fraction in [0.0, 0.1, 0.2, 0.4, 0.8] {
        let outcome =
            on_scanner(|filter, y| filter.update_where(&Comb, &[y], &r, &OnNeed { fraction }).unwrap().taken);
        print("on need", fraction, &outcome);
        on_need.push(outcome);
    }
    for outcome in [&decimated, &on_need] {
        for pair in outcome.windows(2) {
            assert!(pair[1].used < 0.9 * pair[0].used);
            assert!(pair[1].rmse() > 1.01 * pair[0].rmse(), "{} {}", pair[0].rmse(), pair[1].rmse());
        }
    }
    // Decimation does not look at the sample: what the filter states is what it does. On need it does, and
    // what it skips is known to be small: the filter states more than its error, the more the more it skips.
    assert!(decimated.iter().all(honest));
    assert!(honest(&on_need[0]));
    for pair in on_need.windows(2) {
        assert!(spread(&pair[1].nees).0 < spread(&pair[0].nees).0);
    }
    // A tenth of the samples, chosen by need, are worth more than an eighth by the clock.
    assert!(on_need[3].used < decimated[3].used && on_need[3].rmse() < 0.9 * decimated[3].rmse());
}

//! Singular values, observability, and the bound on the accuracy.

use crate::chance::{Chance, minus, plus, spread};
use kalmems_core::bound::{CramerRao, MeanInformation, MeanTransition};
use kalmems_core::{
    Covariance, Ekf, Filter, FilterError, Kalman, LinearMeasurement, LinearProcess, Mat, Measurement,
    Observability, Over, Process, ProcessNoise, Svd,
};
use nalgebra::{SMatrix, SVector};
use proptest::prelude::*;
use std::array;

fn dense<const R: usize, const C: usize>(m: &Mat<f64, R, C>) -> SMatrix<f64, R, C> {
    SMatrix::from_fn(|i, j| m[(i, j)])
}

fn full<const N: usize>(p: &Covariance<f64, N>) -> SMatrix<f64, N, N> {
    dense(&p.to_full())
}

fn covariance<const N: usize>(chance: &mut Chance, least: f64) -> Covariance<f64, N> {
    let a = Mat::<f64, N, N>::from_fn2(|_, _| chance.between(-1.0, 1.0));
    Covariance::from_lower(a.times_transposed(&a)).plus(&Covariance::from_variances([least; N]))
}

/// A matrix filled by something that changes as it is called.
trait FromFn2 {
    fn from_fn2(f: impl FnMut(usize, usize) -> f64) -> Self;
}
impl<const R: usize, const C: usize> FromFn2 for Mat<f64, R, C> {
    fn from_fn2(mut f: impl FnMut(usize, usize) -> f64) -> Self {
        Self(array::from_fn(|i| array::from_fn(|j| f(i, j))))
    }
}

/// V is orthogonal, A·V has orthogonal columns of lengths σ, in order.
fn is_svd<const R: usize, const C: usize>(a: &Mat<f64, R, C>, svd: &Svd<f64, C>) -> bool {
    let (a, v) = (dense(a), dense(&svd.right));
    let orthogonal = (v.transpose() * v - SMatrix::<f64, C, C>::identity()).norm() < 1e-13;
    let columns = a * v;
    let lengths = (0..C).all(|j| (columns.column(j).norm() - svd.values[j]).abs() <= 1e-13 * svd.values[0]);
    let apart = (0..C).all(|p| {
        (0..p).all(|q| columns.column(p).dot(&columns.column(q)).abs() <= 1e-12 * svd.values[0].powi(2))
    });
    orthogonal && lengths && apart && svd.values.windows(2).all(|pair| pair[0] >= pair[1])
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn singular_values_are_those_of_nalgebra(seed in any::<u64>(), rank in 1..=5_usize) {
        let mut chance = Chance::new(seed);
        // Of rank 1 to 4: a product of thin factors.
        let left = Mat::<f64, 6, 4>::from_fn2(|_, j| if j < rank { chance.between(-1.0, 1.0) } else { 0.0 });
        let right = Mat::<f64, 4, 4>::from_fn2(|_, _| chance.between(-1.0, 1.0));
        let a = left.times(&right);
        let svd = Svd::of(&a);
        let mut expected: Vec<f64> = dense(&a).singular_values().iter().copied().collect();
        expected.sort_by(|a, b| b.total_cmp(a));
        for j in 0..4 {
            prop_assert!((svd.values[j] - expected[j]).abs() <= 1e-12 * expected[0]);
        }
        prop_assert!(is_svd(&a, &svd));
        prop_assert!(svd.rank(1e-10) <= rank.min(4));
        if rank < 4 && expected[rank - 1] > 1e-9 * expected[0] {
            prop_assert_eq!(svd.rank(1e-12), rank);
        }
    }

    /// Columns over 18 orders of magnitude: each singular value is right relative to itself, found here with
    /// the graded triangular factor of a pivoted QR whose determinant and Gram matrix of the inverse are
    /// known.
    #[test]
    fn small_singular_values_of_graded_columns_keep_their_digits(
        seed in any::<u64>(), grades in prop::array::uniform3(-9.0..9.0_f64),
    ) {
        // A = B·D with B = rotation·(1 + small): A·Aᵀ has no closed form, but the product of all singular
        // values is
        // |det B|·Π d, the largest is that of nalgebra, and the smallest is the reciprocal of the largest of
        // A⁻¹ = D⁻¹·B⁻¹, whose rows are graded alike.
        let mut chance = Chance::new(seed);
        let b = Mat::<f64, 3, 3>::from_fn2(|i, j| f64::from(u8::from(i == j)) + chance.between(-0.2, 0.2));
        let d = grades.map(|g| 10_f64.powf(g));
        let a = Mat::<f64, 3, 3>::from_fn(|i, j| b[(i, j)] * d[j]);
        let svd = Svd::of(&a);
        let product: f64 = svd.values.iter().product();
        let expected = dense(&b).determinant().abs() * d.iter().product::<f64>();
        prop_assert!((product / expected - 1.0).abs() < 1e-12);
        let largest = dense(&a).singular_values().max();
        prop_assert!((svd.values[0] / largest - 1.0).abs() < 1e-12);
        let inverse = dense(&b).try_inverse().unwrap();
        let inverse = SMatrix::<f64, 3, 3>::from_fn(|i, j| inverse[(i, j)] / d[i]);
        prop_assert!((svd.values[2] * inverse.singular_values().max() - 1.0).abs() < 1e-12);
    }
}

#[test]
fn singular_values_in_extreme_cases() {
    assert_eq!(Svd::of(&Mat::<f64, 3, 3>::zero()).values, [0.0; 3]);
    assert_eq!(Svd::of(&Mat::<f64, 3, 3>::zero()).rank(1e-12), 0);
    let equal = Svd::of(&Mat([[0.0, -3.0], [3.0, 0.0]]));
    assert_eq!(equal.values, [3.0, 3.0]);
    assert!(Svd::of(&Mat([[1.0, f64::NAN], [0.0, 1.0]])).values.iter().any(|v| v.is_nan()));
    // Hilbert's matrix of order 5; det = 1/266716800000.
    let hilbert = Mat::<f64, 5, 5>::from_fn(|i, j| 1.0 / (i + j + 1) as f64);
    let product: f64 = Svd::of(&hilbert).values.iter().product();
    assert!((product * 266_716_800_000.0 - 1.0).abs() < 1e-9);
    // In f32 as well, to its own rounding.
    let narrow = Svd::of(&Mat([[2.0_f32, 0.0], [1e-5, 1e-6]]));
    assert!((narrow.values[1] / 1e-6 - 1.0).abs() < 1e-6);
}

/// The factor of a trajectory of steps and measurements, and the dense stack of its rows.
#[test]
fn the_factor_holds_the_information_of_all_rows() {
    let mut chance = Chance::new(8);
    for _ in 0..1000 {
        let scales = array::from_fn(|_| 10_f64.powf(chance.between(-3.0, 3.0)));
        let mut seen = Observability::<f64, 4>::new(scales);
        let (mut phi, mut information) = (SMatrix::<f64, 4, 4>::identity(), SMatrix::<f64, 4, 4>::zeros());
        for _ in 0..7 {
            let h = Mat::<f64, 2, 4>::from_fn2(|_, _| chance.between(-1.0, 1.0));
            let r = covariance::<2>(&mut chance, 0.1);
            seen.observe(&h, &r);
            information +=
                phi.transpose() * dense(&h).transpose() * full(&r).try_inverse().unwrap() * dense(&h) * phi;
            let f = Mat::<f64, 4, 4>::from_fn2(|_, _| chance.between(-0.7, 0.7));
            seen.advance(&f);
            phi = dense(&f) * phi;
        }
        let d = SMatrix::from_diagonal(&SVector::from(scales));
        let (factor, expected) = (dense(seen.factor()), d * information * d);
        for i in 0..4 {
            for j in 0..4 {
                let (found, size) =
                    ((factor.transpose() * factor)[(i, j)], expected[(i, i)] * expected[(j, j)]);
                assert!((found - expected[(i, j)]).abs() < 1e-12 * size.sqrt());
                assert!(j >= i || factor[(i, j)].abs() == 0.0 || factor[(i, j)].abs() < 1e-10 * size.sqrt());
            }
        }
    }
}

/// An oscillator of unit frequency whose sensor has an unknown gain: y = g·x, state [x, v, g].
struct GainedOscillator;
impl Process<f64, 3> for GainedOscillator {
    type Input = ();
    fn step<S: Over<f64>>(&self, x: &[S; 3], (): &()) -> [S; 3] {
        let (s, c) = 0.1_f64.sin_cos();
        [x[0] * c + x[1] * s, x[1] * c - x[0] * s, x[2]]
    }
    fn noise(&self) -> &ProcessNoise<f64, 3> {
        unreachable!("the trajectory has none")
    }
}
struct Gained {
    /// y = g·x for 0, and y = g·(x + cubic·x³) otherwise.
    cubic: f64,
}
impl Measurement<f64, 3, 1> for Gained {
    fn predict<S: Over<f64>>(&self, x: &[S; 3]) -> [S; 1] {
        [x[2] * (x[0] + x[0].sq() * x[0] * self.cubic)]
    }
}

fn along(sensor: &Gained, amplitude: f64) -> Observability<f64, 3> {
    let (mut x, mut seen) = ([amplitude, 0.0, 2.0], Observability::new([amplitude, amplitude, 2.0]));
    for _ in 0..500 {
        seen.observe(&sensor.linearize(&x).1, &Covariance::from_variances([1e-6]));
        let (next, f) = GainedOscillator.linearize(&x, &());
        seen.advance(&f);
        x = next;
    }
    seen
}

#[test]
fn gain_and_amplitude_are_not_seen_apart_by_a_linear_sensor() {
    let seen = along(&Gained { cubic: 0.0 }, 0.5);
    assert_eq!(seen.rank(1e-12), 2);
    // All states in units of their values: amplitude up, gain down by as much. x₀ = [A, 0], so the velocity
    // is out of it.
    let unseen = seen.directions()[2];
    let [x, v, g] = unseen.components;
    assert!((x + g).abs() < 1e-12 && v.abs() < 1e-12 && (x.abs() - 0.5_f64.sqrt()).abs() < 1e-12);
    assert_eq!(seen.directions()[0].leading_state() == 1, seen.directions()[0].components[1].abs() > 0.71);
    // A sensor that bends tells them apart, the better the larger the motion: at small motion hardly.
    let small = along(&Gained { cubic: 0.3 }, 0.01);
    let large = along(&Gained { cubic: 0.3 }, 0.5);
    assert_eq!((small.rank(1e-12), large.rank(1e-12)), (3, 3));
    let weakest = |o: &Observability<f64, 3>| o.directions()[2].singular_value;
    // The bend is cubic·A² of the signal, which is A itself: 50³ between the two.
    let ratio = weakest(&large) / weakest(&small);
    assert!((0.7..1.3).contains(&(ratio / 125_000.0)), "{ratio}");
    // In its own units: 500 samples of 1 mV at an amplitude of 10 mrad know the gain to no better than the
    // scale.
    assert!(weakest(&small) < 1.0 && weakest(&large) > 100.0);
}

#[test]
fn two_masses_are_seen_whole_by_one_of_them_and_not_by_their_distance() {
    // Masses 1 and 2 with a spring of 3 between them, and none to the wall; both moving.
    let (m1, m2, k) = (1.0, 2.0, 3.0);
    let a = Mat([
        [0.0, 1.0, 0.0, 0.0],
        [-k / m1, 0.0, k / m1, 0.0],
        [0.0, 0.0, 0.0, 1.0],
        [k / m2, 0.0, -k / m2, 0.0],
    ]);
    let f = kalmems_core::discretize::matrix_exponential(&a.scaled(0.05));
    let along = |h: &Mat<f64, 1, 4>| {
        let mut seen = Observability::new([1.0; 4]);
        for _ in 0..400 {
            seen.observe(h, &Covariance::from_variances([1e-4]));
            seen.advance(&f);
        }
        seen
    };
    let distance = along(&Mat([[1.0, 0.0, -1.0, 0.0]]));
    assert_eq!(distance.rank(1e-10), 2);
    // The plane that is not seen: both displaced alike, both moving alike.
    for direction in &distance.directions()[2..] {
        let [x1, v1, x2, v2] = direction.components;
        assert!((x1 - x2).abs() < 1e-9 && (v1 - v2).abs() < 1e-9);
    }
    let first = along(&Mat([[1.0, 0.0, 0.0, 0.0]]));
    assert_eq!(first.rank(1e-10), 4);
    // What the singular values mean: without process noise the covariance of the start is (𝒪ᵀ𝒪)⁻¹, as batch
    // least squares has it.
    let (mut phi, mut information) = (SMatrix::<f64, 4, 4>::identity(), SMatrix::<f64, 4, 4>::zeros());
    for _ in 0..400 {
        information += phi.row(0).transpose() * phi.row(0) * 1e4;
        phi = dense(&f) * phi;
    }
    let weakest = first.directions()[3].singular_value;
    let variance = information.try_inverse().unwrap().symmetric_eigenvalues().max();
    assert!((variance * weakest.powi(2) - 1.0).abs() < 1e-8);
}

#[test]
fn on_linear_systems_both_bounds_are_the_kalman_filter() {
    for seed in 0..1000 {
        let mut chance = Chance::new(seed);
        let f =
            Mat::<f64, 3, 3>::from_fn2(|i, j| 0.5 * f64::from(u8::from(i == j)) + chance.between(-0.7, 0.7));
        let h = Mat::<f64, 2, 3>::from_fn2(|_, _| chance.between(-1.0, 1.0));
        let (q, r) = (covariance::<3>(&mut chance, 0.05), covariance::<2>(&mut chance, 0.05));
        // Every other system has process noise from one source alone: singular, for the single trajectory.
        let source = [chance.between(-1.0, 1.0), chance.between(-1.0, 1.0), chance.between(-1.0, 1.0)];
        let singular = Covariance::from_lower(Mat::from_fn(|i, j| source[i] * source[j]));
        let q = if seed % 2 == 0 { q } else { singular };
        let start = covariance::<3>(&mut chance, 0.05);
        let process = LinearProcess::<f64, 3, 0> { transition: f, input: Mat::zero(), noise: q.into() };
        let mut filter = Kalman::new([0.0; 3], start);
        let (mut single, mut ensemble) = (CramerRao::new(start), CramerRao::new(start));
        // The recursion as it is printed, with inverses.
        let mut j = full(&start).try_inverse().unwrap();
        let information = dense(&h).transpose() * full(&r).try_inverse().unwrap() * dense(&h);
        for _ in 0..10 {
            filter.predict(&process, &[]).unwrap();
            filter.update(&LinearMeasurement { matrix: h }, &[0.0; 2], &r).unwrap();
            single.advance(&f, &q);
            single.observe(&h, &r).unwrap();
            let size = (0..3).map(|i| filter.covariance().get(i, i)).fold(1.0, f64::max);
            let close = |p: &SMatrix<f64, 3, 3>| (p - full(filter.covariance())).amax() < 1e-9 * size;
            assert!(close(&full(single.covariance())), "{seed}");
            if seed % 2 == 0 {
                let mut steps = MeanTransition::new(&q).unwrap();
                let mut seen = MeanInformation::none();
                for _ in 0..5 {
                    steps.add(&f);
                    seen.add(&h, &r).unwrap();
                }
                ensemble.advance_mean(&steps).unwrap();
                ensemble.observe_mean(&seen).unwrap();
                assert!(close(&full(ensemble.covariance())), "{seed}");
                let w = full(&q).try_inverse().unwrap();
                let (d11, d12) = (dense(&f).transpose() * w * dense(&f), -dense(&f).transpose() * w);
                j = w + information - d12.transpose() * (j + d11).try_inverse().unwrap() * d12;
                assert!(close(&j.try_inverse().unwrap()), "{seed}");
            } else {
                assert_eq!(MeanTransition::new(&q).unwrap_err(), FilterError::CovarianceNotPositive);
            }
        }
    }
}

/// The ensemble form with Jacobians that differ, against the recursion as it is printed.
#[test]
fn the_ensemble_bound_is_the_printed_recursion() {
    let mut chance = Chance::new(11);
    for _ in 0..1000 {
        let (q, r) = (covariance::<3>(&mut chance, 0.1), covariance::<1>(&mut chance, 0.1));
        let start = covariance::<3>(&mut chance, 0.1);
        let mut bound = CramerRao::new(start);
        let mut j = full(&start).try_inverse().unwrap();
        let w = full(&q).try_inverse().unwrap();
        for _ in 0..5 {
            let mut steps = MeanTransition::new(&q).unwrap();
            let mut seen = MeanInformation::none();
            let (mut d11, mut d12, mut d22) = (SMatrix::zeros(), SMatrix::<f64, 3, 3>::zeros(), w);
            for _ in 0..8 {
                let f = Mat::<f64, 3, 3>::from_fn2(|_, _| chance.between(-1.0, 1.0));
                let h = Mat::<f64, 1, 3>::from_fn2(|_, _| chance.between(-1.0, 1.0));
                steps.add(&f);
                seen.add(&h, &r).unwrap();
                d11 += dense(&f).transpose() * w * dense(&f) / 8.0;
                d12 -= dense(&f).transpose() * w / 8.0;
                d22 += dense(&h).transpose() * dense(&h) / r.get(0, 0) / 8.0;
            }
            bound.advance_mean(&steps).unwrap();
            bound.observe_mean(&seen).unwrap();
            j = d22 - d12.transpose() * (j + d11).try_inverse().unwrap() * d12;
            let expected = j.try_inverse().unwrap();
            assert!((full(bound.covariance()) - expected).amax() < 1e-9 * expected.amax());
        }
    }
}

#[test]
fn a_bound_refuses_what_it_cannot_use() {
    let mut bound = CramerRao::new(Covariance::from_variances([1.0, 1.0]));
    let before = *bound.covariance();
    let bad = Covariance::from_variances([0.0]);
    assert_eq!(bound.observe(&Mat([[1.0, 0.0]]), &bad).unwrap_err(), FilterError::InnovationNotPositive);
    assert_eq!(bound.covariance(), &before);
    // What is known exactly stays so.
    let mut certain = CramerRao::new(Covariance::from_variances([0.0, 1.0]));
    certain.observe(&Mat([[1.0, 1.0]]), &Covariance::from_variances([1.0])).unwrap();
    assert_eq!(certain.covariance().get(0, 0), 0.0);
    assert_eq!(certain.covariance().get(1, 1), 0.5);
}

/// A pendulum with white noise on both states, swinging by 1 rad, its horizontal position seen.
struct Pendulum(ProcessNoise<f64, 2>);
impl Process<f64, 2> for Pendulum {
    type Input = ();
    fn step<S: Over<f64>>(&self, x: &[S; 2], (): &()) -> [S; 2] {
        let rate = x[1] - x[0].sin() * 0.1;
        [x[0] + rate * 0.1, rate]
    }
    fn noise(&self) -> &ProcessNoise<f64, 2> {
        &self.0
    }
}
struct Horizontal;
impl Measurement<f64, 2, 1> for Horizontal {
    fn predict<S: Over<f64>>(&self, x: &[S; 2]) -> [S; 1] {
        [x[0].sin()]
    }
}

#[test]
fn no_filter_of_a_pendulum_beats_the_bound_and_the_extended_one_comes_close() {
    const RUNS: usize = 1000;
    const STEPS: usize = 200;
    let process = Pendulum(Covariance::from_variances([1e-4, 1e-4]).into());
    let (q, r) = (*process.noise().covariance(), Covariance::from_variances([1e-2]));
    let start = Covariance::from_variances([1e-2, 1e-2]);
    let mut steps = vec![MeanTransition::new(&q).unwrap(); STEPS];
    let mut seen = vec![MeanInformation::none(); STEPS];
    let mut squares = vec![Vec::new(); STEPS];
    for seed in 0..RUNS {
        let mut chance = Chance::new(seed as u64);
        let mut x = plus([1.0, 0.0], chance.vector(&start));
        let mut filter = Ekf::new([1.0, 0.0], start);
        for k in 0..STEPS {
            let (moved, f) = process.linearize(&x, &());
            steps[k].add(&f);
            x = plus(moved, chance.vector(&q));
            let (y, h) = Horizontal.linearize(&x);
            seen[k].add(&h, &r).unwrap();
            filter.predict(&process, &()).unwrap();
            filter.update(&Horizontal, &[y[0] + 0.1 * chance.gaussian()], &r).unwrap();
            squares[k].push(minus(&x, filter.mean())[0].powi(2));
        }
    }
    let mut bound = CramerRao::new(start);
    let (mut total, mut total_bound) = (0.0, 0.0);
    let mut by_run = vec![0.0; RUNS];
    for k in 0..STEPS {
        bound.advance_mean(&steps[k]).unwrap();
        bound.observe_mean(&seen[k]).unwrap();
        let (mean, deviation) = spread(&squares[k]);
        let (error, least) = (deviation / (RUNS as f64).sqrt(), bound.covariance().get(0, 0));
        assert!(mean > least - 4.0 * error, "step {k}: {mean} ± {error} below {least}");
        if k >= 20 {
            total += mean;
            total_bound += least;
            for (run, square) in by_run.iter_mut().zip(&squares[k]) {
                *run += square;
            }
        }
    }
    let error = spread(&by_run).1 / (RUNS as f64).sqrt() / total_bound;
    let ratio = total / total_bound;
    println!("mean square error over bound: {ratio:.3} ± {error:.3}");
    assert!(ratio > 1.0 - 4.0 * error && ratio < 1.15, "{ratio} ± {error}");
}

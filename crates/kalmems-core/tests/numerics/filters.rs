//! The filters against each other, against dense textbook formulas, and against bad input.

use kalmems_core::{
    Covariance, Delayed, Dual, Ekf, Filter, FilterError, Kalman, LinearMeasurement, LinearProcess, Mat,
    Measurement, Over, ProcessNoise, Scalar, SigmaPoints, Ukf,
};
use nalgebra::{SMatrix, SVector};
use proptest::prelude::*;

type Mat3 = Mat<f64, 3, 3>;

/// A random system: entries of Φ, a factor of Q, H, and diagonal R.
fn system() -> impl Strategy<Value = (Mat3, Mat3, Mat<f64, 2, 3>, [f64; 2])> {
    (
        prop::array::uniform9(-0.7..0.7_f64),
        prop::array::uniform9(-1.0..1.0_f64),
        prop::array::uniform6(-1.0..1.0_f64),
        prop::array::uniform2(0.01..2.0_f64),
    )
        .prop_map(|(f, g, h, r)| {
            (
                Mat::from_fn(|i, j| f[3 * i + j] + f64::from(u8::from(i == j)) * 0.5),
                Mat::from_fn(|i, j| g[3 * i + j]),
                Mat::from_fn(|i, j| h[3 * i + j]),
                r,
            )
        })
}

fn close<const N: usize>(a: &Covariance<f64, N>, b: &Covariance<f64, N>, tolerance: f64) -> bool {
    let size = (0..N).map(|i| a.get(i, i)).fold(1.0, f64::max);
    (0..N).all(|i| (0..N).all(|j| (a.get(i, j) - b.get(i, j)).abs() <= tolerance * size))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]
    #[test]
    fn on_a_linear_system_all_filters_are_the_kalman_filter(
        (f, g, h, r) in system(),
        ys in prop::collection::vec(prop::array::uniform2(-3.0..3.0_f64), 1..20),
        // The centre weighs −n/α²: a small α costs the digits of its square.
        alpha in 0.2..1.5_f64,
    ) {
        let q = Covariance::from_lower(g.times_transposed(&g));
        let process = LinearProcess { transition: f, input: Mat::from_fn(|i, _| i as f64), noise: q.into() };
        let measurement = LinearMeasurement { matrix: h };
        let r = Covariance::from_variances(r);
        let start = ([1.0, -2.0, 0.5], Covariance::from_standard_deviations([1.0, 0.3, 2.0]));
        let mut kalman = Kalman::new(start.0, start.1);
        let mut ekf = Ekf::new(start.0, start.1);
        let mut ukf = Ukf::new(start.0, start.1, SigmaPoints { alpha, beta: 2.0, kappa: 0.5 });
        let (mut x, mut p) = (SVector::<f64, 3>::from(start.0), full(&start.1));
        for y in ys {
            kalman.predict(&process, &[0.1]).unwrap();
            let predicted = *kalman.mean();
            ekf.predict(&process, &[0.1]).unwrap();
            ukf.predict(&process, &[0.1]).unwrap();
            let a = kalman.update(&measurement, &y, &r).unwrap();
            let b = ekf.update(&measurement, &y, &r).unwrap();
            let c = ukf.update(&measurement, &y, &r).unwrap();
            prop_assert_eq!(kalman.mean(), ekf.mean());
            prop_assert_eq!(a.nis, b.nis);
            prop_assert!((a.nis - c.nis).abs() <= 1e-10 * a.nis.max(1.0));
            prop_assert!((a.log_likelihood() - c.log_likelihood()).abs() <= 1e-10 * a.nis.max(10.0));
            // A mean is what was predicted and a correction, which may be much larger than their sum: rounding is of the larger.
            let size = predicted.iter().chain(kalman.mean()).fold(1.0_f64, |size, x| size.max(x.abs()));
            for i in 0..3 {
                prop_assert!((kalman.mean()[i] - ukf.mean()[i]).abs() <= 1e-10 * size);
            }
            prop_assert!(close(kalman.covariance(), &ukf.covariance(), 1e-10));

            // The same with dense matrices and an explicit inverse.
            let (fm, hm, rm) = (dense(&f), dense(&h), full(&r));
            x = fm * x + SVector::from([0.0, 0.1, 0.2]);
            p = fm * p * fm.transpose() + full(&q);
            let s = hm * p * hm.transpose() + rm;
            let k = p * hm.transpose() * s.try_inverse().unwrap();
            let e = SVector::from(y) - hm * x;
            let nis = (e.transpose() * s.try_inverse().unwrap() * e)[0];
            let log = -0.5 * (2.0 * std::f64::consts::TAU.ln() + s.determinant().ln() + nis);
            x += k * e;
            let a_ = SMatrix::<f64, 3, 3>::identity() - k * hm;
            p = a_ * p * a_.transpose() + k * rm * k.transpose();
            prop_assert!((nis - a.nis).abs() <= 1e-9 * nis.max(1.0));
            prop_assert!((log - a.log_likelihood()).abs() <= 1e-9 * log.abs().max(1.0));
            for i in 0..3 {
                prop_assert!((x[i] - kalman.mean()[i]).abs() <= 1e-9 * x.norm().max(1.0));
            }
        }
    }

    #[test]
    fn a_delayed_measurement_is_one_taken_in_time(
        (f, _, h, r) in system(),
        y in prop::array::uniform2(-3.0..3.0_f64),
    ) {
        // Needs an inverse of Φ; a nearly singular one has no past to look back to.
        let inverse = dense(&f).try_inverse();
        prop_assume!(inverse.is_some_and(|m| m.norm() < 50.0));
        let inverse = inverse.unwrap();
        let process = LinearProcess { transition: f, input: Mat::<f64, 3, 0>::zero(), noise: ProcessNoise::none() };
        let measurement = LinearMeasurement { matrix: h };
        let r = Covariance::from_variances(r);
        let start = Covariance::from_standard_deviations([1.0, 0.3, 2.0]);
        let mut in_time = Ekf::new([1.0, -2.0, 0.5], start);
        let a = in_time.update(&measurement, &y, &r).unwrap();
        in_time.predict(&process, &[]).unwrap();
        let mut late = Ekf::new([1.0, -2.0, 0.5], start);
        late.predict(&process, &[]).unwrap();
        let delayed = Delayed { measurement, back: Mat::from_fn(|i, j| inverse[(i, j)]) };
        let b = late.update(&delayed, &y, &r).unwrap();
        prop_assert!((a.nis - b.nis).abs() < 1e-8 * a.nis.max(1.0));
        for i in 0..3 {
            prop_assert!((in_time.mean()[i] - late.mean()[i]).abs() < 1e-8);
        }
        prop_assert!(close(&in_time.covariance(), &late.covariance(), 1e-8));
    }

    #[test]
    fn dual_numbers_are_the_derivative(x in 0.05..0.9_f64, y in 0.2..3.0_f64) {
        // Each elementary function and operator once, against central differences.
        fn all<S: Scalar>(v: [S; 2]) -> [S; 8] {
            let [x, y] = v;
            [
                x.exp() * y.ln(), x.sin() / y.cos(), (x * y).sqrt(), x.atanh() - y, y.recip().twice(),
                S::select(x.lt(y), x.sq(), y), (x - y).abs(), (-x).half().mac(x, y),
            ]
        }
        prop_assume!((x - y).abs() > 1e-3 && y.cos().abs() > 1e-2);
        let dual = all(Dual::variables(&[x, y]));
        let h = 1e-6;
        for k in 0..8 {
            prop_assert_eq!(dual[k].value().to_bits(), all([x, y])[k].to_bits());
            for (i, (up, down)) in
                [(all([x + h, y]), all([x - h, y])), (all([x, y + h]), all([x, y - h]))].iter().enumerate()
            {
                let difference = (up[k] - down[k]) / (2.0 * h);
                let gradient = dual[k].gradient()[i];
                prop_assert!((difference - gradient).abs() <= 2e-6 * gradient.abs().max(1.0), "{} {}", k, i);
            }
        }
    }
}

fn dense<const R: usize, const C: usize>(m: &Mat<f64, R, C>) -> SMatrix<f64, R, C> {
    SMatrix::from_fn(|i, j| m[(i, j)])
}

fn full<const N: usize>(p: &Covariance<f64, N>) -> SMatrix<f64, N, N> {
    dense(&p.to_full())
}

/// What a closed-form filter of a falling stone would say: constant velocity, position seen once.
#[test]
fn one_update_in_closed_form() {
    let mut filter = Ekf::new([1.0, 2.0], Covariance::from_variances([4.0, 9.0]));
    let step = LinearProcess::<f64, 2, 0> {
        transition: Mat([[1.0, 0.5], [0.0, 1.0]]),
        input: Mat::zero(),
        noise: ProcessNoise::none(),
    };
    filter.predict(&step, &[]).unwrap();
    // Variance of the position 4 + 0.25·9, with the velocity 0.5·9.
    let position = LinearMeasurement { matrix: Mat([[1.0, 0.0]]) };
    let innovation = filter.update(&position, &[3.0], &Covariance::from_variances([1.0])).unwrap();
    assert_eq!(innovation.residual, [1.0]);
    assert_eq!(innovation.covariance.get(0, 0), 7.25);
    approx::assert_relative_eq!(filter.mean()[0], 2.0 + 6.25 / 7.25, max_relative = 1e-15);
    approx::assert_relative_eq!(filter.mean()[1], 2.0 + 4.5 / 7.25, max_relative = 1e-15);
    approx::assert_relative_eq!(filter.covariance().get(0, 0), 6.25 / 7.25, max_relative = 1e-14);
    approx::assert_relative_eq!(filter.covariance().get(1, 1), 9.0 - 4.5 * 4.5 / 7.25, max_relative = 1e-14);
}

/// Two sensors of different sizes on one filter, in either order, say what one sensor of both says.
#[test]
fn measurements_of_different_sizes_on_one_filter() {
    let start = Covariance::from_lower(Mat([[4.0, 0.0], [1.0, 9.0]]));
    let both = LinearMeasurement { matrix: Mat([[1.0, 0.0], [0.5, 1.0], [0.0, 2.0]]) };
    let pair = LinearMeasurement { matrix: Mat([[1.0, 0.0], [0.5, 1.0]]) };
    let single = LinearMeasurement { matrix: Mat([[0.0, 2.0]]) };
    let (r, r_pair, r_single) = ([1.0, 0.5, 2.0], [1.0, 0.5], [2.0]);
    let mut at_once = Ekf::new([1.0, 2.0], start);
    let all = at_once.update(&both, &[1.5, 2.0, 5.0], &Covariance::from_variances(r)).unwrap();
    let mut one_by_one = Ekf::new([1.0, 2.0], start);
    let first = one_by_one.update(&pair, &[1.5, 2.0], &Covariance::from_variances(r_pair)).unwrap();
    let second = one_by_one.update(&single, &[5.0], &Covariance::from_variances(r_single)).unwrap();
    for i in 0..2 {
        approx::assert_relative_eq!(at_once.mean()[i], one_by_one.mean()[i], max_relative = 1e-13);
    }
    assert!(close(&at_once.covariance(), &one_by_one.covariance(), 1e-14));
    // The chain rule of probability: p(a, b) = p(a)·p(b | a), and NIS adds up.
    let log = first.log_likelihood() + second.log_likelihood();
    approx::assert_relative_eq!(all.log_likelihood(), log, max_relative = 1e-13);
    approx::assert_relative_eq!(all.nis, first.nis + second.nis, max_relative = 1e-13);
}

/// A measurement that is not finite in some places.
struct Logarithm;
impl<T: Scalar> Measurement<T, 2, 1> for Logarithm {
    fn predict<S: Over<T>>(&self, x: &[S; 2]) -> [S; 1] {
        [x[0].ln()]
    }
}

#[test]
fn what_cannot_be_used_is_refused_and_leaves_the_state() {
    let start = ([1.0, 2.0], Covariance::from_variances([4.0, 9.0]));
    let r = Covariance::from_variances([1.0]);
    let mut ekf = Ekf::new(start.0, start.1);
    let mut ukf = Ukf::new(start.0, start.1, SigmaPoints::standard());
    let position = LinearMeasurement { matrix: Mat([[1.0, 0.0]]) };
    let explode = LinearProcess::<f64, 2, 1> {
        transition: Mat([[f64::MAX, 1.0], [0.0, 1.0]]),
        input: Mat::zero(),
        noise: ProcessNoise::none(),
    };
    for y in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        assert_eq!(ekf.update(&position, &[y], &r).unwrap_err(), FilterError::NonFiniteMeasurement);
        assert_eq!(ukf.update(&position, &[y], &r).unwrap_err(), FilterError::NonFiniteMeasurement);
    }
    for variance in [-5.0, f64::NAN, f64::INFINITY] {
        let r = Covariance::from_variances([variance]);
        assert_eq!(ekf.update(&position, &[1.0], &r).unwrap_err(), FilterError::InnovationNotPositive);
        assert_eq!(ukf.update(&position, &[1.0], &r).unwrap_err(), FilterError::InnovationNotPositive);
    }
    assert_eq!(ekf.predict(&explode, &[0.0]).unwrap_err(), FilterError::NonFiniteState);
    assert_eq!(ukf.predict(&explode, &[0.0]).unwrap_err(), FilterError::NonFiniteState);
    assert_eq!(ekf.predict(&explode, &[f64::NAN]).unwrap_err(), FilterError::NonFiniteState);
    // One sigma point lies at 1 − 2√3.
    assert!(ukf.update(&Logarithm, &[0.0], &r).is_err());
    assert_eq!((ekf.mean(), ekf.covariance()), (&start.0, start.1));
    assert_eq!((ukf.mean(), ukf.covariance()), (&start.0, start.1));

    // A correlation of two.
    let no_covariance = Covariance::from_lower(Mat([[1.0, 0.0], [2.0, 1.0]]));
    let mut odd = Ukf::new(start.0, no_covariance, SigmaPoints::standard());
    assert_eq!(odd.update(&position, &[1.0], &r).unwrap_err(), FilterError::CovarianceNotPositive);
    assert_eq!(odd.predict(&explode, &[0.0]).unwrap_err(), FilterError::CovarianceNotPositive);
    // Filters may know something exactly.
    let mut certain = Ekf::new(start.0, Covariance::zero());
    certain.update(&position, &[5.0], &r).unwrap();
    assert_eq!(certain.mean(), &start.0);
    let mut flat = Ukf::new(start.0, Covariance::zero(), SigmaPoints::standard());
    flat.update(&position, &[5.0], &r).unwrap();
    assert_eq!(flat.mean(), &start.0);
}

#[test]
fn an_unscented_filter_of_a_singular_covariance_is_the_kalman_filter() {
    // The second state is known exactly, and the third is twice the first.
    let known = Mat([[4.0, 0.0, 0.0], [0.0, 0.0, 0.0], [8.0, 0.0, 16.0]]);
    let start = ([1.0, 2.0, 3.0], Covariance::from_lower(known));
    let (mut ekf, mut ukf) =
        (Ekf::new(start.0, start.1), Ukf::new(start.0, start.1, SigmaPoints::standard()));
    let process = LinearProcess::<f64, 3, 0> {
        transition: Mat([[0.9, 0.1, 0.0], [0.0, 1.0, 0.0], [0.2, 0.0, 0.8]]),
        input: Mat::zero(),
        noise: Covariance::from_variances([0.0, 0.0, 0.5]).into(),
    };
    let sensor = LinearMeasurement { matrix: Mat([[1.0, 0.5, 0.25]]) };
    for y in [1.0, 3.0, 2.0] {
        let (own, other) =
            (ukf.predict_linked(&process, &[]).unwrap(), ekf.predict_linked(&process, &[]).unwrap());
        let r = Covariance::from_variances([0.7]);
        let nis = [
            ukf.update(&sensor, &[y], &r).unwrap().nis,
            Filter::update(&mut ekf, &sensor, &[y], &r).unwrap().nis,
        ];
        assert!((nis[0] - nis[1]).abs() < 1e-12, "{nis:?}");
        for i in 0..3 {
            assert!((ukf.mean()[i] - ekf.mean()[i]).abs() < 1e-12);
            for j in 0..3 {
                assert!((ukf.covariance().get(i, j) - ekf.covariance().get(i, j)).abs() < 1e-12);
                assert!((own.noise.get(i, j) - other.noise.get(i, j)).abs() < 1e-12);
            }
        }
    }
}

#[test]
fn f32_follows_f64() {
    fn run<T: Scalar>(ys: &[f64]) -> [T; 2] {
        let process = LinearProcess::<T, 2, 0> {
            transition: Mat([[T::of(1.0), T::of(0.1)], [T::of(-0.1), T::of(0.99)]]),
            input: Mat::zero(),
            noise: Covariance::from_variances([T::of(1e-4), T::of(1e-3)]).into(),
        };
        let measurement = LinearMeasurement { matrix: Mat([[T::of(1.0), T::of(0.0)]]) };
        let mut filter = Ekf::new([T::of(0.0); 2], Covariance::from_variances([T::of(1.0); 2]));
        for y in ys {
            assert!(filter.predict(&process, &[]).is_ok());
            assert!(
                filter.update(&measurement, &[T::of(*y)], &Covariance::from_variances([T::of(0.1)])).is_ok()
            );
        }
        *filter.mean()
    }
    let ys: Vec<f64> = (0..500).map(|k| f64::from(k).mul_add(0.1, 0.3).sin()).collect();
    let (wide, narrow) = (run::<f64>(&ys), run::<f32>(&ys));
    for i in 0..2 {
        approx::assert_relative_eq!(wide[i], f64::from(narrow[i]), max_relative = 1e-4);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]
    /// One step is a prediction and an update to the last bit, with two measurements and with one.
    #[test]
    fn a_step_is_a_prediction_and_an_update(
        (f, g, h, r) in system(),
        ys in prop::collection::vec(prop::array::uniform2(-3.0..3.0_f64), 1..10),
    ) {
        let q = Covariance::from_lower(g.times_transposed(&g));
        let process = LinearProcess { transition: f, input: Mat::from_fn(|i, _| i as f64), noise: q.into() };
        let both = LinearMeasurement { matrix: h };
        let first = LinearMeasurement { matrix: Mat([h.0[0]]) };
        let (r2, r1) = (Covariance::from_variances(r), Covariance::from_variances([r[0]]));
        let start = Ekf::new([1.0, -2.0, 0.5], Covariance::from_standard_deviations([1.0, 0.3, 2.0]));
        let (mut one, mut two) = (start, start);
        for y in ys {
            let found = one.step((&process, &[0.1]), (&both, &y, &r2)).unwrap();
            two.predict(&process, &[0.1]).unwrap();
            let expected = two.update(&both, &y, &r2).unwrap();
            prop_assert!(found.taken && found.nis == expected.nis && found.residual == expected.residual);
            one.step((&process, &[0.2]), (&first, &[y[0]], &r1)).unwrap();
            two.predict(&process, &[0.2]).unwrap();
            two.update(&first, &[y[0]], &r1).unwrap();
            prop_assert_eq!(one.mean(), two.mean());
            prop_assert_eq!(one.covariance(), two.covariance());
        }
    }
}

/// A step whose update is refused is a prediction; one whose prediction is refused is nothing.
#[test]
fn a_step_that_is_refused_leaves_what_two_would() {
    let walk = |noise: f64| LinearProcess::<f64, 1, 0> {
        transition: Mat::identity(),
        input: Mat::zero(),
        noise: ProcessNoise::from(Covariance::from_variances([noise])),
    };
    let level = LinearMeasurement { matrix: Mat([[1.0]]) };
    let start = Ekf::new([2.0], Covariance::from_variances([1.0]));
    for (noise, y, r) in [
        (3.0, f64::NAN, 1.0),
        (3.0, f64::INFINITY, 1.0),
        (3.0, 1.0, -10.0),
        // S is exactly 0, and infinite.
        (3.0, 1.0, -4.0),
        (3.0, 1.0, f64::INFINITY),
        (f64::INFINITY, 1.0, 1.0),
        (f64::NAN, f64::NAN, 1.0),
    ] {
        let (mut one, mut two) = (start, start);
        let r = Covariance::from_variances([r]);
        let found = one.step((&walk(noise), &[]), (&level, &[y], &r)).map(|i| i.taken);
        let expected =
            two.predict(&walk(noise), &[]).and_then(|()| two.update(&level, &[y], &r)).map(|i| i.taken);
        assert_eq!(found, expected, "{noise} {y}");
        assert!(found.is_err());
        assert_eq!((one.mean(), one.covariance()), (two.mean(), two.covariance()), "{noise} {y}");
    }
}

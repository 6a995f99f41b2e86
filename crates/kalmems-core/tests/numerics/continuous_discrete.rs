//! Predictions over irregular intervals: against the exact step of linear systems, and against the equations of
//! the moments solved with very fine steps.

use approx::assert_relative_eq;
use kalmems_core::{
    ContinuousDiscrete, ContinuousLinear, Covariance, Dynamics, Ekf, Filter, IntervalError, Kalman,
    LinearMeasurement, LinearProcess, Mat, NoiseDensity, Over, Process, Scalar, SigmaPoints, Ukf,
};
use nalgebra::{Matrix2, Vector2};
use proptest::prelude::*;

/// ẋ = A·x + B·u.
#[derive(Clone, Copy)]
struct Linear<const N: usize> {
    system: Mat<f64, N, N>,
    input: [f64; N],
}
impl<const N: usize> Dynamics<f64, N> for Linear<N> {
    type Input = f64;
    fn derivative<S: Over<f64>>(&self, x: &[S; N], u: &f64) -> [S; N] {
        let moved: [S; N] = self.system.times_vector(x);
        std::array::from_fn(|i| moved[i] + self.input[i] * *u)
    }
}

/// ẍ = μ·(1 − x²)·ẋ − x + u (van der Pol), and ẍ = u − sin x.
#[derive(Clone, Copy)]
struct VanDerPol;
#[derive(Clone, Copy)]
struct Pendulum;
impl<T: Scalar> Dynamics<T, 2> for VanDerPol {
    type Input = T;
    fn derivative<S: Over<T>>(&self, x: &[S; 2], u: &T) -> [S; 2] {
        [x[1], x[1] - x[0].sq() * x[1] - x[0] + *u]
    }
}
impl<T: Scalar> Dynamics<T, 2> for Pendulum {
    type Input = T;
    fn derivative<S: Over<T>>(&self, x: &[S; 2], u: &T) -> [S; 2] {
        [x[1], S::lift(*u) - x[0].sin()]
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]
    /// A filter on a linear system with intervals as they come is the exact discrete filter.
    #[test]
    fn irregular_samples_of_a_linear_system(
        entries in prop::array::uniform9(-1.0..1.0_f64),
        densities in prop::array::uniform3(0.01..1.0_f64),
        samples in prop::collection::vec((0.0..0.5_f64, -3.0..3.0_f64), 1..8),
    ) {
        let system = Mat::<f64, 3, 3>::from_fn(|i, j| entries[3 * i + j]);
        let dynamics = Linear { system, input: [1.0, 0.0, -0.5] };
        let density = NoiseDensity::none().on::<0>(densities[0]).on::<1>(densities[1]).on::<2>(densities[2]);
        let maker = ContinuousDiscrete::new(dynamics, density, 2e-3).unwrap();
        let mut exact = ContinuousLinear::new(system, Mat::from_fn(|i, _| dynamics.input[i]), density);
        let seen = LinearMeasurement { matrix: Mat([[1.0, 0.5, -0.2]]) };
        let r = Covariance::from_variances([0.1]);
        let start = Covariance::from_variances([1.0, 2.0, 0.5]);
        let mut kalman = Kalman::new([1.0, 0.0, -1.0], start);
        let mut ekf = Ekf::new([1.0, 0.0, -1.0], start);
        let mut ukf = Ukf::new([1.0, 0.0, -1.0], start, SigmaPoints::standard());
        for (interval, y) in samples {
            kalman.predict(exact.over(interval).unwrap(), &[0.7]).unwrap();
            let process = maker.over(interval, ekf.mean(), |_| 0.7).unwrap();
            ekf.predict(&process, &()).unwrap();
            ukf.predict(&process, &()).unwrap();
            kalman.update(&seen, &[y], &r).unwrap();
            ekf.update(&seen, &[y], &r).unwrap();
            ukf.update(&seen, &[y], &r).unwrap();
            // Steps of 2 ms against rates of up to 3/s: each is right to (3·0.002)⁵/120, below 1e-13. In seven samples there
            // are up to 1750 of them, and what they leave grows until it is corrected.
            let near = |p: f64, q: f64| (p - q).abs() <= 1e-9 * p.abs().max(1.0);
            for i in 0..3 {
                prop_assert!(near(kalman.mean()[i], ekf.mean()[i]));
                prop_assert!(near(kalman.mean()[i], ukf.mean()[i]));
                for j in 0..=i {
                    let p = kalman.covariance().get(i, j);
                    prop_assert!(near(p, ekf.covariance().get(i, j)));
                    prop_assert!(near(p, ukf.covariance().get(i, j)));
                }
            }
        }
    }

    /// However long the steps are: the covariance stays positive semi-definite.
    #[test]
    fn the_noise_is_positive_semidefinite(
        x in prop::array::uniform2(-3.0..3.0_f64), interval in 0.0..5.0_f64, step in 0.01..3.0_f64,
        density in 0.0..2.0_f64,
    ) {
        let maker = ContinuousDiscrete::new(VanDerPol, NoiseDensity::none().on::<1>(density), step).unwrap();
        let process = maker.over(interval, &x, f64::sin).unwrap();
        let q = process.noise().covariance();
        let q = Matrix2::from_fn(|i, j| q.get(i, j));
        prop_assume!(q.iter().all(|e| e.is_finite()));
        prop_assert!(q.symmetric_eigenvalues().min() >= -1e-14 * q.norm());
    }

    #[test]
    fn where_it_was_made_and_elsewhere_it_is_one_function(
        x in prop::array::uniform2(-2.0..2.0_f64), other in prop::array::uniform2(-2.0..2.0_f64),
    ) {
        let maker = ContinuousDiscrete::new(VanDerPol, NoiseDensity::none().on::<1>(0.1), 0.05).unwrap();
        let (here, there) = (maker.over(0.3, &x, f64::cos).unwrap(), maker.over(0.3, &other, f64::cos).unwrap());
        let (known, computed) = (here.linearize(&x, &()), there.linearize(&x, &()));
        prop_assert_eq!(known.0.map(f64::to_bits), computed.0.map(f64::to_bits));
        prop_assert_eq!(known.1.0.map(|row| row.map(f64::to_bits)), computed.1.0.map(|row| row.map(f64::to_bits)));
        prop_assert_eq!(known.0.map(f64::to_bits), here.step(&x, &()).map(f64::to_bits));
        // And the Jacobian is that of the step.
        let (_, by_dual) = kalmems_core::jacobian(&x, |x| here.step(x, &()));
        for (a, b) in known.1.0.iter().flatten().zip(by_dual.0.iter().flatten()) {
            prop_assert!((a - b).abs() <= 1e-12 * (1.0 + a.abs()));
        }
        prop_assert!(here.linearize(&[f64::NAN, x[1]], &()).0[0].is_nan());
    }
}

/// ṁ = f(m), Ṗ = A(m)·P + P·A(m)ᵀ + D, by Runge–Kutta on both at once, with matrices of nalgebra.
fn moments(
    f: impl Fn(f64, &Vector2<f64>) -> (Vector2<f64>, Matrix2<f64>),
    (mut m, mut p, d): (Vector2<f64>, Matrix2<f64>, Matrix2<f64>),
    duration: f64,
    steps: u32,
) -> (Vector2<f64>, Matrix2<f64>) {
    let h = duration / f64::from(steps);
    let rate = |t: f64, m: &Vector2<f64>, p: &Matrix2<f64>| {
        let (moved, a) = f(t, m);
        (moved, a * p + p * a.transpose() + d)
    };
    for k in 0..steps {
        let t = f64::from(k) * h;
        let a = rate(t, &m, &p);
        let b = rate(t + h / 2.0, &(m + a.0 * (h / 2.0)), &(p + a.1 * (h / 2.0)));
        let c = rate(t + h / 2.0, &(m + b.0 * (h / 2.0)), &(p + b.1 * (h / 2.0)));
        let e = rate(t + h, &(m + c.0 * h), &(p + c.1 * h));
        m += (a.0 + (b.0 + c.0) * 2.0 + e.0) * (h / 6.0);
        p += (a.1 + (b.1 + c.1) * 2.0 + e.1) * (h / 6.0);
    }
    (m, p)
}

fn drive(t: f64) -> f64 {
    0.3 * (2.0 * t).cos()
}

/// The errors of mean, covariance (from P = 0: the noise alone) and covariance (without noise) at 2 s.
fn errors<D: Dynamics<f64, 2, Input = f64> + Copy>(
    dynamics: D,
    by_hand: impl Fn(f64, &Vector2<f64>) -> (Vector2<f64>, Matrix2<f64>) + Copy,
    steps: u32,
) -> [f64; 3] {
    let (duration, q) = (2.0, 0.2);
    let start = [0.8, -0.4];
    let d = Matrix2::new(0.0, 0.0, 0.0, q);
    let p0 = Matrix2::new(0.3, 0.1, 0.1, 0.2);
    let (m, noise) = moments(by_hand, (Vector2::from(start), Matrix2::zeros(), d), duration, 20_000);
    let (_, spread) = moments(by_hand, (Vector2::from(start), p0, Matrix2::zeros()), duration, 20_000);

    let density = NoiseDensity::none().on::<1>(q);
    let maker =
        ContinuousDiscrete::new(dynamics, density, duration / f64::from(steps) * (1.0 + 1e-12)).unwrap();
    let process = maker.over(duration, &start, drive).unwrap();
    let ours = |p: &Covariance<f64, 2>| Matrix2::from_fn(|i, j| p.get(i, j));
    let (mean, f) = process.linearize(&start, &());
    let f = Matrix2::from_fn(|i, j| f[(i, j)]);
    [
        (Vector2::from(mean) - m).norm(),
        (ours(process.noise().covariance()) - noise).norm(),
        (f * p0 * f.transpose() - spread).norm(),
    ]
}

#[test]
fn mean_sensitivity_and_noise_converge_with_the_fourth_order() {
    let pendulum = |t: f64, m: &Vector2<f64>| {
        (Vector2::new(m[1], drive(t) - m[0].sin()), Matrix2::new(0.0, 1.0, -m[0].cos(), 0.0))
    };
    let van_der_pol = |t: f64, m: &Vector2<f64>| {
        let (x, v) = (m[0], m[1]);
        (
            Vector2::new(v, v - x * x * v - x + drive(t)),
            Matrix2::new(0.0, 1.0, -2.0 * x * v - 1.0, 1.0 - x * x),
        )
    };
    for run in [&|n| errors(Pendulum, pendulum, n), &|n| errors(VanDerPol, van_der_pol, n)]
        as [&dyn Fn(u32) -> [f64; 3]; 2]
    {
        let (coarse, fine) = (run(40), run(80));
        for (what, (coarse, fine)) in ["mean", "noise", "spread"].iter().zip(coarse.iter().zip(&fine)) {
            let order = (coarse / fine).log2();
            assert!((3.7..4.4).contains(&order), "{what}: order {order}, error {fine}");
            assert!(*fine < 1e-6, "{what}: {fine}");
        }
    }
}

/// The accelerometer (Zhang 2010, table I): eigenvalues −4390 and −179 820 rad/s.
const STIFFNESS: f64 = 3.0 / 3.8e-9;
const DAMPING: f64 = 7e-4 / 3.8e-9;
const ACCELEROMETER: Linear<2> =
    Linear { system: Mat([[0.0, 1.0], [-STIFFNESS, -DAMPING]]), input: [0.0, 1.0] };

/// The hybrid filter of the thesis integrates Ṗ = A·P + P·Aᵀ + Q by Euler's method. The variance of the fast part
/// moves with 2·(−179 820)/s, so that it diverges above 2/(2·179 820) s = 5.56 µs; the mean does above twice that.
#[test]
fn euler_diverges_on_the_accelerometer_where_this_does_not() {
    let q = 7.7e-7;
    let a = Matrix2::new(0.0, 1.0, -STIFFNESS, -DAMPING);
    let d = Matrix2::new(0.0, 0.0, 0.0, q);
    let settled = |h: f64| {
        let mut p = Matrix2::zeros();
        for _ in 0..20_000 {
            p += (a * p + p * a.transpose() + d) * h;
        }
        p
    };
    // The stationary covariance in closed form: q/(2·b·k) and q/(2·b), per mass.
    let (x, v) = (q / (2.0 * DAMPING * STIFFNESS), q / (2.0 * DAMPING));
    let stable = settled(5.5e-6);
    assert_relative_eq!(stable[(1, 1)], v, max_relative = 0.05);
    assert!(settled(5.62e-6).norm() > 1e3 * v);

    let density = NoiseDensity::none().on::<1>(q);
    // Where a step is as long as the fast part takes to decay, it is stable and no longer exact.
    for (longest, tolerance) in [(1e-6, 1e-3), (5.62e-6, 0.2), (1.2e-5, 2.0)] {
        let maker = ContinuousDiscrete::new(ACCELEROMETER, density, longest).unwrap();
        let mut filter = Ekf::new([1e-8, 0.0], Covariance::zero());
        for _ in 0..2000 {
            let process = maker.over(2.0 * longest, filter.mean(), |_| 0.0).unwrap();
            filter.predict(&process, &()).unwrap();
        }
        assert_relative_eq!(filter.covariance().get(0, 0), x, max_relative = tolerance);
        assert_relative_eq!(filter.covariance().get(1, 1), v, max_relative = tolerance);
        assert!(filter.mean()[0].abs() < 1e-11);
    }
}

/// Exactly, at any interval: one of 100 µs as a hundred of 1 µs, and the stationary variance from one of 1 s.
#[test]
fn a_stiff_linear_system_takes_any_interval() {
    let q = 7.7e-7;
    let density = NoiseDensity::none().on::<1>(q);
    let mut maker = ContinuousLinear::new(ACCELEROMETER.system, Mat([[0.0], [1.0]]), density);
    let start = Covariance::from_variances([1e-20, 1e-12]);
    let mut at_once = Kalman::new([1e-9, 1e-5], start);
    at_once.predict(maker.over(1e-4).unwrap(), &[9.81]).unwrap();
    let mut in_parts = Kalman::new([1e-9, 1e-5], start);
    for _ in 0..100 {
        in_parts.predict(maker.over(1e-6).unwrap(), &[9.81]).unwrap();
    }
    for i in 0..2 {
        assert_relative_eq!(at_once.mean()[i], in_parts.mean()[i], max_relative = 1e-11);
        let (a, b) = (at_once.covariance().get(i, i), in_parts.covariance().get(i, i));
        assert_relative_eq!(a, b, max_relative = 1e-10);
    }
    let mut long = Kalman::new([1e-9, 1e-5], start);
    long.predict(maker.over(1.0).unwrap(), &[9.81]).unwrap();
    assert_relative_eq!(long.covariance().get(0, 0), q / (2.0 * DAMPING * STIFFNESS), max_relative = 1e-10);
    assert_relative_eq!(long.covariance().get(1, 1), q / (2.0 * DAMPING), max_relative = 1e-10);
    // 9.81 m/s² deflect it by a·m/k.
    assert_relative_eq!(long.mean()[0], 9.81 / STIFFNESS, max_relative = 1e-10);

    // What Runge–Kutta makes of it with steps of 1 µs.
    let explicit = ContinuousDiscrete::new(ACCELEROMETER, density, 1e-6).unwrap();
    let process = explicit.over(1e-4, &[1e-9, 1e-5], |_| 9.81).unwrap();
    let mut hybrid = Ekf::new([1e-9, 1e-5], start);
    hybrid.predict(&process, &()).unwrap();
    for i in 0..2 {
        assert_relative_eq!(hybrid.mean()[i], at_once.mean()[i], max_relative = 1e-4);
        let (a, b) = (hybrid.covariance().get(i, i), at_once.covariance().get(i, i));
        assert_relative_eq!(a, b, max_relative = 1e-3);
    }
}

#[test]
fn a_repeated_interval_uses_the_same_process() {
    let density = NoiseDensity::none().on::<1>(0.3);
    let system = Mat([[0.0, 1.0], [-2.0, -0.1]]);
    let mut maker = ContinuousLinear::new(system, Mat([[0.0], [1.0]]), density);
    for interval in [0.1, 0.1, 0.25, 0.1, 0.0] {
        let made = *maker.over(interval).unwrap();
        let exact = LinearProcess::exact(&system, &Mat([[0.0], [1.0]]), &density, interval);
        assert_eq!((made.transition, made.input, made.noise), (exact.transition, exact.input, exact.noise));
    }
}

#[test]
fn intervals_that_time_cannot_run_over() {
    let density = NoiseDensity::none().on::<1>(0.1);
    for step in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert_eq!(ContinuousDiscrete::new(Pendulum, density, step).err(), Some(IntervalError::Step));
    }
    let maker = ContinuousDiscrete::new(Pendulum, density, 0.01).unwrap();
    let mut linear = ContinuousLinear::new(Mat([[0.0, 1.0], [0.0, 0.0]]), Mat::<f64, 2, 0>::zero(), density);
    for (interval, why) in [
        (-1e-9, IntervalError::Negative),
        (f64::NEG_INFINITY, IntervalError::NonFinite),
        (f64::INFINITY, IntervalError::NonFinite),
        (f64::NAN, IntervalError::NonFinite),
    ] {
        assert_eq!(maker.over(interval, &[0.0; 2], |_| 0.0).err(), Some(why));
        assert_eq!(linear.over(interval).err(), Some(why));
    }
    assert_eq!(maker.over(1.1e4, &[0.0; 2], |_| 0.0).err(), Some(IntervalError::TooLong));

    // Two sensors at one instant: nothing moves, to the bit.
    let start = ([0.3, -0.7], Covariance::from_lower(Mat([[2.0, 0.0], [0.3, 0.1]])));
    let mut filter = Ekf::new(start.0, start.1);
    filter.predict(&maker.over(0.0, &start.0, |_| 5.0).unwrap(), &()).unwrap();
    assert_eq!((filter.mean(), filter.covariance()), (&start.0, start.1));
    let mut filter = Ekf::new(start.0, start.1);
    filter.predict(linear.over(0.0).unwrap(), &[]).unwrap();
    assert_eq!((filter.mean(), filter.covariance()), (&start.0, start.1));
}

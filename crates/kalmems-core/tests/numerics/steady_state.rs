//! Constant gains: against the recursion that they are the end of, against closed forms and published numbers,
//! and against eigenvalues by nalgebra.

// Eigenvalues of a library, compared within a tolerance.
#![allow(clippy::disallowed_methods)]

use approx::assert_relative_eq;
use kalmems_core::filter::{ContinuousObserver, ObserverError, Pole, place_poles};
use kalmems_core::riccati::{
    RiccatiError, continuous_lyapunov, continuous_riccati, discrete_lyapunov, discrete_riccati,
    kalman_bucy_gain, kalman_gain,
};
use kalmems_core::{
    Covariance, Dynamics, FilterError, FixedGain, Kalman, LinearMeasurement, LinearProcess, Lu, Mat,
    Measurement, Nodes, NoiseDensity, OperatingPoint, Over, Process, Rk4, Scalar,
};
use nalgebra::DMatrix;
use proptest::prelude::*;

fn dense<const R: usize, const C: usize>(m: &Mat<f64, R, C>) -> DMatrix<f64> {
    DMatrix::from_fn(R, C, |i, j| m[(i, j)])
}

fn full<const N: usize>(p: &Covariance<f64, N>) -> DMatrix<f64> {
    dense(&p.to_full())
}

/// The largest |λ|.
fn radius(a: &DMatrix<f64>) -> f64 {
    a.complex_eigenvalues().iter().fold(0.0, |most, e| most.max(e.norm()))
}

/// The largest real part of λ.
fn abscissa(a: &DMatrix<f64>) -> f64 {
    a.complex_eigenvalues().iter().fold(f64::NEG_INFINITY, |most, e| most.max(e.re))
}

/// A system of a size, cut from the entries of the largest; the noise comes from a root of `sources` columns.
#[derive(Debug)]
struct Entries {
    f: [[f64; 4]; 4],
    h: [[f64; 4]; 2],
    root: [[f64; 4]; 4],
    r: [f64; 2],
    sources: usize,
}

fn entries() -> impl Strategy<Value = Entries> {
    let row = || prop::array::uniform4(-1.0..1.0_f64);
    (
        prop::array::uniform4(row()),
        prop::array::uniform2(row()),
        prop::array::uniform4(row()),
        prop::array::uniform2(0.01..2.0_f64),
        1..=4_usize,
    )
        .prop_map(|(f, h, root, r, sources)| Entries { f, h, root, r, sources })
}

impl Entries {
    /// Spectral radii up to about 1.5: many are unstable.
    fn point<const N: usize, const M: usize>(&self) -> OperatingPoint<f64, N, M> {
        let root = Mat::<f64, N, 4>::from_fn(|i, j| if j < self.sources { self.root[i][j] } else { 0.0 });
        OperatingPoint {
            transition: Mat::from_fn(|i, j| self.f[i][j] * 1.2),
            observation: Mat::from_fn(|i, j| self.h[i][j]),
            process_noise: Covariance::from_lower(root.times_transposed(&root)),
            measurement_noise: Covariance::from_variances(std::array::from_fn(|i| self.r[i])),
        }
    }
}

/// The recursion of the Kalman filter to its end. None where it has not ended after 3000 steps, where the end
/// depends on the start (what does not decay is not moved), or where the variance is more than 10⁴ times what
/// noise and measurement bring: what is hardly seen costs digits.
fn recursion<const N: usize, const M: usize>(point: &OperatingPoint<f64, N, M>) -> Option<DMatrix<f64>> {
    let process = LinearProcess::<f64, N, 0> {
        transition: point.transition,
        input: Mat::zero(),
        noise: point.process_noise.into(),
    };
    let seen = LinearMeasurement { matrix: point.observation };
    let size = full(&point.process_noise).trace() + full(&point.measurement_noise).trace();
    let end_from = |variance: f64| {
        let mut filter = Kalman::new([0.0; N], Covariance::from_variances([variance; N]));
        let mut before = DMatrix::zeros(N, N);
        for _ in 0..3000 {
            filter.update(&seen, &[0.0; M], &point.measurement_noise).ok()?;
            filter.predict(&process, &[]).ok()?;
            let now = full(filter.covariance());
            let change = (&now - &before).norm();
            before = now;
            if change <= 1e-14 * before.norm() + 1e-20 * size {
                return Some(before);
            }
        }
        None
    };
    let (end, from_certainty) = (end_from(1.0)?, end_from(0.0)?);
    let alone = (&end - from_certainty).norm() <= 1e-11 * end.norm() + 1e-16 * size;
    (alone && end.norm() < 1e4 * size).then_some(end)
}

/// The solution is the stabilising one: it solves the equation, is positive semi-definite, and its gain makes
/// the error decay. There is only one such.
fn check_discrete<const N: usize, const M: usize>(entries: &Entries) -> Result<bool, TestCaseError> {
    let point = entries.point::<N, M>();
    let Some(iterated) = recursion(&point) else { return Ok(false) };
    let (h, r) = (&point.observation, &point.measurement_noise);
    let p = discrete_riccati(&point.transition, h, &point.process_noise, r).unwrap();
    let (fd, hd, pd) = (dense(&point.transition), dense(h), full(&p));
    let gain = &pd * hd.transpose() * (&hd * &pd * hd.transpose() + full(r)).try_inverse().unwrap();
    let rest = DMatrix::identity(N, N) - &gain * &hd;
    let corrected = &rest * &pd * rest.transpose() + &gain * full(r) * gain.transpose();
    let residual = &pd - &fd * &corrected * fd.transpose() - full(&point.process_noise);
    // Joseph's form sums numbers of this size, each rounded.
    let size =
        (1.0 + fd.norm_squared() * rest.norm_squared()) * pd.norm() + full(&point.process_noise).norm();
    prop_assert!(residual.norm() <= 1e-13 * size, "{}", residual.norm() / size);
    let closed = &fd - &fd * &gain * &hd;
    prop_assert!(radius(&closed) < 1.0);
    prop_assert!(pd.clone().symmetric_eigenvalues().min() >= -1e-14 * pd.norm());
    let scale = full(&point.process_noise).trace() + full(&point.measurement_noise).trace();
    prop_assert!((&iterated - &pd).norm() <= 1e-9 * pd.norm() + 1e-15 * scale, "{} {}", iterated, pd);

    // Its own error covariance, by another equation.
    let optimal = FixedGain::steady_state([0.0; N], &point).unwrap();
    let again = FixedGain::from_gain([0.0; N], *optimal.gain(), &point).unwrap();
    prop_assert!((full(again.predicted_covariance()) - &pd).norm() <= 1e-9 * pd.norm());
    prop_assert!((full(optimal.filtered_covariance()) - &corrected).norm() <= 1e-9 * pd.norm());
    // Any other gain is worse in every direction.
    let other = Mat::from_fn(|i, k| optimal.gain()[(i, k)] * 0.9 + 0.01);
    match FixedGain::from_gain([0.0; N], other, &point) {
        Ok(other) => {
            let more = full(other.predicted_covariance()) - &pd;
            // Where nothing is left over from one step to the next, every gain predicts the same.
            prop_assert!(more.norm() > 0.0 || fd.norm() * hd.norm() == 0.0);
            prop_assert!(
                more.symmetric_eigenvalues().min() >= -1e-10 * full(other.predicted_covariance()).norm()
            );
        }
        Err(error) => {
            prop_assert_eq!(error, RiccatiError::Unstable);
            prop_assert!(radius(&(&fd - &fd * dense(&other) * &hd)) > 1.0 - 1e-9);
        }
    }
    Ok(true)
}

fn check_continuous<const N: usize, const M: usize>(entries: &Entries) -> Result<bool, TestCaseError> {
    let point = entries.point::<N, M>();
    let (a, h) = (&point.transition, &point.observation);
    let q = NoiseDensity::from_lower(point.process_noise.to_full());
    let r = NoiseDensity::from_lower(point.measurement_noise.to_full());
    // Detectable, and not hardly so: the discrete system over 0.1 s settles.
    let sampled = OperatingPoint {
        transition: kalmems_core::discretize::matrix_exponential(&a.scaled(0.1)),
        process_noise: kalmems_core::discretize::discretize(a, &q, 0.1).noise,
        measurement_noise: Covariance::from_variances(std::array::from_fn(|i| r.get(i, i) / 0.1)),
        observation: *h,
    };
    if recursion(&sampled).is_none() {
        return Ok(false);
    }
    let p = continuous_riccati(a, h, &q, &r).unwrap();
    let (ad, hd, pd) = (dense(a), dense(h), full(&p));
    let gain = dense(&kalman_bucy_gain(&p, h, &r));
    let rd = full(&point.measurement_noise);
    let closed = &ad - &gain * &hd;
    prop_assert!(abscissa(&closed) < 0.0);
    // X ↦ Ac·X + X·Acᵀ as a matrix: its condition number is what the equation multiplies rounding by.
    let one = DMatrix::identity(N, N);
    let singular = (closed.kronecker(&one) + one.kronecker(&closed)).singular_values();
    let condition = singular.max() / singular.min();
    if condition > 1e6 {
        return Ok(false);
    }
    let residual =
        &ad * &pd + &pd * ad.transpose() - &gain * &rd * gain.transpose() + full(&point.process_noise);
    // What rounding P to its own size makes of the equation.
    let size = (ad.norm() + gain.norm() * hd.norm()) * pd.norm() + full(&point.process_noise).norm();
    prop_assert!(residual.norm() <= 1e-12 * size, "{}", residual.norm() / size);
    prop_assert!(pd.clone().symmetric_eigenvalues().min() >= -1e-14 * pd.norm());

    // The error of this gain settles where the equation says.
    let noise = full(&point.process_noise) + &gain * &rd * gain.transpose();
    let closed = Mat::<f64, N, N>::from_fn(|i, j| closed[(i, j)]);
    let again = continuous_lyapunov(&closed, &NoiseDensity::from_lower(Mat::from_fn(|i, j| noise[(i, j)])));
    prop_assert!((full(&again.unwrap()) - &pd).norm() <= 1e-13 * condition * pd.norm());
    Ok(true)
}

/// Real poles and pairs for `n` states, within the unit circle.
fn poles(n: usize) -> impl Strategy<Value = Vec<Pole<f64>>> {
    let pairs = 0..=n / 2;
    (pairs, prop::collection::vec((0.0..0.9_f64, 0.1..3.0_f64), n)).prop_map(move |(pairs, numbers)| {
        let pair = |&(size, angle): &(f64, f64)| Pole::Pair {
            real: size * angle.cos(),
            imaginary: size * angle.sin(),
        };
        let real = |&(size, angle): &(f64, f64)| Pole::Real(if angle < 1.5 { size } else { -size });
        numbers[..pairs].iter().map(pair).chain(numbers[pairs..n - pairs].iter().map(real)).collect()
    })
}

fn check_poles<const N: usize>(entries: &Entries, poles: &[Pole<f64>]) -> Result<bool, TestCaseError> {
    let point = entries.point::<N, 1>();
    let (a, h) = (&point.transition, &point.observation);
    let wanted: Vec<nalgebra::Complex<f64>> = poles
        .iter()
        .flat_map(|pole| match *pole {
            Pole::Real(re) => vec![nalgebra::Complex::new(re, 0.0)],
            Pole::Pair { real, imaginary } => {
                vec![nalgebra::Complex::new(real, imaginary), nalgebra::Complex::new(real, -imaginary)]
            }
        })
        .collect();
    let mut gap = 1.0_f64;
    for (i, a) in wanted.iter().enumerate() {
        for b in &wanted[..i] {
            gap = gap.min((a - b).norm());
        }
    }
    let Ok(placed) = place_poles(a, h, poles) else { return Ok(false) };
    let closed = dense(a) - dense(&placed.gain) * dense(h);
    // Rounding times the observability matrix's condition, times what a change of the matrix does to eigenvalues
    // that lie `gap` apart.
    let spread = (1.0 + closed.norm()).powf(N as f64) / gap.powf(N as f64 - 1.0);
    let tolerance = 1e-15 * placed.condition * spread * 10.0;
    if tolerance > 0.1 * gap || tolerance > 1e-6 {
        return Ok(false);
    }
    let reached = closed.complex_eigenvalues();
    for pole in &wanted {
        let nearest = reached.iter().map(|e| (e - pole).norm()).fold(f64::INFINITY, f64::min);
        prop_assert!(nearest <= tolerance, "{} of {}: {}", pole, reached, tolerance);
    }

    // A filter with that gain: both forms of its error have these poles, and its covariance is that of the error.
    let observer = FixedGain::luenberger([0.0; N], poles, &point);
    if let Ok(observer) = observer {
        let (kd, fd, hd) = (dense(observer.gain()), dense(a), dense(h));
        prop_assert!(
            (&fd * &kd - dense(&placed.gain)).norm() <= 1e-9 * (1.0 + placed.gain.0[0][0].abs()) * spread
        );
        let p = full(observer.filtered_covariance());
        let rest = DMatrix::identity(N, N) - &kd * &hd;
        let predicted = &fd * &p * fd.transpose() + full(&point.process_noise);
        let r = full(&point.measurement_noise);
        let next = &rest * predicted * rest.transpose() + &kd * r * kd.transpose();
        prop_assert!((&next - &p).norm() <= 1e-9 * p.norm() * (1.0 + rest.norm_squared()), "{} {}", next, p);
    }
    Ok(true)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1500))]
    #[test]
    fn the_discrete_equation_is_solved(entries in entries(), n in 1..=4_usize, m in 1..=2_usize) {
        let counted = match (n, m) {
            (1, 1) => check_discrete::<1, 1>(&entries)?,
            (2, 1) => check_discrete::<2, 1>(&entries)?,
            (3, 1) => check_discrete::<3, 1>(&entries)?,
            (4, 1) => check_discrete::<4, 1>(&entries)?,
            (1, _) => check_discrete::<1, 2>(&entries)?,
            (2, _) => check_discrete::<2, 2>(&entries)?,
            (3, _) => check_discrete::<3, 2>(&entries)?,
            _ => check_discrete::<4, 2>(&entries)?,
        };
        prop_assume!(counted);
    }

    #[test]
    fn the_continuous_equation_is_solved(entries in entries(), n in 1..=4_usize, m in 1..=2_usize) {
        let counted = match (n, m) {
            (1, 1) => check_continuous::<1, 1>(&entries)?,
            (2, 1) => check_continuous::<2, 1>(&entries)?,
            (3, 1) => check_continuous::<3, 1>(&entries)?,
            (4, 1) => check_continuous::<4, 1>(&entries)?,
            (1, _) => check_continuous::<1, 2>(&entries)?,
            (2, _) => check_continuous::<2, 2>(&entries)?,
            (3, _) => check_continuous::<3, 2>(&entries)?,
            _ => check_continuous::<4, 2>(&entries)?,
        };
        prop_assume!(counted);
    }

    #[test]
    fn poles_are_placed(
        entries in entries(),
        (n, poles) in (1..=4_usize).prop_flat_map(|n| (Just(n), poles(n))),
    ) {
        let counted = match n {
            1 => check_poles::<1>(&entries, &poles)?,
            2 => check_poles::<2>(&entries, &poles)?,
            3 => check_poles::<3>(&entries, &poles)?,
            _ => check_poles::<4>(&entries, &poles)?,
        };
        prop_assume!(counted);
    }

    #[test]
    fn general_equations_are_solved(entries in entries(), right in prop::array::uniform4(-1.0..1.0_f64)) {
        let a = Mat(entries.f);
        let inverse = dense(&a).try_inverse();
        let norm = inverse.map_or(f64::INFINITY, |m| m.norm());
        prop_assume!(norm < 1e6);
        let lu = Lu::of(&a).unwrap();
        let x = lu.solve(&Mat(right.map(|b| [b])));
        let back = a.times(&x);
        for i in 0..4 {
            prop_assert!((back[(i, 0)] - right[i]).abs() <= 1e-14 * (1.0 + norm));
        }
        let identity = a.times(&lu.inverse());
        prop_assert!((dense(&identity) - DMatrix::identity(4, 4)).norm() <= 1e-13 * (1.0 + norm));
    }
}

#[test]
fn a_local_level_settles_at_the_published_gain() {
    // The Nile's (Durbin and Koopman 2012): q = 1469.1, r = 15 099.
    let one = Mat([[1.0]]);
    let (q, r) = (Covariance::from_variances([1469.1]), Covariance::from_variances([15099.0]));
    let p = discrete_riccati(&one, &one, &q, &r).unwrap();
    assert_relative_eq!(p.get(0, 0), 5_501.257_941_808_476, max_relative = 1e-14);
}

/// Kalata (IEEE Trans. Aerospace and Electronic Systems 20, 174, 1984): α and β as functions of the tracking index
/// λ = T²·σ_w/σ_v alone, for an acceleration that is constant over each interval.
#[test]
fn constant_velocity_settles_at_kalatas_alpha_and_beta() {
    let (interval, sigma_v) = (0.02_f64, 0.3_f64);
    for index in [1e-6, 1e-3, 0.1, 1.0, 10.0, 1e3] {
        let lambda: f64 = index;
        let sigma_w = lambda * sigma_v / interval.powi(2);
        let source = Mat([[interval.powi(2) / 2.0 * sigma_w], [interval * sigma_w]]);
        let point = OperatingPoint {
            transition: Mat([[1.0, interval], [0.0, 1.0]]),
            observation: Mat([[1.0, 0.0]]),
            process_noise: Covariance::from_lower(source.times_transposed(&source)),
            measurement_noise: Covariance::from_variances([sigma_v.powi(2)]),
        };
        let filter = FixedGain::steady_state([0.0; 2], &point).unwrap();
        // The closed form itself cancels: λ² + 8λ − (λ + 4)·√(λ² + 8λ) loses digits for small λ and for large.
        let root = (lambda * lambda + 8.0 * lambda).sqrt();
        let alpha = -(lambda * lambda + 8.0 * lambda - (lambda + 4.0) * root) / 8.0;
        let beta = (lambda * lambda + 4.0 * lambda - lambda * root) / 4.0;
        let lost = 1e-13 * (lambda + 1.0).powi(4);
        assert_relative_eq!(filter.gain()[(0, 0)], alpha, max_relative = 1e-10 + lost);
        assert_relative_eq!(filter.gain()[(1, 0)] * interval, beta, max_relative = 1e-10 + lost);
    }
}

#[test]
fn a_double_integrator_in_continuous_time_in_closed_form() {
    let (a, h) = (Mat([[0.0, 1.0], [0.0, 0.0]]), Mat([[1.0, 0.0]]));
    for (q, r) in [(1.0_f64, 1.0_f64), (1e6, 1e-12), (1e-20, 3.0), (2.0, 1e10)] {
        let density = NoiseDensity::none().on::<1>(q);
        let noise = NoiseDensity::none().on::<0>(r);
        let p = continuous_riccati(&a, &h, &density, &noise).unwrap();
        let two = 2.0_f64.sqrt();
        assert_relative_eq!(p.get(0, 0), two * q.powf(0.25) * r.powf(0.75), max_relative = 1e-12);
        assert_relative_eq!(p.get(1, 0), (q * r).sqrt(), max_relative = 1e-12);
        assert_relative_eq!(p.get(1, 1), two * q.powf(0.75) * r.powf(0.25), max_relative = 1e-12);
        let gain = kalman_bucy_gain(&p, &h, &noise);
        assert_relative_eq!(gain[(0, 0)], two * (q / r).powf(0.25), max_relative = 1e-12);
        assert_relative_eq!(gain[(1, 0)], (q / r).sqrt(), max_relative = 1e-12);
    }
}

#[test]
fn a_model_without_a_steady_state_is_refused_with_the_reason() {
    let q = |v: [f64; 2]| Covariance::from_variances(v);
    let r = Covariance::from_variances([1.0]);
    let first = Mat([[1.0, 0.0]]);
    let solve = |f: [[f64; 2]; 2], h: &Mat<f64, 1, 2>, q: &Covariance<f64, 2>| {
        discrete_riccati(&Mat(f), h, q, &r).unwrap_err()
    };
    let unseen = [[0.5, 0.0], [0.0, 1.1]];
    assert_eq!(solve(unseen, &first, &q([1.0, 1.0])), RiccatiError::NotDetectable);
    assert_eq!(solve(unseen, &first, &q([1.0, 0.0])), RiccatiError::NotDetectable);
    // A random walk that nobody sees, and a constant that nobody sees.
    let constant = [[0.5, 0.0], [0.0, 1.0]];
    assert_eq!(solve(constant, &first, &q([1.0, 1.0])), RiccatiError::NotDetectable);
    assert_eq!(solve(constant, &first, &q([1.0, 0.0])), RiccatiError::NotDetectable);
    // An unstable part is hidden between the states, and the measurement is blind to it up to rounding.
    let (c, s) = (0.7_f64.cos(), 0.7_f64.sin());
    let turned = [[0.5 * c * c + 1.3 * s * s, 0.8 * -c * s], [0.8 * -c * s, 0.5 * s * s + 1.3 * c * c]];
    let blind = solve(turned, &Mat([[c, s]]), &q([1.0, 1.0]));
    assert!(matches!(blind, RiccatiError::NotDetectable | RiccatiError::IllConditioned), "{blind}");
    // A constant that is seen, but never moved.
    let both = Mat([[1.0, 1.0]]);
    assert_eq!(solve(constant, &both, &q([1.0, 0.0])), RiccatiError::NotStabilizable);
    assert_eq!(solve(unseen, &both, &q([1.0, 0.0])), RiccatiError::NotStabilizable);
    // What decays needs neither.
    let decays = Mat([[0.5, 0.0], [0.0, 0.9]]);
    let p = discrete_riccati(&decays, &first, &q([1.0, 0.0]), &r).unwrap();
    assert_eq!(p.get(1, 1), 0.0);

    for bad in [f64::NAN, f64::INFINITY] {
        assert_eq!(solve([[bad, 0.0], [0.0, 0.5]], &first, &q([1.0, 1.0])), RiccatiError::NonFinite);
        assert_eq!(solve(constant, &Mat([[bad, 0.0]]), &q([1.0, 1.0])), RiccatiError::NonFinite);
        assert_eq!(solve(constant, &first, &q([bad, 1.0])), RiccatiError::NonFinite);
    }
    assert_eq!(solve(constant, &first, &q([-1.0, 1.0])), RiccatiError::ProcessNoiseNotPositive);
    let indefinite = Covariance::from_lower(Mat([[1.0, 0.0], [2.0, 1.0]]));
    assert_eq!(solve(constant, &first, &indefinite), RiccatiError::ProcessNoiseNotPositive);
    let zero = Covariance::from_variances([0.0]);
    assert_eq!(
        discrete_riccati(&decays, &first, &q([1.0, 1.0]), &zero).unwrap_err(),
        RiccatiError::MeasurementNoiseNotPositive
    );
    let unstable = Mat([[1.0001, 0.0], [0.0, 0.5]]);
    assert_eq!(discrete_lyapunov(&unstable, &q([1.0, 1.0])).unwrap_err(), RiccatiError::Unstable);

    // The same in continuous time.
    let solve = |a: [[f64; 2]; 2], h: &Mat<f64, 1, 2>, q: [f64; 2]| {
        let density = NoiseDensity::none().on::<0>(q[0]).on::<1>(q[1]);
        continuous_riccati(&Mat(a), h, &density, &NoiseDensity::none().on::<0>(1.0)).unwrap_err()
    };
    assert_eq!(solve([[-1.0, 0.0], [0.0, 0.1]], &first, [1.0, 1.0]), RiccatiError::NotDetectable);
    assert_eq!(solve([[-1.0, 0.0], [0.0, 0.0]], &first, [1.0, 1.0]), RiccatiError::NotDetectable);
    assert_eq!(solve([[-1.0, 0.0], [0.0, 0.0]], &both, [1.0, 0.0]), RiccatiError::NotStabilizable);
    // An undamped oscillation without noise.
    assert_eq!(solve([[0.0, 1.0], [-1.0, 0.0]], &first, [0.0, 0.0]), RiccatiError::NotStabilizable);
}

/// m = 3.8 µg, b = 7·10⁻⁴ kg/s, k = 3 N/m (Zhang 2010, table I): the system matrix of a displacement in m.
const ACCELEROMETER: Mat<f64, 2, 2> = Mat([[0.0, 1.0], [-3.0 / 3.8e-9, -7e-4 / 3.8e-9]]);
/// The readout in V/m (equation 5-3, relative permittivity 4).
const READOUT: Mat<f64, 1, 2> = Mat([[7.47e5, 0.0]]);

/// The observer that the thesis starts from (its section 4.1), in SI with eigenvalues forty times apart.
#[test]
fn the_accelerometers_observer_has_the_poles_it_was_given() {
    let open = dense(&ACCELEROMETER).complex_eigenvalues();
    assert_relative_eq!(
        open.iter().map(|e| e.re).fold(f64::INFINITY, f64::min),
        -179_820.0,
        max_relative = 1e-4
    );
    assert_relative_eq!(
        open.iter().map(|e| e.re).fold(f64::NEG_INFINITY, f64::max),
        -4390.0,
        max_relative = 1e-3
    );

    let wanted = Pole::Pair { real: -3e5, imaginary: 1e5 };
    let placed = place_poles(&ACCELEROMETER, &READOUT, &[wanted]).unwrap();
    let closed = dense(&ACCELEROMETER) - dense(&placed.gain) * dense(&READOUT);
    for e in closed.complex_eigenvalues().iter() {
        assert_relative_eq!(e.re, -3e5, max_relative = 1e-9);
        assert_relative_eq!(e.im.abs(), 1e5, max_relative = 1e-9);
    }
    // By hand: l₁·c = 6e5 − b/m, and (−3e5)² + (1e5)² = (k/m) + l₁·c·b/m + l₂·c.
    let (k, b, c) = (3.0 / 3.8e-9, 7e-4 / 3.8e-9, 7.47e5);
    let first = (6e5 - b) / c;
    assert_relative_eq!(placed.gain[(0, 0)], first, max_relative = 1e-12);
    assert_relative_eq!(placed.gain[(1, 0)], (1e11 - k - first * c * b) / c, max_relative = 1e-12);

    // In continuous time an error decays with the slowest pole: by e^{−3} over 10 µs, up to its own shape.
    let observer = ContinuousObserver {
        dynamics: Linear(ACCELEROMETER),
        measurement: LinearMeasurement { matrix: READOUT },
        gain: placed.gain,
    };
    let run = Rk4::new(observer, 1e-7, &NoiseDensity::none(), (&[0.0; 2], &((), [0.0])));
    let mut x = [1e-9, 0.0];
    for _ in 0..1000 {
        x = run.step(&x, &Nodes::held(((), [0.0])));
    }
    assert!(x[0].abs() < 1e-9 * (-3e5 * 1e-4_f64).exp() * 10.0, "{x:?}");

    // Sampled at 1 µs, with the same poles over the interval; both say what their noise costs.
    let density = NoiseDensity::none().on::<1>(7.7e-7);
    let exact = LinearProcess::<f64, 2, 0>::exact(&ACCELEROMETER, &Mat::zero(), &density, 1e-6);
    let seen = LinearMeasurement { matrix: READOUT };
    let point = OperatingPoint::of(&exact, (&seen, Covariance::from_variances([4.88e-8])), (&[0.0; 2], &[]));
    let fast = FixedGain::luenberger([0.0; 2], &[wanted.sampled(1e-6)], &point).unwrap();
    let best = FixedGain::steady_state([0.0; 2], &point).unwrap();
    let closed = dense(&exact.transition) * (DMatrix::identity(2, 2) - dense(fast.gain()) * dense(&READOUT));
    assert_relative_eq!(radius(&closed), (-0.3_f64).exp(), max_relative = 1e-9);
    for i in 0..2 {
        let (fast, best) = (fast.filtered_covariance(), best.filtered_covariance());
        assert!(fast.standard_deviation(i) > 3.0 * best.standard_deviation(i));
    }
}

struct Linear(Mat<f64, 2, 2>);
impl Dynamics<f64, 2> for Linear {
    type Input = ();
    fn derivative<S: Over<f64>>(&self, x: &[S; 2], (): &()) -> [S; 2] {
        self.0.times_vector(x)
    }
}

#[test]
fn poles_that_cannot_be_placed_are_refused() {
    let a = Mat([[1.0, 0.5], [0.0, 0.8]]);
    let poles = [Pole::Real(0.1), Pole::Real(0.2)];
    let blind = place_poles(&a, &Mat([[0.0, 1.0]]), &poles).unwrap_err();
    assert!(matches!(blind, ObserverError::NotObservable { .. }), "{blind}");
    let nothing = place_poles(&a, &Mat([[0.0, 0.0]]), &poles).unwrap_err();
    assert!(matches!(nothing, ObserverError::NotObservable { .. }), "{nothing}");
    // Seen by rounding alone: the left eigenvector is [0, 1] up to 1e-15.
    let hardly = place_poles(&a, &Mat([[1e-16, 1.0]]), &poles).unwrap_err();
    assert!(matches!(hardly, ObserverError::NotObservable { condition } if condition > 1e14), "{hardly}");

    let h = Mat([[1.0, 0.0]]);
    assert_eq!(place_poles(&a, &h, &poles[..1]).unwrap_err(), ObserverError::PoleCount(1));
    let three = [Pole::Real(0.1), Pole::Pair { real: 0.0, imaginary: 0.1 }];
    assert_eq!(place_poles(&a, &h, &three).unwrap_err(), ObserverError::PoleCount(3));
    let infinite = [Pole::Real(0.1), Pole::Real(f64::NAN)];
    assert_eq!(place_poles(&a, &h, &infinite).unwrap_err(), ObserverError::NonFinite);
    assert_eq!(place_poles(&Mat([[f64::NAN; 2]; 2]), &h, &poles).unwrap_err(), ObserverError::NonFinite);

    let point = |transition| OperatingPoint {
        transition,
        observation: h,
        process_noise: Covariance::zero(),
        measurement_noise: Covariance::from_variances([1.0]),
    };
    let outside =
        FixedGain::luenberger([0.0; 2], &[Pole::Real(0.1), Pole::Real(1.1)], &point(a)).unwrap_err();
    assert_eq!(outside, ObserverError::NoSteadyState(RiccatiError::Unstable));
    // A delay forgets its state: F has no inverse.
    let delay = point(Mat([[0.0, 1.0], [0.0, 0.0]]));
    let singular = FixedGain::luenberger([0.0; 2], &poles, &delay).unwrap_err();
    assert_eq!(singular, ObserverError::SingularTransition);
}

/// ẍ = u − sin x, seen through the sine.
#[derive(Clone, Copy)]
struct Pendulum;
impl<T: Scalar> Dynamics<T, 2> for Pendulum {
    type Input = T;
    fn derivative<S: Over<T>>(&self, x: &[S; 2], u: &T) -> [S; 2] {
        [x[1], S::lift(*u) - x[0].sin() - x[1] * T::of(0.02)]
    }
}
struct Sine;
impl<T: Scalar> Measurement<T, 2, 1> for Sine {
    fn predict<S: Over<T>>(&self, x: &[S; 2]) -> [S; 1] {
        [x[0].sin()]
    }
}

#[test]
fn a_settled_kalman_filter_and_the_constant_gain_are_the_same() {
    let process = LinearProcess::exact(
        &Mat([[0.0, 1.0], [-1.0, -0.1]]),
        &Mat([[0.0], [1.0]]),
        &NoiseDensity::none().on::<1>(0.01),
        0.1,
    );
    let seen = LinearMeasurement { matrix: Mat([[1.0, 0.0], [0.3, 0.5]]) };
    let r = Covariance::from_lower(Mat([[0.1, 0.0], [0.02, 0.3]]));
    let point = OperatingPoint::of(&process, (&seen, r), (&[0.0; 2], &[0.0]));
    let mut fixed = FixedGain::steady_state([1.0, 0.0], &point).unwrap();
    assert_eq!(*fixed.gain(), kalman_gain(fixed.predicted_covariance(), &seen.matrix, &r));
    let mut kalman = Kalman::new([1.0, 0.0], *fixed.filtered_covariance());
    for k in 0..200 {
        let u = [(0.3 * f64::from(k)).sin()];
        let y = [(0.1 * f64::from(k)).cos(), (0.17 * f64::from(k)).sin()];
        kalman.predict(&process, &u).unwrap();
        fixed.predict(&process, &u).unwrap();
        let a = kalman.update(&seen, &y, &r).unwrap();
        let b = fixed.update(&seen, &y).unwrap();
        assert!(b.taken);
        assert_relative_eq!(a.nis, b.nis, max_relative = 1e-11);
        assert_relative_eq!(a.log_likelihood(), b.log_likelihood(), max_relative = 1e-11);
        for i in 0..2 {
            assert_relative_eq!(kalman.mean()[i], fixed.mean()[i], epsilon = 1e-12);
        }
    }
}

#[test]
fn a_constant_gain_follows_a_nonlinear_system_near_its_operating_point() {
    let noise = NoiseDensity::none().on::<1>(1e-4);
    let process = Rk4::new(Pendulum, 0.02, &noise, (&[0.0; 2], &0.0));
    let point = OperatingPoint::of(
        &process,
        (&Sine, Covariance::from_variances([1e-4])),
        (&[0.0; 2], &Nodes::held(0.0)),
    );
    let mut filter = FixedGain::steady_state([0.0, 0.0], &point).unwrap();
    let mut truth = [0.4, 0.0];
    for k in 0..2000 {
        let u = Nodes::held((0.01 * f64::from(k)).sin() * 0.05);
        truth = process.step(&truth, &u);
        filter.predict(&process, &u).unwrap();
        filter.update(&Sine, &Sine.predict(&truth)).unwrap();
    }
    assert!((filter.mean()[0] - truth[0]).abs() < 1e-6, "{:?} {truth:?}", filter.mean());
    assert_eq!(filter.filtered().covariance, *filter.filtered_covariance());
}

#[test]
fn what_is_not_finite_is_refused_and_leaves_the_mean() {
    let process = Rk4::new(Pendulum, 0.02, &NoiseDensity::none().on::<1>(1e-4), (&[0.0; 2], &0.0));
    let r = Covariance::from_variances([1e-4]);
    let point = OperatingPoint::of(&process, (&Sine, r), (&[0.0; 2], &Nodes::held(0.0)));
    let mut filter = FixedGain::steady_state([0.3, -0.1], &point).unwrap();
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        assert_eq!(filter.predict(&process, &Nodes::held(bad)).unwrap_err(), FilterError::NonFiniteState);
        assert_eq!(filter.update(&Sine, &[bad]).unwrap_err(), FilterError::NonFiniteMeasurement);
    }
    assert_eq!(filter.update(&Logarithm, &[0.0]).unwrap_err(), FilterError::NonFiniteState);
    assert_eq!(filter.mean().map(f64::to_bits), [0.3, -0.1].map(f64::to_bits));
    filter.update(&Sine, &[0.2]).unwrap();
    assert_ne!(filter.mean(), &[0.3, -0.1]);
}

/// Not a number for a negative rate.
struct Logarithm;
impl<T: Scalar> Measurement<T, 2, 1> for Logarithm {
    fn predict<S: Over<T>>(&self, x: &[S; 2]) -> [S; 1] {
        [x[1].ln()]
    }
}

#[test]
fn single_precision_settles_too() {
    let f = Mat([[1.0_f32, 0.1], [-0.1, 0.99]]);
    let (q, r) = (Covariance::from_variances([0.0, 0.01_f32]), Covariance::from_variances([0.3_f32]));
    let h = Mat([[1.0_f32, 0.0]]);
    let single = discrete_riccati(&f, &h, &q, &r).unwrap();
    let wide = |m: &Mat<f32, 2, 2>| Mat::<f64, 2, 2>::from_fn(|i, j| f64::from(m[(i, j)]));
    let double = discrete_riccati(
        &wide(&f),
        &Mat([[1.0, 0.0]]),
        &Covariance::from_lower(wide(&q.to_full())),
        &Covariance::from_variances([f64::from(0.3_f32)]),
    )
    .unwrap();
    for (i, j) in [(0, 0), (1, 0), (1, 1)] {
        assert_relative_eq!(f64::from(single.get(i, j)), double.get(i, j), max_relative = 2e-5);
    }
}

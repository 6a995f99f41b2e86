//! Square-root filters against those with a covariance, against dense formulas, and against bad input.

use kalmems_core::update::Gate;
use kalmems_core::{
    Cholesky, Covariance, Ekf, Filter, FilterError, IteratedEkf, LinearMeasurement, LinearProcess, Mat,
    Measurement, Over, Process, ProcessNoise, Scalar, SchmidtEkf, SigmaPoints, SquareRootEkf, SquareRootUkf,
    Ukf,
};
use nalgebra::{Matrix3, SMatrix};
use proptest::prelude::*;

type Mat3 = Mat<f64, 3, 3>;

fn dense<const R: usize, const C: usize>(m: &Mat<f64, R, C>) -> SMatrix<f64, R, C> {
    SMatrix::from_fn(|i, j| m[(i, j)])
}

fn full<const N: usize>(p: &Covariance<f64, N>) -> SMatrix<f64, N, N> {
    dense(&p.to_full())
}

fn lower<const N: usize>(m: &SMatrix<f64, N, N>) -> Covariance<f64, N> {
    Covariance::from_lower(Mat::from_fn(|i, j| m[(i, j)]))
}

/// Whether two covariances agree to a fraction of the largest variance.
fn close<const N: usize>(a: &Covariance<f64, N>, b: &Covariance<f64, N>, tolerance: f64) -> bool {
    let size = (0..N).map(|i| a.get(i, i)).fold(1.0, f64::max);
    (0..N).all(|i| (0..N).all(|j| (a.get(i, j) - b.get(i, j)).abs() <= tolerance * size))
}

fn near<const N: usize>(a: &[f64; N], b: &[f64; N], tolerance: f64) -> bool {
    let size = a.iter().fold(1.0, |size, x| x.abs().max(size));
    (0..N).all(|i| (a[i] - b[i]).abs() <= tolerance * size)
}

/// The smallest eigenvalue as a fraction of the trace.
fn smallest<const N: usize>(p: &Covariance<f64, N>) -> f64 {
    let p = nalgebra::DMatrix::from_fn(N, N, |i, j| p.get(i, j));
    p.symmetric_eigenvalues().min() / p.trace().max(f64::MIN_POSITIVE)
}

#[derive(Clone, Copy, Debug)]
struct System {
    transition: Mat3,
    noise: Covariance<f64, 3>,
    seen: Mat<f64, 2, 3>,
    r: Covariance<f64, 2>,
    start: Mat3,
    points: SigmaPoints<f64>,
}

impl System {
    fn process(&self) -> LinearProcess<f64, 3, 1> {
        LinearProcess {
            transition: self.transition,
            input: Mat([[0.0], [1.0], [2.0]]),
            noise: self.noise.into(),
        }
    }
    fn measurement(&self) -> LinearMeasurement<f64, 3, 2> {
        LinearMeasurement { matrix: self.seen }
    }
    fn covariance(&self) -> Covariance<f64, 3> {
        Covariance::from_lower(self.start.times_transposed(&self.start))
    }
}

const MEAN: [f64; 3] = [1.0, -2.0, 0.5];

/// Three states and two measurements with correlated noise; Q of any rank from 0 to 3. Over the twelve steps of
/// the tests a state grows by less than 1.7¹², so that no innovation covariance is worse conditioned than 10⁹.
fn system() -> impl Strategy<Value = System> {
    (
        prop::array::uniform9(-0.4..0.4_f64),
        (prop::array::uniform9(-1.0..1.0_f64), 0_usize..=3),
        prop::array::uniform6(-1.0..1.0_f64),
        (0.1..1.5_f64, -1.0..1.0_f64, 0.1..1.5_f64),
        (prop::array::uniform3(0.2..2.0_f64), prop::array::uniform3(-1.0..1.0_f64)),
        (0.1..1.4_f64, 0.0..1.0_f64),
    )
        .prop_map(|(f, (g, rank), h, r, (sd, s), (alpha, kappa))| {
            let g: Mat3 = Mat::from_fn(|i, j| if j < rank { g[3 * i + j] } else { 0.0 });
            System {
                transition: Mat::from_fn(|i, j| f[3 * i + j] + if i == j { 0.5 } else { 0.0 }),
                noise: Covariance::from_lower(g.times_transposed(&g)),
                seen: Mat::from_fn(|i, j| h[3 * i + j]),
                r: Covariance::from_lower(Mat([[r.0 * r.0, 0.0], [r.0 * r.1, r.1 * r.1 + r.2 * r.2]])),
                start: Mat([[sd[0], 0.0, 0.0], [s[0], sd[1], 0.0], [s[1], s[2], sd[2]]]),
                points: SigmaPoints { alpha, beta: 2.0, kappa },
            }
        })
}

/// A step that bends.
struct Bend(ProcessNoise<f64, 3>);
impl Process<f64, 3> for Bend {
    type Input = ();
    fn step<S: Over<f64>>(&self, x: &[S; 3], (): &()) -> [S; 3] {
        [x[0] + x[1] * 0.3, x[1] - x[0].sin() * x[2], (x[2] * 0.5).cos() + x[0] * x[1] * 0.2]
    }
    fn noise(&self) -> &ProcessNoise<f64, 3> {
        &self.0
    }
}

/// A sensor that bends, the third state unseen by the second component.
struct Curve;
impl<T: Scalar> Measurement<T, 3, 2> for Curve {
    fn predict<S: Over<T>>(&self, x: &[S; 3]) -> [S; 2] {
        [x[0].sin() + x[1] * x[2], x[0].sq() - x[1]]
    }
    fn depends(i: usize, j: usize) -> bool {
        i == 0 || j < 2
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    #[test]
    fn on_a_linear_system_they_are_the_kalman_filter(
        system in system(),
        ys in prop::collection::vec(prop::array::uniform2(-3.0..3.0_f64), 12),
    ) {
        let (process, measurement) = (system.process(), system.measurement());
        let mut joseph = Ekf::new(MEAN, system.covariance());
        let mut root = SquareRootEkf::from_factor(MEAN, &system.start);
        let mut points = SquareRootUkf::from_factor(MEAN, &system.start, system.points);
        for y in ys {
            for (a, b) in [(root.covariance(), *root.factor()), (points.covariance(), *points.factor())] {
                prop_assert!(close(&joseph.covariance(), &a, 1e-8));
                prop_assert!(smallest(&a) >= -1e-15);
                prop_assert!((0..3).all(|i| b[(i, i)] >= 0.0 && (i + 1..3).all(|j| b[(i, j)] == 0.0)));
            }
            joseph.predict(&process, &[0.1]).unwrap();
            root.predict(&process, &[0.1]).unwrap();
            points.predict(&process, &[0.1]).unwrap();
            prop_assert!(close(&joseph.covariance(), &root.covariance(), 1e-8));
            prop_assert!(close(&joseph.covariance(), &points.covariance(), 1e-8));
            let expected = joseph.update(&measurement, &y, &system.r).unwrap();
            for got in [
                root.update(&measurement, &y, &system.r).unwrap(),
                points.update(&measurement, &y, &system.r).unwrap(),
            ] {
                prop_assert!(near(&expected.residual, &got.residual, 1e-8));
                prop_assert!(close(&expected.covariance, &got.covariance, 1e-8));
                prop_assert!((expected.nis - got.nis).abs() <= 1e-7 * expected.nis.max(1.0));
                let (a, b) = (expected.log_likelihood(), got.log_likelihood());
                prop_assert!((a - b).abs() <= 1e-7 * a.abs().max(1.0));
            }
            prop_assert!(near(joseph.mean(), root.mean(), 1e-8));
            prop_assert!(near(joseph.mean(), points.mean(), 1e-8));
        }
    }

    /// Any rank, any correlation and any scales: a root is right to rounding in each entry.
    #[test]
    fn a_singular_covariance_has_a_root(
        (g, rank) in (prop::array::uniform9(-1.0..1.0_f64), 0_usize..=3),
        scales in prop::array::uniform3(-12..12_i32),
    ) {
        let g: Mat3 = Mat::from_fn(|i, j| if j < rank { g[3 * i + j] * 10_f64.powi(scales[i]) } else { 0.0 });
        let p = Covariance::from_lower(g.times_transposed(&g));
        let root = Cholesky::of_semidefinite(&p);
        let got = Covariance::from_lower(root.times_transposed(&root));
        for i in 0..3 {
            for j in 0..=i {
                let size = (p.get(i, i) * p.get(j, j)).sqrt();
                prop_assert!((p.get(i, j) - got.get(i, j)).abs() <= 1e-14 * size, "{:?} {:?}", p, root);
                prop_assert!(root[(i, i)] >= 0.0 && (i == j || root[(j, i)] == 0.0));
            }
        }
    }

    #[test]
    fn what_is_definite_stays_definite(
        system in system(),
        ys in prop::collection::vec(prop::array::uniform2(-3.0..3.0_f64), 12),
    ) {
        // Without noise a step keeps a covariance definite only where it can be undone, and twelve of them only where their digits suffice: a
        // variance that falls to 10⁻¹² of another is still a number next to it.
        let all = (1..12).fold(dense(&system.transition), |all, _| all * dense(&system.transition)).singular_values();
        prop_assume!(all.min() > 1e-6 * all.max());
        let process = LinearProcess { noise: ProcessNoise::none(), ..system.process() };
        let mut root = SquareRootEkf::new(MEAN, system.covariance());
        let mut points = SquareRootUkf::new(MEAN, system.covariance(), system.points);
        for y in ys {
            root.predict(&process, &[0.1]).unwrap();
            points.predict(&process, &[0.1]).unwrap();
            root.update(&system.measurement(), &y, &system.r).unwrap();
            points.update(&system.measurement(), &y, &system.r).unwrap();
            prop_assert!((0..3).all(|i| root.factor()[(i, i)] > 0.0 && points.factor()[(i, i)] > 0.0));
        }
    }

    #[test]
    fn on_nonlinear_models_they_are_the_filters_with_a_covariance(
        system in system(),
        y in prop::array::uniform2(-1.0..3.0_f64),
    ) {
        let process = Bend(system.noise.into());
        let mut joseph = Ekf::new(MEAN, system.covariance());
        let mut root = SquareRootEkf::from_factor(MEAN, &system.start);
        let mut plain = Ukf::new(MEAN, system.covariance(), system.points);
        let mut points = SquareRootUkf::from_factor(MEAN, &system.start, system.points);
        // The weights of the points reach 1/(2·0.1²·3), the rounding of their squares with them.
        let tolerance = 1e-9;

        let before = plain.covariance();
        let a = joseph.predict_linked(&process, &()).unwrap();
        let b = root.predict_linked(&process, &()).unwrap();
        prop_assert_eq!((a.transition, a.noise), (b.transition, b.noise));
        prop_assert!(near(joseph.mean(), root.mean(), 0.0));
        prop_assert!(close(&joseph.covariance(), &root.covariance(), tolerance));
        let a = plain.predict_linked(&process, &()).unwrap();
        let b = points.predict_linked(&process, &()).unwrap();
        prop_assert!(near(plain.mean(), points.mean(), tolerance));
        prop_assert!(close(&plain.covariance(), &points.covariance(), tolerance));
        // The regression divides by a factor whose smallest pivot is 0.2, twice in one of them.
        prop_assert!((dense(&a.transition) - dense(&b.transition)).norm() < 1e-7, "{:?} {:?}", a, b);
        prop_assert!(close(&a.noise, &b.noise, 1e-7));
        let next = full(&before.transformed(&b.transition)) + full(&b.noise);
        prop_assert!(close(&points.covariance(), &lower(&next), 1e-8));
        prop_assert!(smallest(&b.noise) > -1e-15);

        let a = joseph.update(&Curve, &y, &system.r).unwrap();
        let b = root.update(&Curve, &y, &system.r).unwrap();
        prop_assert!((a.nis - b.nis).abs() <= tolerance * a.nis.max(1.0));
        prop_assert!((a.log_likelihood() - b.log_likelihood()).abs() <= tolerance * a.nis.max(10.0));
        prop_assert!(near(joseph.mean(), root.mean(), tolerance));
        prop_assert!(close(&joseph.covariance(), &root.covariance(), tolerance));
        let a = plain.update(&Curve, &y, &system.r).unwrap();
        let b = points.update(&Curve, &y, &system.r).unwrap();
        prop_assert!((a.nis - b.nis).abs() <= 1e-7 * a.nis.max(1.0));
        prop_assert!((a.log_likelihood() - b.log_likelihood()).abs() <= 1e-7 * a.nis.max(10.0));
        prop_assert!(near(plain.mean(), points.mean(), 1e-7));
        prop_assert!(close(&plain.covariance(), &points.covariance(), 1e-7));
    }
}

/// States that are known exactly, and a sensor without noise.
#[test]
fn what_is_exactly_known_stays_so() {
    let pair = LinearMeasurement { matrix: Mat([[1.0, 0.0], [1.0, 1.0]]) };
    // The second component is exact; the first state's offset is known.
    let mut filter = SquareRootEkf::new([1.0, 2.0], Covariance::from_variances([0.0, 9.0]));
    let r = Covariance::from_variances([4.0, 0.0]);
    let innovation = filter.update(&pair, &[3.0, 5.0], &r).unwrap();
    assert_eq!(filter.mean(), &[1.0, 4.0]);
    assert_eq!(filter.covariance(), Covariance::zero());
    assert_eq!(innovation.nis, 1.0 + 4.0 / 9.0);
    // What is exactly known cannot be measured exactly once more.
    let refused = filter.update(&pair, &[3.0, 5.0], &r).unwrap_err();
    assert_eq!(refused, FilterError::InnovationNotPositive);
    // Points need no factorisation, so that they may lie on each other.
    let start = Covariance::from_variances([0.0, 9.0]);
    let mut points = SquareRootUkf::new([1.0, 2.0], start, SigmaPoints::standard());
    let step = LinearProcess::<f64, 2, 0> {
        transition: Mat([[1.0, 0.0], [3.0, 2.0]]),
        input: Mat::zero(),
        noise: ProcessNoise::none(),
    };
    let link = points.predict_linked(&step, &[]).unwrap();
    approx::assert_relative_eq!(points.covariance().get(1, 1), 36.0, max_relative = 1e-14);
    assert_eq!(points.covariance().get(0, 0), 0.0);
    approx::assert_relative_eq!(link.transition[(1, 1)], 2.0, max_relative = 1e-14);
    assert!(link.noise.get(1, 1) < 1e-25);
}

/// Two sensors, the second with all the noise of the first and its own.
#[test]
fn correlated_sensors_in_closed_form() {
    let both = LinearMeasurement { matrix: Mat([[1.0], [1.0]]) };
    // R = [[1, 1], [1, 2]]: the difference of the two is noise alone, of variance 1. So y₁ says all.
    let r = Covariance::from_lower(Mat([[1.0, 0.0], [1.0, 2.0]]));
    let mut filter = SquareRootEkf::new([0.0], Covariance::from_variances([3.0]));
    let innovation = filter.update(&both, &[2.0, 5.0], &r).unwrap();
    approx::assert_relative_eq!(filter.mean()[0], 1.5, max_relative = 1e-15);
    approx::assert_relative_eq!(filter.covariance().get(0, 0), 0.75, max_relative = 1e-15);
    // 2² over 3 + 1, and the difference 3² over 1; det S = 4·1.
    approx::assert_relative_eq!(innovation.nis, 1.0 + 9.0, max_relative = 1e-15);
    let log = -0.5 * (2.0 * std::f64::consts::TAU.ln() + 4.0_f64.ln() + 10.0);
    approx::assert_relative_eq!(innovation.log_likelihood(), log, max_relative = 1e-15);
    assert!(close(&innovation.covariance, &Covariance::from_lower(Mat([[4.0, 0.0], [4.0, 5.0]])), 1e-15));
}

/// A filter as bits.
fn bits<const N: usize>(filter: &impl Filter<f64, N>, factor: Option<&Mat<f64, N, N>>) -> Vec<u64> {
    let covariance = filter.covariance().to_full();
    let mut all: Vec<f64> = filter.mean().to_vec();
    for m in [Some(&covariance), factor].into_iter().flatten() {
        all.extend(m.0.iter().flatten());
    }
    all.into_iter().map(f64::to_bits).collect()
}

/// Everything that can be refused; what the filter holds must not change by a bit.
fn refuses<F: Filter<f64, 3>>(filter: &mut F, factor: impl Fn(&F) -> Option<Mat<f64, 3, 3>>) {
    let held = |filter: &F| bits(filter, factor(filter).as_ref());
    let before = held(filter);
    let r = Covariance::from_lower(Mat([[2.0, 0.0], [0.5, 1.0]]));
    for y in [[f64::NAN, 1.0], [1.0, f64::INFINITY], [f64::NEG_INFINITY, f64::NAN]] {
        assert_eq!(filter.update(&Curve, &y, &r).unwrap_err(), FilterError::NonFiniteMeasurement);
        assert_eq!(held(filter), before);
    }
    for (i, j, variance) in
        [(0, 0, -99.0), (1, 1, -99.0), (0, 0, f64::NAN), (1, 0, f64::NAN), (1, 1, f64::INFINITY)]
    {
        let mut wrong = r.to_full();
        wrong.0[i][j] = variance;
        let refused = filter.update(&Curve, &[1.0, 1.0], &Covariance::from_lower(wrong)).unwrap_err();
        assert_eq!(refused, FilterError::InnovationNotPositive);
        assert_eq!(held(filter), before);
    }
    let explode = |entry| LinearProcess::<f64, 3, 1> {
        transition: Mat([[entry, 1.0, 0.0], [0.0, 1.0, 0.0], [0.0, 1.0, entry]]),
        input: Mat([[1.0], [0.0], [0.0]]),
        noise: ProcessNoise::none(),
    };
    for (process, u) in [(explode(f64::MAX), 0.0), (explode(1.0), f64::NAN), (explode(f64::NAN), 0.0)] {
        assert_eq!(filter.predict(&process, &[u]).unwrap_err(), FilterError::NonFiniteState);
        assert_eq!(held(filter), before);
    }
    // Declined by a policy: nothing changes either, and the innovation is there.
    let innovation = filter.update_where(&Curve, &[50.0, 1.0], &r, &Gate { nis: 9.0 }).unwrap();
    assert!(!innovation.taken && innovation.nis > 9.0);
    assert_eq!(held(filter), before);
    assert!(filter.update_where(&Curve, &[0.5, 3.0], &r, &Gate { nis: 9.0 }).unwrap().taken);
    assert_ne!(held(filter), before);
}

#[test]
fn what_cannot_be_used_is_refused_and_leaves_the_state() {
    let root = Mat([[1.0, 0.0, 0.0], [0.3, 0.7, 0.0], [-0.2, 0.1, 0.4]]);
    let covariance = Covariance::from_lower(root.times_transposed(&root));
    refuses(&mut SquareRootEkf::from_factor(MEAN, &root), |f| Some(*f.factor()));
    let points = SigmaPoints::standard();
    refuses(&mut SquareRootUkf::from_factor(MEAN, &root, points), |f| Some(*f.factor()));
    refuses(&mut IteratedEkf::<_, 3, 5>::new(MEAN, covariance, 1e-6), |_| None);
    refuses(&mut SchmidtEkf::new(MEAN, covariance, [false, false, true]), |_| None);

    // R needs a root by itself: P + R = 3 would be positive.
    let level = LinearMeasurement { matrix: Mat([[1.0]]) };
    let minus = Covariance::from_variances([-1.0]);
    let start = Covariance::from_variances([4.0]);
    let mut filter = SquareRootEkf::new([0.0], start);
    assert_eq!(filter.update(&level, &[0.0], &minus).unwrap_err(), FilterError::InnovationNotPositive);
    let mut filter = SquareRootUkf::new([0.0], start, points);
    assert_eq!(filter.update(&level, &[0.0], &minus).unwrap_err(), FilterError::InnovationNotPositive);
    // Nor has a component without noise one that it shares.
    let both = LinearMeasurement { matrix: Mat([[1.0], [2.0]]) };
    let indefinite = Covariance::from_lower(Mat([[0.0, 0.0], [1.0, 5.0]]));
    let mut filter = SquareRootEkf::new([0.0], start);
    assert_eq!(filter.update(&both, &[0.0; 2], &indefinite).unwrap_err(), FilterError::InnovationNotPositive);
}

/// x′ = x² or y = x².
struct Square(ProcessNoise<f64, 1>);
impl Process<f64, 1> for Square {
    type Input = ();
    fn step<S: Over<f64>>(&self, x: &[S; 1], (): &()) -> [S; 1] {
        [x[0].sq()]
    }
    fn noise(&self) -> &ProcessNoise<f64, 1> {
        &self.0
    }
}
impl<T: Scalar> Measurement<T, 1, 1> for Square {
    fn predict<S: Over<T>>(&self, x: &[S; 1]) -> [S; 1] {
        [x[0].sq()]
    }
}

/// β below −α²·κ/n makes the covariance of a bend negative: x² of a unit variance gets 4·x̄² + (κ + β + 1 − α²)
/// with n = 1, α = 1, which is −2 at rest for κ = 1, β = −3.
#[test]
fn a_covariance_that_points_make_negative_is_refused() {
    let points = SigmaPoints { alpha: 1.0, beta: -3.0, kappa: 1.0 };
    let q = |variance| Square(Covariance::from_variances([variance]).into());
    let start = Covariance::from_variances([1.0]);
    let mut filter = SquareRootUkf::new([0.0], start, points);
    assert_eq!(filter.predict(&q(1.5), &()).unwrap_err(), FilterError::CovarianceNotPositive);
    let r = Covariance::from_variances([1.5]);
    assert_eq!(filter.update(&q(0.0), &[0.0], &r).unwrap_err(), FilterError::CovarianceNotPositive);
    assert_eq!((filter.mean(), filter.factor()), (&[0.0], &Mat([[1.0]])));

    // With more noise it can be taken away, as the filter with a covariance does.
    for mean in [0.0, 0.5] {
        let mut plain = Ukf::new([mean], start, points);
        let mut filter = SquareRootUkf::new([mean], start, points);
        let r = Covariance::from_variances([2.5]);
        let (a, b) =
            (plain.update(&q(0.0), &[2.0], &r).unwrap(), filter.update(&q(0.0), &[2.0], &r).unwrap());
        approx::assert_relative_eq!(a.nis, b.nis, max_relative = 1e-13);
        approx::assert_relative_eq!(plain.mean()[0], filter.mean()[0], max_relative = 1e-13);
        assert!(close(&plain.covariance(), &filter.covariance(), 1e-13));
    }
    let mut plain = Ukf::new([0.5], start, points);
    let mut filter = SquareRootUkf::new([0.5], start, points);
    let a = plain.predict_linked(&q(2.5), &()).unwrap();
    let b = filter.predict_linked(&q(2.5), &()).unwrap();
    // 4·0.25 − 2 + 2.5
    approx::assert_relative_eq!(filter.covariance().get(0, 0), 1.5, max_relative = 1e-13);
    assert!(close(&plain.covariance(), &filter.covariance(), 1e-13));
    assert!(close(&a.noise, &b.noise, 1e-13) && (a.transition[(0, 0)] - b.transition[(0, 0)]).abs() < 1e-13);
}

/// A start that is vague by 10¹⁴ against the measurement, in `f32`. The answer is the information filter's in f64,
/// which starts from nothing: Y⁺ = Φ⁻ᵀ·Y·Φ⁻¹ + hᵀ·h/r, P = Y⁻¹.
#[test]
fn a_vague_start_in_f32() {
    let transition = Matrix3::new(1.0, 0.1, 0.005, 0.0, 1.0, 0.1, 0.0, 0.0, 1.0);
    let inverse = transition.try_inverse().unwrap();
    let h = nalgebra::RowVector3::new(1.0, 0.3, -0.2);
    let process = LinearProcess::<f32, 3, 0> {
        transition: Mat::from_fn(|i, j| [[1.0, 0.1, 0.005], [0.0, 1.0, 0.1], [0.0, 0.0, 1.0]][i][j]),
        input: Mat::zero(),
        noise: ProcessNoise::none(),
    };
    let sensor = LinearMeasurement { matrix: Mat([[1.0, 0.3, -0.2]]) };
    let (start, r) = (Covariance::from_variances([1e14_f32; 3]), Covariance::from_variances([1.0]));
    let mut joseph = Ekf::new([0.0; 3], start);
    let mut root = SquareRootEkf::new([0.0; 3], start);
    let mut points = SquareRootUkf::new([0.0; 3], start, SigmaPoints::standard());
    let mut information = Matrix3::identity() * 1e-14;
    let (mut lost, mut error, mut of_points) = (false, 0.0_f64, 0.0_f64);
    for step in 0..300 {
        // Joseph's form may refuse or not; what it holds is judged.
        let _ = joseph.predict(&process, &[]);
        let _ = joseph.update(&sensor, &[0.0], &r);
        root.predict(&process, &[]).unwrap();
        root.update(&sensor, &[0.0], &r).unwrap();
        points.predict(&process, &[]).unwrap();
        points.update(&sensor, &[0.0], &r).unwrap();
        information = inverse.transpose() * information * inverse + h.transpose() * h;
        assert!((0..3).all(|i| root.factor()[(i, i)] > 0.0 && points.factor()[(i, i)] > 0.0));
        let wide: Covariance<f64, 3> =
            Covariance::from_lower(Mat::from_fn(|i, j| f64::from(joseph.covariance().get(i, j))));
        lost |= smallest(&wide) < -1e-6;
        // Five samples for three unknowns, or the answer itself has no digits.
        if step >= 5 {
            let p = information.try_inverse().unwrap();
            for i in 0..3 {
                let sd = |p: Covariance<f32, 3>| f64::from(p.standard_deviation(i));
                error = error.max((sd(root.covariance()) / p[(i, i)].sqrt() - 1.0).abs());
                of_points = of_points.max((sd(points.covariance()) / p[(i, i)].sqrt() - 1.0).abs());
            }
        }
    }
    assert!(lost, "Joseph's form kept its definiteness");
    assert!(error < 1e-4, "{error}");
    assert!(of_points < 1e-3, "{of_points}");
}

//! The smoothers against batch solutions, closed forms, a dense smoother of another form, and simulated
//! truth.

use kalmems_core::smooth::{Backward, FixedLag, Smoothed, SmoothingCourse, SmoothingError, smooth_interval};
use kalmems_core::update::Gate;
use kalmems_core::{
    Covariance, Dynamics, Ekf, Filter, FilterError, Gaussian, Information, InformationError,
    LinearMeasurement, LinearProcess, Mat, Measurement, Nodes, NoiseDensity, Over, Process, ProcessNoise,
    Rk4, Scalar, SigmaPoints, StateTransition, Ukf,
};
use nalgebra::{DMatrix, DVector, SMatrix, SVector};
use proptest::prelude::*;

type Mat3 = Mat<f64, 3, 3>;

/// A recording in memory of a linear system of three states, seen by two numbers.
#[derive(Clone, Debug)]
struct Linear {
    process: LinearProcess<f64, 3, 1>,
    measurement: LinearMeasurement<f64, 3, 2>,
    r: Covariance<f64, 2>,
    /// Declines a correction beyond this NIS.
    gate: f64,
    start: Gaussian<f64, 3>,
    ys: Vec<Option<[f64; 2]>>,
}

impl Linear {
    fn input(sample: usize) -> [f64; 1] {
        [(sample as f64).sin()]
    }
    fn ekf(&self) -> Ekf<f64, 3> {
        Ekf::new(self.start.mean, self.start.covariance)
    }
}

impl<F: Filter<f64, 3>> SmoothingCourse<f64, F, 3> for Linear {
    type Error = FilterError;
    fn samples(&self) -> usize {
        self.ys.len()
    }
    fn advance(&mut self, filter: &mut F, sample: usize) -> Result<StateTransition<f64, 3>, FilterError> {
        filter.predict_linked(&self.process, &Self::input(sample))
    }
    fn correct(&mut self, filter: &mut F, sample: usize) -> Result<(), FilterError> {
        let Some(y) = self.ys[sample] else { return Ok(()) };
        filter.update_where(&self.measurement, &y, &self.r, &Gate { nis: self.gate }).map(|_| ())
    }
}

fn gaussian<F: Filter<f64, N>, const N: usize>(filter: &F) -> Gaussian<f64, N> {
    Gaussian { mean: *filter.mean(), covariance: filter.covariance() }
}

/// What the filter alone says at each sample.
fn filtered<F: Filter<f64, N> + Clone, C: SmoothingCourse<f64, F, N>, const N: usize>(
    start: &F,
    course: &mut C,
) -> Vec<Gaussian<f64, N>>
where
    C::Error: std::fmt::Debug,
{
    let mut filter = start.clone();
    let mut all = Vec::new();
    for sample in 0..course.samples() {
        if sample > 0 {
            course.advance(&mut filter, sample).unwrap();
        }
        course.correct(&mut filter, sample).unwrap();
        all.push(gaussian(&filter));
    }
    all
}

/// The fixed-interval smoother in blocks of a length.
fn smoothed<F: Filter<f64, N> + Clone, C: SmoothingCourse<f64, F, N>, const N: usize>(
    start: &F,
    course: &mut C,
    length: usize,
) -> Result<Vec<Smoothed<f64, N>>, SmoothingError<C::Error>> {
    let mut checkpoints = vec![start.clone(); course.samples().div_ceil(length)];
    let mut all = Vec::new();
    let mut expected = course.samples();
    smooth_interval(
        start,
        course,
        &mut checkpoints,
        &mut vec![Backward::identity(); length],
        |sample, s| {
            expected -= 1;
            assert_eq!(sample, expected, "the last first, each once");
            all.push(*s);
            Ok(())
        },
    )?;
    assert_eq!(expected, 0);
    all.reverse();
    Ok(all)
}

fn dense<const R: usize, const C: usize>(m: &Mat<f64, R, C>) -> SMatrix<f64, R, C> {
    SMatrix::from_fn(|i, j| m[(i, j)])
}

fn full<const N: usize>(p: &Covariance<f64, N>) -> SMatrix<f64, N, N> {
    dense(&p.to_full())
}

/// A rotation of three dimensions.
fn rotation(angles: [f64; 3]) -> SMatrix<f64, 3, 3> {
    *nalgebra::Rotation3::from_euler_angles(angles[0], angles[1], angles[2]).matrix()
}

/// Transitions with singular values between 0.4 and 1.1: nothing explodes in 15 steps, and the way back
/// exists.
fn transition() -> impl Strategy<Value = Mat3> {
    (
        prop::array::uniform3(-3.0..3.0_f64),
        prop::array::uniform3(0.4..1.1_f64),
        prop::array::uniform3(-3.0..3.0_f64),
    )
        .prop_map(|(a, s, b)| {
            let f = rotation(a) * SMatrix::from_diagonal(&SVector::from(s)) * rotation(b);
            Mat::from_fn(|i, j| f[(i, j)])
        })
}

/// Recordings of `samples` samples, one in five missing, with process noise from `noise` sources.
fn recordings(samples: usize, noise: usize) -> impl Strategy<Value = Linear> {
    (
        transition(),
        prop::array::uniform9(-1.0..1.0_f64),
        prop::array::uniform6(-1.0..1.0_f64),
        prop::array::uniform2(0.01..2.0_f64),
        prop::collection::vec((0..5, prop::array::uniform2(-3.0..3.0_f64)), samples),
    )
        .prop_map(move |(f, g, h, r, ys)| {
            let root: Mat3 = Mat::from_fn(|i, j| if j < noise { g[3 * i + j] } else { 0.0 });
            Linear {
                process: LinearProcess {
                    transition: f,
                    input: Mat([[1.0], [0.0], [-0.5]]),
                    noise: Covariance::from_lower(root.times_transposed(&root)).into(),
                },
                measurement: LinearMeasurement { matrix: Mat::from_fn(|i, j| h[3 * i + j]) },
                r: Covariance::from_variances(r),
                gate: f64::INFINITY,
                start: Gaussian {
                    mean: [1.0, -2.0, 0.5],
                    covariance: Covariance::from_standard_deviations([1.0, 0.3, 2.0]),
                },
                ys: ys.into_iter().map(|(missing, y)| (missing > 0).then_some(y)).collect(),
            }
        })
}

/// All states at once, by least squares: the rows of start, steps and measurements, each whitened, and a QR.
///
/// Needs a process noise that can be whitened. Without a start, what the measurements alone say.
fn least_squares(course: &Linear, with_start: bool) -> Option<(DVector<f64>, DMatrix<f64>)> {
    let n = course.ys.len();
    let mut rows: Vec<(DVector<f64>, f64)> = Vec::new();
    let mut add = |root: DMatrix<f64>, blocks: &[(usize, DMatrix<f64>)], right: DVector<f64>| {
        let white = |m: &DMatrix<f64>| root.solve_lower_triangular(m).unwrap();
        let right = white(&DMatrix::from_column_slice(right.len(), 1, right.as_slice()));
        for i in 0..right.nrows() {
            let mut row = DVector::zeros(3 * n);
            for (state, block) in blocks {
                row.rows_mut(3 * state, 3).copy_from(&white(block).row(i).transpose());
            }
            rows.push((row, right[(i, 0)]));
        }
    };
    let dynamic = |m: SMatrix<f64, 3, 3>| DMatrix::from_iterator(3, 3, m.iter().copied());
    let identity = DMatrix::<f64>::identity(3, 3);
    if with_start {
        let root = full(&course.start.covariance).cholesky()?.l();
        add(dynamic(root), &[(0, identity.clone())], DVector::from_row_slice(&course.start.mean));
    }
    let root = dynamic(full(course.process.noise.covariance()).cholesky()?.l());
    for k in 1..n {
        let moved = dense(&course.process.input) * Linear::input(k)[0];
        let f = dynamic(dense(&course.process.transition));
        add(root.clone(), &[(k, identity.clone()), (k - 1, -f)], DVector::from_row_slice(moved.as_slice()));
    }
    for (k, y) in course.ys.iter().enumerate() {
        if let Some(y) = y {
            let root = DMatrix::from_fn(2, 2, |i, j| if i == j { course.r.get(i, i).sqrt() } else { 0.0 });
            let h = DMatrix::from_fn(2, 3, |i, j| course.measurement.matrix[(i, j)]);
            add(root, &[(k, h)], DVector::from_row_slice(y));
        }
    }
    let a = DMatrix::from_rows(&rows.iter().map(|(row, _)| row.transpose()).collect::<Vec<_>>());
    let b = DVector::from_iterator(rows.len(), rows.iter().map(|(_, right)| *right));
    if a.nrows() < a.ncols() {
        return None;
    }
    let qr = a.qr();
    let inverse = qr.r().solve_upper_triangular(&DMatrix::identity(3 * n, 3 * n))?;
    Some((&inverse * (qr.q().transpose() * b), &inverse * inverse.transpose()))
}

/// All states at once, as one Gaussian over all of them conditioned on all measurements; nothing is inverted
/// but the innovation covariance, so that everything else may be singular.
fn conditioned(course: &Linear) -> (DVector<f64>, DMatrix<f64>) {
    let n = course.ys.len();
    let (f, q) = (dense(&course.process.transition), full(course.process.noise.covariance()));
    let mut mean = DVector::zeros(3 * n);
    let mut joint = DMatrix::zeros(3 * n, 3 * n);
    let (mut m, mut p) = (SVector::from(course.start.mean), full(&course.start.covariance));
    for k in 0..n {
        if k > 0 {
            m = f * m + dense(&course.process.input) * Linear::input(k)[0];
            p = f * p * f.transpose() + q;
        }
        mean.rows_mut(3 * k, 3).copy_from(&m);
        let mut cross = p;
        for later in k..n {
            joint.view_mut((3 * later, 3 * k), (3, 3)).copy_from(&cross);
            joint.view_mut((3 * k, 3 * later), (3, 3)).copy_from(&cross.transpose());
            cross = f * cross;
        }
    }
    let seen: Vec<(usize, [f64; 2])> =
        course.ys.iter().enumerate().filter_map(|(k, y)| y.map(|y| (k, y))).collect();
    if seen.is_empty() {
        return (mean, joint);
    }
    let mut h = DMatrix::zeros(2 * seen.len(), 3 * n);
    let mut r = DMatrix::zeros(2 * seen.len(), 2 * seen.len());
    let mut y = DVector::zeros(2 * seen.len());
    for (row, (k, value)) in seen.iter().enumerate() {
        h.view_mut((2 * row, 3 * k), (2, 3)).copy_from(&dense(&course.measurement.matrix));
        r.view_mut((2 * row, 2 * row), (2, 2)).copy_from(&full(&course.r));
        y.rows_mut(2 * row, 2).copy_from_slice(value);
    }
    let hj = &h * &joint;
    let s = (&hj * h.transpose() + r).cholesky().unwrap();
    (&mean + hj.transpose() * s.solve(&(y - &h * &mean)), &joint - hj.transpose() * s.solve(&hj))
}

/// The largest difference from a batch solution, beside the size of what is compared.
fn difference(smoothed: &[Smoothed<f64, 3>], batch: &(DVector<f64>, DMatrix<f64>)) -> f64 {
    let mut worst = 0.0_f64;
    for (k, s) in smoothed.iter().enumerate() {
        let mean = batch.0.fixed_rows::<3>(3 * k);
        let covariance = batch.1.fixed_view::<3, 3>(3 * k, 3 * k);
        let apart = (SVector::from(s.mean) - mean).amax() / mean.amax().max(1.0);
        let apart_covariance = (full(&s.covariance()) - covariance).amax() / covariance.amax().max(1.0);
        worst = worst.max(apart).max(apart_covariance);
    }
    worst
}

/// The smallest eigenvalue of filtered minus smoothed covariance, beside the size of the filtered one.
fn least_gain<const N: usize>(filtered: &Gaussian<f64, N>, smoothed: &Smoothed<f64, N>) -> f64 {
    let before = full(&filtered.covariance);
    let gain = before - full(&smoothed.covariance());
    DMatrix::from_iterator(N, N, gain.iter().copied()).symmetric_eigenvalues().min() / before.amax()
}

proptest! {
    #![proptest_config(ProptestConfig { max_global_rejects: 100_000, ..ProptestConfig::with_cases(1000) })]

    #[test]
    fn the_smoother_is_the_least_squares_solution(mut course in recordings(15, 3)) {
        // The batch solution needs a process noise that can be whitened.
        let q = full(course.process.noise.covariance()) + SMatrix::identity() * 0.01;
        course.process.noise = Covariance::from_lower(Mat::from_fn(|i, j| q[(i, j)])).into();
        let batch = least_squares(&course, true).unwrap();
        let (ekf, mut other) = (course.ekf(), course.clone());
        let ukf = Ukf::new(course.start.mean, course.start.covariance, SigmaPoints::standard());
        let by_ekf = smoothed(&ekf, &mut course, 15).unwrap();
        prop_assert!(difference(&by_ekf, &batch) < 1e-9, "{}", difference(&by_ekf, &batch));
        let by_ukf = smoothed(&ukf, &mut other, 15).unwrap();
        prop_assert!(difference(&by_ukf, &batch) < 1e-9, "{}", difference(&by_ukf, &batch));
        for (f, s) in filtered(&ekf, &mut course).iter().zip(&by_ekf) {
            prop_assert!(least_gain(f, s) > -1e-12, "{}", least_gain(f, s));
        }
    }

    #[test]
    fn singular_covariances_and_transitions_are_smoothed(
        mut course in recordings(15, 1),
        exact in 0..3_usize,
        forgets in any::<bool>(),
    ) {
        // One source of noise, one state exactly known at the start, and a transition that may forget a
        // direction.
        let mut deviations = [1.0, 0.3, 2.0];
        deviations[exact] = 0.0;
        course.start.covariance = Covariance::from_standard_deviations(deviations);
        if forgets {
            course.process.transition.0[exact] = [0.0; 3];
        }
        // A variance is either a good part of the largest, or zero to rounding.
        prop_assume!(filtered(&course.ekf(), &mut course).iter().all(|f| {
            let variances = full(&f.covariance).symmetric_eigenvalues();
            let largest = variances.max();
            variances.iter().all(|v| v.abs() < 1e-13 * largest || *v > 1e-5 * largest)
        }));
        let by_ekf = smoothed(&course.ekf(), &mut course, 15).unwrap();
        let worst = difference(&by_ekf, &conditioned(&course));
        prop_assert!(worst < 1e-9, "{worst}");
    }

    #[test]
    fn a_start_from_nothing_is_least_squares_without_a_start(mut course in recordings(8, 3)) {
        let q = full(course.process.noise.covariance()) + SMatrix::identity() * 0.01;
        course.process.noise = Covariance::from_lower(Mat::from_fn(|i, j| q[(i, j)])).into();
        // The first four samples must say enough of the states: none of them beyond a standard deviation of
        // 100.
        let mut beginning = course.clone();
        beginning.ys.truncate(4);
        let known = least_squares(&beginning, false);
        prop_assume!(known.is_some_and(|(_, p)| p.diagonal().max() < 1e4));

        let mut information = Information::nothing();
        let mut back = Vec::new();
        let mut first = 0;
        let known = loop {
            if let Some(y) = course.ys[first] {
                information.update(&course.measurement, &y, &course.r).unwrap();
            }
            match information.gaussian() {
                Ok(known) => break known,
                Err(InformationError::Undetermined { rank, states }) => prop_assert!(rank < states && states == 3),
                Err(error) => panic!("{error}"),
            }
            first += 1;
            back.push(information.predict(&course.process, &Linear::input(first)).unwrap());
        };
        // The rest from the filter, the states before from the steps back.
        let batch = least_squares(&course, false).unwrap();
        let mut rest = From { course: course.clone(), first };
        let start = Ekf::new(known.mean, known.covariance);
        let mut all = smoothed(&start, &mut rest, 8 - first).unwrap();
        for step in back.iter().rev() {
            let earlier = step.apply(&all[0]);
            all.insert(0, earlier);
        }
        let worst = difference(&all, &batch);
        prop_assert!(worst < 1e-7, "{worst} {first}");
    }

    #[test]
    fn a_lagged_state_is_smoothed_over_exactly_the_data_until_now(
        mut course in recordings(14, 3),
        gate in 0.5..20.0_f64,
    ) {
        // Some samples are missing, and of the rest the gate declines some.
        course.gate = gate;
        let mut lagged = FixedLag::<f64, _, 3, 4>::new(course.ekf());
        let mut shortest = FixedLag::<f64, _, 3, 1>::new(course.ekf());
        let mut none = FixedLag::<f64, _, 3, 0>::new(course.ekf());
        for k in 0..14 {
            if k > 0 {
                course.clone().advance(&mut lagged, k).unwrap();
                course.clone().advance(&mut shortest, k).unwrap();
                course.clone().advance(&mut none, k).unwrap();
            }
            course.clone().correct(&mut lagged, k).unwrap();
            course.clone().correct(&mut shortest, k).unwrap();
            course.clone().correct(&mut none, k).unwrap();
            let mut until_now = course.clone();
            until_now.ys.truncate(k + 1);
            let interval = smoothed(&course.ekf(), &mut until_now, k + 1).unwrap();
            let close = |a: &Smoothed<f64, 3>, b: &Smoothed<f64, 3>| {
                let mean = (SVector::from(a.mean) - SVector::from(b.mean)).amax();
                let (p, q) = (full(&a.covariance()), full(&b.covariance()));
                mean <= 1e-10 * SVector::from(b.mean).amax().max(1.0) && (p - q).amax() <= 1e-10 * q.amax().max(1.0)
            };
            for lag in 0..=4 {
                match lagged.lagged(lag) {
                    Some(state) => prop_assert!(close(&state, &interval[k - lag]), "{k} {lag}"),
                    None => prop_assert!(lag > k),
                }
            }
            prop_assert_eq!(lagged.smoothed(), lagged.lagged(4));
            prop_assert!(lagged.lagged(5).is_none() && none.lagged(1).is_none());
            if k > 0 {
                prop_assert!(close(&shortest.smoothed().unwrap(), &interval[k - 1]));
            }
            // Without a lag it is the filter.
            let now = none.smoothed().unwrap();
            prop_assert_eq!(&now.mean, none.filter().mean());
            prop_assert!((full(&now.covariance()) - full(&none.covariance())).amax() < 1e-14 * 30.0);
        }
    }
}

/// A course from a sample on that is corrected already.
struct From {
    course: Linear,
    first: usize,
}

impl<F: Filter<f64, 3>> SmoothingCourse<f64, F, 3> for From {
    type Error = FilterError;
    fn samples(&self) -> usize {
        self.course.ys.len() - self.first
    }
    fn advance(&mut self, filter: &mut F, sample: usize) -> Result<StateTransition<f64, 3>, FilterError> {
        self.course.advance(filter, self.first + sample)
    }
    fn correct(&mut self, filter: &mut F, sample: usize) -> Result<(), FilterError> {
        if sample == 0 { Ok(()) } else { self.course.correct(filter, self.first + sample) }
    }
}

/// A straight line: without process noise the smoother is linear regression, whose variances have a closed
/// form.
#[test]
fn constant_velocity_is_linear_regression() {
    let (h, r) = (0.25, 0.04);
    let ys = [1.0, 1.3, 0.9, 2.2, 2.0, 2.9, 2.7, 3.8, 3.5, 4.6];
    let position = LinearMeasurement { matrix: Mat([[1.0, 0.0]]) };
    let noise = Covariance::from_variances([r]);
    let step = LinearProcess::<f64, 2, 0> {
        transition: Mat([[1.0, h], [0.0, 1.0]]),
        input: Mat::zero(),
        noise: ProcessNoise::none(),
    };
    // Nothing is known at the start; two samples make a line.
    let mut start = Information::nothing();
    start.update(&position, &[ys[0]], &noise).unwrap();
    assert_eq!(start.gaussian(), Err(InformationError::Undetermined { rank: 1, states: 2 }));
    let to_first = start.predict(&step, &[]).unwrap();
    assert_eq!(start.rank(), 1);
    start.update(&position, &[ys[1]], &noise).unwrap();
    let known = start.gaussian().unwrap();
    let mut filter = FixedLag::<f64, _, 2, 16>::new(Ekf::new(known.mean, known.covariance));
    for y in &ys[2..] {
        filter.predict(&step, &[]).unwrap();
        filter.update(&position, &[*y], &noise).unwrap();
    }
    let mut all: Vec<_> = (0..ys.len() - 1).map(|lag| filter.lagged(lag).unwrap()).collect();
    all.push(to_first.apply(all.last().unwrap()));
    all.reverse();

    let n = ys.len() as f64;
    let middle = h * (n - 1.0) / 2.0;
    let spread: f64 = (0..ys.len()).map(|k| (h * k as f64 - middle).powi(2)).sum();
    let mean = ys.iter().sum::<f64>() / n;
    let slope = ys.iter().enumerate().map(|(k, y)| (h * k as f64 - middle) * y).sum::<f64>() / spread;
    for (k, state) in all.iter().enumerate() {
        let t = h * k as f64 - middle;
        approx::assert_relative_eq!(state.mean[0], mean + slope * t, max_relative = 1e-12);
        approx::assert_relative_eq!(state.mean[1], slope, max_relative = 1e-12);
        let p = state.covariance();
        approx::assert_relative_eq!(p.get(0, 0), r * (1.0 / n + t * t / spread), max_relative = 1e-12);
        approx::assert_relative_eq!(p.get(1, 0), r * t / spread, max_relative = 1e-11, epsilon = 1e-15);
        approx::assert_relative_eq!(p.get(1, 1), r / spread, max_relative = 1e-12);
    }
}

/// A pendulum in rad and rad/s.
struct Pendulum;
impl<T: Scalar> Dynamics<T, 2> for Pendulum {
    type Input = ();
    fn derivative<S: Over<T>>(&self, x: &[S; 2], (): &()) -> [S; 2] {
        [x[1], x[0].sin() * T::of(-9.81)]
    }
}

/// Seen from the side.
struct Side;
impl<T: Scalar> Measurement<T, 2, 1> for Side {
    fn predict<S: Over<T>>(&self, x: &[S; 2]) -> [S; 1] {
        [x[0].sin()]
    }
}

const SIDE_VARIANCE: f64 = 0.1;

struct Swing {
    process: Rk4<Pendulum, f64, 2>,
    ys: Vec<f64>,
}

impl Swing {
    fn new(ys: Vec<f64>) -> Self {
        let noise = NoiseDensity::none().on::<1>(0.1);
        Self { process: Rk4::new(Pendulum, 0.05, &noise, (&[0.0, 0.0], &())), ys }
    }
    /// A simulated one with its truth.
    fn simulated(samples: usize, seed: u64) -> (Self, Vec<SVector<f64, 2>>) {
        let mut normal = Normal(seed);
        let mut swing = Self::new(Vec::new());
        let root = dense(swing.process.noise().root());
        let deviations = START_DEVIATIONS.map(|d| d * normal.next());
        let mut x = SVector::from(START) + SVector::from(deviations);
        let mut truth = Vec::new();
        for k in 0..samples {
            if k > 0 {
                let moved = swing.process.step(&[x[0], x[1]], &Nodes::held(()));
                x = SVector::from(moved) + root * SVector::from([normal.next(), normal.next()]);
            }
            swing.ys.push(x[0].sin() + SIDE_VARIANCE.sqrt() * normal.next());
            truth.push(x);
        }
        (swing, truth)
    }
    fn ukf() -> Ukf<f64, 2> {
        Ukf::new(START, Covariance::from_standard_deviations(START_DEVIATIONS), SigmaPoints::standard())
    }
}

const START: [f64; 2] = [1.2, 0.0];
const START_DEVIATIONS: [f64; 2] = [0.2, 0.3];

impl<F: Filter<f64, 2>> SmoothingCourse<f64, F, 2> for Swing {
    type Error = FilterError;
    fn samples(&self) -> usize {
        self.ys.len()
    }
    fn advance(&mut self, filter: &mut F, _: usize) -> Result<StateTransition<f64, 2>, FilterError> {
        filter.predict_linked(&self.process, &Nodes::held(()))
    }
    fn correct(&mut self, filter: &mut F, sample: usize) -> Result<(), FilterError> {
        let r = Covariance::from_variances([SIDE_VARIANCE]);
        filter.update(&Side, &[self.ys[sample]], &r).map(|_| ())
    }
}

/// Normal numbers: a counter through the finaliser of SplitMix64 (Steele, Lea and Flood, OOPSLA 2014), and
/// Box–Muller.
struct Normal(u64);
impl Normal {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
    fn next(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform()).cos()
    }
}

/// The unscented filter and smoother as Särkkä prints them, with dense matrices, seven-point tables of
/// weights and covariances as differences.
fn dense_unscented_smoother(swing: &Swing) -> Vec<(SVector<f64, 2>, SMatrix<f64, 2, 2>)> {
    let (n, kappa, beta) = (2.0, 1.0, 2.0);
    let (w, centre_mean) = (0.5 / (n + kappa), kappa / (n + kappa));
    let mean_weights = [centre_mean, w, w, w, w];
    let covariance_weights = [centre_mean + beta, w, w, w, w]; // α = 1
    let points = |m: SVector<f64, 2>, p: SMatrix<f64, 2, 2>| {
        let root = (p * (n + kappa)).cholesky().unwrap().l();
        [m, m + root.column(0), m + root.column(1), m - root.column(0), m - root.column(1)]
    };
    let q = full(swing.process.noise().covariance());
    let (mut m, mut p) =
        (SVector::from(START), SMatrix::from_diagonal(&SVector::from(START_DEVIATIONS.map(|d| d * d))));
    let mut steps = Vec::new();
    for (k, y) in swing.ys.iter().enumerate() {
        if k > 0 {
            let from = points(m, p);
            let to = from.map(|x| SVector::from(swing.process.step(&[x[0], x[1]], &Nodes::held(()))));
            let predicted: SVector<f64, 2> = (0..5).map(|i| to[i] * mean_weights[i]).sum();
            let mut covariance = q;
            let mut cross = SMatrix::<f64, 2, 2>::zeros();
            for i in 0..5 {
                covariance += (to[i] - predicted) * (to[i] - predicted).transpose() * covariance_weights[i];
                cross += (from[i] - m) * (to[i] - predicted).transpose() * covariance_weights[i];
            }
            steps.push((m, p, predicted, covariance, cross));
            (m, p) = (predicted, covariance);
        }
        let xs = points(m, p);
        let ys = xs.map(|x| x[0].sin());
        let predicted: f64 = (0..5).map(|i| ys[i] * mean_weights[i]).sum();
        let s: f64 =
            (0..5).map(|i| (ys[i] - predicted).powi(2) * covariance_weights[i]).sum::<f64>() + SIDE_VARIANCE;
        let cross: SVector<f64, 2> =
            (0..5).map(|i| (xs[i] - m) * (ys[i] - predicted) * covariance_weights[i]).sum();
        m += cross / s * (y - predicted);
        p -= cross * cross.transpose() / s;
    }
    let mut all = vec![(m, p)];
    for (before, covariance, predicted, predicted_covariance, cross) in steps.into_iter().rev() {
        let gain = cross * predicted_covariance.try_inverse().unwrap();
        let (later, later_covariance) = all[0];
        let smoothed = before + gain * (later - predicted);
        let smoothed_covariance =
            covariance + gain * (later_covariance - predicted_covariance) * gain.transpose();
        all.insert(0, (smoothed, smoothed_covariance));
    }
    all
}

#[test]
fn the_unscented_smoother_is_saerkkaes() {
    let (mut swing, _) = Swing::simulated(80, 7);
    let ours = smoothed(&Swing::ukf(), &mut swing, 80).unwrap();
    let filtered = filtered(&Swing::ukf(), &mut swing);
    for (k, (mean, covariance)) in dense_unscented_smoother(&swing).iter().enumerate() {
        assert!((SVector::from(ours[k].mean) - mean).amax() < 1e-11, "{k}");
        assert!((full(&ours[k].covariance()) - covariance).amax() < 1e-12, "{k}");
        assert!(least_gain(&filtered[k], &ours[k]) > -1e-12, "{k}");
    }
}

/// The symmetric interval that a binomial count lies in with this probability.
fn binomial_interval(trials: u32, probability: f64, inside: f64) -> (u32, u32) {
    let mut mass = (1.0 - probability).powi(i32::try_from(trials).unwrap());
    let (mut below, mut low, mut high) = (0.0, None, trials);
    for count in 0..=trials {
        below += mass;
        if low.is_none() && below > (1.0 - inside) / 2.0 {
            low = Some(count);
        }
        if below >= 1.0 - (1.0 - inside) / 2.0 {
            high = count;
            break;
        }
        mass *= f64::from(trials - count) / f64::from(count + 1) * probability / (1.0 - probability);
    }
    (low.unwrap_or(0), high)
}

/// 400 pendulums: the smoother is nearer to the truth than the filter, and says truly how near.
#[test]
fn on_simulated_pendulums_the_smoother_is_better_and_consistent() {
    const RUNS: u32 = 400;
    // χ² of two degrees of freedom exceeds −2·ln 0.05 in one of twenty.
    let quantile = -2.0 * 0.05_f64.ln();
    let checked = [0, 20, 40];
    let (mut filter_error, mut smoother_error) = ([0.0; 2], [0.0; 2]);
    let mut exceeded = [0; 3];
    for run in 0..RUNS {
        let (mut swing, truth) = Swing::simulated(60, 1000 + u64::from(run));
        let by_filter = filtered(&Swing::ukf(), &mut swing);
        let by_smoother = smoothed(&Swing::ukf(), &mut swing, 60).unwrap();
        for k in 0..59 {
            for i in 0..2 {
                filter_error[i] += (by_filter[k].mean[i] - truth[k][i]).powi(2);
                smoother_error[i] += (by_smoother[k].mean[i] - truth[k][i]).powi(2);
            }
        }
        for (count, k) in exceeded.iter_mut().zip(checked) {
            let error = SVector::from(by_smoother[k].mean) - truth[k];
            let nees = error.dot(&full(&by_smoother[k].covariance()).cholesky().unwrap().solve(&error));
            *count += u32::from(nees > quantile);
        }
    }
    let ratio = [0, 1].map(|i: usize| (smoother_error[i] / filter_error[i]).sqrt());
    println!("smoothed over filtered error: {ratio:?}; NEES exceedances of {RUNS}: {exceeded:?}");
    assert!(ratio.iter().all(|r| *r < 0.8), "{ratio:?}");
    let (low, high) = binomial_interval(RUNS, 0.05, 0.999);
    assert!(exceeded.iter().all(|count| (low..=high).contains(count)), "{exceeded:?} in {low}..={high}");
}

/// A mirror that follows its warmth, which a warmer frame holds: angle, rate and two temperatures, without noise. Nothing is known of it but
/// its start and how it is read.
struct Mirror {
    process: LinearProcess<f64, 4, 0>,
    measurement: LinearMeasurement<f64, 4, 1>,
    ys: Vec<f64>,
}

const MIRROR_R: f64 = 2.5e-7;

impl SmoothingCourse<f64, Ekf<f64, 4>, 4> for Mirror {
    type Error = FilterError;
    fn samples(&self) -> usize {
        self.ys.len()
    }
    fn advance(
        &mut self,
        filter: &mut Ekf<f64, 4>,
        _: usize,
    ) -> Result<StateTransition<f64, 4>, FilterError> {
        filter.predict_linked(&self.process, &[])
    }
    fn correct(&mut self, filter: &mut Ekf<f64, 4>, sample: usize) -> Result<(), FilterError> {
        let noise = Covariance::from_variances([MIRROR_R]);
        filter.update(&self.measurement, &[self.ys[sample]], &noise).map(|_| ())
    }
}

/// Where all that decays is known to the last digit and a variance is what larger ones leave of one another, rounding makes it negative by more than a
/// millionth of itself. The smoother goes on, and says what all samples say of the start by least squares, moved to each sample.
#[test]
fn what_has_decayed_is_smoothed_as_least_squares_have_it() {
    let (frame_s, actuator_s, w) = (3.0, 8e-3, 3015.0);
    let rates = SMatrix::<f64, 4, 4>::from_row_slice(&[
        0.0,
        1.0,
        0.0,
        0.0,
        -w * w,
        -w / 38.0,
        2e-3 * w * w,
        -4e-4 * w * w,
        0.0,
        0.0,
        -1.0 / actuator_s,
        1.0 / actuator_s,
        0.0,
        0.0,
        0.16,
        -1.0 / frame_s,
    ]);
    let moved = (rates * 1e-4).exp();
    let (sight, samples) = ([2.5, 0.0, 0.0, 3e-3], 6000);
    let (start, sds) = (SVector::from([0.1, 0.0, 50.0, 3.0]), SVector::from([1e-3, 1.0, 0.1, 0.1]));
    let mut normal = Normal(5);
    let truth = start + sds.map(|sd| sd * normal.next());
    // A row of all that is known of the start, in units of its standard deviations.
    let (mut rows, mut right) = (DMatrix::zeros(samples + 4, 4), DVector::zeros(samples + 4));
    rows.view_mut((0, 0), (4, 4)).fill_with_identity();
    let (mut power, mut ys, mut powers) = (SMatrix::<f64, 4, 4>::identity(), Vec::new(), Vec::new());
    let sees = SVector::from(sight).transpose();
    for sample in 0..samples {
        let row = sees * power;
        let y = (row * truth)[0] + MIRROR_R.sqrt() * normal.next();
        let scaled = row.component_mul(&sds.transpose()) / MIRROR_R.sqrt();
        rows.row_mut(sample + 4).copy_from(&scaled);
        right[sample + 4] = (y - (row * start)[0]) / MIRROR_R.sqrt();
        ys.push(y);
        powers.push(power);
        power = moved * power;
    }
    let qr = rows.qr();
    let inverse = qr.r().solve_upper_triangular(&DMatrix::identity(4, 4)).unwrap();
    let scale = DMatrix::from_diagonal(&DVector::from_column_slice(sds.as_slice()));
    let root = &scale * &inverse;
    let found = DVector::from_column_slice(start.as_slice()) + &root * (qr.q().transpose() * right);

    let mut mirror = Mirror {
        process: LinearProcess {
            transition: Mat::from_fn(|i, j| moved[(i, j)]),
            input: Mat::zero(),
            noise: ProcessNoise::none(),
        },
        measurement: LinearMeasurement { matrix: Mat([sight]) },
        ys,
    };
    let ekf = Ekf::new(start.into(), Covariance::from_standard_deviations(sds.into()));
    let all = smoothed(&ekf, &mut mirror, 80).unwrap();
    for (k, (state, power)) in all.iter().zip(&powers).enumerate() {
        let (mean, spread) = (power * &found, power * &root);
        for i in 0..4 {
            let sd = spread.row(i).norm();
            let claimed = state.covariance().get(i, i).sqrt();
            let apart = (state.mean[i] - mean[i]) / sd;
            assert!(apart.abs() < 1e-3, "sample {k}, state {i}: {apart}");
            assert!((0.99..1.1).contains(&(claimed / sd)), "sample {k}, state {i}: {claimed} for {sd}");
        }
    }
}

/// However a recording is cut into blocks, and whatever the storage held before, to the bit.
#[test]
fn blocks_change_nothing() {
    let (mut swing, _) = Swing::simulated(53, 3);
    let whole = smoothed(&Swing::ukf(), &mut swing, 53).unwrap();
    let bits = |s: &Smoothed<f64, 2>| {
        let root = s.root.0;
        [s.mean[0], s.mean[1], root[0][0], root[1][0], root[1][1]].map(f64::to_bits)
    };
    let mut block = vec![Backward::identity(); 70];
    for length in 1..=70 {
        let count = 53_usize.div_ceil(length);
        // One more than are needed, which is left alone.
        let mut checkpoints = vec![Swing::ukf(); count + 1];
        let mut left = 53;
        smooth_interval(&Swing::ukf(), &mut swing, &mut checkpoints, &mut block[..length], |k, s| {
            assert_eq!(bits(s), bits(&whole[k]), "{length} {k}");
            left -= 1;
            Ok(())
        })
        .unwrap();
        assert_eq!(left, 0);
    }
}

/// A course that counts how often each sample is advanced to.
struct Counted(Swing, Vec<usize>);
impl SmoothingCourse<f64, Ukf<f64, 2>, 2> for Counted {
    type Error = FilterError;
    fn samples(&self) -> usize {
        SmoothingCourse::<f64, Ukf<f64, 2>, 2>::samples(&self.0)
    }
    fn advance(
        &mut self,
        filter: &mut Ukf<f64, 2>,
        sample: usize,
    ) -> Result<StateTransition<f64, 2>, FilterError> {
        self.1[sample] += 1;
        self.0.advance(filter, sample)
    }
    fn correct(&mut self, filter: &mut Ukf<f64, 2>, sample: usize) -> Result<(), FilterError> {
        self.0.correct(filter, sample)
    }
}

#[test]
fn each_sample_is_filtered_at_most_twice() {
    let (swing, _) = Swing::simulated(100, 5);
    let mut counted = Counted(swing, vec![0; 100]);
    smoothed(&Swing::ukf(), &mut counted, 10).unwrap();
    assert!(counted.1.iter().all(|times| *times <= 2), "{:?}", counted.1);
    assert_eq!(counted.1.iter().sum::<usize>(), 2 * 100 - 10 - 1);
    counted.1.fill(0);
    smoothed(&Swing::ukf(), &mut counted, 100).unwrap();
    assert_eq!(counted.1.iter().sum::<usize>(), 99);
}

#[test]
fn a_course_that_cannot_be_smoothed_is_refused() {
    let (mut swing, _) = Swing::simulated(20, 9);
    let start = Swing::ukf();
    let none = |_: usize, _: &Smoothed<f64, 2>| Ok(());
    let mut block = [Backward::identity(); 6];
    let room = smooth_interval(&start, &mut swing, &mut [start; 3], &mut block, none);
    assert_eq!(room, Err(SmoothingError::Storage { samples: 20, room: 18 }));
    let empty = smooth_interval(&start, &mut Swing::new(Vec::new()), &mut [], &mut [], none);
    assert_eq!(empty, Ok(()));
    swing.ys[13] = f64::NAN;
    let cause = FilterError::NonFiniteMeasurement;
    for length in [5, 20] {
        assert_eq!(
            smoothed(&start, &mut swing, length).unwrap_err(),
            SmoothingError::Course { sample: 13, cause }
        );
    }
    let mut stopped = 20;
    let outcome =
        smooth_interval(&start, &mut Swing::simulated(20, 9).0, &mut [start; 4], &mut block, |k, _| {
            stopped = k;
            if k == 11 { Err(cause) } else { Ok(()) }
        });
    assert_eq!((outcome, stopped), (Err(SmoothingError::Course { sample: 11, cause }), 11));

    // No covariance: a correlation of two. An EKF does not look; the smoother does, and leaves the filter.
    let no_covariance = Covariance::from_lower(Mat([[1.0, 0.0], [2.0, 1.0]]));
    let mut lagged = FixedLag::<f64, _, 2, 3>::new(Ekf::new([1.0, 2.0], no_covariance));
    let refused = lagged.predict(&swing.process, &Nodes::held(()));
    assert_eq!(refused, Err(FilterError::CovarianceNotPositive));
    assert_eq!((lagged.mean(), lagged.covariance()), (&[1.0, 2.0], no_covariance));
    assert!(lagged.smoothed().is_none() && lagged.lagged(0).is_none());
    let ekf = Ekf::new([1.0, 2.0], no_covariance);
    let mut blind = Swing::new(vec![0.5; 3]);
    assert!(matches!(smoothed(&ekf, &mut blind, 3), Err(SmoothingError::Step { sample: 0, .. })));
}

#[test]
fn an_information_refuses_what_it_cannot_take_and_stays() {
    let mut start = Information::<f64, 2>::nothing();
    let position = LinearMeasurement { matrix: Mat([[1.0, 0.0]]) };
    start.update(&position, &[3.0], &Covariance::from_variances([0.5])).unwrap();
    let before = start;
    let zero = start.update(&position, &[3.0], &Covariance::zero());
    assert_eq!(zero, Err(InformationError::MeasurementNoiseNotPositive));
    let missing = start.update(&position, &[f64::NAN], &Covariance::from_variances([0.5]));
    assert_eq!(missing, Err(InformationError::NonFinite));
    let forgets = LinearProcess::<f64, 2, 0> {
        transition: Mat([[1.0, 2.0], [2.0, 4.0]]),
        input: Mat::zero(),
        noise: ProcessNoise::none(),
    };
    assert_eq!(start.predict(&forgets, &[]).unwrap_err(), InformationError::TransitionSingular);
    assert_eq!(start, before);
    // The same position again and again says nothing of the velocity, whatever rounding does.
    for k in 0..1000 {
        start.update(&position, &[f64::from(k).sin()], &Covariance::from_variances([0.3])).unwrap();
    }
    assert_eq!(start.gaussian(), Err(InformationError::Undetermined { rank: 1, states: 2 }));
}

/// A small process noise survives beside a large covariance: the link is no difference of the two.
#[test]
fn the_link_of_the_unscented_filter_keeps_a_small_noise() {
    let q = Covariance::from_lower(Mat([[1e-18, 0.0], [0.5e-18, 2e-18]]));
    let step = LinearProcess::<f64, 2, 0> {
        transition: Mat([[0.9, 0.3], [-0.2, 1.1]]),
        input: Mat::zero(),
        noise: q.into(),
    };
    let p = Covariance::from_lower(Mat([[2.0, 0.0], [0.7, 1.0]]));
    let mut ukf = Ukf::new([1.0, -1.0], p, SigmaPoints::standard());
    let link = ukf.predict_linked(&step, &[]).unwrap();
    for i in 0..2 {
        for j in 0..=i {
            assert!((link.noise.get(i, j) - q.get(i, j)).abs() < 1e-29, "{:?}", link.noise);
            assert!((link.transition[(i, j)] - step.transition[(i, j)]).abs() < 1e-15);
        }
    }
    // On a pendulum: F·P·Fᵀ + Ω is the predicted covariance, and Ω holds more than the process noise.
    let swing = Swing::new(Vec::new());
    let mut ukf = Swing::ukf();
    let before = full(&ukf.covariance());
    let link = ukf.predict_linked(&swing.process, &Nodes::held(())).unwrap();
    let f = dense(&link.transition);
    let again = f * before * f.transpose() + full(&link.noise);
    assert!((again - full(&ukf.covariance())).amax() < 1e-15);
    let left = full(&link.noise) - full(swing.process.noise().covariance());
    assert!(left.symmetric_eigenvalues().min() > -1e-18 && left[(1, 1)] > 1e-5, "{left}");
}

#[test]
fn f32_smooths_as_f64() {
    fn run<T: Scalar>(ys: &[f64]) -> Vec<[f64; 2]>
    where
        f64: std::convert::From<T>,
    {
        let process = LinearProcess::<T, 2, 0> {
            transition: Mat([[T::of(1.0), T::of(0.1)], [T::of(-0.1), T::of(0.99)]]),
            input: Mat::zero(),
            noise: Covariance::from_variances([T::of(1e-4), T::of(1e-3)]).into(),
        };
        let measurement = LinearMeasurement { matrix: Mat([[T::of(1.0), T::of(0.0)]]) };
        let start = Ekf::new([T::of(0.0); 2], Covariance::from_variances([T::of(1.0); 2]));
        let mut filter = FixedLag::<T, _, 2, 10>::new(start);
        let mut all = Vec::new();
        for y in ys {
            assert!(filter.predict(&process, &[]).is_ok());
            let r = Covariance::from_variances([T::of(0.1)]);
            assert!(filter.update(&measurement, &[T::of(*y)], &r).is_ok());
            all.extend(filter.smoothed().map(|s| s.mean.map(f64::from)));
        }
        all
    }
    let ys: Vec<f64> = (0..300).map(|k| f64::from(k).mul_add(0.1, 0.3).sin()).collect();
    let (wide, narrow) = (run::<f64>(&ys), run::<f32>(&ys));
    assert_eq!(wide.len(), 291);
    for (a, b) in wide.iter().zip(&narrow) {
        // The motion has an amplitude of one.
        assert!((a[0] - b[0]).abs() < 2e-5 && (a[1] - b[1]).abs() < 2e-5, "{a:?} {b:?}");
    }
}

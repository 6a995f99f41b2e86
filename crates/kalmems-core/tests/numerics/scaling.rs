//! Filters in scaled states against the same filters in SI.

use approx::assert_relative_eq;
use kalmems_core::discretize::discretize;
use kalmems_core::riccati::RiccatiError;
use kalmems_core::{
    ContinuousDiscrete, Covariance, Dynamics, Ekf, Filter, FixedGain, Gaussian, LinearMeasurement,
    LinearProcess, Mat, Measurement, NoiseDensity, NotAScale, OperatingPoint, Over, Process, Scalar, Scaled,
    ScaledProcess, Scales, SigmaPoints, Ukf,
};
use proptest::prelude::*;

/// ẍ = u − sin x, seen through the sine of the angle.
#[derive(Clone, Copy)]
struct Pendulum;
impl<T: Scalar> Dynamics<T, 2> for Pendulum {
    type Input = T;
    fn derivative<S: Over<T>>(&self, x: &[S; 2], u: &T) -> [S; 2] {
        [x[1], S::lift(*u) - x[0].sin()]
    }
    fn natural_scales(&self) -> [T; 2] {
        [T::of(0.3), T::of(5.0)]
    }
}
#[derive(Clone, Copy)]
struct Sine;
impl<T: Scalar> Measurement<T, 2, 1> for Sine {
    fn predict<S: Over<T>>(&self, x: &[S; 2]) -> [S; 1] {
        [x[0].sin()]
    }
    fn depends(_: usize, j: usize) -> bool {
        j == 0
    }
}

type Mat3 = Mat<f64, 3, 3>;

#[derive(Debug)]
struct System {
    f: Mat3,
    q: Covariance<f64, 3>,
    h: Mat<f64, 2, 3>,
    r: [f64; 2],
    ys: Vec<[f64; 2]>,
}

fn system() -> impl Strategy<Value = System> {
    (
        prop::array::uniform9(-0.7..0.7_f64),
        prop::array::uniform9(-1.0..1.0_f64),
        prop::array::uniform6(-1.0..1.0_f64),
        prop::array::uniform2(0.01..2.0_f64),
        prop::collection::vec(prop::array::uniform2(-3.0..3.0_f64), 1..20),
    )
        .prop_map(|(f, g, h, r, ys)| {
            let g = Mat3::from_fn(|i, j| g[3 * i + j]);
            System {
                f: Mat::from_fn(|i, j| f[3 * i + j] + f64::from(u8::from(i == j)) * 0.5),
                q: Covariance::from_lower(g.times_transposed(&g)),
                h: Mat::from_fn(|i, j| h[3 * i + j]),
                r,
                ys,
            }
        })
}

/// Mean and covariance at the end of a linear system's samples.
fn run_linear<F: Filter<f64, 3>>(
    mut filter: F,
    process: &impl Process<f64, 3, Input = [f64; 1]>,
    measurement: &impl Measurement<f64, 3, 2>,
    system: &System,
) -> Gaussian<f64, 3> {
    for y in &system.ys {
        filter.predict(process, &[0.3]).unwrap();
        filter.update(measurement, y, &Covariance::from_variances(system.r)).unwrap();
    }
    Gaussian { mean: *filter.mean(), covariance: filter.covariance() }
}

/// The same for the pendulum, over irregular intervals.
fn run_pendulum<F: Filter<f64, 2>>(
    mut filter: F,
    maker: &ContinuousDiscrete<impl Dynamics<f64, 2, Input = f64>, f64, 2>,
    measurement: &impl Measurement<f64, 2, 1>,
    ys: &[[f64; 2]],
) -> Gaussian<f64, 2> {
    for y in ys {
        let process = maker.over(0.02 + 0.05 * y[0].abs(), filter.mean(), |t| t).unwrap();
        filter.predict(&process, &()).unwrap();
        filter.update(measurement, &[y[1] * 0.3], &Covariance::from_variances([0.01])).unwrap();
    }
    Gaussian { mean: *filter.mean(), covariance: filter.covariance() }
}

fn start<const N: usize>() -> Gaussian<f64, N> {
    Gaussian {
        mean: std::array::from_fn(|i| 0.5 - i as f64),
        covariance: Covariance::from_standard_deviations(std::array::from_fn(|i| 0.5 + 0.3 * i as f64)),
    }
}

/// The end in SI and, restored, the end in scaled states, of an EKF and a UKF.
fn both_linear(system: &System, scales: &Scales<f64, 3>) -> [[Gaussian<f64, 3>; 2]; 2] {
    let process =
        LinearProcess { transition: system.f, input: Mat([[1.0], [0.0], [-2.0]]), noise: system.q.into() };
    let seen = LinearMeasurement { matrix: system.h };
    let (scaled_process, scaled_seen) = (ScaledProcess::new(process, *scales), Scaled::new(seen, *scales));
    let x = start();
    let z = scales.scale_gaussian(&x);
    let points = SigmaPoints::standard();
    [
        [
            run_linear(Ekf::new(x.mean, x.covariance), &process, &seen, system),
            scales.restore_gaussian(&run_linear(
                Ekf::new(z.mean, z.covariance),
                &scaled_process,
                &scaled_seen,
                system,
            )),
        ],
        [
            run_linear(Ukf::new(x.mean, x.covariance, points), &process, &seen, system),
            scales.restore_gaussian(&run_linear(
                Ukf::new(z.mean, z.covariance, points),
                &scaled_process,
                &scaled_seen,
                system,
            )),
        ],
    ]
}

fn both_pendulum(ys: &[[f64; 2]], scales: &Scales<f64, 2>) -> [[Gaussian<f64, 2>; 2]; 2] {
    let density = NoiseDensity::from_lower(Mat([[0.01, 0.0], [0.005, 0.2]]));
    let maker = ContinuousDiscrete::new(Pendulum, density, 0.02).unwrap();
    let scaled = Scaled::new(Pendulum, *scales);
    let scaled_maker = ContinuousDiscrete::new(scaled, scales.scale_density(&density), 0.02).unwrap();
    let seen = Scaled::new(Sine, *scales);
    let x = start();
    let z = scales.scale_gaussian(&x);
    let points = SigmaPoints::standard();
    [
        [
            run_pendulum(Ekf::new(x.mean, x.covariance), &maker, &Sine, ys),
            scales.restore_gaussian(&run_pendulum(Ekf::new(z.mean, z.covariance), &scaled_maker, &seen, ys)),
        ],
        [
            run_pendulum(Ukf::new(x.mean, x.covariance, points), &maker, &Sine, ys),
            scales.restore_gaussian(&run_pendulum(
                Ukf::new(z.mean, z.covariance, points),
                &scaled_maker,
                &seen,
                ys,
            )),
        ],
    ]
}

fn bits<const N: usize>(g: &Gaussian<f64, N>) -> ([u64; N], [[u64; N]; N]) {
    (g.mean.map(f64::to_bits), g.covariance.to_full().0.map(|row| row.map(f64::to_bits)))
}

/// Close in units of the standard deviations.
fn close<const N: usize>(a: &Gaussian<f64, N>, b: &Gaussian<f64, N>, tolerance: f64) -> bool {
    let sd: [f64; N] = std::array::from_fn(|i| a.covariance.standard_deviation(i));
    (0..N).all(|i| {
        (a.mean[i] - b.mean[i]).abs() <= tolerance * (sd[i] + a.mean[i].abs())
            && (0..N)
                .all(|j| (a.covariance.get(i, j) - b.covariance.get(i, j)).abs() <= tolerance * sd[i] * sd[j])
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]
    #[test]
    fn scaled_is_unscaled_to_rounding(system in system(), exponents in prop::array::uniform3(-12.0..12.0_f64)) {
        let scales = Scales::new(exponents.map(|e| 10.0_f64.powf(e))).unwrap();
        for [si, scaled] in both_linear(&system, &scales) {
            prop_assert!(close(&si, &scaled, 1e-10), "{:?} {:?}", si, scaled);
        }
        let scales = Scales::new([10.0_f64.powf(exponents[0]), 10.0_f64.powf(exponents[1])]).unwrap();
        for [si, scaled] in both_pendulum(&system.ys, &scales) {
            prop_assert!(close(&si, &scaled, 1e-10), "{:?} {:?}", si, scaled);
        }
    }

    #[test]
    fn powers_of_two_change_no_bit(system in system(), exponents in prop::array::uniform3(-60..60_i32)) {
        let scales = Scales::new(exponents.map(|e| 2.0_f64.powi(e))).unwrap();
        for [si, scaled] in both_linear(&system, &scales) {
            prop_assert_eq!(bits(&si), bits(&scaled));
        }
        let scales = Scales::new([2.0_f64.powi(exponents[0]), 2.0_f64.powi(exponents[1])]).unwrap();
        for [si, scaled] in both_pendulum(&system.ys, &scales) {
            prop_assert_eq!(bits(&si), bits(&scaled));
        }
    }

    #[test]
    fn there_and_back(
        entries in prop::array::uniform9(-1.0..1.0_f64), sizes in prop::array::uniform3(1e-12..1e3_f64), h in 0.01..1.0_f64,
    ) {
        let scales = Scales::new(sizes).unwrap();
        let a = Mat3::from_fn(|i, j| entries[3 * i + j] * sizes[i] / sizes[j]);
        let root = Mat3::from_fn(|i, j| entries[3 * j + i] * sizes[i]);
        let p = Covariance::from_lower(root.times_transposed(&root));
        let density = NoiseDensity::from_lower(p.to_full());
        let g = Gaussian { mean: sizes, covariance: p };
        prop_assert!(close(&g, &scales.restore_gaussian(&scales.scale_gaussian(&g)), 1e-14));
        let back = scales.restore_density(&scales.scale_density(&density));
        for i in 0..3 {
            for j in 0..3 {
                prop_assert!((back.get(i, j) - p.get(i, j)).abs() <= 1e-15 * p.get(i, j).abs());
            }
        }
        // To discretise in z, or to discretise and scale then.
        let in_z = Mat3::from_fn(|i, j| entries[3 * i + j]);
        let z = discretize(&in_z, &scales.scale_density(&density), h).noise;
        let x = discretize(&a, &density, h).noise;
        let x = Gaussian { mean: [0.0; 3], covariance: x };
        let z = Gaussian { mean: [0.0; 3], covariance: scales.restore_covariance(&z) };
        prop_assert!(close(&x, &z, 1e-12), "{:?} {:?}", x, z);
    }

    #[test]
    fn the_power_of_two_below(size in prop_oneof![1e-300..1e-290_f64, 1e-9..1e9_f64, 1e290..1e300_f64]) {
        let power = Scales::new([size]).unwrap().to_powers_of_two().sizes()[0];
        prop_assert!(power <= size && size < 2.0 * power);
        prop_assert_eq!(power.log2().fract(), 0.0);
    }
}

#[test]
fn what_is_no_scale_is_refused() {
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-310] {
        assert_eq!(Scales::new([1.0, bad]).unwrap_err(), NotAScale { state: 1 });
    }
    for bad in [1e-39_f32, f32::INFINITY] {
        assert_eq!(Scales::new([bad]).unwrap_err(), NotAScale { state: 0 });
    }
}

#[test]
fn a_model_states_its_scales() {
    struct Silent;
    impl<T: Scalar> Dynamics<T, 1> for Silent {
        type Input = ();
        fn derivative<S: Over<T>>(&self, x: &[S; 1], (): &()) -> [S; 1] {
            [-x[0]]
        }
    }
    assert_eq!(Scales::<f64, 1>::natural(&Silent).unwrap().sizes(), &[1.0]);
    let scales = Scales::natural(&Pendulum).unwrap();
    assert_eq!(scales.sizes(), &[0.25, 4.0]);
    let scaled = Scaled::new(Pendulum, scales);
    assert_eq!(scaled.natural_scales(), [0.3 / 0.25, 5.0 / 4.0]);
    // By the model's own Jacobian and by dual numbers through the scales.
    let z = [0.7, 0.2];
    let (_, by_dual) = kalmems_core::jacobian(&z, |z| scaled.derivative(z, &0.0));
    assert_eq!(scaled.jacobian(&z, &0.0), by_dual);
    let seen = Scaled::new(Sine, scales);
    let (_, by_dual) = kalmems_core::jacobian(&z, |z| seen.predict(z));
    assert_eq!(seen.linearize(&z).1, by_dual);
    assert!(<Scaled<Sine, f64, 2> as Measurement<f64, 2, 1>>::depends(0, 0));
    assert!(!<Scaled<Sine, f64, 2> as Measurement<f64, 2, 1>>::depends(0, 1));
}

/// The accelerometer (Zhang 2010, table I) with the acceleration as a second-order Gauss–Markov process:
/// x = [displacement in m, velocity, acceleration, its rate], 8 mg rms within 100 Hz, sampled at 10 MHz, 22 µV of
/// noise behind 7.47·10⁵ V/m.
const RMS: f64 = 0.08;
const BANDWIDTH: f64 = 628.0;
const INTERVAL: f64 = 1e-7;
const NOISE: f64 = 2.21e-5;
/// What 8 mg does: 10⁻¹⁰ m, with the bandwidth's rates.
const SIZES: [f64; 4] = [1e-10, 1e-7, RMS, RMS * BANDWIDTH];

struct Accelerometer<T> {
    process: LinearProcess<T, 4, 0>,
    readout: LinearMeasurement<T, 4, 1>,
    noise: Covariance<T, 1>,
}

/// In states of these units, every number computed in f64 before it is rounded to `T`.
fn accelerometer<T: Scalar>(units: &[f64; 4]) -> Accelerometer<T> {
    let (w, damping) = (BANDWIDTH, 0.7);
    let a = [
        [0.0, 1.0, 0.0, 0.0],
        [-3.0 / 3.8e-9, -7e-4 / 3.8e-9, 1.0, 0.0],
        [0.0, 0.0, 0.0, 1.0],
        [0.0, 0.0, -w * w, -2.0 * damping * w],
    ];
    let density = 4.0 * damping * w.powi(3) * RMS * RMS / units[3] / units[3];
    let a = Mat::from_fn(|i, j| T::of(a[i][j] * units[j] / units[i]));
    let density = NoiseDensity::none().on::<3>(T::of(density));
    let zero = T::of(0.0);
    Accelerometer {
        process: LinearProcess::exact(&a, &Mat::zero(), &density, T::of(INTERVAL)),
        readout: LinearMeasurement { matrix: Mat([[T::of(7.47e5 * units[0]), zero, zero, zero]]) },
        noise: Covariance::from_variances([T::of(NOISE * NOISE)]),
    }
}

impl<T: Scalar> Accelerometer<T> {
    fn settled(&self) -> Result<FixedGain<T, 4, 1>, RiccatiError> {
        let zero = [T::of(0.0); 4];
        let point = OperatingPoint::of(&self.process, (&self.readout, self.noise), (&zero, &[]));
        FixedGain::steady_state(zero, &point)
    }

    /// An EKF over a slow oscillation with a disturbance of the size of the noise, from the scales as a start.
    fn followed(&self, deviations: [T; 4]) -> Ekf<T, 4> {
        let mut filter = Ekf::new([T::of(0.0); 4], Covariance::from_standard_deviations(deviations));
        for k in 0..5000 {
            let k = f64::from(k);
            let y = 7.47e5 * 1e-10 * (1e4 * INTERVAL * k).sin() + NOISE * (0.37 * k).sin();
            filter.predict(&self.process, &[]).unwrap();
            filter.update(&self.readout, &[T::of(y)], &self.noise).unwrap();
        }
        filter
    }
}

/// In SI the noise of one step, q·h⁷/252 in the displacement, is about the least number of f32: what is left is no
/// covariance, its root is wrong, and a steady state is refused. In scaled states all three are there, and the
/// filters in f32 say what those in f64 say.
#[test]
fn an_accelerometer_in_single_precision() {
    let exact = accelerometer::<f64>(&[1.0; 4]);
    let in_si = accelerometer::<f32>(&[1.0; 4]);
    let scaled = accelerometer::<f32>(&SIZES);

    let (q, wanted) = (in_si.process.noise.covariance(), exact.process.noise.covariance());
    assert!((f64::from(q.get(0, 0)) - wanted.get(0, 0)).abs() > 0.1 * wanted.get(0, 0));
    assert_relative_eq!(f64::from(q.get(1, 0)), wanted.get(1, 0), max_relative = 1e-2);
    let root = in_si.process.noise.root();
    let product = f64::from(root.times_transposed(root)[(1, 1)]);
    assert!((product - wanted.get(1, 1)).abs() > 0.1 * wanted.get(1, 1), "{product}");
    assert_eq!(in_si.settled().unwrap_err(), RiccatiError::ProcessNoiseNotPositive);

    let restored = |p: &Covariance<f32, 4>, i: usize, j: usize| f64::from(p.get(i, j)) * SIZES[i] * SIZES[j];
    for i in 0..4 {
        for j in 0..=i {
            let q = restored(scaled.process.noise.covariance(), i, j);
            assert_relative_eq!(q, wanted.get(i, j), max_relative = 1e-4);
            let root = scaled.process.noise.root();
            let product = f64::from(root.times_transposed(root)[(i, j)]) * SIZES[i] * SIZES[j];
            assert_relative_eq!(product, wanted.get(i, j), max_relative = 1e-4);
        }
    }

    let (ours, settled) = (scaled.settled().unwrap(), exact.settled().unwrap());
    let (a, b) = (scaled.followed([1.0; 4]), exact.followed(SIZES));
    for i in 0..4 {
        assert_relative_eq!(
            f64::from(ours.gain()[(i, 0)]) * SIZES[i],
            settled.gain()[(i, 0)],
            max_relative = 1e-4
        );
        let sd = f64::from(ours.filtered_covariance().standard_deviation(i)) * SIZES[i];
        assert_relative_eq!(sd, settled.filtered_covariance().standard_deviation(i), max_relative = 1e-4);

        let wanted = b.covariance().standard_deviation(i);
        assert_relative_eq!(
            f64::from(a.covariance().standard_deviation(i)) * SIZES[i],
            wanted,
            max_relative = 1e-4
        );
        let difference = f64::from(a.mean()[i]) * SIZES[i] - b.mean()[i];
        // The rate of the acceleration is three integrations away from what is seen.
        let tolerance = [1e-4, 1e-4, 1e-4, 5e-4][i];
        assert!(difference.abs() < tolerance * SIZES[i], "{i}: {difference}");
    }
}

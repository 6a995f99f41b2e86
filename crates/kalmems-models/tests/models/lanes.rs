//! Filters in lanes against filters by themselves, bit for bit: 1024 scanners with different parameters.

use kalmems_core::lanes::{Isa, Kernel, Lane, Real};
use kalmems_core::{
    Covariance, Ekf, Euler, Filter, Mat, Measurement, Nodes, NoiseDensity, Process, ProcessNoise, Rk4,
    Scalar, SigmaPoints, Ukf,
};
use kalmems_models::capacitance::GaussianComb;
use kalmems_models::dynamics::{ParametricScanner, TorsionalResonator};
use kalmems_models::readout::DemodulatedComb;
use std::marker::PhantomData;

const DEVICES: usize = 1024;
const STEPS: usize = 200;

/// The parameters of device `index`, each varied by some percent.
fn parameters<S: Scalar>(vary: impl Fn(f64, usize) -> S) -> (ParametricScanner<S>, DemodulatedComb<S>) {
    let one = |x: f64| vary(x, 0);
    let comb = GaussianComb { nominal: vary(5.71e-12, 7), angular_width: vary(0.2, 11), bias: one(9.79e-12) };
    let resonator = TorsionalResonator {
        inertia: vary(1.15e-14, 13),
        damping: vary(5.95e-12, 17),
        stiffness: vary(1.10e-4, 19),
    };
    (
        ParametricScanner { resonator, comb, carrier_mean_square: one(18.0) },
        DemodulatedComb { comb, gain: one(-0.3574e12), offset: one(6.3945) },
    )
}

fn varied(nominal: f64, step: usize, index: usize) -> f64 {
    nominal * (1.0 + 0.04 * ((index * step % DEVICES) as f64 / DEVICES as f64 - 0.5))
}

/// What the devices' sensors say, step after step.
fn measurements() -> Vec<f64> {
    let mut all = vec![0.0; DEVICES * STEPS];
    for index in 0..DEVICES {
        let (scanner, readout) = parameters(|nominal, step| varied(nominal, step, index));
        let process = Rk4::with_noise(scanner, 1e-6, ProcessNoise::none());
        let mut truth = [0.15, 0.0];
        for step in 0..STEPS {
            truth = process.step(&truth, &Nodes::held(23.76));
            all[step * DEVICES + index] = readout.predict(&truth)[0];
        }
    }
    all
}

/// Follows all devices with filters made by `make`.
struct Follow<'a, M> {
    make: PhantomData<M>,
    measurements: &'a [f64],
    /// Where a drive is infinite: device and step.
    broken: &'a dyn Fn(usize, usize) -> bool,
}

/// A filter for any kind of number, and how it steps.
trait Make {
    type Drive<S: Scalar>;
    fn process<S: Scalar>(
        scanner: ParametricScanner<S>,
        noise: Covariance<S, 2>,
    ) -> impl Process<S, 2, Input = Self::Drive<S>>;
    fn drive<S: Scalar>(volts: S) -> Self::Drive<S>;
    fn filter<S: Scalar>(mean: [S; 2], covariance: Covariance<S, 2>) -> impl Filter<S, 2>;
}

struct MakeEkf;
impl Make for MakeEkf {
    type Drive<S: Scalar> = Nodes<S>;
    fn process<S: Scalar>(
        scanner: ParametricScanner<S>,
        noise: Covariance<S, 2>,
    ) -> impl Process<S, 2, Input = Nodes<S>> {
        Rk4::with_noise(scanner, S::of(1e-6), ProcessNoise::from(noise))
    }
    fn drive<S: Scalar>(volts: S) -> Nodes<S> {
        Nodes::held(volts)
    }
    fn filter<S: Scalar>(mean: [S; 2], covariance: Covariance<S, 2>) -> impl Filter<S, 2> {
        Ekf::new(mean, covariance)
    }
}

/// By Euler's method: with five sigma points and four evaluations each, the compiler would be at it for half a minute.
struct MakeUkf;
impl Make for MakeUkf {
    type Drive<S: Scalar> = S;
    fn process<S: Scalar>(
        scanner: ParametricScanner<S>,
        noise: Covariance<S, 2>,
    ) -> impl Process<S, 2, Input = S> {
        Euler::new(scanner, S::of(1e-6), noise)
    }
    fn drive<S: Scalar>(volts: S) -> S {
        volts
    }
    fn filter<S: Scalar>(mean: [S; 2], covariance: Covariance<S, 2>) -> impl Filter<S, 2> {
        Ukf::new(mean, covariance, SigmaPoints::standard())
    }
}

/// What became of one device: after each prediction and each correction whether it was taken, mean and covariance.
#[derive(Clone, Default)]
struct Course {
    taken: Vec<bool>,
    states: Vec<[f64; 5]>,
}

impl<F: Real + Into<f64>, M: Make> Kernel<F> for Follow<'_, M> {
    type Output = Vec<Course>;

    #[inline(always)]
    fn run<L: Lane<F>>(self) -> Vec<Course> {
        let mut courses = vec![Course::default(); DEVICES];
        let q = NoiseDensity::none().on::<1>(1e6_f64);
        let r = Covariance::from_lower(Mat([[L::of(1.92e-4)]]));
        for first in (0..DEVICES).step_by(L::WIDTH) {
            let (scanner, readout) =
                parameters(|nominal, step| L::from_fn(|lane| F::of(varied(nominal, step, first + lane))));
            let noises: Vec<ProcessNoise<f64, 2>> = (first..first + L::WIDTH)
                .map(|index| {
                    let (scanner, _) = parameters(|nominal, step| varied(nominal, step, index));
                    *Rk4::new(scanner, 1e-6, &q, (&[0.0, 0.0], &23.76)).noise()
                })
                .collect();
            let noise = Covariance::from_lower(Mat::from_fn(|i, j| {
                L::from_fn(|lane| F::of(noises[lane].covariance().get(i, j)))
            }));
            let process = M::process(scanner, noise);
            let start = Covariance::from_standard_deviations([L::of(0.05), L::of(5e3)]);
            let mut filter = M::filter([L::of(0.12), L::of(0.0)], start);
            for (step, at) in self.measurements.chunks_exact(DEVICES).enumerate() {
                let drive = L::from_fn(|lane| {
                    F::of(if (self.broken)(first + lane, step) { f64::INFINITY } else { 23.76 })
                });
                let y = L::from_fn(|lane| F::of(at[first + lane]));
                let taken = filter.predict(&process, &M::drive(drive)).ok();
                record(&mut courses[first..], &filter, taken);
                let taken = filter.update(&readout, &[y], &r).ok().map(|innovation| innovation.taken);
                record(&mut courses[first..], &filter, taken);
            }
        }
        courses
    }
}

/// Notes the state of a filter for each of its lanes.
fn record<F: Into<f64>, L: Lane<F>>(
    courses: &mut [Course],
    filter: &impl Filter<L, 2>,
    taken: Option<L::Mask>,
) {
    let p = filter.covariance();
    let state = [filter.mean()[0], filter.mean()[1], p.get(0, 0), p.get(1, 0), p.get(1, 1)];
    for (lane, course) in courses.iter_mut().take(L::WIDTH).enumerate() {
        course.taken.push(taken.is_some_and(|taken| L::is_set(taken, lane)));
        course.states.push(state.map(|s| s.lane(lane).expect("there is this lane").into()));
    }
}

/// Runs every instruction set against one filter at a time; with faults, checks what they did too.
fn compare<F: Real + Into<f64>, M: Make>(steps: usize, faults: bool) {
    let mut measurements = measurements();
    measurements.truncate(steps * DEVICES);
    let missing = |index: usize, step: usize| faults && index % 37 == 5 && step % 11 == 7;
    let broken = |index: usize, step: usize| faults && index % 29 == 3 && step % 13 == 4;
    for (at, y) in measurements.iter_mut().enumerate() {
        if missing(at % DEVICES, at / DEVICES) {
            *y = f64::NAN;
        }
    }
    let kernel = || Follow { make: PhantomData::<M>, measurements: &measurements, broken: &broken };
    let expected: Vec<Course> = kernel().run::<F>();
    for (index, course) in expected.iter().enumerate() {
        for step in 0..steps {
            let (predicted, corrected) = (2 * step, 2 * step + 1);
            assert_eq!(course.taken[predicted], !broken(index, step), "device {index}, step {step}");
            assert_eq!(course.taken[corrected], !missing(index, step), "device {index}, step {step}");
            if broken(index, step) {
                assert_eq!(course.states[predicted], course.states[predicted - 1]);
            }
            if missing(index, step) {
                assert_eq!(course.states[corrected], course.states[predicted]);
            }
        }
    }
    for isa in Isa::available() {
        let found: Vec<Course> = isa.run::<F, _>(kernel()).expect("it is available");
        for (index, (a, b)) in expected.iter().zip(&found).enumerate() {
            assert_eq!(a.taken, b.taken, "{isa:?}, device {index}");
            let bits = |c: &Course| c.states.iter().map(|s| s.map(f64::to_bits)).collect::<Vec<_>>();
            assert!(bits(a) == bits(b), "{isa:?}, device {index}");
        }
    }
}

#[test]
fn extended_filters_agree() {
    compare::<f64, MakeEkf>(STEPS, false);
    compare::<f32, MakeEkf>(STEPS, false);
}

#[test]
fn unscented_filters_agree() {
    compare::<f64, MakeUkf>(100, false);
    compare::<f32, MakeUkf>(100, false);
}

/// A missing measurement or a broken input stops its own lane, and no other.
#[test]
fn a_refused_lane_is_as_if_alone() {
    compare::<f64, MakeEkf>(60, true);
    compare::<f32, MakeEkf>(60, true);
    compare::<f64, MakeUkf>(60, true);
}

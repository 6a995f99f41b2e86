//! What is filtered: a device, how it moves from sample to sample, and what is seen of it.

use kalmems_core::{
    AddedState, Augmented, AugmentedMeasurement, ContinuousDiscrete, Covariance, Drift, Dynamics, Euler,
    Filter, FilterError, LinearMeasurement, LinearProcess, Mat, Measurement, Nodes, NoiseDensity, Over,
    Parameters, Process, Rk4, Scalar, Scaled, ScaledProcess, Scales, StateTransition,
};
use kalmems_models::capacitance::GaussianComb;
use kalmems_models::dynamics::{Duffing, ParametricScanner, TorsionalResonator};
use kalmems_models::readout::DemodulatedComb;
use std::f64::consts::TAU;
use std::fmt::Debug;

/// f64 or f32.
pub trait Number: Scalar + Into<f64> + PartialEq + Debug {}
impl Number for f64 {}
impl Number for f32 {}

/// A device with its sensor, in whatever units its states are in.
pub trait Device<T: Number, const N: usize, const M: usize> {
    type Sensor: Measurement<T, N, M>;
    /// What is believed of the state at the first sample: mean and standard deviations.
    fn start(&self) -> &([T; N], [T; N]);
    fn sensor(&self) -> &Self::Sensor;
    /// The covariance of the sensor's noise.
    fn noise(&self) -> &Covariance<T, M>;
    /// Moves a filter from sample `sample` − 1 to `sample`.
    fn advance<F: Filter<T, N>>(
        &self,
        filter: &mut F,
        sample: usize,
    ) -> Result<StateTransition<T, N>, FilterError>;
}

/// One process for all intervals, which are all of the same length.
pub struct Stepped<P: Process<T, N>, H, T: Number, const N: usize, const M: usize> {
    pub process: P,
    pub input: fn(usize) -> P::Input,
    pub sensor: H,
    pub start: ([T; N], [T; N]),
    pub noise: Covariance<T, M>,
}

impl<T, P, H, const N: usize, const M: usize> Device<T, N, M> for Stepped<P, H, T, N, M>
where
    T: Number,
    P: Process<T, N>,
    H: Measurement<T, N, M>,
{
    type Sensor = H;
    fn start(&self) -> &([T; N], [T; N]) {
        &self.start
    }
    fn sensor(&self) -> &H {
        &self.sensor
    }
    fn noise(&self) -> &Covariance<T, M> {
        &self.noise
    }
    #[inline(never)]
    fn advance<F: Filter<T, N>>(
        &self,
        filter: &mut F,
        sample: usize,
    ) -> Result<StateTransition<T, N>, FilterError> {
        filter.predict_linked(&self.process, &(self.input)(sample))
    }
}

/// A differential equation, and samples that come as they may.
pub struct Irregular<D, H, T, const N: usize, const M: usize> {
    model: ContinuousDiscrete<D, T, N>,
    sensor: H,
    start: ([T; N], [T; N]),
    noise: Covariance<T, M>,
}

impl<T, D, H, const N: usize, const M: usize> Device<T, N, M> for Irregular<D, H, T, N, M>
where
    T: Number,
    D: Dynamics<T, N, Input = T>,
    H: Measurement<T, N, M>,
{
    type Sensor = H;
    fn start(&self) -> &([T; N], [T; N]) {
        &self.start
    }
    fn sensor(&self) -> &H {
        &self.sensor
    }
    fn noise(&self) -> &Covariance<T, M> {
        &self.noise
    }
    #[inline(never)]
    fn advance<F: Filter<T, N>>(
        &self,
        filter: &mut F,
        sample: usize,
    ) -> Result<StateTransition<T, N>, FilterError> {
        let (from, to) = (irregular(sample - 1), irregular(sample));
        let process = self.model.over(to - from, filter.mean(), |t| T::of(volts(from + t))).unwrap();
        filter.predict_linked(&process, &())
    }
}

/// Microseconds, each sample up to 0.45 µs early or late.
fn irregular(sample: usize) -> f64 {
    let k = sample as f64;
    (k + 0.45 * (1.7 * k * k).sin()) * 1e-6
}

const INTERVAL: f64 = 1e-6;
/// An angular acceleration's density in rad²/s³.
const DENSITY: f64 = 1e8;
/// The drive of the scanner in V, near the upper edge of its resonance.
fn volts(t: f64) -> f64 {
    90.0 + 90.0 * (TAU * 31_350.0 * t).sin()
}

/// The drive over the interval before a sample.
fn drive<T: Number>(sample: usize) -> Nodes<T> {
    let end = sample as f64 * INTERVAL;
    let volts = |t| T::of(volts(t));
    Nodes { start: volts(end - INTERVAL), middle: volts(end - INTERVAL / 2.0), end: volts(end) }
}

/// Euler's method turns a loss into a gain where its step is long: here it is a quarter.
const EULER: f64 = INTERVAL / 4.0;

fn held<T: Number>(sample: usize) -> T {
    T::of(volts(sample as f64 * EULER))
}

fn of<T: Number>(_: usize, value: f64) -> T {
    T::of(value)
}

const COMB: GaussianComb<f64> = GaussianComb { nominal: 5.71e-12, angular_width: 0.2, bias: 9.79e-12 };
const RESONATOR: TorsionalResonator<f64> =
    TorsionalResonator { inertia: 1.15e-14, damping: 5.95e-12, stiffness: 1.10e-4 };
const SCANNER: ParametricScanner<f64> =
    ParametricScanner { resonator: RESONATOR, comb: COMB, carrier_mean_square: 18.0 };
const READOUT: DemodulatedComb<f64> = DemodulatedComb { comb: COMB, gain: -0.3574e12, offset: 6.3945 };
/// The deflection of the scanner's spring, hardened so much that 0.15 rad raise its frequency by 2 %.
const HARDENED: Duffing<f64> = Duffing { damping: 520.0, stiffness: 9.57e9, cubic: 2.4e10, gain: 8.7e13 };

/// Released at 0.15 rad, whose sign is thereby known.
fn released<T: Number>() -> ([T; 2], [T; 2]) {
    ([T::of(0.15), T::of(0.0)], [T::of(0.005), T::of(500.0)])
}

fn density<T: Number>() -> NoiseDensity<T, 2> {
    NoiseDensity::none().on::<1>(T::of(DENSITY))
}

/// 14 mV of the demodulated signal.
pub fn demodulated<T: Number>() -> (DemodulatedComb<T>, Covariance<T, 1>) {
    (READOUT.map(of), Covariance::from_standard_deviations([T::of(0.014)]))
}

/// The angle itself, to 2 mrad.
pub fn angle<T: Number>() -> (LinearMeasurement<T, 2, 1>, Covariance<T, 1>) {
    let matrix = Mat([[T::of(1.0), T::of(0.0)]]);
    (LinearMeasurement { matrix }, Covariance::from_standard_deviations([T::of(0.002)]))
}

/// The angle and the rate, with noise that is correlated.
pub fn angle_and_rate<T: Number>() -> (LinearMeasurement<T, 2, 2>, Covariance<T, 2>) {
    let (zero, one) = (T::of(0.0), T::of(1.0));
    let noise = Covariance::from_lower(Mat([[T::of(4e-6), zero], [T::of(0.12), T::of(1e4)]]));
    (LinearMeasurement { matrix: Mat([[one, zero], [zero, one]]) }, noise)
}

/// The demodulated signal, and light on a detector that gives 5 V/rad.
pub struct CombAndLight<T>(DemodulatedComb<T>);

impl<T: Number, const N: usize> Measurement<T, N, 2> for CombAndLight<T> {
    fn predict<S: Over<T>>(&self, x: &[S; N]) -> [S; 2] {
        let [voltage] = self.0.predict(x);
        [voltage, x[0] * T::of(5.0)]
    }
    fn depends(_: usize, state: usize) -> bool {
        state == 0
    }
}

pub fn comb_and_light<T: Number>() -> (CombAndLight<T>, Covariance<T, 2>) {
    let noise = Mat([[T::of(2e-4), T::of(0.0)], [T::of(-0.5e-4), T::of(1e-4)]]);
    (CombAndLight(READOUT.map(of)), Covariance::from_lower(noise))
}

/// The scanner, stepped by Runge and Kutta.
pub fn scanner<T: Number, H, const M: usize>(
    seen: (H, Covariance<T, M>),
) -> Stepped<Rk4<ParametricScanner<T>, T, 2>, H, T, 2, M> {
    scanner_of_stiffness(1.0, seen)
}

/// The scanner with its stiffness times `factor`.
pub fn scanner_of_stiffness<T: Number, H, const M: usize>(
    factor: f64,
    (sensor, noise): (H, Covariance<T, M>),
) -> Stepped<Rk4<ParametricScanner<T>, T, 2>, H, T, 2, M> {
    let resonator = TorsionalResonator { stiffness: RESONATOR.stiffness * factor, ..RESONATOR };
    let model = ParametricScanner { resonator, ..SCANNER };
    let process = Rk4::new(model.map(of), T::of(INTERVAL), &density(), (&released().0, &T::of(90.0)));
    Stepped { process, input: drive, sensor, start: released(), noise }
}

/// The scanner, stepped by Euler.
pub fn scanner_by_euler<T: Number, H, const M: usize>(
    (sensor, noise): (H, Covariance<T, M>),
) -> Stepped<Euler<ParametricScanner<T>, T, 2>, H, T, 2, M> {
    let of_step = Covariance::from_variances([T::of(1e-14), T::of(DENSITY * EULER)]);
    let process = Euler::new(SCANNER.map(of), T::of(EULER), of_step);
    Stepped { process, input: held, sensor, start: released(), noise }
}

/// A hardening spring, pushed at its resonance.
pub fn duffing<T: Number, H, const M: usize>(
    (sensor, noise): (H, Covariance<T, M>),
) -> Stepped<Rk4<Duffing<T>, T, 2>, H, T, 2, M> {
    fn push<T: Number>(sample: usize) -> Nodes<T> {
        let at = |k: f64| T::of(1e-6 * (0.0985 * k).sin());
        let end = sample as f64;
        Nodes { start: at(end - 1.0), middle: at(end - 0.5), end: at(end) }
    }
    let process = Rk4::new(HARDENED.map(of), T::of(INTERVAL), &density(), (&released().0, &T::of(0.0)));
    Stepped { process, input: push, sensor, start: released(), noise }
}

/// A mirror on a torsion spring, its torque held over each interval.
pub fn resonator<T: Number, H, const M: usize>(
    seen: (H, Covariance<T, M>),
) -> Stepped<LinearProcess<T, 2, 1>, H, T, 2, M> {
    resonator_of_stiffness(1.0, seen)
}

/// The same with its stiffness times `factor`.
pub fn resonator_of_stiffness<T: Number, H, const M: usize>(
    factor: f64,
    (sensor, noise): (H, Covariance<T, M>),
) -> Stepped<LinearProcess<T, 2, 1>, H, T, 2, M> {
    fn torque<T: Number>(sample: usize) -> [T; 1] {
        [T::of(1e-6 * (0.0978 * sample as f64).sin())]
    }
    let model = TorsionalResonator { stiffness: RESONATOR.stiffness * factor, ..RESONATOR };
    let process = model.map(of::<T>).exact(T::of(INTERVAL), T::of(DENSITY));
    Stepped { process, input: torque, sensor, start: released(), noise }
}

type AugmentedScanner<T> = Stepped<
    Augmented<Rk4<ParametricScanner<T>, T, 2>, T, 2, 3, 5>,
    AugmentedMeasurement<DemodulatedComb<T>, T, 2, 3>,
    T,
    5,
    1,
>;

/// The scanner with its stiffness, and gain and offset of its readout, as states: known to 0.3 %, 3 % and 20 mV.
pub fn augmented<T: Number>() -> AugmentedScanner<T> {
    let wanders =
        |scale| AddedState { scale: T::of(scale), drift: Drift::RandomWalk { density: T::of(1.0) } };
    let added = [wanders(0.003 * 1.10e-4), wanders(-0.03 * 0.3574e12), wanders(0.02)];
    let plain = Rk4::new(SCANNER.map(of), T::of(INTERVAL), &density(), (&released().0, &T::of(90.0)));
    let (readout, noise) = demodulated();
    let ([angle, rate], [d_angle, d_rate]) = released();
    let (zero, one) = (T::of(0.0), T::of(1.0));
    Stepped {
        process: Augmented::new(plain, &added, [Some("resonator.stiffness"), None, None]).unwrap(),
        input: drive,
        sensor: AugmentedMeasurement::new(readout, &added, [None, Some("gain"), Some("offset")]).unwrap(),
        start: ([angle, rate, zero, zero, zero], [d_angle, d_rate, one, one, one]),
        noise,
    }
}

fn natural<T: Number>() -> Scales<T, 2> {
    Scales::natural(&SCANNER.map(of::<T>)).unwrap()
}

fn scaled_start<T: Number>(scales: &Scales<T, 2>) -> ([T; 2], [T; 2]) {
    let (mean, deviations) = released();
    (scales.scale_state(&mean), scales.scale_state(&deviations))
}

type ScaledScanner<P, T> = Stepped<P, Scaled<DemodulatedComb<T>, T, 2>, T, 2, 1>;

/// The scanner in units of its own size, scaled as a differential equation.
pub fn scaled<T: Number>() -> ScaledScanner<Rk4<Scaled<ParametricScanner<T>, T, 2>, T, 2>, T> {
    let scales = natural();
    let start = scaled_start(&scales);
    let model = Scaled::new(SCANNER.map(of), scales);
    let density = scales.scale_density(&density());
    let (readout, noise) = demodulated();
    Stepped {
        process: Rk4::new(model, T::of(INTERVAL), &density, (&start.0, &T::of(90.0))),
        input: drive,
        sensor: Scaled::new(readout, scales),
        start,
        noise,
    }
}

/// The same, scaled as a process.
pub fn scaled_process<T: Number>() -> ScaledScanner<ScaledProcess<Rk4<ParametricScanner<T>, T, 2>, T, 2>, T> {
    let scales = natural();
    let Stepped { process, input, sensor, noise, .. } = scanner(demodulated());
    Stepped {
        process: ScaledProcess::new(process, scales),
        input,
        sensor: Scaled::new(sensor, scales),
        start: scaled_start(&scales),
        noise,
    }
}

/// The scanner at irregular intervals of 0.1 to 1.9 µs.
pub fn irregular_scanner<T: Number, H, const M: usize>(
    (sensor, noise): (H, Covariance<T, M>),
) -> Irregular<ParametricScanner<T>, H, T, 2, M> {
    let model = ContinuousDiscrete::new(SCANNER.map(of), density(), 0.5 * INTERVAL).unwrap();
    Irregular { model, sensor, start: released(), noise }
}

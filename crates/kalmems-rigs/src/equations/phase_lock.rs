//! The phase-locked loop: a constant gain on a sine, whose slopes turn with its phase.

use super::filter_task::under_no_input;
use super::model::EquationModel;
use super::own_device::OwnDevice;
use crate::estimate::{AnyFilter, GainOf, MeanAndCovariance, Never, Sensor, Transition, butterworth};
use kalmems_core::Portable;
use kalmems_core::filter::{Pole, place_poles};
use kalmems_core::riccati::{continuous_riccati, kalman_bucy_gain};
use kalmems_core::update::Policy;
use kalmems_core::{
    Covariance, Ekf, Filter, FilterError, FixedGain, Innovation, Lu, Mat, NoiseDensity, NumericMeasurement,
    NumericProcess, OperatingPoint, StateTransition,
};
use std::f64::consts::TAU;

/// A constant gain on what a sample says of amplitude, phase and rest: δ̂ = G⁻¹·hᵀ·ν with the sample's slopes h by these three and the mean
/// G of h·hᵀ over a cycle, so that its mean is δ and its covariance R·G⁻¹.
///
/// It claims the covariance in which its error settles, which does not follow what is measured.
#[derive(Clone, Copy, Debug)]
struct PhaseLock<const N: usize> {
    lock: FixedGain<f64, N, 3>,
    roles: ToldStates<N>,
    inverse: Mat<f64, 3, 3>,
    transition: Mat<f64, N, N>,
    noise: Covariance<f64, N>,
}

/// The three states that a sample tells, as a measurement.
#[derive(Clone, Copy, Debug)]
struct ToldStates<const N: usize>([usize; 3]);

impl<const N: usize> NumericMeasurement<f64, N, 3> for ToldStates<N> {
    fn expected(&self, x: &[f64; N]) -> [f64; 3] {
        self.0.map(|state| x[state])
    }

    fn linearized(&self, x: &[f64; N]) -> ([f64; 3], Mat<f64, 3, N>) {
        let slopes = Mat::from_fn(|i, j| if self.0[i] == j { 1.0 } else { 0.0 });
        (self.expected(x), slopes)
    }
}

/// How many times faster than the loop the motion has to be at least: what is left of the mean over its cycle turns at twice its
/// frequency, of which the loop then passes a twentieth.
const FASTER: f64 = 10.0;
/// Points of a cycle over which the slopes are taken together.
const POINTS: u32 = 256;

/// What a loop is made for.
pub struct LoopOf {
    /// The states that are amplitude, frequency, phase and rest.
    pub roles: [usize; 4],
    /// The states at the segment's beginning, for which its gain is.
    pub at: Vec<f64>,
    /// Index of the measurement.
    pub measure: usize,
    /// The interval between samples in s.
    pub interval_s: f64,
    /// The variance of a sample.
    pub variance: f64,
}

/// The loop of this gain from a start; why there is none.
pub fn phase_lock(
    (own, model): (&OwnDevice, &EquationModel),
    gain: GainOf,
    start: &MeanAndCovariance,
    of: &LoopOf,
) -> Result<AnyFilter, String> {
    under_no_input(own, (model, &of.at), (of.measure, of.interval_s), |step, sensor| match start.mean.len() {
        4 => PhaseLock::<4>::new(gain, start, (step, sensor), of).map(AnyFilter::this),
        5 => PhaseLock::<5>::new(gain, start, (step, sensor), of).map(AnyFilter::this),
        6 => PhaseLock::<6>::new(gain, start, (step, sensor), of).map(AnyFilter::this),
        states => Err(format!(
            "a phase-locked loop is built for 4 to 6 states, and this would have {states}; use `ekf`"
        )),
    })
}

impl<const N: usize> PhaseLock<N> {
    fn new(
        gain: GainOf,
        start: &MeanAndCovariance,
        (step, sensor): (&dyn Transition, &dyn Sensor),
        of: &LoopOf,
    ) -> Result<Self, String> {
        let numbers =
            |from: &[f64]| -> [f64; N] { std::array::from_fn(|i| from.get(i).copied().unwrap_or(f64::NAN)) };
        let (mean, at) = (numbers(&start.mean), numbers(&of.at));
        let [amplitude, frequency, phase, rest] = of.roles;
        let roles = ToldStates([amplitude, phase, rest]);
        let together = slopes_together(sensor, at, &roles, phase);
        let Some(lu) = Lu::of(&together) else {
            return Err("the signal does not tell amplitude, phase and rest position apart".to_owned());
        };
        let (mut next, mut jacobian) = ([0.0; N], vec![0.0; N * N]);
        step.linearize(&at, &mut next, &mut jacobian);
        let (mut covariance, mut root) = (vec![0.0; N * N], vec![0.0; N * N]);
        step.noise(&mut covariance, &mut root);
        let inverse = lu.inverse();
        let point = OperatingPoint {
            transition: Mat::from_fn(|i, j| jacobian[i * N + j]),
            observation: roles.linearized(&mean).1,
            process_noise: Covariance::from_lower(Mat::from_fn(|i, j| covariance[i * N + j])),
            measurement_noise: Covariance::from_lower(inverse.scaled(of.variance)),
        };
        let motion_hz = at[frequency];
        let lock = match gain {
            GainOf::Settled => FixedGain::steady_state(mean, &point),
            GainOf::Continuous => {
                let gain = continuous(&point, of.interval_s)?;
                FixedGain::from_gain(mean, gain, &point)
            }
            GainOf::Poles(corner) if corner * FASTER > TAU * motion_hz => {
                return Err(format!(
                    "the signal is mixed over cycles of the motion, {motion_hz:.6} Hz, and a loop of {:.6} Hz is not {FASTER} times slower",
                    corner / TAU
                ));
            }
            GainOf::Poles(corner) => {
                FixedGain::from_gain(mean, placed(&point, &roles, (corner, of.interval_s))?, &point)
            }
        };
        let lock = lock.map_err(|why| why.to_string())?;
        Ok(Self { lock, roles, inverse, transition: point.transition, noise: point.process_noise })
    }
}

/// The mean over a cycle of the products of a measurement's slopes by three states.
fn slopes_together<const N: usize>(
    sensor: &dyn Sensor,
    mean: [f64; N],
    roles: &ToldStates<N>,
    phase: usize,
) -> Mat<f64, 3, 3> {
    let mut together = Mat::<f64, 3, 3>::zero();
    for point in 0..POINTS {
        let (mut there, mut slopes) = (mean, [0.0; N]);
        there[phase] = TAU * f64::from(point) / f64::from(POINTS);
        sensor.linearize(&there, &mut slopes);
        let told = roles.0.map(|state| slopes[state]);
        for i in 0..3 {
            for j in 0..3 {
                together.0[i][j] += told[i] * told[j] / f64::from(POINTS);
            }
        }
    }
    together
}

/// The gain of the continuous Kalman filter over an interval h: ∫e^{−A·s} ds·K from 0 to h, on the state that a prediction e^{A·h}
/// follows. A² is 0 of a sine whose amplitude, frequency and rest drift, so that e^{A·h} is I + A·h.
fn continuous<const N: usize>(
    point: &OperatingPoint<f64, N, 3>,
    interval_s: f64,
) -> Result<Mat<f64, N, 3>, String> {
    let identity = Mat::<f64, N, N>::identity();
    let moved = Mat::from_fn(|i, j| point.transition.0[i][j] - identity.0[i][j]);
    let squared = moved.times(&moved);
    if (0..N).any(|i| (0..N).any(|j| squared.0[i][j] != 0.0)) {
        return Err("its rates are not those of a drift; use `steady_state`".to_owned());
    }
    // Samples of a covariance R that are h apart carry what a continuous signal with noise of the density R·h does.
    let noise = NoiseDensity::from_lower(point.measurement_noise.lower_triangle().scaled(interval_s));
    // Of the covariance over an interval the diagonal of states that nothing else moves is the density times the interval.
    let density = NoiseDensity::from_lower(Mat::from_fn(|i, j| {
        let is_moved = (0..N).any(|k| k != i && moved.0[i][k] != 0.0);
        if i == j && !is_moved { point.process_noise.get(i, i) / interval_s } else { 0.0 }
    }));
    let (system, seen) = (moved.scaled(interval_s.recip()), &point.observation);
    let settled = continuous_riccati(&system, seen, &density, &noise).map_err(|why| why.to_string())?;
    let over = Mat::<f64, N, N>::from_fn(|i, j| interval_s * (identity.0[i][j] - 0.5 * moved.0[i][j]));
    Ok(over.times(&kalman_bucy_gain(&settled, seen, &noise)))
}

/// The gain with these poles: amplitude with its rate, phase with the frequency, and rest position are a loop each, of second order where
/// another state moves it.
fn placed<const N: usize>(
    point: &OperatingPoint<f64, N, 3>,
    roles: &ToldStates<N>,
    (corner, interval_s): (f64, f64),
) -> Result<Mat<f64, N, 3>, String> {
    let poles: Vec<Pole<f64>> = butterworth(2, corner).map(|pole| pole.sampled(interval_s)).collect();
    let mut gain = Mat::<f64, N, 3>::zero();
    for (seen, state) in roles.0.into_iter().enumerate() {
        let Some(rate) = (0..N).find(|rate| *rate != state && point.transition.0[state][*rate] != 0.0) else {
            gain.0[state][seen] = 1.0 - (-corner * interval_s).portable_exp();
            continue;
        };
        let transition = Mat([[1.0, point.transition.0[state][rate]], [0.0, 1.0]]);
        let placed = place_poles(&transition, &Mat([[1.0, 0.0]]), &poles).map_err(|why| why.to_string())?;
        let lu = Lu::of(&transition).ok_or("the step has no inverse")?;
        let Mat([[of_state], [of_rate]]) = lu.solve(&placed.gain);
        (gain.0[state][seen], gain.0[rate][seen]) = (of_state, of_rate);
    }
    Ok(gain)
}

impl<const N: usize> Filter<f64, N> for PhaseLock<N> {
    fn mean(&self) -> &[f64; N] {
        self.lock.mean()
    }

    fn covariance(&self) -> Covariance<f64, N> {
        *self.lock.filtered_covariance()
    }

    fn predict_linked<P: NumericProcess<f64, N>>(
        &mut self,
        process: &P,
        u: &P::Input,
    ) -> Result<StateTransition<f64, N>, FilterError> {
        self.lock.predict(process, u)?;
        Ok(StateTransition { transition: self.transition, noise: self.noise })
    }

    fn update_where<H: NumericMeasurement<f64, N, M>, const M: usize>(
        &mut self,
        measurement: &H,
        y: &[f64; M],
        r: &Covariance<f64, M>,
        _: &impl Policy<f64, N>,
    ) -> Result<Innovation<f64, M>, FilterError> {
        const { assert!(M == 1, "a sample is one number") };
        let claimed = Ekf::new(*self.lock.mean(), *self.lock.predicted_covariance());
        let mut innovation = { claimed }.update_where(measurement, y, r, &Never)?;
        let mean = self.lock.mean();
        let (expected, slopes) = measurement.linearized(mean);
        let residual = y[0] - expected[0];
        let told = Mat(self.roles.0.map(|state| [slopes.0[0][state] * residual]));
        let off = self.inverse.times(&told);
        let seen = std::array::from_fn(|i| mean[self.roles.0[i]] + off.0[i][0]);
        self.lock.update(&self.roles, &seen)?;
        innovation.taken = true;
        Ok(innovation)
    }
}

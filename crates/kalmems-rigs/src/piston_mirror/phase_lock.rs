//! The phase-locked loop as a filter of the loop that serves all.

use super::phasor::{Drifting, Phasor};
use super::plates::COEFFICIENTS;
use crate::estimate::{GainOf, Never, butterworth};
use kalmems_core::Portable;
use kalmems_core::filter::{Pole, place_poles};
use kalmems_core::riccati::{continuous_riccati, kalman_bucy_gain};
use kalmems_core::update::Policy;
use kalmems_core::{
    Covariance, Ekf, Filter, FilterError, FixedGain, Innovation, Lu, Mat, NoiseDensity, NumericMeasurement,
    NumericProcess, OperatingPoint, StateTransition,
};
use kalmems_models::readout::PhasorDetector;
use std::f64::consts::TAU;

/// A constant gain on the mixed signal; see [`PhasorDetector`].
///
/// It claims the covariance in which its error settles, which does not follow what is measured.
#[derive(Clone, Copy, Debug)]
pub struct PhaseLock {
    lock: FixedGain<f64, 5, 3>,
    detector: PhasorDetector<f64, COEFFICIENTS>,
    transition: Mat<f64, 5, 5>,
    noise: Covariance<f64, 5>,
}

/// How many times faster than the loop the motion has to be at least: what is left of the mean over its cycle turns at twice its
/// frequency, of which the loop then passes a twentieth.
const FASTER: f64 = 10.0;

impl PhaseLock {
    /// The loop for a motion at `mean`, from there, for samples of this interval in s and with this noise in F².
    pub fn new(
        detector: PhasorDetector<f64, COEFFICIENTS>,
        drifting: &Drifting,
        gain: GainOf,
        mean: [f64; 5],
        (interval_s, noise_variance): (f64, f64),
    ) -> Result<Self, String> {
        let point = detector.operating_point(&drifting.over(interval_s), &mean, noise_variance);
        let lock = match gain {
            GainOf::Settled => FixedGain::steady_state(mean, &point),
            GainOf::Continuous => {
                let gain = continuous(&point, &drifting.density, interval_s)?;
                FixedGain::from_gain(mean, gain, &point)
            }
            GainOf::Poles(corner) if corner * FASTER > TAU * mean[1] => {
                return Err(format!(
                    "the signal is mixed over cycles of the motion, {:.6} Hz, and a loop of {:.6} Hz is not {FASTER} times slower",
                    mean[1],
                    corner / TAU
                ));
            }
            GainOf::Poles(corner) => FixedGain::from_gain(mean, placed(&point, corner, interval_s)?, &point),
        };
        let lock = lock.map_err(|why| why.to_string())?;
        Ok(Self { lock, detector, transition: point.transition, noise: point.process_noise })
    }
}

/// The gain of the continuous Kalman filter over an interval h: ∫e^{−A·s} ds·K from 0 to h, on the state that a prediction e^{A·h}
/// follows. A² is 0, so that e^{A·h} is I + A·h.
fn continuous(
    point: &OperatingPoint<f64, 5, 3>,
    density: &NoiseDensity<f64, 5>,
    interval_s: f64,
) -> Result<Mat<f64, 5, 3>, String> {
    let identity = Mat::<f64, 5, 5>::identity();
    let moved = Mat::from_fn(|i, j| point.transition.0[i][j] - identity.0[i][j]);
    // Samples of a covariance R that are h apart carry what a continuous signal with noise of the density R·h does.
    let noise = NoiseDensity::from_lower(point.measurement_noise.lower_triangle().scaled(interval_s));
    let (system, seen) = (moved.scaled(interval_s.recip()), &point.observation);
    let settled = continuous_riccati(&system, seen, density, &noise).map_err(|why| why.to_string())?;
    let over = Mat::<f64, 5, 5>::from_fn(|i, j| interval_s * (identity.0[i][j] - 0.5 * moved.0[i][j]));
    Ok(over.times(&kalman_bucy_gain(&settled, seen, &noise)))
}

/// The gain with these poles. The mixed signal less what is expected is G·[δA, δφ, δd₀]; by G⁻¹ it is taken apart, so that
/// amplitude with its rate, phase with the frequency, and rest position are a loop each.
fn placed(point: &OperatingPoint<f64, 5, 3>, corner: f64, interval_s: f64) -> Result<Mat<f64, 5, 3>, String> {
    let mixed = Mat::<f64, 3, 3>::from_fn(|i, j| point.observation.0[i][[0, 2, 3][j]]);
    let apart = Lu::of(&mixed).ok_or("the signal does not tell amplitude, phase and rest position apart")?;
    let poles: Vec<Pole<f64>> = butterworth(2, corner).map(|pole| pole.sampled(interval_s)).collect();
    let mut gain = Mat::<f64, 5, 3>::zero();
    for (seen, [state, rate]) in [[0, 4], [2, 1]].into_iter().enumerate() {
        let transition = Mat([[1.0, point.transition.0[state][rate]], [0.0, 1.0]]);
        let placed = place_poles(&transition, &Mat([[1.0, 0.0]]), &poles).map_err(|why| why.to_string())?;
        let lu = Lu::of(&transition).ok_or("the step has no inverse")?;
        let Mat([[of_state], [of_rate]]) = lu.solve(&placed.gain);
        (gain.0[state][seen], gain.0[rate][seen]) = (of_state, of_rate);
    }
    gain.0[3][2] = 1.0 - (-corner * interval_s).portable_exp();
    Ok(gain.times(&apart.inverse()))
}

impl Filter<f64, 5> for PhaseLock {
    fn mean(&self) -> &[f64; 5] {
        self.lock.mean()
    }

    fn covariance(&self) -> Covariance<f64, 5> {
        *self.lock.filtered_covariance()
    }

    fn predict_linked<P: NumericProcess<f64, 5>>(
        &mut self,
        process: &P,
        u: &P::Input,
    ) -> Result<StateTransition<f64, 5>, FilterError> {
        self.lock.predict(process, u)?;
        Ok(StateTransition { transition: self.transition, noise: self.noise, taken: true })
    }

    fn update_where<H: NumericMeasurement<f64, 5, M>, const M: usize>(
        &mut self,
        measurement: &H,
        y: &[f64; M],
        r: &Covariance<f64, M>,
        _: &impl Policy<f64, 5>,
    ) -> Result<Innovation<f64, M>, FilterError> {
        const { assert!(M == 1, "the detector mixes one number") };
        let claimed = Ekf::new(*self.lock.mean(), *self.lock.predicted_covariance());
        let mut innovation = { claimed }.update_where(measurement, y, r, &Never)?;
        let [value, ..] = y[..] else { return Err(FilterError::NonFiniteMeasurement) };
        let mixed = self.detector.mixed(self.lock.mean(), value);
        self.lock.update(&self.detector, &mixed)?;
        innovation.taken = true;
        Ok(innovation)
    }
}

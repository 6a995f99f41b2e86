//! What a phase-locked loop compares: the signal, mixed with the slopes of what is expected.

use crate::capacitance::DistanceSeries;
use kalmems_core::{Covariance, Mat, Measurement, OperatingPoint, Over, Process, Scalar};
use kalmems_macros::{Parameters, model};

/// z = w(x)·y, with w = C′(d)·[cos φ, −A·sin φ, 1] for [A, φ, d₀], on the states [A, f, φ, d₀, Ȧ] of
/// [`DriftingPhasor`](crate::dynamics::DriftingPhasor).
///
/// The slope of the capacitance turns with the phase, so that no constant gain K fits it. Mixed with w the signal does
/// not turn: z − w·C(d) = w·wᵀ·[δA, δφ, δd₀] + w·v, with the mean G over a cycle in place of w·wᵀ, and noise of the
/// covariance R·G. That is a system with constant matrices, [`operating_point`](Self::operating_point), and the
/// [`FixedGain`](kalmems_core::FixedGain) in which its Kalman filter settles is a phase-locked loop: w₂ is the phase
/// detector, K's entries for φ and f its proportional and integral gain, the process the oscillator; beside it stand
/// a loop for the amplitude with its rate, and one for the rest position. Per sample it takes a sine, a cosine, a
/// reciprocal and 15 products for the correction, and no covariance.
///
/// Right where the loop is much slower than the motion; the error of the mean is then at twice the motion's frequency,
/// which the loop does not follow. The extended filter needs no such mean.
///
/// ```
/// use kalmems_core::{FixedGain, NoiseDensity};
/// use kalmems_models::{capacitance::DistanceSeries, dynamics::DriftingPhasor, readout::PhasorDetector};
/// let detector =
///     PhasorDetector { series: DistanceSeries { reference_distance: 1e-3, coefficients: [0.0, 109.3e-15] } };
/// let density = NoiseDensity::none().on::<1>(1e-8).on::<3>(1e-19).on::<4>(1e-14);
/// let process = DriftingPhasor::new(5e-5, &density);
/// let start = [0.5e-3, 500.0, 0.7, 1e-3, 0.0];
/// // 0.151 aF/√Hz at 20 kHz.
/// let point = detector.operating_point(&process, &start, 2.28e-34);
/// let mut lock = FixedGain::<f64, 5, 3>::steady_state(start, &point)?;
/// let y = detector.series.capacitance(1e-3 + 0.5e-3 * 0.7_f64.cos());
/// lock.update(&detector, &detector.mixed(lock.mean(), y))?;
/// assert!((lock.mean()[2] - 0.7).abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
pub struct PhasorDetector<P, const K: usize> {
    /// C(d).
    pub series: DistanceSeries<P, K>,
}

/// Points of a cycle over which the mean is taken; what it leaves falls exponentially with them.
const POINTS: u32 = 64;

#[model]
impl<T: Scalar, const K: usize> PhasorDetector<T, K> {
    /// w·y, from the state before the correction and the capacitance in F.
    pub fn mixed(&self, x: &[T; 5], y: T) -> [T; 3] {
        let (weights, _) = self.weights(x);
        [weights[0] * y, weights[1] * y, weights[2] * y]
    }

    /// w and C(d).
    fn weights<S: Over<T>>(&self, x: &[S; 5]) -> ([S; 3], S) {
        let (c, s) = (x[2].cos(), x[2].sin());
        let distance = x[0] * c + x[3];
        let slope = self.series.slope(distance);
        ([slope * c, -(slope * x[0] * s), slope], self.series.capacitance(distance))
    }

    /// The system that the mixed signal makes: with G·E for H and R·G for the noise, where E takes A, φ and d₀ out of the
    /// state and G is the mean of w·wᵀ over a cycle of the motion at `x`; `noise_variance` is R in F².
    ///
    /// The information of one sample, HᵀR⁻¹H = EᵀGE/R, is the mean of that of the signal itself.
    pub fn operating_point<P: Process<T, 5, Input = T>>(
        &self,
        process: &P,
        x: &[T; 5],
        noise_variance: T,
    ) -> OperatingPoint<T, 5, 3> {
        let mut mean = Mat::<T, 3, 3>::zero();
        for point in 0..POINTS {
            let mut there = *x;
            there[2] = T::of(core::f64::consts::TAU * f64::from(point) / f64::from(POINTS));
            let (w, _) = self.weights(&there);
            for i in 0..3 {
                for j in 0..3 {
                    mean.0[i][j] = mean.0[i][j] + w[i] * w[j] * T::of(1.0 / f64::from(POINTS));
                }
            }
        }
        let mut observation = Mat::<T, 3, 5>::zero();
        for i in 0..3 {
            for (j, state) in [0, 2, 3].into_iter().enumerate() {
                observation.0[i][state] = mean.0[i][j];
            }
        }
        OperatingPoint {
            transition: process.linearize(x, &T::of(0.0)).1,
            observation,
            process_noise: *process.noise().covariance(),
            measurement_noise: Covariance::from_lower(mean.scaled(noise_variance)),
        }
    }
}

#[model]
impl<T: Scalar, const K: usize> Measurement<T, 5, 3> for PhasorDetector<T, K> {
    fn predict<S: Over<T>>(&self, x: &[S; 5]) -> [S; 3] {
        let (weights, capacitance) = self.weights(x);
        [weights[0] * capacitance, weights[1] * capacitance, weights[2] * capacitance]
    }
}

//! Amplitude and phase of an estimated motion.

use super::Complex;
use kalmems_core::{Covariance, Scalar};

/// Where in its cycle a motion is: θ = A·cos β, θ̇ = −A·ω·sin β, with the standard deviations that a filter claims for A
/// and β.
///
/// What an image or a spectrum needs beside the angle: which point of the scan is being looked at, sample by sample. A
/// and β are those of one state; where a motion has harmonics they swing a little within each cycle, as the state does.
///
/// ```
/// use kalmems_core::Covariance;
/// use kalmems_models::control::MotionPhase;
/// let covariance = Covariance::from_standard_deviations([1e-4, 10.0]);
/// // At rest on its far side: half a cycle from the maximum.
/// let there = MotionPhase::of(&[-0.1_f64, 0.0], &covariance, 1e5);
/// assert!((there.phase.abs() - core::f64::consts::PI).abs() < 1e-12 && (there.amplitude - 0.1).abs() < 1e-15);
/// // An angle uncertain by 1e-4 is one of the amplitude there, a rate by 10 rad/s one of the phase.
/// assert!((there.amplitude_sd / 1e-4 - 1.0).abs() < 1e-9 && (there.phase_sd / 1e-3 - 1.0).abs() < 1e-9);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionPhase<P> {
    /// A in the unit of the first state.
    pub amplitude: P,
    /// Its standard deviation.
    pub amplitude_sd: P,
    /// β in rad, from −π to π: 0 where the first state is largest.
    pub phase: P,
    /// Its standard deviation in rad.
    pub phase_sd: P,
}

impl<P: Scalar> MotionPhase<P> {
    /// Of a filter's mean and covariance, whose first states are the angle and its rate, at the rate ω in rad/s of the
    /// motion.
    ///
    /// σ_A² = gᵀPg with g = [cos β, −sin β/ω], and σ_β² with g = −[sin β, cos β/ω]/A.
    pub fn of<const N: usize>(mean: &[P; N], covariance: &Covariance<P, N>, rate: P) -> Self {
        const { assert!(N >= 2, "the first states are the angle and its rate") };
        let z = Complex { re: mean[0], im: -(mean[1] / rate) };
        let (amplitude, phase) = (z.size(), z.angle());
        let (cosine, sine) = (phase.cos(), phase.sin());
        Self {
            amplitude,
            amplitude_sd: deviation(covariance, cosine, -(sine / rate)),
            phase,
            phase_sd: deviation(covariance, sine, cosine / rate) / amplitude,
        }
    }
}

/// The standard deviation of so much of the angle and so much of the rate.
fn deviation<P: Scalar, const N: usize>(covariance: &Covariance<P, N>, of_angle: P, of_rate: P) -> P {
    let cross = covariance.get(1, 0) * of_angle * of_rate;
    (covariance.get(0, 0) * of_angle.sq() + cross.twice() + covariance.get(1, 1) * of_rate.sq()).sqrt()
}

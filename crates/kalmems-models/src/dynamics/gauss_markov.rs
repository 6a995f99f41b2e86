//! A quantity that is known by its size and its bandwidth alone.

use kalmems_core::{Over, Scalar};
use kalmems_macros::{Parameters, model};

/// ä + 2·ζ·ω·ȧ + ω²·a = w: a second-order Gauss–Markov process, white noise behind a resonant low-pass (Gelb, Applied
/// Optimal Estimation, 1974, section 3.8; there with ζ = 1).
///
/// With a density q = 4·ζ·ω³·σ² of w the process has the standard deviation σ, and its rate has ω·σ.
///
/// ```
/// use kalmems_models::dynamics::GaussMarkov;
/// let prior = GaussMarkov { rms: 2.0_f64, rate: 10.0, damping_ratio: 0.5 };
/// assert_eq!(prior.density(), 8000.0);
/// assert_eq!(prior.derivative(3.0, 1.0), [1.0, -310.0]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
pub struct GaussMarkov<P> {
    /// σ in the quantity's unit.
    pub rms: P,
    /// ω in rad/s. Positive.
    pub rate: P,
    /// ζ. Positive.
    pub damping_ratio: P,
}

#[model]
impl<P: Scalar> GaussMarkov<P> {
    /// [ȧ, ä] without the noise.
    pub fn derivative<S: Over<P>>(&self, value: S, slope: S) -> [S; 2] {
        [slope, -(value * self.rate.sq() + slope * (self.damping_ratio * self.rate).twice())]
    }

    /// q: the two-sided density of w, in the quantity's unit²/s³.
    pub fn density(&self) -> P {
        self.damping_ratio * P::of(4.0) * self.rate.sq() * self.rate * self.rms.sq()
    }

    /// The one-sided power density at a rate in rad/s, in the quantity's unit²/Hz: 2·q/|(jΩ)² + 2ζω·jΩ + ω²|².
    pub fn spectrum(&self, rate: P) -> P {
        let (re, im) = (self.rate.sq() - rate.sq(), (self.damping_ratio * self.rate * rate).twice());
        self.density().twice() / (re.sq() + im.sq())
    }
}

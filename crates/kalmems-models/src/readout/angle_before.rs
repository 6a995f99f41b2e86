//! The angle a short time ago.

use crate::dynamics::TorsionalResonator;
use kalmems_core::{Over, Scalar};
use kalmems_macros::{Parameters, model};

/// θ(t − τ) from the motion at t: θ − s·θ̇ + c·θ̈ with s = sin(ω₀τ)/ω₀ in s and c = (1 − cos ω₀τ)/ω₀² in s².
///
/// What a constant delay of a readout needs: without stages behind it y(t) is read from θ(t − τ), and a delay
/// commutes with linear stages, so that it can stand before them. The formula is Taylor's series as far as
/// the law of motion gives derivatives, with the rest as if the motion were harmonic at ω₀: exact for that,
/// and for any motion but for τ³·(θ⃛ + ω₀²θ̇)/6. Of the scanner of Chen et al. (shared electrodes, 2020),
/// whose electrodes modulate its stiffness by 2 %, that is 10⁻⁵ of the amplitude at 1.2 µs. White noise of
/// the acceleration over τ, of density q, is left out: q·τ³/3 in θ².
///
/// ```
/// use kalmems_models::dynamics::TorsionalResonator;
/// use kalmems_models::readout::AngleBefore;
/// let resonator = TorsionalResonator { inertia: 1.15e-14, damping: 0.0, stiffness: 1.10e-4 };
/// let (rate, delay) = (resonator.natural_rate(), 1.2e-6);
/// let at = |t: f64| 0.1 * (rate * t).sin();
/// let [angle, speed, acceleration] = [at(3e-6), 0.1 * rate * (rate * 3e-6_f64).cos(), -rate * rate * at(3e-6)];
/// let before = AngleBefore::of(delay, &resonator).angle(angle, speed, acceleration);
/// assert!((before - at(3e-6 - delay)).abs() < 1e-15);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
pub struct AngleBefore<P> {
    /// s in s.
    pub by_rate: P,
    /// c in s².
    pub by_acceleration: P,
}

#[model]
impl<P: Scalar> AngleBefore<P> {
    /// At once: the angle as it is.
    pub fn none() -> Self {
        Self { by_rate: P::of(0.0), by_acceleration: P::of(0.0) }
    }

    /// `delay` in s ago, for a device with this resonator.
    pub fn of(delay: P, resonator: &TorsionalResonator<P>) -> Self {
        let rate = resonator.natural_rate();
        // 1 − cos x without its cancellation.
        let half = (rate * delay).half();
        let chord = half.sin() / rate.half();
        Self { by_rate: (rate * delay).sin() / rate, by_acceleration: chord.sq().half() }
    }

    /// Whether there is no delay.
    pub fn is_none(&self) -> bool {
        !self.by_rate.abs().gt(P::of(0.0))
    }

    /// θ(t − τ) in rad from θ, θ̇ and θ̈ at t.
    pub fn angle<S: Over<P>>(&self, angle: S, rate: S, acceleration: S) -> S {
        angle - rate * self.by_rate + acceleration * self.by_acceleration
    }
}

//! The physics, once: generic over the number, so that dual numbers give its Jacobian.

use kalmems_core::{Dynamics, Measurement, Over, Scalar};
use kalmems_macros::{Parameters, model};

/// ẍ + 2ζ·ω₀·ẋ + ω₀²·(x + h·x³ − c·V²) = 0 and v̇ = p·(g·x − v); states [x, ẋ, v], input V.
///
/// The force of a comb grows with the square of the voltage and, over the overlap of its fingers, does not depend on x. The
/// spring hardens for h > 0: a free motion of amplitude A has about ω² = ω₀²·(1 + ¾·h·A²).
#[derive(Clone, Copy, Debug, Parameters)]
pub struct CombResonator<P> {
    /// ω₀ in rad/s.
    pub rate: P,
    /// ζ.
    pub damping_ratio: P,
    /// h in 1/m².
    pub hardening: P,
    /// c in m/V².
    pub per_square_volt: P,
    /// g in V/m.
    pub gain: P,
    /// p in 1/s.
    pub pole: P,
}

#[model(parametric)]
impl<T: Scalar> Dynamics<T, 3> for CombResonator<T> {
    type Input = T;

    fn derivative<S: Over<T>>(&self, x: &[S; 3], volts: &T) -> [S; 3] {
        let spring = x[0] * (x[0].sq() * self.hardening + T::of(1.0)) - self.per_square_volt * volts.sq();
        let acceleration = -(spring * self.rate + x[1] * self.damping_ratio.twice()) * self.rate;
        [x[1], acceleration, (x[0] * self.gain - x[2]) * self.pole]
    }
}

/// The recorded signal: v.
#[derive(Clone, Copy, Debug, Parameters)]
pub struct Output<P> {
    /// What is added to it, in V.
    pub offset: P,
}

#[model(parametric)]
impl<T: Scalar> Measurement<T, 3, 1> for Output<T> {
    fn predict<S: Over<T>>(&self, x: &[S; 3]) -> [S; 1] {
        [x[2] + self.offset]
    }

    fn depends(_: usize, state: usize) -> bool {
        state == 2
    }
}

//! A resonator whose spring hardens or softens with the deflection.

use kalmems_core::{Dynamics, Over, Scalar};
use kalmems_macros::{Parameters, model};

/// ẍ + d·ẋ + ω₀²·x + a₃·x³ = g·u: Duffing's equation, everything divided by the mass; states [x, ẋ], input u.
///
/// x is a deflection in whatever unit it is measured in, called X here: m, rad, or V behind a readout. U is the
/// unit of u. For a₃ > 0 the spring hardens, for a₃ < 0 it softens: a free oscillation of amplitude A has about
/// ω² = ω₀² + ¾·a₃·A². With u also x changes its sign.
///
/// The suspension of many MEMS resonators follows it at large amplitudes, and so does the electronic circuit of
/// the Silverbox benchmark (Wigren and Schoukens, Three free data sets for development and benchmarking in
/// nonlinear system identification, European Control Conference 2013), where x is a voltage.
///
/// ```
/// use kalmems_core::Dynamics;
/// use kalmems_models::dynamics::Duffing;
/// let circuit = Duffing { damping: 42.0_f64, stiffness: 1.84e5, cubic: 7.3e5, gain: 1.86e5 };
/// // At rest under a constant input, the spring takes up what the input gives.
/// let u = (1.84e5 * 0.2 + 7.3e5 * 0.008) / 1.86e5;
/// let [rate, acceleration] = circuit.derivative(&[0.2, 0.0], &u);
/// assert!(rate == 0.0 && acceleration.abs() < 1e-10);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
pub struct Duffing<P> {
    /// d in 1/s: the damping over the mass.
    pub damping: P,
    /// ω₀² in 1/s²: the stiffness at rest over the mass.
    pub stiffness: P,
    /// a₃ in 1/(s²·X²): the cubic stiffness over the mass.
    pub cubic: P,
    /// g in X/(s²·U): what one unit of the input accelerates.
    pub gain: P,
}

#[model]
impl<P: Scalar> Duffing<P> {
    /// ẍ in X/s², with x in X, ẋ in X/s and u in U.
    pub fn acceleration<S: Over<P>>(&self, deflection: S, rate: S, input: P) -> S {
        let per_deflection = deflection.sq() * self.cubic + self.stiffness;
        -(deflection * per_deflection + rate * self.damping) + self.gain * input
    }

    /// ½·ẋ² + ½·ω₀²·x² + ¼·a₃·x⁴ in X²/s²: the energy over the mass.
    pub fn energy(&self, deflection: P, rate: P) -> P {
        let square = deflection.sq();
        (rate.sq() + square * (self.stiffness + (self.cubic * square).half())).half()
    }
}

#[model(parametric)]
impl<T: Scalar> Dynamics<T, 2> for Duffing<T> {
    type Input = T;

    fn bends(i: usize) -> bool {
        i != 0
    }

    fn derivative<S: Over<T>>(&self, x: &[S; 2], input: &T) -> [S; 2] {
        [x[1], self.acceleration(x[0], x[1], *input)]
    }
}

//! The low-pass filters behind a demodulator.

use kalmems_core::{Dynamics, Measurement, Over, Scalar};
use kalmems_macros::{Parameters, model};

/// ẋ₁ = ω·(u − x₁), ẋ₂ = ω·(x₁ − x₂): two equal real poles with a gain of one at rest, states [x₁, x₂] and input in
/// one unit.
///
/// An envelope detector and the stage after it have nearly one cut-off (Chen et al., shared electrodes, 2020, Table I:
/// 41.1 and 40.8 kHz), and two poles near each other act as two at their geometric mean.
///
/// ```
/// use kalmems_core::Dynamics;
/// use kalmems_models::readout::LowPassPair;
/// assert_eq!(LowPassPair { rate: 2.0 }.derivative(&[1.0, 4.0], &5.0), [8.0, -6.0]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
pub struct LowPassPair<P> {
    /// ω in rad/s.
    pub rate: P,
}

#[model(parametric)]
impl<T: Scalar> Dynamics<T, 2> for LowPassPair<T> {
    type Input = T;

    fn derivative<S: Over<T>>(&self, x: &[S; 2], input: &T) -> [S; 2] {
        [(S::lift(*input) - x[0]) * self.rate, (x[0] - x[1]) * self.rate]
    }
}

/// y = a·x₂ + b: what a [`LowPassPair`] passes on, scaled.
///
/// ```
/// use kalmems_core::Measurement;
/// use kalmems_models::readout::LowPassOutput;
/// assert_eq!(LowPassOutput { gain: -2.0, offset: 1.0 }.predict(&[9.0, 3.0]), [-5.0]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
pub struct LowPassOutput<P> {
    /// a in units of y per unit of x.
    pub gain: P,
    /// b in units of y.
    pub offset: P,
}

#[model(parametric)]
impl<T: Scalar> Measurement<T, 2, 1> for LowPassOutput<T> {
    fn predict<S: Over<T>>(&self, x: &[S; 2]) -> [S; 1] {
        [x[1] * self.gain + self.offset]
    }

    fn depends(_: usize, state: usize) -> bool {
        state == 1
    }
}

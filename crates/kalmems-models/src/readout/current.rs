//! The current of a comb under constant bias, as a voltage.

use crate::capacitance::CombCurve;
use kalmems_core::{Measurement, Over, Scalar};
use kalmems_macros::{Parameters, model};

/// y = h(θ)·θ̇ + y₀ in V, on states that begin with [θ, θ̇] (Chen, dissertation, 2018, equation 71).
///
/// Its derivative by the state is [h′(θ)·θ̇, h(θ)]; the paper's Table 4.1 prints [0, h(θ)].
///
/// ```
/// use kalmems_core::Measurement;
/// use kalmems_models::capacitance::{CombCurve, CurveShape};
/// use kalmems_models::readout::CurrentReadout;
/// let comb = CombCurve { centre: 0.0, gain: 2.82e-3, steepness: 76.0, shape: CurveShape::Logistic };
/// let readout = CurrentReadout { comb, offset: 1e-3 };
/// let ([volts], h) = readout.linearize(&[0.0_f64, 500.0]);
/// assert_eq!((volts, h[(0, 1)]), (1e-3, 0.0));
/// assert!((h[(0, 0)] - 2.82e-3 * 76.0 / 4.0 * 500.0).abs() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
pub struct CurrentReadout<P> {
    /// The comb.
    pub comb: CombCurve<P>,
    /// y₀ in V.
    pub offset: P,
}

#[model(parametric)]
impl<T: Scalar, const N: usize> Measurement<T, N, 1> for CurrentReadout<T> {
    fn predict<S: Over<T>>(&self, x: &[S; N]) -> [S; 1] {
        const { assert!(N >= 2, "the first states are the angle and its rate") };
        [self.comb.sensitivity(x[0]) * x[1] + self.offset]
    }

    fn depends(_: usize, state: usize) -> bool {
        state < 2
    }
}

//! The current of a biased capacitance.

use crate::capacitance::GaussianComb;
use kalmems_core::{Measurement, Over, Scalar};
use kalmems_macros::{Parameters, model};

/// V_o1 = R_f·V·dC/dt + y₀ = R_f·V·C′(θ)·θ̇ + y₀ in V, and the angle θ + y₁ in rad that another instrument shows; on
/// states that begin with [θ, θ̇].
///
/// What a transimpedance stage makes of electrodes under a constant voltage (Chen et al., shared electrodes, 2020,
/// equation 19 with dV/dt = 0). What does not move has no current: C_b does not enter. θ → −θ leaves the voltage
/// as it is.
///
/// ```
/// use kalmems_core::Measurement;
/// use kalmems_models::{capacitance::GaussianComb, readout::BiasedComb};
/// let comb = GaussianComb { nominal: 5.71e-12, angular_width: 0.2, bias: 9.79e-12 };
/// let readout = BiasedComb { comb, gain: 17.86e3 * 23.76, offset: 1e-3, angle_offset: 0.0 };
/// let [volts, angle] = readout.predict(&[0.1_f64, 2e3]);
/// assert!((volts - (17.86e3 * 23.76 * comb.slope(0.1) * 2e3 + 1e-3)).abs() < 1e-15);
/// assert_eq!(angle, 0.1);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
pub struct BiasedComb<P> {
    /// The electrodes.
    pub comb: GaussianComb<P>,
    /// R_f·V in Ω·V; negative for a stage that inverts.
    pub gain: P,
    /// y₀ in V.
    pub offset: P,
    /// y₁ in rad.
    pub angle_offset: P,
}

#[model(parametric)]
impl<T: Scalar, const N: usize> Measurement<T, N, 2> for BiasedComb<T> {
    fn predict<S: Over<T>>(&self, x: &[S; N]) -> [S; 2] {
        const { assert!(N >= 2, "the first states are the angle and its rate") };
        let per_second = self.comb.slope(x[0]) * x[1];
        [per_second * self.gain + self.offset, x[0] + self.angle_offset]
    }

    fn depends(output: usize, state: usize) -> bool {
        state == 0 || (output == 0 && state == 1)
    }
}

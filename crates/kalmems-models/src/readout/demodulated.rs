//! A carrier through the capacitance, demodulated.

use super::first_state::of_first_state;
use crate::capacitance::GaussianComb;
use kalmems_core::{Dual, Mat, Measurement, Over, Scalar};
use kalmems_macros::{Parameters, model};

/// y = a·C(θ) + b in V, on states that begin with θ in rad.
///
/// What the demodulated signal of an amplitude-modulated carrier amounts to at frequencies well below the
/// demodulator's poles (Chen et al., shared electrodes, 2020, equations 25 to 27). It is even in θ: the sign of
/// the motion cannot be known from it.
///
/// ```
/// use kalmems_core::Measurement;
/// use kalmems_models::{capacitance::GaussianComb, readout::DemodulatedComb};
/// let readout = DemodulatedComb {
///     comb: GaussianComb { nominal: 5.71e-12, angular_width: 0.2, bias: 9.79e-12 },
///     gain: -0.3574e12,
///     offset: 6.3945,
/// };
/// let [at_rest] = readout.predict(&[0.0_f64, 0.0]);
/// assert!((at_rest - 0.8548).abs() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
pub struct DemodulatedComb<P> {
    /// The electrodes.
    pub comb: GaussianComb<P>,
    /// a in V/F.
    pub gain: P,
    /// b in V.
    pub offset: P,
}

#[model]
impl<T: Scalar> DemodulatedComb<T> {
    /// y in V.
    pub fn voltage<S: Over<T>>(&self, angle: S) -> S {
        S::lift(self.offset).mac_by(self.comb.capacitance(angle), self.gain)
    }
}

of_first_state!(DemodulatedComb, "angle");

//! A detector that multiplies by the carrier.

use kalmems_core::{Over, Scalar};
use kalmems_macros::{Parameters, model};

/// v_out = 2·v·cos(ψ + φ), with ψ the phase of the carrier's cosine and φ that of the reference.
///
/// Of v = A·cos(ψ + δ) a low-pass keeps A·cos(δ − φ): the amplitude itself where the reference is in phase, and
/// nothing a quarter of a cycle away (Chen, dissertation, 2018, Figure 2.2b). It is linear: lines far from the
/// carrier stay far from where the motion comes to lie.
///
/// ```
/// use kalmems_models::circuit::SynchronousDemodulator;
/// assert_eq!(SynchronousDemodulator { phase: 0.0 }.voltage(1.5, 0.0), 3.0);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
pub struct SynchronousDemodulator<P> {
    /// φ in rad.
    pub phase: P,
}

#[model]
impl<P: Scalar> SynchronousDemodulator<P> {
    /// v_out in V, from v in V and the carrier's phase ψ in rad.
    pub fn voltage<S: Over<P>>(&self, v: S, carrier_phase: S) -> S {
        (v * (carrier_phase + self.phase).cos()).twice()
    }
}

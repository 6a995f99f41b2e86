//! An alternating current through the capacitance, its voltage read.

use kalmems_core::{Over, Scalar};
use kalmems_macros::{Parameters, model};

/// |V| = I/(ω·(C + C_p)): linear in a gap, as a voltage source's current is linear in an overlap.
///
/// Chen, dissertation, 2018, equation 3, with what lies in parallel added. It holds while the capacitance hardly
/// changes within a cycle of the source. It needs electrodes that no drive voltage is forced on.
///
/// ```
/// use kalmems_models::circuit::ConstantCurrent;
/// let readout = ConstantCurrent { current: 1e-6, source_rate: 1e6, parasitic_capacitance: 0.0 };
/// assert!((readout.amplitude(0.5e-12_f64) - 2.0).abs() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
pub struct ConstantCurrent<P> {
    /// The amplitude I of the source in A.
    pub current: P,
    /// ω of the source in rad/s.
    pub source_rate: P,
    /// C_p in F: what lies in parallel and does not move.
    pub parasitic_capacitance: P,
}

#[model]
impl<P: Scalar> ConstantCurrent<P> {
    /// The amplitude of the voltage in V over C in F.
    pub fn amplitude<S: Over<P>>(&self, capacitance: S) -> S {
        (capacitance + self.parasitic_capacitance).recip() * (self.current / self.source_rate)
    }
}

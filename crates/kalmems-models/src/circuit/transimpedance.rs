//! The stage that turns the electrodes' current into a voltage.

use kalmems_core::{Over, Scalar};
use kalmems_macros::{Parameters, model};

/// v = R_f·d/dt[(C + C_p)·V] = R_f·(Ċ·V + (C + C_p)·V̇).
///
/// The electrodes hold the charge (C + C_p)·V; the current that changes it flows through the feedback resistor
/// (Chen et al., shared electrodes, 2020, equations 19 and 20). The sign is theirs: an inverting stage has the
/// other one. A real amplifier follows with a pole of its own, [`Section::low_pass`](super::Section::low_pass).
///
/// ```
/// use kalmems_models::circuit::Transimpedance;
/// let stage = Transimpedance { feedback_resistance: 1e4, parasitic_capacitance: 5e-12 };
/// // 15 pF under 1 V/µs carry 15 µA.
/// assert!((stage.voltage(10e-12_f64, 0.0, 3.0, 1e6) - 0.15).abs() < 1e-15);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
pub struct Transimpedance<P> {
    /// R_f in Ω.
    pub feedback_resistance: P,
    /// C_p in F: what lies in parallel with the electrodes and does not move.
    pub parasitic_capacitance: P,
}

#[model]
impl<P: Scalar> Transimpedance<P> {
    /// v in V, from C in F, Ċ in F/s, V in V and V̇ in V/s.
    pub fn voltage<S: Over<P>>(&self, capacitance: S, capacitance_rate: S, voltage: S, voltage_rate: S) -> S {
        let charge_rate =
            capacitance_rate * voltage + (capacitance + self.parasitic_capacitance) * voltage_rate;
        charge_rate * self.feedback_resistance
    }
}

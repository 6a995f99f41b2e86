//! The transistor at the input of an amplifier.

use crate::constants::{BOLTZMANN, ELEMENTARY_CHARGE};
use kalmems_core::Scalar;
use kalmems_macros::{Parameters, model};

/// A MOSFET with a long channel in saturation, and the diode that leaks at its gate (Zhang 2010, Figure 11).
#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
pub struct Mosfet<P> {
    /// γ: 2/3 for a long channel.
    pub thermal_coefficient: P,
    /// µ_n in m²/(V·s).
    pub mobility: P,
    /// C_ox in F/m².
    pub oxide_capacitance: P,
    /// W in m.
    pub width: P,
    /// L in m.
    pub length: P,
    /// I_D in A.
    pub drain_current: P,
    /// K_f in A·F.
    pub flicker_coefficient: P,
    /// I_leak in A.
    pub leakage_current: P,
    /// C_total in F: all that depends on the gate.
    pub gate_node_capacitance: P,
}

impl Mosfet<f64> {
    /// ASSUMED values: the thesis gives none. Those of an n-channel transistor of a 0.5 µm process of its time, of
    /// moderate size, with some picofarads at its gate. Noise that is computed from them says what such a stage could
    /// do, not what the thesis's did.
    pub const ASSUMED: Self = Self {
        thermal_coefficient: 2.0 / 3.0,
        mobility: 0.05,
        oxide_capacitance: 3.8e-3,
        width: 200e-6,
        length: 0.6e-6,
        drain_current: 100e-6,
        flicker_coefficient: 2e-28,
        leakage_current: 1e-12,
        gate_node_capacitance: 2e-12,
    };
}

#[model]
impl<P: Scalar> Mosfet<P> {
    /// g_m = √(2·µ_n·C_ox·(W/L)·I_D) in S.
    pub fn transconductance(&self) -> P {
        (self.mobility * self.oxide_capacitance * (self.width / self.length) * self.drain_current)
            .twice()
            .sqrt()
    }

    /// 4·γ·k_B·T/g_m in V²/Hz at the gate, with T in K (equation 3-7).
    pub fn thermal(&self, temperature: P) -> P {
        self.thermal_coefficient * temperature * P::of(4.0 * BOLTZMANN) / self.transconductance()
    }

    /// K_f/(2·µ_n·C_ox²·W·L·f) in V²/Hz at the gate, with f in Hz (equation 3-8).
    pub fn flicker(&self, frequency: P) -> P {
        let face = self.width * self.length * self.oxide_capacitance.sq();
        self.flicker_coefficient / (self.mobility * face * frequency).twice()
    }

    /// 2·q·I_leak/(2π·f·C_total)² in V²/Hz at the gate (equation 3-9, whose numerator has lost the 2).
    pub fn leakage(&self, frequency: P) -> P {
        let admittance = frequency * self.gate_node_capacitance * P::of(core::f64::consts::TAU);
        self.leakage_current * P::of(2.0 * ELEMENTARY_CHARGE) / admittance.sq()
    }

    /// All three (equation 3-10), in V²/Hz.
    pub fn total(&self, frequency: P, temperature: P) -> P {
        self.thermal(temperature) + self.flicker(frequency) + self.leakage(frequency)
    }
}

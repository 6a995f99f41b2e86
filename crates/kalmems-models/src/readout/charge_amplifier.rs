//! The amplifier that makes a voltage of a differential capacitance.

use super::first_state::of_first_state;
use crate::capacitance::DifferentialPlates;
use kalmems_core::{Dual, Mat, Measurement, Over, Scalar};
use kalmems_macros::{Parameters, model};

/// y = V₁·(C₁ − C₂)/C₄ = 2·ε·A·V₁/(C₄·d₀²)·x/(1 − (x/d₀)²) in V, on states that begin with x in m (Zhang 2010,
/// equations 2-7 and 2-9).
///
/// The amplitude of the carrier behind the charge amplifier, demodulated in phase; the amplifier's minus is the
/// demodulator's affair.
#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
pub struct DifferentialReadout<P> {
    /// The capacitors.
    pub plates: DifferentialPlates<P>,
    /// V₁ in V: the carrier's amplitude.
    pub carrier_amplitude: P,
    /// C₄ in F.
    pub feedback_capacitance: P,
}

#[model]
impl<P: Scalar> DifferentialReadout<P> {
    /// dy/dx = 2·ε·A·V₁/(C₄·d₀²) in V/m at rest (equation 2-10).
    pub fn sensitivity(&self) -> P {
        let plates = &self.plates;
        (plates.permittivity * plates.area * self.carrier_amplitude).twice()
            / (self.feedback_capacitance * plates.gap.sq())
    }

    /// y in V.
    pub fn voltage<S: Over<P>>(&self, x: S) -> S {
        self.plates.difference(x) * (self.carrier_amplitude / self.feedback_capacitance)
    }

    /// x in m, of y in V: of y·(1 − u²) = y₀·u with u = x/d₀ and y₀ = dy/dx·d₀ the solution between the plates,
    /// u = 2·y/(y₀ + √(y₀² + 4·y²)).
    ///
    /// ```
    /// use kalmems_models::{capacitance::DifferentialPlates, readout::DifferentialReadout};
    /// let plates = DifferentialPlates { area: 1.86e-6, gap: 2.3e-6, permittivity: 3.54e-11 };
    /// let readout = DifferentialReadout { plates, carrier_amplitude: 0.6, feedback_capacitance: 20e-12 };
    /// for x in [0.0_f64, 3e-8, -2e-6] {
    ///     assert!((readout.displacement(readout.voltage(x)) - x).abs() <= 1e-15 * 2.3e-6);
    /// }
    /// ```
    pub fn displacement(&self, voltage: P) -> P {
        let full = self.sensitivity() * self.plates.gap;
        let root = (full.sq() + voltage.twice().sq()).sqrt();
        self.plates.gap * voltage.twice() / (full + root)
    }
}

of_first_state!(DifferentialReadout, "displacement");

/// The circuit of the thesis's Figure 6 around an ideal amplifier, at one frequency.
///
/// The movable plate, with R₁ to ground, goes through C₃ to the amplifier's input; C₄ and R₂ lead back. With the
/// carrier V₁ on one fixed plate and −V₁ on the other the output is
/// v_o = −1/C₄·f₂·f₃·f₁·(C₁ − C₂)·V₁ (equations 2-5 and 2-6), where each factor is one that the approximation 2-7 takes
/// for 1: f₂ = jωC₄R₂/(1 + jωC₄R₂), f₃ = C₃/(C₁ + C₂ + C₃) and f₁ = jω(C₁ + C₂ + C₃)R₁/(1 + jω(C₁ + C₂ + C₃)R₁).
#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
pub struct ChargeAmplifier<P> {
    /// R₁ in Ω: from the movable plate to ground.
    pub leak_resistance: P,
    /// R₂ in Ω: in parallel with C₄.
    pub feedback_resistance: P,
    /// C₃ in F: from the movable plate to the amplifier.
    pub coupling_capacitance: P,
    /// C₄ in F.
    pub feedback_capacitance: P,
}

#[model]
impl<P: Scalar> ChargeAmplifier<P> {
    /// f₁ as real and imaginary part, at ω in rad/s and with C₁ + C₂ in F: 1 where R₁ leaks nothing.
    pub fn leak_factor(&self, rate: P, sum: P) -> (P, P) {
        high_pass(rate * (sum + self.coupling_capacitance) * self.leak_resistance)
    }

    /// f₂ as real and imaginary part: 1 where R₂ takes nothing of the charge.
    pub fn feedback_factor(&self, rate: P) -> (P, P) {
        high_pass(rate * self.feedback_capacitance * self.feedback_resistance)
    }

    /// f₃: 1 where C₃ is much larger than the capacitors that are sensed.
    pub fn coupling_factor(&self, sum: P) -> P {
        self.coupling_capacitance / (self.coupling_capacitance + sum)
    }

    /// v_o/((C₁ − C₂)·V₁) in 1/F as real and imaginary part, exactly.
    pub fn response(&self, rate: P, sum: P) -> (P, P) {
        let (a, b) = self.leak_factor(rate, sum);
        let (c, d) = self.feedback_factor(rate);
        let scale = -(self.coupling_factor(sum) / self.feedback_capacitance);
        ((a * c - b * d) * scale, (a * d + b * c) * scale)
    }

    /// −1/C₄ in 1/F: the same with all factors 1 (equation 2-7).
    pub fn ideal(&self) -> P {
        -self.feedback_capacitance.recip()
    }
}

/// jz/(1 + jz).
#[model]
fn high_pass<P: Scalar>(z: P) -> (P, P) {
    let scale = (z.sq() + P::of(1.0)).recip();
    (z.sq() * scale, z * scale)
}

//! What the gas around a plate takes from its motion.

use kalmems_core::Scalar;
use kalmems_macros::{Parameters, model};

/// The molar gas constant in J/(mol·K) (CODATA 2018).
const GAS_CONSTANT: f64 = 8.314_462_618;

/// 1/Q(p) = 1/Q_i + 1/Q_v · p/(p + p_t): the quality factor of a resonator over the pressure.
///
/// Where molecules meet the plate more often than one another, they brake in proportion to their number, and where they
/// make a fluid, its viscosity does not depend on the pressure (Newell, Science 161, 1320, 1968, tells these regimes
/// apart). The form joins both: the slope 1/(Q_v·p_t) at low pressure is that of [`free_molecular`](Self::free_molecular),
/// and Q_v the quality in the fluid. Between them it is an interpolation.
///
/// ```
/// use kalmems_models::dynamics::GasDamping;
/// let gas = GasDamping { intrinsic_quality: 20e3, viscous_quality: 100.0, transition_pressure: 400.0_f64 };
/// // Left alone by the gas at first, then ten times the pressure is ten times the braking, and at last it is all the same.
/// assert!((gas.quality(0.0) - 20e3).abs() < 1e-9);
/// let braking = |p: f64| 1.0 / gas.quality(p) - 1.0 / 20e3;
/// assert!((braking(1.0) / braking(0.1) - 10.0).abs() < 0.03);
/// assert!((gas.quality(1e7) - 100.0).abs() < 1.0);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
pub struct GasDamping<P> {
    /// Q_i: what the mechanics alone would have.
    pub intrinsic_quality: P,
    /// Q_v: what the gas alone would leave where it is a fluid.
    pub viscous_quality: P,
    /// p_t in Pa: where the braking is half of that of the fluid. Positive.
    pub transition_pressure: P,
}

#[model]
impl<P: Scalar> GasDamping<P> {
    /// Q at a pressure in Pa.
    pub fn quality(&self, pressure: P) -> P {
        let share = pressure / (pressure + self.transition_pressure);
        (self.intrinsic_quality.recip() + share / self.viscous_quality).recip()
    }

    /// f₀·√(1 − 1/(4·Q²)) in Hz: the frequency of a free decay at a pressure in Pa, f₀ without damping.
    pub fn resonance(&self, natural_frequency: P, pressure: P) -> P {
        let half = self.quality(pressure).twice().recip();
        natural_frequency * (P::of(1.0) - half.sq()).sqrt()
    }

    /// Q·p = (π/2)^{3/2}·ρh·f·√(R·T/M) in Pa of a plate that moves along its normal in free molecular flow, from its mass per
    /// area in kg/m², its frequency in Hz, the temperature in K and the molar mass of the gas in kg/mol (Christian,
    /// Vacuum 16, 175, 1966).
    ///
    /// ```
    /// use kalmems_models::dynamics::GasDamping;
    /// // 50 µm of silicon at 500 Hz in air: Q 336 at 100 Pa.
    /// let product = GasDamping::free_molecular(2330.0 * 50e-6, 500.0, 300.0, 0.029_f64);
    /// assert!((product / 100.0 - 336.0).abs() < 1.0);
    /// ```
    pub fn free_molecular(mass_per_area: P, frequency: P, temperature: P, molar_mass: P) -> P {
        let thermal = (temperature * P::of(GAS_CONSTANT) / molar_mass).sqrt();
        mass_per_area * frequency * thermal * P::of(1.968_701_243_215_302_5)
    }
}

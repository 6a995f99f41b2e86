//! A carrier through the sensed capacitance into a shunt.

use kalmems_core::{Dual, Over, Scalar};
use kalmems_macros::{Parameters, model};

/// |U|(C): the amplitude at an amplifier of a carrier that has passed the sensed capacitance C, in V.
///
/// The carrier's source, then C in series, then a node with the shunt R_s and the parasitic capacitance C_p to ground,
/// and from there a capacitor C_k, which keeps the shunt's direct voltage from the amplifier, into the amplifier's
/// input conductance G_i (Faller and Zangl, 2017, figure 4). With b = ω·C_k the load of the node is
///
/// Y = 1/R_s + j·ω·C_p + G_i·b·(b + j·G_i)/(G_i² + b²) = G + j·ω·C_∥,
///
/// so that |U| = U_e·κ·ω·C/√(G² + ω²·(C_∥ + C)²) with the part κ = b/√(G_i² + b²) that C_k lets pass. The paper's
/// equations 7 and 8 are this without C_k and G_i, with R_s put right as an admittance. The equation is quadratic in
/// C for a given |U|, and inverted exactly: linearised at rest it would be wrong by up to 0.1 µm over the stroke.
///
/// `excitation`, the voltages and their noise are all amplitudes or all root mean squares.
///
/// ```
/// use kalmems_models::readout::CarrierDivider;
/// use std::f64::consts::TAU;
/// let divider = CarrierDivider {
///     excitation: 1.0,
///     carrier_rate: TAU * 20e6,
///     shunt_conductance: 1.0 / 50.0,
///     parallel_capacitance: 100e-12,
///     input_conductance: 0.0,
///     blocking_capacitance: 100e-9,
/// };
/// let volts = divider.voltage(109.3e-15_f64);
/// assert!((divider.capacitance(volts) / 109.3e-15 - 1.0).abs() < 1e-14);
/// // 2.09 nV/√Hz at the shunt are 0.393 aF/√Hz.
/// assert!((divider.capacitance_noise(2.09e-9, 109.3e-15) - 0.393e-18).abs() < 0.001e-18);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
pub struct CarrierDivider<P> {
    /// U_e in V.
    pub excitation: P,
    /// ω in rad/s.
    pub carrier_rate: P,
    /// 1/R_s in S.
    pub shunt_conductance: P,
    /// C_p in F.
    pub parallel_capacitance: P,
    /// G_i in S; 0 for an amplifier that draws no current.
    pub input_conductance: P,
    /// C_k in F. Positive.
    pub blocking_capacitance: P,
}

#[model]
impl<P: Scalar> CarrierDivider<P> {
    /// |U| in V, C in F.
    pub fn voltage<S: Over<P>>(&self, capacitance: S) -> S {
        let load = self.load();
        let alone = capacitance.alone();
        let reactive = alone + load.capacitance;
        let length = (reactive.sq() + load.conductance_per_rate.sq()).sqrt();
        capacitance.chained(alone / length * load.open)
    }

    /// C in F from |U| in V; the inverse of [`voltage`](Self::voltage).
    ///
    /// Not a positive number where the voltage is not between 0 and that of a capacitance without limit.
    pub fn capacitance<S: Over<P>>(&self, voltage: S) -> S {
        let load = self.load();
        let share = voltage.alone() * load.open.recip();
        let square = share.sq();
        let rest = -square + P::of(1.0);
        let root = (rest * load.conductance_per_rate.sq() + load.capacitance.sq()).sqrt();
        voltage.chained((square * load.capacitance + share * root) / rest)
    }

    /// d|U|/dC in V/F.
    pub fn slope(&self, capacitance: P) -> P {
        let [slope] = self.voltage(Dual::<P, 1>::variable(capacitance, 0)).gradient();
        slope
    }

    /// The noise of the capacitance in F/√Hz from that of the voltage in V/√Hz, both one-sided, at a capacitance in F
    /// (Faller and Zangl, 2017, equation 5).
    pub fn capacitance_noise(&self, voltage_noise: P, capacitance: P) -> P {
        voltage_noise / self.slope(capacitance).abs()
    }

    fn load(&self) -> Load<P> {
        let (input, rate) = (self.input_conductance, self.carrier_rate);
        let blocking = rate * self.blocking_capacitance;
        let square = input.sq() + blocking.sq();
        let conductance = self.shunt_conductance + input * blocking.sq() / square;
        Load {
            conductance_per_rate: conductance / rate,
            capacitance: self.parallel_capacitance + input.sq() * blocking / square / rate,
            open: self.excitation * blocking / square.sqrt(),
        }
    }
}

/// What the sensed capacitance works into.
struct Load<P> {
    /// G/ω in F.
    conductance_per_rate: P,
    /// C_∥ in F.
    capacitance: P,
    /// U_e·κ in V: what a capacitance without limit would give.
    open: P,
}

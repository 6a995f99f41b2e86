//! The mirror's mechanics and its drive.

use crate::config::Quantity;
use crate::piston_mirror::device::DrivenPlate;
use kalmems_models::capacitance::GaussianComb;
use kalmems_models::dynamics::{GasDamping, ParametricScanner, TorsionalResonator};
use std::f64::consts::TAU;

/// What moves, and what brakes it.
#[derive(Clone, Copy, Debug)]
pub struct Mechanics {
    /// The moving mass in kg.
    pub mass: f64,
    /// The resonance without drive and damping in Hz.
    pub resonance_hz: f64,
    /// What the comb's capacitance has more at rest, in F.
    pub comb_capacitance: f64,
    /// The displacement in m at which that has fallen to 1/e.
    pub comb_width: f64,
    /// The quality factor over the pressure.
    pub damping: GasDamping<f64>,
    /// The pressure in Pa.
    pub pressure: f64,
}

impl Mechanics {
    /// From the device's table. Without gas the pressure is 0.
    pub fn of(table: &DrivenPlate) -> Self {
        let gas = table.gas.as_ref();
        Self {
            mass: table.mass.si(),
            resonance_hz: table.resonance.si(),
            comb_capacitance: table.comb_capacitance.si(),
            comb_width: table.comb_width.si(),
            damping: GasDamping {
                intrinsic_quality: table.intrinsic_quality.si(),
                viscous_quality: gas.map_or(f64::INFINITY, |gas| gas.viscous_quality.si()),
                transition_pressure: gas.map_or(1.0, |gas| gas.transition_pressure.si()),
            },
            pressure: gas.map_or(0.0, |gas| Quantity::si(&gas.pressure)),
        }
    }

    /// m·z̈ + (m·ω/Q)·ż + m·ω²·z = ½·C_d′(z)·V² at a pressure in Pa, states [z, ż] in m and m/s, z counted from rest:
    /// the law of a scanner that turns, with m for the inertia and metres for radians.
    ///
    /// The comb lies in the plane of the rest position, so that it pulls back from either side and a voltage at twice
    /// the frequency of the motion keeps it going (Faller and Zangl, 2017, section II-A).
    pub fn device(&self, pressure: f64) -> ParametricScanner<f64> {
        let rate = TAU * self.resonance_hz;
        ParametricScanner {
            resonator: TorsionalResonator {
                inertia: self.mass,
                damping: self.mass * rate / self.damping.quality(pressure),
                stiffness: self.mass * rate * rate,
            },
            comb: GaussianComb { nominal: self.comb_capacitance, angular_width: self.comb_width, bias: 0.0 },
            carrier_mean_square: 0.0,
        }
    }
}

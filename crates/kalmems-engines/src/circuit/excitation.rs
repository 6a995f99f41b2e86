//! What the electrodes are under: voltages and a motion.

use kalmems_core::Portable;
use std::f64::consts::TAU;

/// V = offset + amplitude·sin(ω_dr·t) + carrier·sin(ω_c·t).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Excitation {
    /// In V.
    pub offset: f64,
    /// In V.
    pub amplitude: f64,
    /// ω_dr/2π.
    pub drive_hz: f64,
    /// In V.
    pub carrier: f64,
    /// ω_c/2π.
    pub carrier_hz: f64,
}

/// sin and cos of 2πx.
pub(super) fn turned(x: f64) -> (f64, f64) {
    (TAU * (x - x.floor())).portable_sin_cos()
}

impl Excitation {
    /// V in V and V̇ in V/s.
    pub fn at(&self, time_s: f64) -> (f64, f64) {
        let (drive, drive_slope) = turned(self.drive_hz * time_s);
        let (carrier, carrier_slope) = turned(self.carrier_hz * time_s);
        (
            self.offset + self.amplitude * drive + self.carrier * carrier,
            TAU * (self.amplitude * self.drive_hz * drive_slope
                + self.carrier * self.carrier_hz * carrier_slope),
        )
    }
}

/// θ = amplitude·sin(ω_dr·t/2 + phase): a motion at half of the drive's frequency, as parametric resonance makes it
/// (Chen et al., shared electrodes, 2020, equation 17).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SineMotion {
    /// In rad.
    pub amplitude_rad: f64,
    /// φ in rad, of the motion's cycle.
    pub phase_rad: f64,
}

impl SineMotion {
    /// θ in rad and θ̇ in rad/s under a drive of this frequency.
    pub fn at(&self, time_s: f64, drive_hz: f64) -> (f64, f64) {
        let (sine, cosine) = turned(0.5 * drive_hz * time_s + self.phase_rad / TAU);
        (self.amplitude_rad * sine, self.amplitude_rad * 0.5 * TAU * drive_hz * cosine)
    }
}

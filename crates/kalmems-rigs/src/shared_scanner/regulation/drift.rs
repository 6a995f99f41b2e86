//! What a temperature does to the scanner and its readout.

use super::super::settings::ScannerHardware;
use crate::config::{Quantity, TemperatureRamp};
use kalmems_models::dynamics::ParametricScanner;
use kalmems_models::readout::DemodulatedComb;

/// A temperature that changes linearly, and its coefficients.
#[derive(Clone, Copy, Debug)]
pub struct TemperatureDrift {
    change_k: f64,
    from_s: f64,
    to_s: f64,
    /// Relative, per K.
    stiffness: f64,
    damping: f64,
    gain: f64,
    /// In V/K.
    offset: f64,
}

/// By how much each parameter is off what the file says.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Drifted {
    /// The temperature in K.
    pub temperature_k: f64,
    /// Relative.
    pub stiffness: f64,
    /// Relative.
    pub damping: f64,
    /// Relative.
    pub gain: f64,
    /// In V.
    pub offset_v: f64,
}

impl TemperatureDrift {
    /// As the file describes it.
    pub fn of(ramp: &TemperatureRamp) -> Self {
        Self {
            change_k: ramp.change.si(),
            from_s: ramp.from.si(),
            to_s: ramp.to.si(),
            stiffness: ramp.stiffness.as_ref().map_or(0.0, Quantity::si),
            damping: ramp.damping.as_ref().map_or(0.0, Quantity::si),
            gain: ramp.gain.as_ref().map_or(0.0, Quantity::si),
            offset: ramp.offset.as_ref().map_or(0.0, Quantity::si),
        }
    }

    /// What it has done by a time.
    pub fn at(&self, time_s: f64) -> Drifted {
        let passed = ((time_s - self.from_s) / (self.to_s - self.from_s)).clamp(0.0, 1.0);
        // No −0 where nothing has changed yet.
        let by = |per_kelvin: f64| per_kelvin * self.change_k * passed + 0.0;
        Drifted {
            temperature_k: by(1.0),
            stiffness: by(self.stiffness),
            damping: by(self.damping),
            gain: by(self.gain),
            offset_v: by(self.offset),
        }
    }
}

impl Drifted {
    /// The scanner that has become of it.
    pub fn scanner(&self, hardware: &ScannerHardware) -> ParametricScanner<f64> {
        let mut scanner = hardware.scanner;
        scanner.resonator.stiffness *= 1.0 + self.stiffness;
        scanner.resonator.damping *= 1.0 + self.damping;
        scanner
    }

    /// The readout.
    pub fn readout(&self, hardware: &ScannerHardware) -> DemodulatedComb<f64> {
        let mut readout = hardware.readout;
        readout.gain *= 1.0 + self.gain;
        readout.offset += self.offset_v;
        readout
    }
}

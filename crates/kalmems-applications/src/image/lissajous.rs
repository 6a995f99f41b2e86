//! A spot on a Lissajous figure.

use kalmems_core::Scalar;
use std::f64::consts::TAU;

/// One axis: x(t) = ½ + ½·a·sin(2π·f·t + φ).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisOscillation {
    /// f in Hz.
    pub frequency_hz: f64,
    /// a, as a part of half the field of view: 1 sweeps all of it.
    pub amplitude: f64,
    /// φ in rad.
    pub phase_rad: f64,
}

impl AxisOscillation {
    /// The position at a time in s; the field of view is 0 to 1.
    pub fn position(&self, time_s: f64) -> f64 {
        // Whole cycles are taken off first: they would cost digits.
        let cycles = self.frequency_hz * time_s;
        let sine = Scalar::sin(TAU * (cycles - cycles.floor()) + self.phase_rad);
        0.5 + 0.5 * self.amplitude * sine
    }

    /// The same with the phase this much further ahead.
    #[must_use]
    pub fn ahead_by(self, phase_rad: f64) -> Self {
        Self { phase_rad: self.phase_rad + phase_rad, ..self }
    }
}

/// Two axes and the rate at which the detector samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lissajous {
    /// To the right.
    pub x: AxisOscillation,
    /// Downwards.
    pub y: AxisOscillation,
    /// Samples per second.
    pub rate_hz: f64,
}

/// Where the spot is when a sample is taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spot {
    /// When, in s.
    pub time_s: f64,
    /// x and y.
    pub position: [f64; 2],
}

impl Lissajous {
    /// The scanner of Chen et al. 2020: 27.68 kHz by 6.54 kHz over the whole field; the figure closes after 50 ms.
    ///
    /// The phases are those of the paper's calibration, 380.143° and 370.116°. How the axes' phases lie to each other
    /// decides how evenly the figure covers the field.
    pub fn published(rate_hz: f64) -> Self {
        let axis = |frequency_hz, phase_deg: f64| AxisOscillation {
            frequency_hz,
            amplitude: 1.0,
            phase_rad: phase_deg.to_radians(),
        };
        Self { x: axis(27_680.0, 20.143), y: axis(6_540.0, 10.116), rate_hz }
    }

    /// The samples of a frame of this many seconds, the first at time 0.
    pub fn frame(&self, duration_s: f64) -> impl Iterator<Item = Spot> + Clone + use<> {
        let this = *self;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturates
        let samples = (duration_s * self.rate_hz).round() as u64;
        (0..samples).map(move |k| {
            let time_s = k as f64 / this.rate_hz;
            Spot { time_s, position: [this.x.position(time_s), this.y.position(time_s)] }
        })
    }
}

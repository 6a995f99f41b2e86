//! What is added to the feedback so that the recording tells the device's parameters.

use crate::config::Dither;
use crate::simulate::{Drive, Tone, WhiteNoise};
use kalmems_core::Scalar;
use std::f64::consts::TAU;

/// The stream of the phases, beside those of the noises.
const PHASES: u64 = 3;

/// The sum of sines that the settings describe, with phases by chance: with equal ones they would pile up at 0 s.
pub fn tones(settings: &Dither, seed: u64) -> Drive {
    let mut chance = WhiteNoise::new(seed, PHASES);
    let (from_hz, to_hz) = (settings.from.si(), settings.to.si());
    let (span, steps) = (Scalar::ln(to_hz / from_hz), f64::from(settings.tones - 1));
    let amplitude = settings.rms.si() * (2.0 / f64::from(settings.tones)).sqrt();
    let tone = |k: u32| Tone {
        amplitude,
        frequency_hz: from_hz * Scalar::exp(span * f64::from(k) / steps),
        phase_rad: TAU * chance.uniform(),
    };
    Drive::Tones { offset: 0.0, tones: (0..settings.tones).map(tone).collect() }
}

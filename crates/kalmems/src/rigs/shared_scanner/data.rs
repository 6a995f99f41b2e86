//! What the estimators see of a segment.

use super::drive::Drive;
use super::settings::Settings;
use crate::estimate::Motion;
use std::f64::consts::TAU;

/// One segment of a recording as the estimators see it.
#[derive(Clone, Debug)]
pub struct SegmentData<'a> {
    /// When, in s.
    pub time_s: &'a [f64],
    /// The demodulated signal in V.
    pub signal: &'a [f64],
    /// The drive.
    pub drive: Drive<'a>,
    /// The usual interval between samples in s.
    pub interval_s: f64,
}

impl SegmentData<'_> {
    /// How fast the mirror moves: at half the frequency of a steady drive, else at its own.
    pub fn motion(&self, settings: &Settings) -> Motion {
        match self.drive.sine() {
            Some(sine) => Motion { frequency_hz: sine.frequency_hz / 2.0, is_driven: true },
            None => Motion {
                frequency_hz: settings.hardware.scanner.resonator.natural_rate() / TAU,
                is_driven: false,
            },
        }
    }

    /// The first drive peak after the settling time; the end of the settling time where there is none.
    pub fn first_drive_peak(&self, settings: &Settings) -> f64 {
        let start = self.time_s.first().copied().unwrap_or(0.0) + settings.skip_s;
        self.drive.sine().map_or(start, |sine| sine.peak_after(start))
    }
}

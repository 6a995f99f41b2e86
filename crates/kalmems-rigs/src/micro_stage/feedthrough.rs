//! What reaches a signal of the drive beside the motion, taken away.

use crate::signal::{Sine, fit_sine_at};
use kalmems_core::Portable;
use std::f64::consts::TAU;

/// A record with the bias off: its drive, and the sine of the drive's frequency in each signal.
#[derive(Clone, Debug)]
pub struct BiasOffRecord {
    /// The record's label.
    pub label: String,
    /// Its drive.
    pub drive: Sine,
    /// What the signals hold of it, offset included; in the order of the electrodes.
    pub signals: Vec<Sine>,
    /// Samples that they were fitted to.
    pub samples: usize,
}

impl BiasOffRecord {
    /// From the drive and the signals of a record. `None` where a signal has too few samples.
    pub fn of(label: &str, time_s: &[f64], drive: Sine, signals: &[&[f64]]) -> Option<Self> {
        let fitted = signals.iter().map(|signal| fit_sine_at(time_s, signal, drive.frequency_hz));
        Some(Self {
            label: label.to_owned(),
            drive,
            signals: fitted.collect::<Option<_>>()?,
            samples: time_s.len(),
        })
    }

    /// A signal of the record with the bias on without what the drive alone makes of it.
    ///
    /// The sine of the record with the bias off is scaled and turned by the ratio of the drive's phasors of both
    /// records: neither their amplitudes nor their triggers need to agree. It has the drive's frequency alone; the
    /// harmonics, which say the gap, are not touched and get no noise from it. The offset is taken away too.
    pub fn cancel(&self, electrode: usize, time_s: &[f64], drive: &Sine, signal: &[f64]) -> Vec<f64> {
        let Some(alone) = self.signals.get(electrode) else { return signal.to_vec() };
        let turned = Sine {
            offset: alone.offset,
            amplitude: alone.amplitude * drive.amplitude / self.drive.amplitude,
            frequency_hz: drive.frequency_hz,
            phase_rad: alone.phase_rad + drive.phase_rad - self.drive.phase_rad,
            residual_rms: 0.0,
        };
        time_s.iter().zip(signal).map(|(t, y)| y - turned.at(*t)).collect()
    }

    /// The standard deviation of each component of what is taken away from a signal, in V for each volt of the drive.
    pub fn sd_per_volt(&self, electrode: usize) -> Option<f64> {
        Some(self.signals.get(electrode)?.component_sd(self.samples) / self.drive.amplitude)
    }

    /// The same as g and g′ of y = g·V + g′·V̇, in V/V and s.
    pub fn gain_and_slope(&self, electrode: usize) -> Option<[f64; 2]> {
        let alone = self.signals.get(electrode)?;
        let ratio = alone.amplitude / self.drive.amplitude;
        let (sine, cosine) = (alone.phase_rad - self.drive.phase_rad).portable_sin_cos();
        Some([ratio * cosine, ratio * sine / (TAU * self.drive.frequency_hz)])
    }
}

/// A signal without g·V + g′·V̇ of this drive.
pub fn without_drive(time_s: &[f64], drive: &Sine, signal: &[f64], [gain, slope]: [f64; 2]) -> Vec<f64> {
    let rate = TAU * drive.frequency_hz;
    let part = |t: f64| {
        let (sine, cosine) = (rate * t + drive.phase_rad).portable_sin_cos();
        drive.amplitude * (gain * cosine - slope * rate * sine)
    };
    time_s.iter().zip(signal).map(|(t, y)| y - part(*t)).collect()
}

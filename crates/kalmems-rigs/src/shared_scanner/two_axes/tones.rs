//! The two sines of a recorded drive.

use super::filters::STATES;
use crate::estimate::MotionRate;
use crate::signal::{Sine, fit_sine, fit_sine_at};
use kalmems_core::Portable;

/// A drive that is an offset and two sines, one for each axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveTones {
    /// The mean in V.
    pub offset: f64,
    /// The sines of x and y, each without an offset.
    pub tones: [Sine; 2],
    /// The root mean square of what they leave, in V.
    pub residual_rms: f64,
    /// Whether the drive follows them in all samples that are known. Where it does not, the motions have no phase that they would have to keep.
    pub is_steady: bool,
}

/// How often the sines are fitted in turns. What one sine leaks into the fit of the other falls with their distance
/// times the length of the record, and by that factor squared each time.
const TURNS: usize = 6;

impl DriveTones {
    /// The name of each axis's angle, and how fast it goes: at half the frequency of its drive.
    pub fn motions(&self) -> [(&'static str, MotionRate); 2] {
        [0, 1].map(|axis| {
            let frequency_hz = 0.5 * self.tones[axis].frequency_hz;
            (STATES[2 * axis].0, MotionRate { frequency_hz, is_driven: self.is_steady })
        })
    }

    /// The drive in V at a time in s.
    pub fn at(&self, time_s: f64) -> f64 {
        self.offset + self.tones.iter().map(|tone| tone.at(time_s)).sum::<f64>()
    }

    /// Fits both sines, and gives to each axis the one that is nearer to twice its resonance.
    ///
    /// `None` where two sines leave more than 2 % of the smaller one's amplitude: such a drive is another one.
    pub fn of(time_s: &[f64], volts: &[f64], interval_s: f64, resonances_hz: [f64; 2]) -> Option<Self> {
        Self::among(&TwoSines::of(time_s, volts, interval_s)?, resonances_hz)
    }

    /// The same by both sines as they were fitted.
    pub(super) fn among(TwoSines([first, second, last]): &TwoSines, resonances_hz: [f64; 2]) -> Option<Self> {
        let alone = |sine: &Sine| Sine { offset: 0.0, residual_rms: last.residual_rms, ..*sine };
        let mut tones = [alone(first), alone(second)];
        // ln(f/2f_res): a sine is near to a resonance in proportion, not in Hz.
        let away =
            |sine: &Sine, axis: usize| (sine.frequency_hz / (2.0 * resonances_hz[axis])).portable_ln().abs();
        if away(&tones[0], 0) + away(&tones[1], 1) > away(&tones[0], 1) + away(&tones[1], 0) {
            tones.swap(0, 1);
        }
        let smaller = tones[0].amplitude.min(tones[1].amplitude);
        (last.residual_rms < 0.02 * smaller).then_some(Self {
            offset: last.offset,
            tones,
            residual_rms: last.residual_rms,
            is_steady: true,
        })
    }
}

/// Two sines fitted in turns, and the second once more at its frequency, with what both leave.
#[derive(Clone, Copy, Debug)]
pub(super) struct TwoSines(pub(super) [Sine; 3]);

impl TwoSines {
    /// `None` where a fit does not settle.
    pub(super) fn of(time_s: &[f64], volts: &[f64], interval_s: f64) -> Option<Self> {
        let without = |sine: &Sine| -> Vec<f64> {
            time_s.iter().zip(volts).map(|(t, v)| v - (sine.at(*t) - sine.offset)).collect()
        };
        let mut first = fit_sine(time_s, volts, interval_s)?;
        let mut second = fit_sine(time_s, &without(&first), interval_s)?;
        for _ in 0..TURNS {
            first = fit_sine(time_s, &without(&second), interval_s)?;
            second = fit_sine(time_s, &without(&first), interval_s)?;
        }
        let last = fit_sine_at(time_s, &without(&first), second.frequency_hz)?;
        Some(Self([first, second, last]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;
    use std::f64::consts::TAU;

    #[test]
    fn both_sines_are_found_in_either_order_of_size() {
        for (large, small) in [(90.0, 20.0), (20.0, 90.0)] {
            let time: Vec<f64> = (0..12_000).map(|i| f64::from(i) * 1e-6).collect();
            let volts = |t: f64| {
                85.0 + large * (TAU * 31_352.7 * t + 0.3).cos() + small * (TAU * 13_081.3 * t - 2.0).cos()
            };
            let v: Vec<f64> = time.iter().map(|t| volts(*t)).collect();
            let found = DriveTones::of(&time, &v, 1e-6, [15_700.0, 6_545.0]).unwrap();
            for (tone, (frequency, amplitude, phase)) in
                found.tones.iter().zip([(31_352.7, large, 0.3), (13_081.3, small, -2.0)])
            {
                assert_abs_diff_eq!(tone.frequency_hz, frequency, epsilon = 1e-3);
                assert_abs_diff_eq!(tone.amplitude, amplitude, epsilon = 1e-4);
                assert_abs_diff_eq!(tone.phase_rad, phase, epsilon = 1e-4);
            }
            assert_abs_diff_eq!(found.offset, 85.0, epsilon = 1e-4);
        }
    }

    #[test]
    fn another_drive_is_none() {
        let time: Vec<f64> = (0..12_000).map(|i| f64::from(i) * 1e-6).collect();
        let three: Vec<f64> = (time.iter())
            .map(|t| [31e3, 13e3, 20e3].iter().map(|f| 50.0 * (TAU * f * t).cos()).sum())
            .collect();
        assert_eq!(DriveTones::of(&time, &three, 1e-6, [15_700.0, 6_545.0]), None);
        assert_eq!(DriveTones::of(&time, &vec![90.0; 12_000], 1e-6, [15_700.0, 6_545.0]), None);
    }
}

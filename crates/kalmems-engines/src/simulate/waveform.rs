//! A drive that repeats: other sizes and frequencies of it, the harmonics of its square, its steps over a period.

use super::Drive;
use kalmems_core::Portable;
use std::f64::consts::{PI, TAU};

/// One step of a period in which the drive does not jump.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PeriodStep {
    /// Its length as a part of the period.
    pub part: f64,
    /// The voltage at its start, in its middle and at its end, in V.
    pub volts: [f64; 3],
}

/// One period of a drive that repeats, without its frequency and phase; voltages in V.
#[derive(Clone, Copy, Debug)]
pub(super) enum Waveform {
    /// Of a sine, or of a sweep, whose frequency changes alone.
    Sine { offset: f64, amplitude: f64 },
    /// High for the part `duty` of the period, then low.
    Square { low: f64, high: f64, duty: f64 },
}

impl Drive {
    /// The same waveform with all voltages this many times as large.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        let mut scaled = self.clone();
        match &mut scaled {
            Self::Constant { level } => *level *= factor,
            Self::Sine { offset, amplitude, .. } | Self::Sweep { offset, amplitude, .. } => {
                *offset *= factor;
                *amplitude *= factor;
            }
            Self::Square { low, high, .. } => {
                *low *= factor;
                *high *= factor;
            }
            Self::Tones { offset, tones } => {
                *offset *= factor;
                for tone in tones {
                    tone.amplitude *= factor;
                }
            }
            Self::Interrupted { drive, .. } | Self::Late { drive, .. } | Self::Rate { of: drive } => {
                **drive = drive.scaled(factor);
            }
            Self::Steps { first, steps } => {
                *first *= factor;
                for (_, level) in steps {
                    *level *= factor;
                }
            }
            Self::Switched { before, after, .. } => {
                **before = before.scaled(factor);
                **after = after.scaled(factor);
            }
            Self::Recorded { volts, .. } => volts.iter_mut().for_each(|v| *v *= factor),
        }
        scaled
    }

    /// What it does in each period; `None` where it does not repeat.
    pub(super) fn waveform(&self) -> Option<Waveform> {
        match *self {
            Self::Sine { offset, amplitude, .. } | Self::Sweep { offset, amplitude, .. } => {
                Some(Waveform::Sine { offset, amplitude })
            }
            Self::Square { low, high, duty, .. } => Some(Waveform::Square { low, high, duty }),
            Self::Constant { .. }
            | Self::Tones { .. }
            | Self::Interrupted { .. }
            | Self::Steps { .. }
            | Self::Switched { .. }
            | Self::Late { .. }
            | Self::Rate { .. }
            | Self::Recorded { .. } => None,
        }
    }

    /// The waveform held at one frequency, at phase 0; `None` where it does not repeat.
    pub fn held_at(&self, hz: f64) -> Option<Self> {
        Some(match self.waveform()? {
            Waveform::Sine { offset, amplitude } => {
                Self::Sine { offset, amplitude, frequency_hz: hz, phase_rad: 0.0 }
            }
            Waveform::Square { low, high, duty } => Self::Square { low, high, frequency_hz: hz, duty },
        })
    }

    /// The largest voltage of a waveform that repeats, without its sign: what the drive is called by in figures.
    pub fn peak_volts(&self) -> Option<f64> {
        Some(match self.waveform()? {
            Waveform::Sine { offset, amplitude } => offset.abs() + amplitude.abs(),
            Waveform::Square { low, high, .. } => low.abs().max(high.abs()),
        })
    }

    /// a and b of a·cos 2πnft + b·sin 2πnft in V², the n-th harmonic of the drive's square at phase 0, n ≥ 1; `None`
    /// for a drive that does not repeat.
    ///
    /// (V_o + V₁ sin)² has 2·V_o·V₁ in the sine of the first and −V₁²/2 in the cosine of the second. A square wave
    /// that is high over the first part d of its period has (V_h² − V_l²)/(πn) times sin 2πnd and 1 − cos 2πnd.
    pub fn square_harmonic(&self, harmonic: u32) -> Option<[f64; 2]> {
        Some(match self.waveform()? {
            Waveform::Sine { offset, amplitude } => match harmonic {
                1 => [0.0, 2.0 * offset * amplitude],
                2 => [-0.5 * amplitude * amplitude, 0.0],
                _ => [0.0; 2],
            },
            Waveform::Square { low, high, duty } => {
                let n = f64::from(harmonic);
                let (sine, cosine) = (TAU * n * duty).portable_sin_cos();
                let size = (high * high - low * low) / (PI * n);
                [size * sine, size * (1.0 - cosine)]
            }
        })
    }

    /// A period in about `count` steps, from phase 0; `None` for a drive that does not repeat.
    ///
    /// The parts do not depend on the frequency, so that many frequencies can be integrated beside each other.
    pub fn period_steps(&self, count: u32) -> Option<Vec<PeriodStep>> {
        let unit = self.held_at(1.0)?;
        let Self::Square { low, high, duty, .. } = unit else {
            let part = 1.0 / f64::from(count.max(1));
            let at = |k: f64| unit.at(k * part);
            let step = |k: u32| {
                let k = f64::from(k);
                PeriodStep { part, volts: [at(k), at(k + 0.5), at(k + 1.0)] }
            };
            return Some((0..count.max(1)).map(step).collect());
        };
        // Whole steps on either side of the jump.
        let mut steps = Vec::new();
        for (share, level) in [(duty, high), (1.0 - duty, low)] {
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // rounded, positive and small
            let parts = (share * f64::from(count)).ceil().max(1.0) as usize;
            let step = PeriodStep { part: share / parts as f64, volts: [level; 3] };
            steps.extend(std::iter::repeat_n(step, parts));
        }
        Some(steps)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn drives() -> [Drive; 2] {
        [
            Drive::Sine { offset: 30.0, amplitude: -20.0, frequency_hz: 3e4, phase_rad: 0.0 },
            Drive::Square { low: 10.0, high: 60.0, frequency_hz: 3e4, duty: 0.3 },
        ]
    }

    /// By the mean of the square times cosine and sine.
    #[test]
    fn harmonics_of_the_square_are_those_of_a_sum() {
        for drive in drives() {
            let unit = drive.held_at(1.0).unwrap();
            for harmonic in 1..6 {
                let n = 40_000;
                let mut summed = [0.0; 2];
                for i in 0..n {
                    let t = (f64::from(i) + 0.5) / f64::from(n);
                    let (s, c) = (TAU * f64::from(harmonic) * t).sin_cos();
                    let square = unit.at(t).powi(2);
                    summed[0] += 2.0 * square * c / f64::from(n);
                    summed[1] += 2.0 * square * s / f64::from(n);
                }
                let ours = drive.square_harmonic(harmonic).unwrap();
                for (a, b) in ours.into_iter().zip(summed) {
                    assert_relative_eq!(a, b, max_relative = 1e-6, epsilon = 1e-4);
                }
                let size = drive.square(harmonic).unwrap().1;
                assert_relative_eq!(ours[0].hypot(ours[1]), size, max_relative = 1e-12);
            }
        }
    }

    #[test]
    fn the_steps_of_a_period_follow_the_waveform_and_end_at_its_jump() {
        for drive in drives() {
            let unit = drive.held_at(1.0).unwrap();
            let steps = drive.period_steps(40).unwrap();
            let mut at = 0.0;
            for step in &steps {
                let middle = at + 0.5 * step.part;
                assert_relative_eq!(step.volts[1], unit.at(middle), max_relative = 1e-12);
                at += step.part;
            }
            assert_relative_eq!(at, 1.0, max_relative = 1e-12);
            if let Drive::Square { duty, .. } = drive {
                assert_relative_eq!(
                    steps[..12].iter().map(|s| s.part).sum::<f64>(),
                    duty,
                    max_relative = 1e-12
                );
            }
        }
    }

    #[test]
    fn a_scaled_drive_is_that_many_times_as_large_everywhere() {
        let recorded = Drive::Recorded { time_s: vec![0.0, 1e-6, 2e-6], volts: vec![1.0, 2.0, 0.5] };
        let sweep = Drive::Sweep { offset: 3.0, amplitude: 2.0, from_hz: 1e4, to_hz: 2e4, duration_s: 1e-3 };
        for drive in drives().into_iter().chain([recorded, sweep, Drive::Constant { level: 4.0 }]) {
            for t in [0.0, 0.7e-6, 1.3e-6, 2.0e-6] {
                assert_relative_eq!(drive.scaled(2.5).at(t), 2.5 * drive.at(t), max_relative = 1e-12);
            }
        }
    }
}

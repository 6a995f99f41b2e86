//! The lines that two oscillations make in one signal, told apart.

use crate::signal::least_squares;
use kalmems_core::Portable;
use std::f64::consts::TAU;

/// Harmonics of each line that are fitted.
const HARMONICS: u8 = 3;
/// What is fitted: a mean, and cosine and sine of the harmonics of each line.
const COLUMNS: usize = 13;
/// How many times the width of a line, which is one over the window's length, the lines of a lock-in are apart at least.
const LINE_WIDTHS: f64 = 4.0;

/// A signal with the line of one oscillation alone, for each of two, and the standard deviation of the amplitude of a line.
pub struct SeparateLines {
    /// Mean, line, and what no line makes.
    pub signals: [Vec<f64>; 2],
    /// The noise of an amplitude, in the unit of the signal.
    pub amplitude_sd: f64,
}

impl SeparateLines {
    /// All lines at once, so that none leaks into another; `None` where the samples do not tell them apart.
    pub fn of((time_s, signal): (&[f64], &[f64]), lines_hz: [f64; 2]) -> Option<Self> {
        let origin = *time_s.first()?;
        let basis = |t: f64| {
            let mut columns = [1.0; COLUMNS];
            for (axis, line_hz) in lines_hz.iter().enumerate() {
                for harmonic in 1..=HARMONICS {
                    let (s, c) = (TAU * line_hz * f64::from(harmonic) * (t - origin)).portable_sin_cos();
                    let at = column(axis, harmonic);
                    (columns[at], columns[at + 1]) = (c, s);
                }
            }
            columns
        };
        let fitted = least_squares(time_s, signal, basis)?;
        let mut squares = (0.0, 0_usize);
        let mut signals = [const { Vec::new() }; 2];
        for (t, y) in time_s.iter().zip(signal) {
            let columns = basis(*t);
            let part = |from: usize, count: usize| -> f64 {
                (from..from + count).map(|k| columns[k] * fitted[k]).sum()
            };
            let left = y - part(0, COLUMNS);
            if left.is_finite() {
                squares = (squares.0 + left * left, squares.1 + 1);
            }
            for (axis, alone) in signals.iter_mut().enumerate() {
                alone.push(fitted[0] + part(column(axis, 1), 2) + left);
            }
        }
        let (sum, count) = (squares.0, squares.1.max(1) as f64);
        Some(Self { signals, amplitude_sd: (2.0 * sum).sqrt() / count })
    }
}

/// The first of both columns of a harmonic.
fn column(axis: usize, harmonic: u8) -> usize {
    1 + 2 * (axis * usize::from(HARMONICS) + usize::from(harmonic - 1))
}

/// How long a window of the lock-in has to be in s, so that the lines of one oscillation are told apart from those of the other: the nearest two are some widths
/// of a line apart. Infinite where two lines coincide.
pub fn separating_s(lines_hz: [f64; 2]) -> f64 {
    let apart = |of_x: u8, of_y: u8| f64::from(of_x) * lines_hz[0] - f64::from(of_y) * lines_hz[1];
    let harmonics = || 1..=HARMONICS;
    let all = harmonics().flat_map(|of_x| harmonics().map(move |of_y| apart(of_x, of_y).abs()));
    LINE_WIDTHS / all.chain(lines_hz).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::signal::fit_sine_at;
    use crate::simulate::WhiteNoise;

    /// Within five standard deviations of an amplitude.
    #[test]
    fn a_line_is_alone_and_its_noise_is_that_of_an_amplitude() {
        let time: Vec<f64> = (0..2000).map(|i| f64::from(i) * 1e-6).collect();
        let mut noise = WhiteNoise::new(5, 0);
        let bound = 5.0 * 0.01 * (2.0_f64 / 2000.0).sqrt();
        let lines = [31_350.0, 13_080.0];
        let signal: Vec<f64> = (0..2000)
            .map(|k| {
                let of = |hz: f64, a: f64| a * (TAU * hz * time[k] + 0.4).cos();
                2.0 + of(lines[0], 0.5) + of(2.0 * lines[0], 0.1) + of(lines[1], 0.2) + 0.01 * noise.sample()
            })
            .collect();
        let found = SeparateLines::of((&time, &signal), lines).unwrap();
        for (axis, amplitude) in [(0, 0.5), (1, 0.2)] {
            let sine = fit_sine_at(&time, &found.signals[axis], lines[axis]).unwrap();
            assert!((sine.amplitude - amplitude).abs() < bound && (sine.offset - 2.0).abs() < bound);
            let other = fit_sine_at(&time, &found.signals[axis], lines[1 - axis]).unwrap();
            // What its own line adds to a fit over 36 beats of both.
            assert!(other.amplitude < 0.02 * amplitude, "{}", other.amplitude);
        }
        assert!((found.amplitude_sd / (0.01 * (2.0_f64 / 2000.0).sqrt()) - 1.0).abs() < 0.1);
        assert!((separating_s(lines) - 4.0 / 5_190.0).abs() < 1e-9, "{}", separating_s(lines));
    }
}

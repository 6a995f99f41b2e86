//! Where both axes are, from the lines that their motions make in the signal.

use crate::estimate::Swing;
use crate::signal::least_squares;
use kalmems_core::Portable;
use kalmems_models::capacitance::GaussianComb;
use kalmems_models::readout::TwoAxisComb;
use std::f64::consts::{PI, TAU};

/// Harmonics of each drive that the lock-in takes.
const HARMONICS: u8 = 3;
/// Columns of the lock-in: a mean, and the harmonics of each axis.
const COLUMNS: usize = 13;
/// How many times the width of a line, which is one over the window's length, the lines of a lock-in are apart at least.
const LINE_WIDTHS: f64 = 4.0;
/// How many standard deviations of a line its amplitude has at least.
const LEAST_LINE: f64 = 5.0;

/// Why samples do not tell the swings of both axes.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LineError {
    /// The lines of both axes cannot be distinguished in them.
    #[error(
        "the first samples do not tell the lines of the two axes apart; take a longer recording, or move the drives apart"
    )]
    Inseparable,
    /// An axis does not move, or too little.
    #[error(
        "axis {axis}: its line in the signal is {line_v:.2e} V, and its standard deviation {sd_v:.1e} V; expected five times \
         that; the axis stands still, or the recording is too short"
    )]
    NoMotion {
        /// `x` or `y`.
        axis: char,
        /// The amplitude of the line.
        line_v: f64,
        /// Its standard deviation.
        sd_v: f64,
    },
    /// The line of an axis is larger than its comb can make it.
    #[error(
        "axis {axis}: its line in the signal is {line_v:.3} V, and its comb makes {most_v:.3} V at most; check gain and \
         capacitances"
    )]
    TooLarge {
        /// `x` or `y`.
        axis: char,
        /// The amplitude of the line.
        line_v: f64,
        /// What the comb can make.
        most_v: f64,
    },
}

/// The swings of x and y that a lock-in at both drives and their harmonics finds in some samples, all at once so that no axis leaks into the
/// other. The comb's law inverted makes amplitudes of their lines (see [`line_share`]); their signs are those that are nearer to the swings before.
pub fn swings(
    readout: &TwoAxisComb<f64>,
    (time_s, signal): (&[f64], &[f64]),
    drives_hz: [f64; 2],
    before: &[Swing],
) -> Result<Vec<Swing>, LineError> {
    let origin = *time_s.first().ok_or(LineError::Inseparable)?;
    let basis = |t: f64| {
        let mut columns = [1.0; COLUMNS];
        for (axis, drive_hz) in drives_hz.iter().enumerate() {
            for harmonic in 1..=HARMONICS {
                let (s, c) = (TAU * drive_hz * f64::from(harmonic) * (t - origin)).portable_sin_cos();
                let at = 1 + 6 * axis + 2 * usize::from(harmonic - 1);
                (columns[at], columns[at + 1]) = (c, s);
            }
        }
        columns
    };
    let lines = least_squares(time_s, signal, basis).ok_or(LineError::Inseparable)?;
    let left: Vec<f64> = (time_s.iter().zip(signal))
        .map(|(t, y)| y - basis(*t).iter().zip(&lines).map(|(b, line)| b * line).sum::<f64>())
        .collect();
    let samples = signal.iter().filter(|y| y.is_finite()).count();
    let sd_v = spread(&left) * (2.0 / samples as f64).sqrt();
    let swing = |axis: usize, comb: &GaussianComb<f64>| {
        let name = ['x', 'y'][axis];
        let [c, s] = [lines[1 + 6 * axis], lines[2 + 6 * axis]];
        let line_v = c.portable_hypot(s);
        if line_v < LEAST_LINE * sd_v {
            return Err(LineError::NoMotion { axis: name, line_v, sd_v });
        }
        let full = readout.gain * comb.nominal;
        let most_v = full.abs() * line_share(LARGEST);
        let too_large = LineError::TooLarge { axis: name, line_v, most_v };
        let amplitude = amplitude_of(line_v / full.abs()).ok_or(too_large)? * comb.angular_width;
        // The line is full·share·cos 2ψ with 2ψ = 2π·f·t′ + 2φ; of gain below 0 it is turned round.
        let turned = if full < 0.0 { PI } else { 0.0 };
        let phase = 0.5 * ((-s).portable_atan2(c) - turned);
        let rate = PI * drives_hz[axis];
        let swing = Swing { rest: 0.0, amplitude, rate, phase: phase - rate * origin };
        Ok(swing.nearest_to(before.get(axis)))
    };
    Ok(vec![swing(0, &readout.x)?, swing(1, &readout.y)?])
}

/// How long a window of the lock-in has to be in s, so that lines of one drive are told apart from those of the other: the
/// nearest two of them, of the first harmonics, are some widths of a line apart. Infinite where two lines coincide.
pub fn separating_s(drives_hz: [f64; 2]) -> f64 {
    let apart = |of_x: u8, of_y: u8| f64::from(of_x) * drives_hz[0] - f64::from(of_y) * drives_hz[1];
    let harmonics = || 1..=HARMONICS;
    let all = harmonics().flat_map(|of_x| harmonics().map(move |of_y| apart(of_x, of_y).abs()));
    LINE_WIDTHS / all.chain(drives_hz).fold(f64::INFINITY, f64::min)
}

/// The root mean square about the mean, of what is finite.
fn spread(values: &[f64]) -> f64 {
    let finite = || values.iter().filter(|v| v.is_finite());
    let count = finite().count().max(1) as f64;
    let mean = finite().sum::<f64>() / count;
    (finite().map(|v| (v - mean).powi(2)).sum::<f64>() / count).sqrt()
}

/// 2·e^{−z}·I₁(z) with z = ½·(A/θ₀)²: what a sine of amplitude A makes of the comb's C₀ at twice its frequency.
///
/// θ = A·sin ψ gives exp(−(θ/θ₀)²) = e^{−z}·e^{z·cos 2ψ}, whose line at 2ψ is 2·e^{−z}·I₁(z) by the generating function
/// of the modified Bessel functions (Abramowitz and Stegun 9.6.34). It rises up to A ≈ 1.76·θ₀.
pub fn line_share(amplitude_over_width: f64) -> f64 {
    let z = 0.5 * amplitude_over_width * amplitude_over_width;
    // I₁(z) = Σ (z/2)^{2k+1}/(k!·(k+1)!); z stays below 2, where 20 terms are beyond rounding.
    let (mut term, mut sum) = (0.5 * z, 0.0);
    for k in 1..=20 {
        sum += term;
        term *= 0.25 * z * z / f64::from(k * (k + 1));
    }
    2.0 * (-z).portable_exp() * sum
}

/// A/θ₀ where the line is largest.
const LARGEST: f64 = 1.757;

/// A/θ₀ that makes this share; `None` where none does.
fn amplitude_of(share: f64) -> Option<f64> {
    let (mut low, mut high) = (0.0, LARGEST);
    if share.is_nan() || share >= line_share(high) {
        return None;
    }
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if line_share(middle) < share { low = middle } else { high = middle }
    }
    Some(0.5 * (low + high))
}

//! Where the motion starts, from the first samples alone.

use super::data::PistonSegment;
use super::plates::{Plates, distance_at};
use crate::fit::{ByDual, FitError, FitSettings, ResidualLaw, fit, outliers};
use crate::signal::{fit_sine, fit_sine_at, white_noise_variance};
use kalmems_core::{Covariance, Mat, Over};
use std::f64::consts::TAU;

/// A motion with constant rates: [A, f, φ, d₀, Ȧ] at the first sample, and how well they are known from the samples
/// that it was fitted to.
#[derive(Clone, Copy, Debug)]
pub struct PistonBatchStart {
    /// [A, f, φ, d₀, Ȧ] in m, Hz, rad, m and m/s, with A > 0, f > 0 and φ in (−π, π].
    pub mean: [f64; 5],
    /// Their covariance, from the stated noise of a sample, or from what the fit leaves where that is far more; that of Ȧ is without limit where it
    /// was held at 0.
    pub covariance: Covariance<f64, 5>,
    /// Samples that were used.
    pub samples: usize,
    /// Samples whose capacitance no distance has, or that are missing.
    pub left_out: usize,
    /// The sum of squared residuals over its degrees of freedom, each divided by the noise: about 1 where motion and
    /// noise are as the device's table has them.
    pub mean_square: f64,
}

/// Why there is none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NoPistonBatchStart {
    /// Not even a sine was found in the distances.
    NoSine,
    /// The fit did not settle.
    NotFitted,
    /// It settled, and leaves far more than the noise.
    Poor {
        /// The mean square of the residuals over the noise.
        mean_square: f64,
    },
}

impl std::fmt::Display for NoPistonBatchStart {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::NoSine => f.write_str(
                "its first samples show no oscillation of the distance; a longer settling time (`estimate.skip`) gives a \
                 slow motion more of them",
            ),
            Self::NotFitted => f.write_str("no sinusoidal motion fits its first samples"),
            Self::Poor { mean_square } => write!(
                f,
                "the best sinusoidal motion leaves {mean_square:.3} times the stated noise in its first samples; the \
                 noise, the electrodes or the motion are not as described"
            ),
        }
    }
}

/// The first samples that are looked at, in s: ten cycles of a mirror at 500 Hz.
pub const WINDOW_S: f64 = 20e-3;
/// Cycles that the window must hold at least; it grows until it does.
pub const CYCLES: f64 = 6.0;

/// The rows that a filter is started again by that has lost its signal, at this interval in s.
pub fn rows_of_window(interval_s: f64) -> usize {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a positive count, saturating
    let rows = (WINDOW_S / interval_s).ceil() as usize;
    rows
}

/// How often samples are left out and the motion is fitted anew.
const ROUNDS: usize = 6;
/// What a fit may leave of the noise's mean square, by the larger of the stated noise and of what neighbouring samples show. A window of 400 samples varies by 7 %, a lost start leaves
/// thousands.
const POOR: f64 = 4.0;

/// Fits a motion to the first samples of a segment, from any phase: the capacitances as distances, the largest line of
/// their spectrum with linear least squares and Gauss–Newton steps on its frequency ([`fit_sine`]), and from
/// there Gauss–Newton steps on the capacitances themselves, which weigh each sample as it deserves. Where a trigger tells
/// the frequency, no line is looked for.
///
/// Ȧ is held at 0: so short a window says nothing of it.
pub fn batch_start(plates: &Plates, data: &PistonSegment) -> Result<PistonBatchStart, NoPistonBatchStart> {
    batch_start_of(plates, data, false)
}

/// The same of a motion that may have a second and a third harmonic; the start is that of its sine.
pub fn batch_start_of(
    plates: &Plates,
    data: &PistonSegment,
    has_harmonics: bool,
) -> Result<PistonBatchStart, NoPistonBatchStart> {
    let first_s = data.time_s.first().copied().ok_or(NoPistonBatchStart::NoSine)?;
    let mut window_s = WINDOW_S;
    loop {
        let end = data.time_s.partition_point(|t| *t < first_s + window_s);
        let window = PistonSegment { time_s: &data.time_s[..end], signal: &data.signal[..end], ..*data };
        let start = within(plates, &window, has_harmonics);
        let enough = start.as_ref().is_ok_and(|start| start.mean[1] * window_s >= CYCLES);
        if enough || end == data.time_s.len() {
            return start;
        }
        window_s *= 2.0;
    }
}

/// The same in one window, without the samples that are none of the signal by what the motion leaves of them.
fn within(
    plates: &Plates,
    window: &PistonSegment,
    has_harmonics: bool,
) -> Result<PistonBatchStart, NoPistonBatchStart> {
    let mut signal = window.signal.to_vec();
    let (mut found, mut parameters) = of_all(plates, window, has_harmonics)?;
    for _ in 0..ROUNDS {
        let law = MotionLaw { plates, window };
        let mut residuals = Vec::with_capacity(signal.len());
        law.residuals(&parameters, &mut |residual: f64| residuals.push(residual));
        let Some(is_out) = outliers(&residuals) else { break };
        let mut is_out = is_out.into_iter();
        // Those that are no number have no residual.
        let used = window
            .signal
            .iter()
            .map(|y| if y.is_finite() && is_out.next() == Some(true) { f64::NAN } else { *y });
        let used: Vec<f64> = used.collect();
        if used.iter().zip(&signal).all(|(new, old)| new.is_nan() == old.is_nan()) {
            break;
        }
        signal = used;
        (found, parameters) = of_all(plates, &PistonSegment { signal: &signal, ..*window }, has_harmonics)?;
    }
    // Neighbouring samples show the noise where less is stated: then the verdict names the factor, and the motion is found all the same.
    let shown = white_noise_variance(window.signal).unwrap_or(0.0) / window.noise_variance;
    if found.mean_square > POOR * shown.max(1.0) {
        return Err(NoPistonBatchStart::Poor { mean_square: found.mean_square });
    }
    if found.mean_square <= POOR {
        return Ok(found);
    }
    let covariance = found.covariance.to_full().scaled(found.mean_square);
    Ok(PistonBatchStart { covariance: Covariance::from_lower(covariance), ..found })
}

/// The start by all samples of a window, and what was fitted to them.
fn of_all(
    plates: &Plates,
    window: &PistonSegment,
    has_harmonics: bool,
) -> Result<(PistonBatchStart, [f64; WITH_HARMONICS]), NoPistonBatchStart> {
    let first_s = window.time_s.first().copied().ok_or(NoPistonBatchStart::NoSine)?;
    let distances: Vec<f64> =
        window.signal.iter().map(|c| distance_at(plates, *c).unwrap_or(f64::NAN)).collect();
    let times: Vec<f64> = window.time_s.iter().map(|t| t - first_s).collect();
    let sine = match window.motion_hz {
        Some(frequency_hz) => fit_sine_at(&times, &distances, frequency_hz),
        None => fit_sine(&times, &distances, window.interval_s),
    };
    let sine = sine.ok_or(NoPistonBatchStart::NoSine)?;
    let from = [sine.amplitude, sine.frequency_hz, sine.phase_rad, sine.offset, 0.0];
    let found = if has_harmonics {
        fit_motion::<WITH_HARMONICS>(plates, window, from, false)
    } else {
        fit_motion::<5>(plates, window, from, false)
            .map(|(start, sine)| (start, std::array::from_fn(|i| sine.get(i).copied().unwrap_or(0.0))))
    };
    let (mut start, parameters) = found.map_err(|_| NoPistonBatchStart::NotFitted)?;
    start.left_out = distances.iter().filter(|d| !d.is_finite()).count();
    Ok((start, parameters))
}

/// The motion with constant rates that fits the capacitances of a window best, from a start nearby; `drifts` says
/// whether Ȧ is fitted too.
pub fn batch_fit(
    plates: &Plates,
    window: &PistonSegment,
    start: [f64; 5],
    drifts: bool,
) -> Result<PistonBatchStart, FitError> {
    fit_motion::<5>(plates, window, start, drifts).map(|(start, _)| start)
}

/// [A, f, φ, d₀, Ȧ], and the amplitudes of the harmonics.
const WITH_HARMONICS: usize = 9;

/// The same with the parameters as they were fitted: five, or nine with harmonics.
fn fit_motion<const N: usize>(
    plates: &Plates,
    window: &PistonSegment,
    start: [f64; 5],
    drifts: bool,
) -> Result<(PistonBatchStart, [f64; N]), FitError> {
    let law = ByDual(MotionLaw { plates, window });
    let from = std::array::from_fn(|i| start.get(i).copied().unwrap_or(0.0));
    let free: [bool; N] = std::array::from_fn(|i| i != 4 || drifts);
    let settings = FitSettings { free, tolerance: 1e-10, ..FitSettings::from_start(from) };
    let found = fit(&law, &settings)?;
    let mean_square = found.residual_deviation().powi(2);
    // The fit scales by what it found of the noise; here the noise is known.
    let all = found.covariance.to_full().scaled(mean_square.recip());
    let mut covariance = Mat::<f64, 5, 5>::from_fn(|i, j| all.0[i][j]);
    if !drifts {
        covariance.0[4][4] = f64::INFINITY;
    }
    let of_sine = std::array::from_fn(|i| found.parameters.get(i).copied().unwrap_or(f64::NAN));
    let start = PistonBatchStart {
        mean: canonical(of_sine),
        covariance: Covariance::from_lower(covariance),
        samples: found.degrees_of_freedom + free.iter().filter(|is_free| **is_free).count(),
        left_out: 0,
        mean_square,
    };
    Ok((start, found.parameters))
}

/// The same motion with A > 0, f > 0 and φ in (−π, π].
///
/// (A, f, φ, Ȧ) and (−A, f, φ + π, −Ȧ) are one motion, and so are (f, φ) and (−f, −φ).
pub fn canonical([amplitude, frequency, phase, offset, drift]: [f64; 5]) -> [f64; 5] {
    let (mut phase, sign) = if amplitude < 0.0 { (phase + TAU / 2.0, -1.0) } else { (phase, 1.0) };
    if frequency < 0.0 {
        phase = -phase;
    }
    [sign * amplitude, frequency.abs(), wrapped(phase), offset, sign * drift]
}

/// φ in (−π, π].
pub fn wrapped(phase: f64) -> f64 {
    phase - TAU * (phase / TAU - 0.5).ceil()
}

/// The samples of a window less a motion, over the noise.
struct MotionLaw<'a> {
    plates: &'a Plates,
    window: &'a PistonSegment<'a>,
}

impl<const N: usize> ResidualLaw<N> for MotionLaw<'_> {
    fn residuals<S: Over<f64>>(&self, p: &[S; N], each: &mut impl FnMut(S)) {
        let weight = self.window.noise_variance.sqrt().recip();
        let first_s = self.window.time_s.first().copied().unwrap_or(0.0);
        let samples = self.window.time_s.iter().zip(self.window.signal).filter(|(_, y)| y.is_finite());
        for (time, y) in samples {
            let t = time - first_s;
            let phase = p[2] + p[1] * (TAU * t);
            let mut distance = (p[0] + p[4] * t) * phase.cos() + p[3];
            if let [c2, s2, c3, s3] = p[5..] {
                let (double, triple) = (phase * 2.0, phase * 3.0);
                distance =
                    distance + c2 * double.cos() + s2 * double.sin() + c3 * triple.cos() + s3 * triple.sin();
            }
            each((self.plates.capacitance(distance) - *y) * weight);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    #[test]
    fn mirrored_motions_are_one() {
        let at = |[a, f, phase, rest, drift]: [f64; 5], t: f64| {
            rest + (a + drift * t) * (phase + TAU * f * t).cos()
        };
        for motion in
            [[-5e-4, 500.0, 2.0, 1e-3, 1e-6], [5e-4, -500.0, -2.0, 1e-3, 1e-6], [-1.0, -2.0, 9.0, 0.0, 3.0]]
        {
            let found = canonical(motion);
            assert!(found[0] > 0.0 && found[1] > 0.0 && found[2].abs() <= TAU / 2.0);
            for t in [0.0, 1e-4, 0.3] {
                assert_abs_diff_eq!(at(motion, t), at(found, t), epsilon = 1e-12);
            }
        }
        assert_eq!(wrapped(TAU / 2.0), TAU / 2.0);
        assert_abs_diff_eq!(wrapped(-TAU / 2.0), TAU / 2.0, epsilon = 1e-15);
        assert_abs_diff_eq!(wrapped(7.0), 7.0 - TAU, epsilon = 1e-15);
    }
}

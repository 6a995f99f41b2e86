//! What errors of the position do to a spectrum.

use std::f64::consts::PI;

/// The largest wavenumber in 1/m that a detector sampled at a rate in Hz can see while the mirror moves at a speed in
/// m/s: the path changes by twice that, and a wavenumber ν makes ν times that speed in Hz.
///
/// ```
/// use kalmems::applications::spectrum::detector_limit;
/// // 0.5 mm at 500 Hz, sampled at 194 kHz: 309 per cm.
/// let speed = 2.0 * std::f64::consts::PI * 500.0 * 0.5e-3;
/// assert!((detector_limit(194e3, speed) / 100.0 - 309.0).abs() < 0.5);
/// ```
pub fn detector_limit(sampling_rate_hz: f64, mirror_speed_m_per_s: f64) -> f64 {
    sampling_rate_hz / (4.0 * mirror_speed_m_per_s)
}

/// What is left of a line's height at a wavenumber in 1/m when the mirror's position has white errors of a standard
/// deviation in m: exp(−(4π·ν·σ)²/2).
pub fn line_height(wavenumber_per_m: f64, position_sd_m: f64) -> f64 {
    (-0.5 * (4.0 * PI * wavenumber_per_m * position_sd_m).powi(2)).exp()
}

/// How far a line at a wavenumber in 1/m is shifted, in 1/m, when the amplitude of the motion is taken δA too large
/// relative to it: every path difference is too long by that share, and the wavenumber too small.
pub fn line_shift(wavenumber_per_m: f64, relative_amplitude_error: f64) -> f64 {
    -wavenumber_per_m * relative_amplitude_error
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::applications::spectrum::{Apodisation, line_near, path_weights, spectrum_at};
    use crate::simulate::WhiteNoise;
    use std::f64::consts::TAU;

    /// Against spectra that are computed with such errors.
    #[test]
    fn heights_and_shifts_are_those_of_computed_spectra() {
        let (largest, line, n) = (1e-3, 200e3, 20_000_i32);
        let x: Vec<f64> = (-n..=n).map(|k| largest * f64::from(k) / f64::from(n)).collect();
        let y: Vec<f64> = x.iter().map(|x| (TAU * line * x).cos()).collect();
        let settings = (Apodisation::Triangular, largest);
        let grid: Vec<f64> = (0..201).map(|i| line - 500.0 + 5.0 * f64::from(i)).collect();
        let found = |positions: &[f64]| {
            let weights = path_weights(&x);
            let values: Vec<f64> =
                grid.iter().map(|nu| spectrum_at(*nu, positions, (&y, &weights), settings).re).collect();
            line_near(&grid, &values, line, 400.0).unwrap()
        };
        let ideal = found(&x);
        let mut noise = WhiteNoise::new(3, 0);
        let sd = 150e-9;
        let shaken: Vec<f64> = x.iter().map(|x| x + 2.0 * sd * noise.sample()).collect();
        let left = found(&shaken).height / ideal.height;
        assert!((left - line_height(line, sd)).abs() < 0.01, "{left} {}", line_height(line, sd));
        let longer: Vec<f64> = x.iter().map(|x| x * (1.0 + 5e-4)).collect();
        let shift = found(&longer).wavenumber_per_m - ideal.wavenumber_per_m;
        assert!((shift - line_shift(line, 5e-4)).abs() < 0.2, "{shift}");
    }
}

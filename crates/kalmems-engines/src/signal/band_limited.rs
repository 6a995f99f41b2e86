//! What a signal was between its samples.

use kalmems_core::Portable;
use std::f64::consts::PI;

/// How many samples on each side have a say.
const REACH: i32 = 16;

/// β: larger lets less through from beyond the band, and narrows the band.
const SHARPNESS: f64 = 12.0;

/// The value of a uniformly sampled signal at a position counted in samples, from the 16 samples on each side.
///
/// By the sampling theorem a signal without content at or above half the sampling rate is a sum of shifted
/// sin(πx)/(πx), one per sample. Here each is shortened by the window exp(12·(√(1 − (x/16)²) − 1)), which is
/// close to Kaiser's and needs no Bessel function (Barnett, Magland and af Klinteberg, SIAM J. Sci. Comput. 41, C479,
/// 2019), and the weights are scaled to add up to 1. Up to 0.36
/// cycles per sample the error is below 4 · 10⁻⁶ of the amplitude; nearer to half the rate it grows. Beyond its ends the signal counts as held. A sample that is
/// not finite makes its whole neighbourhood so.
///
/// ```
/// use kalmems_engines::signal::band_limited;
/// // 0.3 cycles per sample: a straight line between these samples would be off by up to 0.4.
/// let sine = |x: f64| (std::f64::consts::TAU * 0.3 * x).sin();
/// let samples: Vec<f64> = (0..100).map(|k| sine(f64::from(k))).collect();
/// assert!((band_limited(&samples, 50.4) - sine(50.4)).abs() < 1e-5);
/// ```
pub fn band_limited(samples: &[f64], position: f64) -> f64 {
    let Some(last) = samples.len().checked_sub(1) else { return f64::NAN };
    let below = position.floor();
    let fraction = position - below;
    // sin(π(x − n)) alternates in sign from sample to sample.
    let sine = (PI * fraction).portable_sin() / PI;
    let (mut total, mut weights) = (0.0, 0.0);
    for n in 1 - REACH..=REACH {
        let distance = fraction - f64::from(n);
        let sign = if n % 2 == 0 { 1.0 } else { -1.0 };
        let sinc = if distance == 0.0 { 1.0 } else { sign * sine / distance };
        let inside = (1.0 - (distance / f64::from(REACH)).powi(2)).max(0.0);
        let weight = sinc * (SHARPNESS * (inside.sqrt() - 1.0)).portable_exp();
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturates: held beyond the ends
        let index = (below + f64::from(n)) as usize;
        total += weight * samples[index.min(last)];
        weights += weight;
    }
    total / weights
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn sines_within_the_band_are_followed_to_four_millionths() {
        let sine = |frequency: f64, x: f64| (TAU * frequency * x + 0.3).sin();
        for frequency in [0.01, 0.11, 0.2, 0.3, 0.36] {
            let samples: Vec<f64> = (0..64).map(|k| sine(frequency, f64::from(k))).collect();
            for step in 0..=320 {
                let x = 16.0 + 0.1 * f64::from(step);
                let error = band_limited(&samples, x) - sine(frequency, x);
                assert!(error.abs() < 4e-6, "{frequency} at {x}: {error}");
            }
        }
    }

    #[test]
    fn at_a_sample_it_is_the_sample_and_beyond_the_ends_it_is_held() {
        let samples: Vec<f64> = (0..40_u32).map(|k| f64::from(k * 7919 % 13)).collect();
        for (k, sample) in samples.iter().enumerate() {
            assert_eq!(band_limited(&samples, k as f64), *sample);
        }
        assert_eq!(band_limited(&samples, -100.3), samples[0]);
        assert!((band_limited(&samples, 1e9 + 0.3) - samples[39]).abs() < 1e-12);
        assert!(band_limited(&[], 0.0).is_nan() && band_limited(&samples, f64::NAN).is_nan());
        // What is not a number is not made up, and spoils no more than its neighbourhood.
        let mut holed = samples.clone();
        holed[20] = f64::NAN;
        assert!(band_limited(&holed, 19.5).is_nan());
        assert_eq!(band_limited(&holed, 3.5), band_limited(&samples, 3.5));
    }
}

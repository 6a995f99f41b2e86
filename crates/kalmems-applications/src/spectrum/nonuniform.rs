//! The spectrum of an interferogram with samples at any path differences.

use super::Apodisation;
use kalmems_core::Portable;
use realfft::num_complex::Complex64;
use std::f64::consts::TAU;

/// How much of the path each sample stands for, in m: half the way from the sample before to the one behind, whichever
/// way the mirror goes.
///
/// With samples at equal times that is the speed times the interval. Without it the slow ends of the stroke, where
/// samples are dense, would count far too much.
pub fn path_weights(position_m: &[f64]) -> Vec<f64> {
    let n = position_m.len();
    (0..n)
        .map(|k| {
            let (before, after) = (k.saturating_sub(1), (k + 1).min(n - 1));
            (position_m[after] - position_m[before]).abs() / 2.0
        })
        .collect()
}

/// Σ y·w·a(x)·e^{−i·2π·ν·x} at one wavenumber in 1/m, over the samples whose path difference is within the largest one;
/// in the unit of [`transform`](super::transform), which it equals for samples at equal path differences.
///
/// Scans are co-added by giving the samples of all of them, each scan with its own weights, over their number.
pub fn spectrum_at(
    wavenumber_per_m: f64,
    position_m: &[f64],
    (value, weight): (&[f64], &[f64]),
    (apodisation, largest_m): (Apodisation, f64),
) -> Complex64 {
    let mut sum = Complex64::new(0.0, 0.0);
    for ((x, y), w) in position_m.iter().zip(value).zip(weight) {
        let (s, c) = (TAU * wavenumber_per_m * x).portable_sin_cos();
        let size = y * w * apodisation.weight(x / largest_m);
        sum += Complex64::new(size * c, -size * s);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::signal::PortableComplex;
    use crate::spectrum::transform;

    const LARGEST: f64 = 1e-3;

    fn light(x: f64) -> f64 {
        (TAU * 200e3 * x).cos() + 0.5 * (TAU * 201e3 * x).cos() + 0.3 * (TAU * 160e3 * x + 0.2).cos()
    }

    #[test]
    fn at_equal_steps_it_is_the_transform() {
        let half = 1000_i32;
        let step = LARGEST / f64::from(half);
        let x: Vec<f64> = (-half..=half).map(|k| step * f64::from(k)).collect();
        let y: Vec<f64> = x.iter().map(|x| light(*x)).collect();
        let mean = y.iter().sum::<f64>() / y.len() as f64;
        let y: Vec<f64> = y.iter().map(|y| y - mean).collect();
        let settings = (Apodisation::HappGenzel, LARGEST);
        let uniform = transform(&y, 1000, step, settings, 8192).unwrap();
        // But for the ends, where half a step is missing.
        let mut weights = path_weights(&x);
        weights[0] *= 2.0;
        weights[2000] *= 2.0;
        for index in [1000, 1638, 1646, 2000] {
            let found = spectrum_at(uniform.wavenumber(index), &x, (&y, &weights), settings);
            assert!((found - uniform.values[index]).portable_norm() < 1e-12 * LARGEST, "{index}");
        }
    }

    /// Along half a period of a sinusoid, dense enough for its fastest part.
    #[test]
    fn along_a_sinusoid_it_is_that_of_equal_steps() {
        let n = 6000_i32;
        let x: Vec<f64> =
            (0..=n).map(|k| -LARGEST * (TAU / 2.0 * f64::from(k) / f64::from(n)).cos()).collect();
        let y: Vec<f64> = x.iter().map(|x| light(*x)).collect();
        let half = 4000_i32;
        let even: Vec<f64> = (-half..=half).map(|k| LARGEST / f64::from(half) * f64::from(k)).collect();
        let of_even: Vec<f64> = even.iter().map(|x| light(*x)).collect();
        let settings = (Apodisation::NortonBeerMedium, LARGEST);
        let (weights, even_weights) = (path_weights(&x), path_weights(&even));
        for nu in [158e3, 160e3, 199.5e3, 200e3, 200.6e3, 201e3] {
            let found = spectrum_at(nu, &x, (&y, &weights), settings);
            let expected = spectrum_at(nu, &even, (&of_even, &even_weights), settings);
            assert!((found - expected).portable_norm() < 1e-4 * LARGEST, "{nu}: {found} {expected}");
            // Without the weights it is another spectrum.
            let equal = vec![2.0 * LARGEST / f64::from(n); x.len()];
            let unweighted = spectrum_at(nu, &x, (&y, &equal), settings);
            assert!((unweighted - expected).portable_norm() > 5e-3 * LARGEST, "{nu}");
        }
    }
}

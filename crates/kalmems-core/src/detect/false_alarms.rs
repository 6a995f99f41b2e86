//! How often noise alone looks like an edge.

use super::DetectError;
use core::f64::consts::{PI, SQRT_2};

/// The maxima of filtered white noise: how many there are per sample, and how high.
///
/// For a Gaussian process with the variances λ₀, λ₂, λ₄ of itself and its first two derivatives (Rice, Bell System
/// Technical Journal 24, 46, 1945; Cartwright & Longuet-Higgins, Proc. Royal Society A 237, 212, 1956): with the
/// bandwidth ε² = 1 − λ₂²/(λ₀·λ₄) the maxima above η standard deviations have the density
///
/// N(η) = (1/2π)·√(λ₄/λ₂)·[Q(η/ε) + √(1−ε²)·e^{−η²/2}·(1 − Q(η·√(1−ε²)/ε))], Q the tail of the normal distribution.
///
/// For the derivative of a Gaussian of s samples λ₂/λ₀ = 3/(2s²), λ₄/λ₂ = 5/(2s²), ε² = 2/5. The formula is that of a
/// continuous process; a response known at the samples alone has as many maxima as long as s is a few samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoiseMaxima {
    /// Maxima per sample, of any height.
    density: f64,
    /// √(1 − ε²) = λ₂/√(λ₀·λ₄).
    narrowness: f64,
}

/// Q(x), the chance of a standard normal number above x.
fn tail(x: f64) -> f64 {
    0.5 * libm::erfc(x / SQRT_2)
}

impl NoiseMaxima {
    /// From λ₀, λ₂ and λ₄, in samples.
    pub(super) fn of_moments([zeroth, second, fourth]: [f64; 3]) -> Self {
        Self {
            density: libm::sqrt(fourth / second) / (2.0 * PI),
            narrowness: second / libm::sqrt(zeroth * fourth),
        }
    }

    /// N(η): maxima per sample above `deviations` standard deviations of the response.
    pub fn above(&self, deviations: f64) -> f64 {
        let bandwidth = libm::sqrt((1.0 - self.narrowness * self.narrowness).max(f64::MIN_POSITIVE));
        let narrow = self.narrowness * libm::exp(-deviations * deviations / 2.0);
        self.density
            * (tail(deviations / bandwidth) + narrow * tail(-deviations * self.narrowness / bandwidth))
    }

    /// False alarms per sample: the maxima above `deviations` that have no higher one within `reach` samples.
    ///
    /// Higher maxima are taken to come independently of each other, so that one of height η is left with the chance
    /// e^{−2·reach·N(η)}; over all heights that is (1 − e^{−2·reach·N})/(2·reach).
    pub fn detections(&self, deviations: f64, reach: usize) -> f64 {
        let span = 2.0 * reach as f64;
        if span > 0.0 { -libm::expm1(-span * self.above(deviations)) / span } else { self.above(deviations) }
    }

    /// The level, in standard deviations of the response, with this many false alarms per sample.
    ///
    /// # Errors
    /// Where the rate is not positive, or as large as that of all positive maxima.
    pub fn level(&self, per_sample: f64, reach: usize) -> Result<f64, DetectError> {
        let largest = self.detections(0.0, reach);
        // Not a number fails both.
        if !(per_sample > 0.0 && per_sample < largest) {
            return Err(DetectError::Rate { per_sample, largest });
        }
        // Beyond 38 σ the tail is below the smallest number.
        let (mut low, mut high) = (0.0, 38.0);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if self.detections(middle, reach) > per_sample {
                low = middle;
            } else {
                high = middle;
            }
        }
        Ok(0.5 * (low + high))
    }
}

//! Gaussian noise that is the same on every machine.

use kalmems_core::Scalar;
use rand_pcg::Pcg64;
use rand_pcg::rand_core::Rng;
use std::f64::consts::TAU;

/// White noise of mean 0 and variance 1.
///
/// PCG64 (the 128-bit XSL RR generator of O'Neill, PCG: A Family of Simple Fast Space-Efficient Statistically Good
/// Algorithms for Random Number Generation, 2014) and Box and Muller's transformation (Annals of Mathematical Statistics
/// 29, 610, 1958). Seed and stream say which numbers come; streams of one seed are independent.
///
/// ```
/// use kalmems_engines::simulate::WhiteNoise;
/// let (mut a, mut b) = (WhiteNoise::new(1, 0), WhiteNoise::new(1, 0));
/// assert!((0..100).all(|_| a.sample() == b.sample()));
/// assert_ne!(WhiteNoise::new(1, 1).sample(), WhiteNoise::new(1, 0).sample());
/// ```
#[derive(Clone, Debug)]
pub struct WhiteNoise {
    generator: Pcg64,
    /// The second of a pair.
    spare: Option<f64>,
}

impl WhiteNoise {
    /// Its name in records of runs.
    pub const NAME: &'static str = "PCG64 (XSL RR 128/64), Box-Muller";

    /// The noise of this seed and stream.
    pub fn new(seed: u64, stream: u64) -> Self {
        Self { generator: Pcg64::new(seed.into(), stream.into()), spare: None }
    }

    /// The next sample.
    pub fn sample(&mut self) -> f64 {
        if let Some(spare) = self.spare.take() {
            return spare;
        }
        // Above 0, so that the logarithm is finite: the largest deviation is 8.6.
        let radius = Scalar::sqrt(-2.0 * Scalar::ln(1.0 - self.uniform()));
        let angle = TAU * self.uniform();
        self.spare = Some(radius * Scalar::sin(angle));
        radius * Scalar::cos(angle)
    }

    /// In [0, 1), from the upper 53 bits.
    pub fn uniform(&mut self) -> f64 {
        (self.generator.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use statrs::distribution::{ContinuousCDF, Normal};

    /// The first numbers of O'Neill's own program `pcg64-demo`, which starts from 42 and 54.
    #[test]
    fn the_generator_is_the_published_one() {
        let mut noise = WhiteNoise::new(42, 54);
        let published = [0x86b1_da1d_7206_2b68_u64, 0x1304_aa46_c985_3d39, 0xa367_0e9e_0dd5_0358];
        assert_eq!(published.map(|_| noise.generator.next_u64()), published);
    }

    /// Kolmogorov and Smirnov's distance, and that neighbours have nothing to do with each other.
    #[test]
    fn the_noise_is_gaussian_and_white() {
        const COUNT: usize = 100_000;
        let mut noise = WhiteNoise::new(7, 3);
        let samples: Vec<f64> = (0..COUNT).map(|_| noise.sample()).collect();
        for lag in 1..=3 {
            let sum: f64 = samples.iter().zip(&samples[lag..]).map(|(a, b)| a * b).sum();
            assert!(sum.abs() < 4.0 * (COUNT as f64).sqrt(), "lag {lag}: {sum}");
        }
        let mut sorted = samples;
        sorted.sort_by(f64::total_cmp);
        let normal = Normal::standard();
        let distance = sorted
            .iter()
            .enumerate()
            .map(|(i, x)| (normal.cdf(*x) - (i as f64 + 0.5) / COUNT as f64).abs())
            .fold(0.0, f64::max);
        // 1 in 1000 samples of a Gaussian would be further off than 1.95/√n.
        assert!(distance < 1.95 / (COUNT as f64).sqrt(), "{distance}");
    }
}

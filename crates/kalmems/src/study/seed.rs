//! Seeds and draws that follow from the study's seed and a run's index alone.

use crate::simulate::WhiteNoise;
use sha2::{Digest, Sha256};

/// Bits of a seed: as many as an `f64` keeps, so that no table program changes it.
const BITS: u32 = 53;

/// The seed of a run's noise.
pub(super) fn noise(seed: u64, run: u64) -> u64 {
    number("noise", &[seed, run])
}

/// What chance says of one varied key in one run.
#[derive(Clone, Copy, Debug)]
pub(super) struct Draw(u64);

impl Draw {
    /// Of the key at this place among those that vary.
    pub(super) fn of(seed: u64, run: u64, axis: usize) -> Self {
        Self(number("draw", &[seed, run, axis as u64]))
    }

    /// Of the parameter at this place among those that a device may be uncertain in.
    pub(super) fn of_prior(seed: u64, run: u64, parameter: usize) -> Self {
        Self(number("prior", &[seed, run, parameter as u64]))
    }

    /// Of the direction at this place in which a device is stated as uncertain.
    pub(super) fn of_device(seed: u64, run: u64, direction: usize) -> Self {
        Self(number("device", &[seed, run, direction as u64]))
    }

    /// With mean 0 and standard deviation 1.
    pub(super) fn normal(self) -> f64 {
        WhiteNoise::new(self.0, 0).sample()
    }

    /// From 0 to below 1.
    pub(super) fn uniform(self) -> f64 {
        self.0 as f64 / (1_u64 << BITS) as f64
    }
}

/// A number of 53 bits by SHA-256: numbers of neighbouring runs have nothing to do with each other.
fn number(purpose: &str, of: &[u64]) -> u64 {
    let mut hash = Sha256::new();
    hash.update(purpose);
    for value in of {
        hash.update(value.to_le_bytes());
    }
    let digest = hash.finalize();
    let bytes = digest.iter().take(8);
    bytes.fold(0, |number, byte| (number << 8) | u64::from(*byte)) >> (64 - BITS)
}

#[cfg(test)]
mod tests {
    use super::*;
    use statrs::distribution::{ContinuousCDF, Normal};

    /// Kolmogorov and Smirnov's distance, for draws of neighbouring runs.
    #[test]
    fn draws_of_neighbouring_runs_follow_their_distribution() {
        const COUNT: u64 = 20_000;
        let normal = Normal::standard();
        let uniform: Vec<f64> = (0..COUNT).map(|run| Draw::of(3, run, 1).uniform()).collect();
        let gaussian: Vec<f64> = (0..COUNT).map(|run| normal.cdf(Draw::of(3, run, 0).normal())).collect();
        for mut sample in [uniform, gaussian] {
            let neighbours: f64 = sample.windows(2).map(|w| (w[0] - 0.5) * (w[1] - 0.5)).sum();
            // Each product has the variance 1/144.
            assert!((neighbours * 12.0).abs() < 4.0 * (COUNT as f64).sqrt(), "{neighbours}");
            sample.sort_by(f64::total_cmp);
            let distance = sample
                .iter()
                .enumerate()
                .map(|(i, p)| (p - (i as f64 + 0.5) / COUNT as f64).abs())
                .fold(0.0, f64::max);
            // 1 in 1000 samples would be further off than 1.95/√n.
            assert!(distance < 1.95 / (COUNT as f64).sqrt(), "{distance}");
        }
    }

    #[test]
    fn no_two_runs_share_their_noise() {
        let seeds: std::collections::BTreeSet<u64> =
            (0..3).flat_map(|seed| (0..10_000).map(move |run| noise(seed, run))).collect();
        assert_eq!(seeds.len(), 30_000);
    }
}

//! Whether ranks are distributed uniformly.

use serde::Serialize;
use statrs::distribution::{Binomial, ChiSquared, ContinuousCDF, DiscreteCDF, Normal};

/// A histogram of ranks and what it says.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Uniformity {
    /// How many ranks lie in each of as many equally wide bins between 0 and 1.
    pub counts: Vec<u64>,
    /// Between which counts all bins lie together with 99 % probability where the ranks are uniform.
    pub band: [u64; 2],
    /// Pearson's χ² of the counts.
    pub chi_square: f64,
    /// The probability of one as large where the ranks are uniform.
    pub p_value: f64,
}

/// Bins of a histogram at most, and ranks in each on average at least.
const BINS: usize = 20;
const IN_EACH: usize = 10;

/// What lies outside of a band.
const OUTSIDE: f64 = 0.01;

impl Uniformity {
    /// Of errors (truth − estimate)/sd that are independent of each other; `None` of too few to tell.
    pub fn of(deviates: &[f64]) -> Option<Self> {
        let normal = Normal::standard();
        let bins = (deviates.len() / IN_EACH).min(BINS);
        if bins < 2 {
            return None;
        }
        let mut counts = vec![0_u64; bins];
        for deviate in deviates {
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
            // between 0 and the number of bins
            let bin = (normal.cdf(*deviate) * bins as f64) as usize;
            counts[bin.min(bins - 1)] += 1;
        }
        let (n, share) = (deviates.len() as f64, 1.0 / bins as f64);
        let expected = n * share;
        let chi_square = counts.iter().map(|count| (*count as f64 - expected).powi(2) / expected).sum();
        let p_value = ChiSquared::new(bins as f64 - 1.0).ok()?.sf(chi_square);
        // Each bin by itself is outside so much more seldom (Bonferroni).
        let one = Binomial::new(share, deviates.len() as u64).ok()?;
        let tail = 0.5 * OUTSIDE * share;
        Some(Self { counts, band: [one.inverse_cdf(tail), one.inverse_cdf(1.0 - tail)], chi_square, p_value })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::WhiteNoise;

    fn of_normal(size: f64, offset: f64, seed: u64, count: usize) -> Uniformity {
        let mut noise = WhiteNoise::new(seed, 3);
        let deviates: Vec<f64> = (0..count).map(|_| size * noise.sample() + offset).collect();
        Uniformity::of(&deviates).unwrap()
    }

    /// Of a claim that holds the p value is uniform itself and one histogram in a hundred leaves its band; 0.13 standard deviations
    /// of bias and 10 % of size are seen in 10⁴ ranks.
    #[test]
    fn a_claim_that_holds_looks_uniform_and_another_one_does_not() {
        let sets = 400;
        let (mut below, mut outside) = (0, 0);
        for seed in 0..sets {
            let found = of_normal(1.0, 0.0, seed, 600);
            assert_eq!((found.counts.len(), found.counts.iter().sum::<u64>()), (20, 600));
            below += u32::from(found.p_value < 0.1);
            outside += u32::from(found.counts.iter().any(|c| *c < found.band[0] || found.band[1] < *c));
        }
        // 40 ± 6 of 400, and 4 ± 2 at most.
        assert!((22..58).contains(&below) && outside < 13, "{below}, {outside}");
        assert!(of_normal(1.1, 0.0, 1, 10_000).p_value < 1e-6);
        assert!(of_normal(1.0, 0.13, 1, 10_000).p_value < 1e-6);
        assert_eq!(Uniformity::of(&[0.0; 19]), None);
        // What is infinitely far off is in the last bin.
        assert_eq!(Uniformity::of(&[f64::INFINITY; 20]).unwrap().counts, [0, 20]);
    }
}

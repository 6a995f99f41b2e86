//! Whether values are normally distributed, their mean and variance unknown.

use super::bench::moments;
use statrs::distribution::{ContinuousCDF, Normal};

/// What the test says of some values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lilliefors {
    /// How many values.
    pub count: usize,
    /// D: the largest distance between their distribution and the normal one with their mean and variance.
    pub distance: f64,
    /// D·(√n − 0.01 + 0.85/√n), which is large where they are not normal, about alike for every n.
    pub modified: f64,
}

/// What the modified distance exceeds in 5 % of all normal samples.
const CRITICAL: f64 = 0.895;

impl Lilliefors {
    /// Tests values. `None` where there are fewer than five, or all are the same.
    ///
    /// Lilliefors, Journal of the American Statistical Association 62, 399 (1967); the modified distance and its critical
    /// value are those of Stephens, the same journal 69, 730 (1974), table 1A, case 3.
    pub fn of(values: &[f64]) -> Option<Self> {
        let (mean, deviation) = moments(values);
        let normal = Normal::new(mean, deviation).ok()?;
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        let n = sorted.len() as f64;
        if n < 5.0 {
            return None;
        }
        let distance = sorted.iter().enumerate().map(|(i, value)| {
            let expected = normal.cdf(*value);
            (expected - i as f64 / n).abs().max(((i + 1) as f64 / n - expected).abs())
        });
        let distance = distance.fold(0.0, f64::max);
        let modified = distance * (n.sqrt() - 0.01 + 0.85 / n.sqrt());
        Some(Self { count: sorted.len(), distance, modified })
    }

    /// Whether a normal distribution is refused at the level of 5 %.
    pub fn refuses(&self) -> bool {
        self.modified > CRITICAL
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::WhiteNoise;

    /// One normal sample in twenty is refused, at any size; uniform ones of 250 always are.
    #[test]
    fn one_normal_sample_in_twenty_is_refused() {
        let mut noise = WhiteNoise::new(5, 0);
        for count in [20, 250] {
            let samples = 2000;
            let refused = (0..samples).filter(|_| {
                let values: Vec<f64> = (0..count).map(|_| 3.0 + 0.2 * noise.sample()).collect();
                Lilliefors::of(&values).unwrap().refuses()
            });
            // 100 expected; four standard deviations are 39.
            let refused = refused.count();
            assert!((61..=139).contains(&refused), "{count}: {refused}");
        }
        let uniform: Vec<f64> = (0..250).map(f64::from).collect();
        assert!(Lilliefors::of(&uniform).unwrap().refuses());
        assert_eq!(Lilliefors::of(&[1.0, 2.0, 3.0]), None);
        assert_eq!(Lilliefors::of(&[1.0; 9]), None);
    }
}

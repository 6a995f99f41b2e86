//! Random numbers that are the same everywhere, and how often what is random may happen.
#![allow(dead_code)] // each test takes what it needs

use kalmems_core::{Cholesky, Covariance};

/// SplitMix64 (Steele, Lea & Flood, OOPSLA 2014) and Gaussians by Box and Muller.
pub struct Chance(u64);

impl Chance {
    pub fn new(seed: u64) -> Self {
        // Mixed once, so that the streams of neighbouring seeds lie nowhere near each other.
        let start = Self(seed).next();
        Self(start)
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// Uniform in (0, 1).
    pub fn uniform(&mut self) -> f64 {
        ((self.next() >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
    }

    /// Uniform between two numbers.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform()
    }

    /// Gaussian with variance one.
    pub fn gaussian(&mut self) -> f64 {
        (-2.0 * self.uniform().ln()).sqrt() * (std::f64::consts::TAU * self.uniform()).cos()
    }

    /// A Gaussian vector with this covariance.
    pub fn vector<const N: usize>(&mut self, covariance: &Covariance<f64, N>) -> [f64; N] {
        let l = Cholesky::of_semidefinite(covariance);
        let w: [f64; N] = std::array::from_fn(|_| self.gaussian());
        l.times_vector(&w)
    }
}

/// Sum of two vectors.
pub fn plus<const N: usize>(a: [f64; N], b: [f64; N]) -> [f64; N] {
    std::array::from_fn(|i| a[i] + b[i])
}

/// Difference of two vectors.
pub fn minus<const N: usize>(a: &[f64; N], b: &[f64; N]) -> [f64; N] {
    std::array::from_fn(|i| a[i] - b[i])
}

/// The smallest interval of counts of `n` trials of chance `p` that leaves less than `outside`/2 on each
/// side.
pub fn binomial_interval(n: usize, p: f64, outside: f64) -> (usize, usize) {
    let mut log = n as f64 * (1.0 - p).ln(); // of the chance of no count
    let (mut below, mut low, mut high) = (0.0, None, None);
    for count in 0..=n {
        let chance = log.exp();
        if low.is_none() && below + chance > outside / 2.0 {
            low = Some(count);
        }
        below += chance;
        if high.is_none() && 1.0 - below < outside / 2.0 {
            high = Some(count);
        }
        log += ((n - count) as f64 / (count + 1) as f64).ln() + (p / (1.0 - p)).ln();
    }
    (low.unwrap(), high.unwrap())
}

/// Mean and standard deviation.
pub fn spread(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    (mean, (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt())
}

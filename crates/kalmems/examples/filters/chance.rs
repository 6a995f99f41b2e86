//! Random numbers that are the same everywhere, and what many seeds come to.

use std::f64::consts::TAU;

/// SplitMix64 (Steele, Lea and Flood, OOPSLA 2014), made Gaussian by Box and Muller's method.
pub struct Chance(u64);

impl Chance {
    /// A stream for each seed; mixed once, so that neighbouring seeds lie nowhere near each other.
    pub fn new(seed: u64) -> Self {
        Self(Self(seed).next())
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn uniform(&mut self) -> f64 {
        ((self.next() >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
    }

    /// Mean 0, variance 1.
    pub fn gaussian(&mut self) -> f64 {
        (-2.0 * self.uniform().ln()).sqrt() * (TAU * self.uniform()).cos()
    }
}

/// Least, median and largest of many values.
#[derive(Clone, Copy)]
pub struct Spread {
    pub least: f64,
    pub median: f64,
    pub most: f64,
}

impl Spread {
    pub fn of(mut values: Vec<f64>) -> Self {
        values.sort_by(f64::total_cmp);
        let at = |i: usize| values.get(i).copied().unwrap_or(f64::NAN);
        let (last, half) = (values.len().saturating_sub(1), values.len() / 2);
        let median = if values.len().is_multiple_of(2) {
            f64::midpoint(at(half.max(1) - 1), at(half))
        } else {
            at(half)
        };
        Self { least: at(0), median, most: at(last) }
    }

    /// In another unit.
    pub fn times(&self, by: f64) -> Self {
        Self { least: by * self.least, median: by * self.median, most: by * self.most }
    }

    /// `median (least–most)` with three digits.
    pub fn text(&self) -> String {
        format!("{} ({}–{})", digits(self.median), digits(self.least), digits(self.most))
    }
}

/// A number with three digits that count.
pub fn digits(value: f64) -> String {
    if !value.is_finite() || value == 0.0 {
        return value.to_string();
    }
    match value.abs() {
        size if size >= 99.95 => format!("{value:.0}"),
        size if size >= 9.995 => format!("{value:.1}"),
        size if size >= 0.9995 => format!("{value:.2}"),
        size if size >= 0.09995 => format!("{value:.3}"),
        size if size >= 0.000_999_5 => format!("{value:.4}"),
        _ => format!("{value:.1e}"),
    }
}

//! The error of an angle in parts of a recording.

use super::ErrorSeries;
use serde::Serialize;

/// The error in one part.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PartErrors {
    /// Where it begins, in s.
    pub from_s: f64,
    /// Where it ends, in s.
    pub to_s: f64,
    /// The root mean square error of the angle, in degrees; not a number where there is nothing to compare.
    pub rmse_deg: f64,
    /// Samples compared.
    pub samples: usize,
}

impl ErrorSeries {
    /// The errors in `count` equal parts of the time from `from_s` to `to_s`.
    pub fn parts(&self, from_s: f64, to_s: f64, count: u32) -> Vec<PartErrors> {
        let edge = |i: u32| from_s + (to_s - from_s) * f64::from(i) / f64::from(count);
        // Half an ulp of a decimal time must not decide about a sample.
        let tiny = 1e-9 * (to_s - from_s);
        let first = |time_s: f64| self.time_s.partition_point(|t| *t < time_s - tiny);
        let part = |i: u32| {
            let errors = self.error.get(first(edge(i))..first(edge(i + 1))).unwrap_or_default();
            let finite = errors.iter().filter(|e| e.is_finite());
            let (samples, sum) = finite.fold((0_usize, 0.0), |(n, sum), e| (n + 1, sum + e * e));
            let rmse_deg = (sum / samples as f64).sqrt().to_degrees();
            PartErrors { from_s: edge(i), to_s: edge(i + 1), rmse_deg, samples }
        };
        (0..count).map(part).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_sample_belongs_to_one_part() {
        let time_s: Vec<f64> = (0..40).map(|k| f64::from(k) * 0.1).collect();
        let error: Vec<f64> = (0..40).map(|k| [1.0, 2.0, f64::NAN, 4.0][k / 10]).collect();
        let parts = ErrorSeries { time_s, error, sd: Vec::new() }.parts(0.0, 4.0, 4);
        let found: Vec<(usize, f64)> =
            parts.iter().map(|part| (part.samples, part.rmse_deg.to_radians())).collect();
        assert_eq!((found[0].0, found[1].0, found[2].0, found[3].0), (10, 10, 0, 10));
        assert!((found[3].1 - 4.0).abs() < 1e-12 && found[2].1.is_nan());
    }
}

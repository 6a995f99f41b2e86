//! The figures of a channel.

use serde::Serialize;

/// Figures over all rows of a channel, in SI.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Statistics {
    /// How many values are finite numbers.
    pub count: usize,
    /// How many are not.
    pub missing: usize,
    /// The lowest value, where there is one.
    pub minimum: Option<f64>,
    /// The highest value, where there is one.
    pub maximum: Option<f64>,
    /// The mean, where there is a value.
    pub mean: Option<f64>,
    /// The standard deviation of a sample (n − 1), where there are two values.
    pub standard_deviation: Option<f64>,
}

impl Statistics {
    pub(super) fn of(values: &[f64]) -> Self {
        let numbers = || values.iter().copied().filter(|v| v.is_finite());
        let count = numbers().count();
        // Twice, as the sum of squares alone loses the deviation of a small signal on a large offset.
        let mean = (count > 0).then(|| numbers().sum::<f64>() / count as f64);
        let square = mean.map(|mean| numbers().map(|v| (v - mean).powi(2)).sum::<f64>());
        Self {
            count,
            missing: values.len() - count,
            minimum: numbers().reduce(f64::min),
            maximum: numbers().reduce(f64::max),
            mean,
            standard_deviation: square.filter(|_| count > 1).map(|s| (s / (count - 1) as f64).sqrt()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// NIST's data set `NumAcc3`, whose certified mean and deviation are 1000000.2 and 0.1.
    #[test]
    fn a_large_offset_loses_no_digits() {
        let mut values = vec![1_000_000.2];
        for _ in 0..500 {
            values.extend([1_000_000.1, 1_000_000.3]);
        }
        let found = Statistics::of(&values);
        assert_eq!((found.count, found.missing), (1001, 0));
        approx::assert_relative_eq!(found.mean.unwrap(), 1_000_000.2, max_relative = 1e-14);
        approx::assert_relative_eq!(found.standard_deviation.unwrap(), 0.1, max_relative = 1e-8);
    }

    #[test]
    fn what_is_no_number_is_counted() {
        let found = Statistics::of(&[f64::NAN, 2.0, f64::NAN, 4.0]);
        assert_eq!((found.count, found.missing, found.mean), (2, 2, Some(3.0)));
        assert_eq!((found.minimum, found.maximum), (Some(2.0), Some(4.0)));
        let none = Statistics::of(&[f64::NAN]);
        assert_eq!((none.count, none.missing, none.mean, none.standard_deviation), (0, 1, None, None));
    }
}

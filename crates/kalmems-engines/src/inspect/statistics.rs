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

/// The figures of values that come in stretches.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ValueMoments {
    count: usize,
    missing: usize,
    minimum: Option<f64>,
    maximum: Option<f64>,
    mean: f64,
    /// The sum of the squared deviations from the mean.
    squares: f64,
}

impl ValueMoments {
    fn of(values: &[f64]) -> Self {
        let numbers = || values.iter().copied().filter(|v| v.is_finite());
        let count = numbers().count();
        // Twice, as the sum of squares alone loses the deviation of a small signal on a large offset.
        let mean = if count > 0 { numbers().sum::<f64>() / count as f64 } else { 0.0 };
        Self {
            count,
            missing: values.len() - count,
            minimum: numbers().reduce(f64::min),
            maximum: numbers().reduce(f64::max),
            mean,
            squares: numbers().map(|v| (v - mean).powi(2)).sum(),
        }
    }

    /// Adds values: means and squares are put together as T. F. Chan, G. H. Golub and R. J. LeVeque have it, "Updating
    /// formulae and a pairwise algorithm for computing sample variances", COMPSTAT 1982.
    pub(super) fn add(&mut self, values: &[f64]) {
        let other = Self::of(values);
        self.missing += other.missing;
        if self.count == 0 || other.count == 0 {
            let missing = self.missing;
            *self = Self { missing, ..if self.count == 0 { other } else { *self } };
            return;
        }
        let count = self.count + other.count;
        let part = other.count as f64 / count as f64;
        let apart = other.mean - self.mean;
        self.squares += other.squares + apart.powi(2) * self.count as f64 * part;
        self.mean += apart * part;
        self.count = count;
        self.minimum = self.minimum.zip(other.minimum).map(|(a, b)| a.min(b));
        self.maximum = self.maximum.zip(other.maximum).map(|(a, b)| a.max(b));
    }

    pub(super) fn statistics(&self) -> Statistics {
        let count = self.count;
        Statistics {
            count,
            missing: self.missing,
            minimum: self.minimum,
            maximum: self.maximum,
            mean: (count > 0).then_some(self.mean),
            standard_deviation: (count > 1).then(|| (self.squares / (count - 1) as f64).sqrt()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The figures of values in stretches of so many.
    fn figures(values: &[f64], stretch: usize) -> Statistics {
        let mut moments = ValueMoments::default();
        values.chunks(stretch).for_each(|part| moments.add(part));
        moments.statistics()
    }

    /// NIST's data set `NumAcc3`, whose certified mean and deviation are 1000000.2 and 0.1.
    #[test]
    fn a_large_offset_loses_no_digits() {
        let mut values = vec![1_000_000.2];
        for _ in 0..500 {
            values.extend([1_000_000.1, 1_000_000.3]);
        }
        for stretch in [1, 7, 500, 5000] {
            let found = figures(&values, stretch);
            assert_eq!((found.count, found.missing), (1001, 0));
            approx::assert_relative_eq!(found.mean.unwrap(), 1_000_000.2, max_relative = 1e-14);
            approx::assert_relative_eq!(found.standard_deviation.unwrap(), 0.1, max_relative = 1e-8);
        }
    }

    #[test]
    fn what_is_no_number_is_counted() {
        for stretch in 1..5 {
            let found = figures(&[f64::NAN, 2.0, f64::NAN, 4.0], stretch);
            assert_eq!((found.count, found.missing, found.mean), (2, 2, Some(3.0)));
            assert_eq!((found.minimum, found.maximum), (Some(2.0), Some(4.0)));
        }
        let none = figures(&[f64::NAN], 1);
        assert_eq!((none.count, none.missing, none.mean, none.standard_deviation), (0, 1, None, None));
    }
}

//! A share with its interval.

use serde::Serialize;
use statrs::distribution::{Beta, ContinuousCDF};

/// So many of a number, and where the true share lies with 95 % confidence.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Share {
    /// The share that was counted.
    pub share: f64,
    /// How many independent trials that is worth.
    pub of: f64,
    /// The lower end of the interval.
    pub lower: f64,
    /// The upper end.
    pub upper: f64,
}

/// What is outside of the interval on each side.
const OUTSIDE: f64 = 0.025;

impl Share {
    /// A share of so many independent trials, which need not be whole: Clopper and Pearson's interval, with the quantiles of the beta
    /// distribution (Biometrika 26, 404, 1934).
    pub fn new(share: f64, of: f64) -> Self {
        let count = (share * of).clamp(0.0, of.max(0.0));
        let quantile = |a: f64, b: f64, p: f64| Beta::new(a, b).map_or(f64::NAN, |beta| beta.inverse_cdf(p));
        let lower = if count > 0.0 { quantile(count, of - count + 1.0, OUTSIDE) } else { 0.0 };
        let upper = if count < of { quantile(count + 1.0, of - count, 1.0 - OUTSIDE) } else { 1.0 };
        Self { share, of, lower, upper }
    }

    /// So many of a whole number of independent trials.
    pub fn counted(count: u64, of: u64) -> Self {
        let (count, of) = (count as f64, of as f64);
        Self::new(if of > 0.0 { count / of } else { 0.0 }, of)
    }

    /// Whether a share lies in the interval.
    pub fn holds(&self, share: f64) -> bool {
        self.lower <= share && share <= self.upper
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Intervals as published for Clopper and Pearson's method: 0 of 10, 5 of 10, 81 of 263 (Newcombe, Statistics in Medicine 17,
    /// 857, 1998), 15 of 148, 29 of 29.
    #[test]
    fn intervals_are_those_of_the_literature() {
        for (count, of, lower, upper) in [
            (0, 10, 0.0, 0.3085),
            (5, 10, 0.1871, 0.8129),
            (81, 263, 0.2527, 0.3676),
            (15, 148, 0.0578, 0.1617),
            (0, 20, 0.0, 0.1684),
            (1, 29, 0.0009, 0.1776),
            (29, 29, 0.8806, 1.0),
        ] {
            let share = Share::counted(count, of);
            assert!(
                (share.lower - lower).abs() < 6e-5 && (share.upper - upper).abs() < 6e-5,
                "{count} of {of}: {share:?}"
            );
        }
    }

    #[test]
    fn fewer_independent_trials_make_a_wider_interval() {
        let (many, few) = (Share::new(0.6827, 1000.0), Share::new(0.6827, 12.5));
        assert!(few.lower < many.lower && many.upper < few.upper);
        assert!(many.holds(0.6827) && !many.holds(0.75) && few.holds(0.75));
        assert_eq!((Share::counted(0, 0).lower, Share::counted(0, 0).upper), (0.0, 1.0));
    }
}

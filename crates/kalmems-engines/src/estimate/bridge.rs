//! Steps over a time without samples.

/// Steps for one gap at most: a prediction of that many takes some hundredths of a second. Where more samples are missing
/// the steps are longer, which a process bears that is sampled many times in a cycle: a gap lasts
/// [`MOST_CYCLES`](crate::config::MOST_CYCLES) cycles at most, so that a cycle still has 64 steps.
pub const MOST_STEPS: usize = 1 << 16;

/// A time without samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bridge {
    /// Samples that are missing.
    pub missing: usize,
    /// Steps to take over it.
    pub steps: usize,
}

impl Bridge {
    /// Over an interval between two samples of this usual interval.
    pub fn over(interval: f64, usual: f64) -> Self {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // rounded and positive, saturating
        let intervals = (interval / usual).round().max(1.0) as usize;
        Self { missing: intervals - 1, steps: intervals.min(MOST_STEPS) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_steps_over_a_gap_are_bounded_whatever_it_lasts() {
        assert_eq!(Bridge::over(1e-6, 1e-6), Bridge { missing: 0, steps: 1 });
        assert_eq!(Bridge::over(5e-6, 1e-6), Bridge { missing: 4, steps: 5 });
        assert_eq!(Bridge::over(3600.0, 1e-6), Bridge { missing: 3_599_999_999, steps: MOST_STEPS });
        assert_eq!(Bridge::over(1e300, 1e-6).steps, MOST_STEPS);
        assert_eq!(Bridge::over(1e-9, 1e-6), Bridge { missing: 0, steps: 1 });
    }
}

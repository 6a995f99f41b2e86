//! A filter that stopped, until it is started again.
//!
//! A state that is no number, or a covariance that is none, cannot be corrected. The samples until the filter is started again have no estimate and
//! carry the reason. It is started from samples behind the one at which it stopped, as a filter is that has lost its signal, or from what its file
//! states where it is not started from samples. Attempts become as rare as stops are frequent, so that the work for a sample is bounded.

use super::{FilterFailure, MeanAndCovariance};
use kalmems_core::FilterError;

/// Rows from a stop to the first attempt, and from one to another at most.
const FIRST_WAIT: usize = 64;
const LONGEST_WAIT: usize = 1 << 16;

/// Rows behind the one at which a filter stopped that may depend on it: a drive is interpolated through samples on both sides.
const REACH: usize = 8;

/// A filter that has run for so many times its last wait has recovered for good.
const RAN: usize = 8;

/// The reasons by their numbers in [`Recovery::numbers`].
const REASONS: [FilterError; 4] = [
    FilterError::NonFiniteMeasurement,
    FilterError::NonFiniteState,
    FilterError::InnovationNotPositive,
    FilterError::CovarianceNotPositive,
];

/// A time without an estimate, as the filter had stopped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilterStop {
    /// Where and why.
    pub failure: FilterFailure,
    /// The time in s of the sample that the filter corrected first after it was started again; infinite where it was not.
    pub until_s: f64,
}

impl FilterStop {
    /// Whether a sample at this time in s has no estimate because of it.
    pub fn covers(&self, time_s: f64) -> bool {
        (self.failure.time_s..self.until_s).contains(&time_s)
    }
}

/// Whether a filter has stopped, and when it is started again.
#[derive(Clone, Debug)]
pub(super) struct Recovery {
    /// What is known at the beginning, which a filter comes back to that is not started from samples.
    pub(super) start: MeanAndCovariance,
    stopped: Option<FilterFailure>,
    /// Rows since it stopped, or since it runs, and those at which the next attempt is due.
    rows: usize,
    due: usize,
    wait: usize,
}

impl Recovery {
    pub(super) const NUMBERS: usize = 5;

    pub(super) const fn new(start: MeanAndCovariance) -> Self {
        Self { start, stopped: None, rows: 0, due: 0, wait: FIRST_WAIT }
    }

    /// Where and why the filter stopped that has not been started again.
    pub(super) const fn stopped(&self) -> Option<FilterFailure> {
        self.stopped
    }

    /// The filter took a row.
    #[inline]
    pub(super) fn ran(&mut self) {
        self.rows += 1;
        if self.wait > FIRST_WAIT && self.rows > RAN * self.wait {
            self.wait = FIRST_WAIT;
        }
    }

    /// The filter stopped at a row.
    pub(super) fn stop(&mut self, failure: FilterFailure) {
        (self.stopped, self.rows) = (Some(failure), 0);
        self.put_off();
    }

    fn put_off(&mut self) {
        self.due = self.rows + self.wait;
        self.wait = (2 * self.wait).min(LONGEST_WAIT);
    }

    /// Comes to a row of a filter that has stopped: whether it is to be started again there, from so many rows before.
    pub(super) fn is_due(&mut self, from: usize) -> bool {
        self.rows += 1;
        let is_due = self.rows >= self.due.max(from + REACH);
        if is_due {
            self.put_off();
        }
        is_due
    }

    /// The filter was started again.
    pub(super) fn start_again(&mut self) {
        (self.stopped, self.rows) = (None, 0);
    }

    /// As numbers, for another run to go on from.
    pub(super) fn numbers(&self) -> [f64; Self::NUMBERS] {
        let [time_s, why] = self.stopped.map_or([f64::NAN; 2], |FilterFailure { time_s, why }| {
            [time_s, REASONS.iter().position(|reason| *reason == why).unwrap_or(0) as f64]
        });
        let [rows, due, wait] = [self.rows, self.due, self.wait].map(|rows| rows as f64);
        [time_s, why, rows, due, wait]
    }

    /// Goes on from such numbers.
    pub(super) fn resume(&mut self, [time_s, why, rows, due, wait]: [f64; Self::NUMBERS]) {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // counts
        let count = |number: f64| number as usize;
        let why = REASONS.get(count(why)).copied().filter(|_| time_s.is_finite());
        self.stopped = why.map(|why| FilterFailure { time_s, why });
        (self.rows, self.due) = (count(rows), count(due));
        self.wait = count(wait).clamp(FIRST_WAIT, LONGEST_WAIT);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FAILURE: FilterFailure = FilterFailure { time_s: 1.0, why: FilterError::NonFiniteState };

    #[test]
    fn attempts_to_start_a_stopped_filter_are_rarer_the_longer_it_fails() {
        let mut recovery = Recovery::new(MeanAndCovariance::apart([(0.0, 1.0)]));
        recovery.stop(FAILURE);
        let mut due = Vec::new();
        for row in 1..1_000_000 {
            if recovery.is_due(20) {
                due.push(row);
            }
            // Another run goes on from the numbers as this one does.
            let mut resumed = Recovery::new(recovery.start.clone());
            resumed.resume(recovery.numbers());
            recovery = resumed;
        }
        assert_eq!(recovery.stopped(), Some(FAILURE));
        assert_eq!(due[..3], [64, 192, 448]);
        assert!(due.len() < 30 && due.windows(2).all(|pair| pair[1] - pair[0] <= LONGEST_WAIT), "{due:?}");
        // Behind a long run a stop is as the first one.
        recovery.start_again();
        (0..=RAN * LONGEST_WAIT).for_each(|_| recovery.ran());
        recovery.stop(FAILURE);
        assert_eq!((1..1000).find(|_| recovery.is_due(0)), Some(64));
        // The rows that a start needs are all behind the stop.
        recovery.start_again();
        (0..=RAN * LONGEST_WAIT).for_each(|_| recovery.ran());
        recovery.stop(FAILURE);
        assert_eq!((1..1000).find(|_| recovery.is_due(500)), Some(508));
    }
}

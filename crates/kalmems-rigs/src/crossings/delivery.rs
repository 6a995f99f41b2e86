//! When a filter is told of what happened.

use crate::config::CrossingApplication;

/// How a filter is told of the time of a crossing.
#[derive(Clone, Copy, Debug, Default)]
pub struct CrossingDelivery {
    /// When.
    pub applied: CrossingApplication,
    /// How long after the crossing a filter is told that is told late, in s; `None` for as long as the detector takes.
    pub lag_s: Option<f64>,
}

impl CrossingDelivery {
    /// The row of a part at which a filter is told of a crossing at this time in s, which a detector knows of at row `known_at` of
    /// the segment; `first` is the row of the segment that the part begins with. `None` before the rows that are there.
    pub fn row(
        self,
        taken_s: f64,
        (known_at, first): (usize, usize),
        (time_s, interval_s): (&[f64], f64),
    ) -> Option<usize> {
        // A time that rounding puts behind a sample is that sample's.
        let row_at = |at_s: f64| time_s.partition_point(|t| *t < at_s - 1e-6 * interval_s);
        let row = match (self.applied, self.lag_s) {
            (CrossingApplication::Late, None) => known_at.checked_sub(first)?,
            (CrossingApplication::Late, Some(lag_s)) => row_at(taken_s + lag_s),
            (CrossingApplication::InPlace, _) => row_at(taken_s),
        };
        (row > 0 || first == 0).then_some(row)
    }
}

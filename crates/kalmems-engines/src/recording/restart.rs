//! Where a record is cut into stretches: behind a gap that is too long to be predicted over, and where its clock goes back.

use super::{FindingKind as Kind, Restarts};
use serde::Serialize;

/// What cuts the record between two rows, if something does.
fn cut_between(restarts: &Restarts, before_s: f64, after_s: f64) -> Option<Kind> {
    if after_s < before_s {
        Some(Kind::ClockBack)
    } else if after_s - before_s > restarts.longest_gap_s {
        Some(Kind::LongGap)
    } else {
        None
    }
}

/// The first of some times, from the one at `from` on, before which the record is cut, and by what.
pub(super) fn first_cut(restarts: &Restarts, times: &[f64], from: usize) -> Option<(usize, Kind)> {
    let pairs = times.iter().zip(times.iter().skip(1)).enumerate().skip(from.saturating_sub(1));
    pairs.filter(|(i, _)| i + 1 >= from).find_map(|(i, (a, b))| Some((i + 1, cut_between(restarts, *a, *b)?)))
}

/// Which stretch of its record a run of rows is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct StretchPlace {
    /// Its number, counted from 1.
    pub number: usize,
    /// How often the clock has begun until then: 1, and one more for each time that it went back.
    pub clock_run: usize,
    /// The last time before it in s, where there is one.
    pub after_s: Option<f64>,
}

impl StretchPlace {
    /// The first of a record.
    pub const FIRST: Self = Self { number: 1, clock_run: 1, after_s: None };

    /// The one after this, which was cut by this.
    pub(super) fn next(self, why: Kind, after_s: f64) -> Self {
        let clock_run = self.clock_run + usize::from(why == Kind::ClockBack);
        Self { number: self.number + 1, clock_run, after_s: Some(after_s) }
    }
}

/// How often the rows so far were cut, and whether that is too often for a recording.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct RestartCounts {
    back: usize,
    gaps: usize,
}

/// The rows after which a recording can be refused while it is read.
const JUDGED_FROM: usize = 10_000;

/// A file is not in the order of its times if more than one row in so many goes back.
pub(super) const UNSORTED: usize = 100;

/// A file has been sampled too slowly for its policy if more than one row in so many follows a gap.
pub(super) const TOO_SLOW: usize = 4;

impl RestartCounts {
    /// Counts one.
    pub(super) fn add(&mut self, why: Kind) {
        match why {
            Kind::ClockBack => self.back += 1,
            // As often as the file says.
            Kind::NewWaveform => {}
            _ => self.gaps += 1,
        }
    }

    /// What is wrong with so many rows, of which no more come where they have ended.
    pub(super) fn judge(&self, rows: usize, ended: bool) -> Option<Kind> {
        if !ended && rows < JUDGED_FROM {
            return None;
        }
        if self.back.saturating_mul(UNSORTED) > rows {
            return Some(Kind::DecreasingTime);
        }
        (self.gaps.saturating_mul(TOO_SLOW) > rows).then_some(Kind::SparseTime)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_is_cut_where_the_clock_goes_back_and_behind_long_gaps() {
        let times = [0.0, 1.0, 2.0, 5.0, 5.5, 4.0, 5.0, 1e300];
        let policy = Restarts::beyond(2.0);
        let mut cuts = Vec::new();
        let mut from = 1;
        while let Some((row, why)) = first_cut(&policy, &times, from) {
            cuts.push((row, why));
            from = row + 1;
        }
        assert_eq!(cuts, [(3, Kind::LongGap), (5, Kind::ClockBack), (7, Kind::LongGap)]);
        assert_eq!(first_cut(&policy, &times, 0), Some((3, Kind::LongGap)));
        assert_eq!(first_cut(&Restarts::WHERE_THE_CLOCK_GOES_BACK, &times, 0), Some((5, Kind::ClockBack)));
    }

    #[test]
    fn many_restarts_are_a_fault_of_the_file_only_after_its_share_is_known() {
        let mut counts = RestartCounts::default();
        counts.add(Kind::ClockBack);
        assert_eq!(counts.judge(50, false), None);
        assert_eq!(counts.judge(50, true), Some(Kind::DecreasingTime));
        assert_eq!(counts.judge(100, true), None);
        let mut counts = RestartCounts::default();
        counts.add(Kind::LongGap);
        assert_eq!(counts.judge(4, true), None);
        assert_eq!(counts.judge(3, true), Some(Kind::SparseTime));
    }
}

//! The stretches without a gap of a record whose samples are equidistant by their own clock, and what that clock shows.

use std::ops::Range;

/// Intervals shorter than this part of the usual one belong to a burst.
const QUICK: f64 = 0.5;

/// A gap is a step of the time that stays, from this part of an interval on.
const STEP: f64 = 0.5;

/// Samples in a row that show the rate, at least; fewer if there are no more.
const WINDOW: usize = 64;

/// The rows of a record between its gaps.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct RecordStretches {
    /// Rows without a gap, in their order.
    pub(super) rows: Vec<Range<usize>>,
    /// From one sample to the next in s.
    pub(super) interval_s: f64,
    /// Samples that come in the longest burst; 1 where times do not come in bursts.
    pub(super) burst: usize,
    /// The longest gap in s and the time before it, if there is one.
    pub(super) longest_gap: Option<[f64; 2]>,
}

/// Stretches by times in s, which increase; `None` of fewer than two rows.
pub(super) fn stretches(time_s: &[f64]) -> Option<RecordStretches> {
    let mut found = StretchFinder::of(time_s)?;
    found.take(time_s, 0..time_s.len());
    Some(found.finish())
}

/// Finds the stretches of times that are given part by part.
///
/// Times that a host has given come late by what their way took: in bursts, where several samples travelled together. The
/// interval is therefore the median over long windows of their mean intervals, not the median interval, and a gap is a step that
/// the earliest of the times around it take alike.
pub(super) struct StretchFinder {
    usual: f64,
    burst: usize,
    rows: Vec<Range<usize>>,
    longest_gap: Option<[f64; 2]>,
    slope: SlopeSums,
}

/// Samples that are missing before a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct MissingBefore {
    pub row: usize,
    pub samples: usize,
}

impl StretchFinder {
    /// By the first of the times.
    pub fn of(time_s: &[f64]) -> Option<Self> {
        let last = time_s.len().checked_sub(1).filter(|last| *last > 0)?;
        let mean = (time_s[last] - time_s[0]) / last as f64;
        let steps = || time_s.windows(2).map(|pair| pair[1] - pair[0]);
        let burst = 1 + longest_run(steps().map(|step| step < QUICK * mean));
        let window = WINDOW.max(4 * burst).min(last);
        let stride = (window / 2).max(1);
        let mut slopes: Vec<f64> = (0..=last - window)
            .step_by(stride)
            .map(|i| (time_s[i + window] - time_s[i]) / window as f64)
            .collect();
        let middle = slopes.len() / 2;
        let usual = *slopes.select_nth_unstable_by(middle, f64::total_cmp).1;
        (usual > 0.0 && usual.is_finite()).then(|| Self {
            usual,
            burst,
            rows: Vec::new(),
            longest_gap: None,
            slope: SlopeSums::default(),
        })
    }

    /// Takes further rows, with some before and after them for a look around; where among them samples are missing.
    pub fn take(&mut self, time_s: &[f64], fresh: Range<usize>) -> Vec<MissingBefore> {
        let first = self.rows.last().map_or(0, |rows| rows.end);
        let mut from = fresh.start;
        let mut missing = Vec::new();
        let breaks = breaks(time_s, self.usual, self.burst);
        let within = breaks.into_iter().filter(|(row, _)| fresh.contains(row));
        for (row, late_s) in within.chain([(fresh.end, 0.0)]) {
            if row > from {
                self.slope.take(&time_s[from..row], self.usual);
                let (start, end) = (first + from - fresh.start, first + row - fresh.start);
                match self.rows.last_mut().filter(|_| from == fresh.start && missing.is_empty()) {
                    Some(rows) => rows.end = end,
                    None => self.rows.push(start..end),
                }
            }
            if row < fresh.end {
                let gap_s = time_s[row] - time_s[row - 1] - self.usual;
                if self.longest_gap.is_none_or(|[longest, _]| gap_s >= longest) {
                    self.longest_gap = Some([gap_s, time_s[row - 1]]);
                }
                #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
                // a positive count, saturating
                let samples = (late_s / self.usual).round().max(1.0) as usize;
                missing.push(MissingBefore { row, samples });
                self.slope.end();
                from = row;
            }
        }
        missing
    }

    /// What the times have shown.
    pub fn finish(mut self) -> RecordStretches {
        let interval_s = self.slope.finish().map_or(self.usual, |off| self.usual + off);
        RecordStretches { interval_s, rows: self.rows, burst: self.burst, longest_gap: self.longest_gap }
    }
}

fn longest_run(flags: impl Iterator<Item = bool>) -> usize {
    let runs = flags.scan(0, |run, flag| {
        *run = if flag { *run + 1 } else { 0 };
        Some(*run)
    });
    runs.max().unwrap_or(0)
}

/// The rows before which samples are missing, and how much later in s they begin than they would without.
fn breaks(time_s: &[f64], interval_s: f64, burst: usize) -> Vec<(usize, f64)> {
    let around = 2 * burst + 6;
    let late = |row: usize, from: usize| time_s[row] - time_s[from] - (row - from) as f64 * interval_s;
    let mut breaks: Vec<(usize, f64)> = Vec::new();
    for row in 1..time_s.len() {
        let end = (row + around).min(time_s.len());
        // The last of a burst is the least late: a burst that is cut at the end tells nothing.
        if time_s[row] - time_s[row - 1] <= (1.0 + STEP) * interval_s || end - row < burst {
            continue;
        }
        // What came before another gap is earlier for that alone.
        let start = row.saturating_sub(around).max(breaks.last().map_or(0, |(row, _)| *row));
        let earliest = |rows: Range<usize>| rows.map(|r| late(r, start)).fold(f64::INFINITY, f64::min);
        let late_s = earliest(row..end) - earliest(start..row);
        if late_s > STEP * interval_s {
            breaks.push((row, late_s));
        }
    }
    breaks
}

/// The slope of times over their rows by least squares, with an offset for each stretch; what lies beyond the usual interval.
#[derive(Default)]
struct SlopeSums {
    square: f64,
    product: f64,
    /// The present stretch: its first time, its rows, and the sums of rows, their squares, times and products.
    start_s: Option<f64>,
    count: f64,
    sums: [f64; 4],
}

impl SlopeSums {
    fn take(&mut self, time_s: &[f64], usual: f64) {
        for time in time_s {
            let row = self.count;
            let off = time - *self.start_s.get_or_insert(*time) - row * usual;
            for (sum, value) in self.sums.iter_mut().zip([row, row * row, off, row * off]) {
                *sum += value;
            }
            self.count += 1.0;
        }
    }

    fn end(&mut self) {
        if self.count > 0.0 {
            let [rows, squares, offs, products] = self.sums;
            self.square += squares - rows * rows / self.count;
            self.product += products - rows * offs / self.count;
        }
        (self.start_s, self.count, self.sums) = (None, 0.0, [0.0; 4]);
    }

    fn finish(&mut self) -> Option<f64> {
        self.end();
        let slope = self.product / self.square;
        slope.is_finite().then_some(slope)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Times of 99.3 Hz that a host has given in bursts of so many, each sample of one 10 µs after the one before.
    fn in_bursts(samples: usize, burst: usize) -> Vec<f64> {
        let arrival = |k: usize| ((k / burst + 1) * burst) as f64 / 99.3;
        (0..samples).map(|k| arrival(k) + 1e-5 * (k % burst) as f64).collect()
    }

    #[test]
    fn bursts_do_not_hide_the_rate() {
        for burst in [1, 3, 5, 32] {
            let found = stretches(&in_bursts(20_000, burst)).unwrap();
            assert!((found.interval_s * 99.3 - 1.0).abs() < 1e-4, "{burst}: {found:?}");
            assert_eq!((found.rows.len(), found.burst), (1, burst), "{found:?}");
        }
    }

    #[test]
    fn a_gap_is_where_it_is_with_bursts_and_without() {
        for burst in [1, 5, 32] {
            let mut time_s = in_bursts(20_000, burst);
            // 100 s are missing from a burst's beginning on.
            let row = 5000 / burst * burst;
            time_s.iter_mut().skip(row).for_each(|time| *time += 100.0);
            let found = stretches(&time_s).unwrap();
            assert_eq!(found.rows, [0..row, row..20_000], "{burst}");
            assert!((found.interval_s * 99.3 - 1.0).abs() < 1e-4, "{burst}: {}", found.interval_s);
            assert!((found.longest_gap.unwrap()[0] - 100.0).abs() < 0.4, "{found:?}");
        }
    }

    #[test]
    fn one_missing_sample_is_a_gap_and_jitter_is_none() {
        let jitter = |k: usize| 2e-3 * ((k * 7919 % 101) as f64 / 101.0);
        let mut time_s: Vec<f64> = (0..1000).map(|k| k as f64 * 0.01 + jitter(k)).collect();
        assert_eq!(stretches(&time_s).unwrap().rows.len(), 1);
        time_s.remove(400);
        assert_eq!(stretches(&time_s).unwrap().rows, [0..400, 400..999]);
        assert_eq!(stretches(&[1.0]), None);
    }
}

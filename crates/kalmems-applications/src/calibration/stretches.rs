//! The stretches without a gap of a record whose samples are equidistant by their own clock, and what that clock shows.

use std::ops::Range;

/// Intervals shorter than this part of the usual one belong to a burst.
const QUICK: f64 = 0.5;

/// A gap is a step of the time that stays, from this part of an interval on.
const STEP: f64 = 0.5;

/// How many samples in a row show the rate at least, where there are as many.
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
    /// The longest gap in s and the time before it, where there is one.
    pub(super) longest_gap: Option<[f64; 2]>,
}

/// Stretches by times in s, which increase.
///
/// Times that a host has given come late by what their way took: in bursts, where several samples travelled together. The
/// interval is therefore the median over long windows of their mean intervals, not the median interval, and a gap is a step that
/// the earliest of the times around it take alike. `None` of fewer than two rows.
pub(super) fn stretches(time_s: &[f64]) -> Option<RecordStretches> {
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
    if !(usual > 0.0 && usual.is_finite()) {
        return None;
    }
    let breaks = breaks(time_s, usual, burst);
    let ends = breaks.iter().copied().chain([time_s.len()]);
    let starts = std::iter::once(0).chain(breaks.iter().copied());
    let rows: Vec<Range<usize>> = starts.zip(ends).map(|(start, end)| start..end).collect();
    let gaps = breaks.iter().map(|row| [time_s[*row] - time_s[row - 1] - usual, time_s[row - 1]]);
    Some(RecordStretches {
        interval_s: slope(time_s, &rows).unwrap_or(usual),
        rows,
        burst,
        longest_gap: gaps.max_by(|a, b| a[0].total_cmp(&b[0])),
    })
}

fn longest_run(flags: impl Iterator<Item = bool>) -> usize {
    let runs = flags.scan(0, |run, flag| {
        *run = if flag { *run + 1 } else { 0 };
        Some(*run)
    });
    runs.max().unwrap_or(0)
}

/// The rows before which samples are missing.
fn breaks(time_s: &[f64], interval_s: f64, burst: usize) -> Vec<usize> {
    let around = 2 * burst + 6;
    let late = |row: usize, from: usize| time_s[row] - time_s[from] - (row - from) as f64 * interval_s;
    let mut breaks: Vec<usize> = Vec::new();
    for row in 1..time_s.len() {
        let end = (row + around).min(time_s.len());
        // The last of a burst is the least late: a burst that is cut at the end tells nothing.
        if time_s[row] - time_s[row - 1] <= (1.0 + STEP) * interval_s || end - row < burst {
            continue;
        }
        // What came before another gap is earlier for that alone.
        let start = row.saturating_sub(around).max(breaks.last().copied().unwrap_or(0));
        let earliest = |rows: Range<usize>| rows.map(|r| late(r, start)).fold(f64::INFINITY, f64::min);
        if earliest(row..end) - earliest(start..row) > STEP * interval_s {
            breaks.push(row);
        }
    }
    breaks
}

/// The slope of the times over the rows, by least squares with an offset for each stretch.
fn slope(time_s: &[f64], stretches: &[Range<usize>]) -> Option<f64> {
    let (mut square, mut product) = (0.0, 0.0);
    for rows in stretches {
        let (start, count) = (time_s[rows.start], rows.len() as f64);
        let mean_row = 0.5 * (count - 1.0);
        let mean = rows.clone().map(|row| time_s[row] - start).sum::<f64>() / count;
        for (k, row) in rows.clone().enumerate() {
            let along = k as f64 - mean_row;
            square += along * along;
            product += along * (time_s[row] - start - mean);
        }
    }
    let slope = product / square;
    (slope > 0.0 && slope.is_finite()).then_some(slope)
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

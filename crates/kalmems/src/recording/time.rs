//! The diagnosis of a segment's times.

use super::FindingKind as Kind;
use super::findings::{Findings, Place, short};

/// How far an interval may be from the segment's median, as a part of the median.
pub const TIME_TOLERANCE: f64 = 0.01;

/// How far a gap may be from a whole number of intervals, as a part of one interval.
pub const GAP_TOLERANCE: f64 = 0.1;

/// Checks the times of a segment, whose row `i` is at `place(i)`; the median interval, and whether all are it.
pub(super) fn check(
    times: &[f64],
    place: impl Fn(usize) -> Place,
    findings: &mut Findings,
) -> (Option<f64>, bool) {
    let steps = || times.iter().zip(times.iter().skip(1)).enumerate();
    let mut uniform = times.len() > 1;
    let mut positive = Vec::with_capacity(times.len());
    for (i, (before, after)) in steps() {
        let order = match after.partial_cmp(before) {
            Some(std::cmp::Ordering::Greater) => {
                positive.push(after - before);
                continue;
            }
            Some(std::cmp::Ordering::Equal) => Some((Kind::RepeatedTime, "again after")),
            Some(std::cmp::Ordering::Less) => Some((Kind::DecreasingTime, "after")),
            // One of them is no number, which the reading has counted.
            None => None,
        };
        uniform = false;
        if let Some((kind, word)) = order {
            findings.add(kind, place(i + 1), || format!("{after} s {word} {before} s"));
        }
    }
    let Some(median) = median(&mut positive) else { return (None, false) };

    let mut gaps = Found::default();
    let mut irregular = Found::default();
    let (mut shortest, mut longest) = (f64::INFINITY, 0.0_f64);
    let mut missing = 0.0;
    for (i, (before, after)) in steps() {
        let interval = after - before;
        // The times themselves are rounded; far from zero that is more than a part of the interval.
        let rounding = 4.0 * f64::EPSILON * before.abs().max(after.abs());
        // The comparison is false for times that are no numbers as well.
        if !(interval > 0.0 && (interval - median).abs() > TIME_TOLERANCE * median + rounding) {
            continue;
        }
        let whole = (interval / median).round();
        if whole >= 2.0 && (interval / median - whole).abs() <= GAP_TOLERANCE {
            gaps.add(i + 1);
            missing += whole - 1.0;
        } else {
            irregular.add(i + 1);
            shortest = shortest.min(interval);
            longest = longest.max(interval);
        }
    }
    uniform &= gaps.count == 0 && irregular.count == 0;
    findings.add_many(Kind::Gap, place(gaps.first), gaps.count, || {
        let (samples, are) = if missing > 1.0 { ("samples", "are") } else { ("sample", "is") };
        format!("{missing} {samples} {are} missing where one is expected every {} s", short(median))
    });
    findings.add_many(Kind::IrregularTime, place(irregular.first), irregular.count, || {
        let (percent, longest, median) = (TIME_TOLERANCE * 100.0, short(longest), short(median));
        let intervals = match irregular.count {
            1 => format!("an interval of {longest} s"),
            _ => format!("intervals from {} s to {longest} s", short(shortest)),
        };
        format!("{intervals}, more than {percent} % off the median of {median} s")
    });
    (Some(median), uniform)
}

#[derive(Default)]
struct Found {
    first: usize,
    count: usize,
}

impl Found {
    fn add(&mut self, i: usize) {
        if self.count == 0 {
            self.first = i;
        }
        self.count += 1;
    }
}

/// The median, the upper one of an even number; `None` of nothing.
fn median(values: &mut [f64]) -> Option<f64> {
    if values.is_empty() {
        return None;
    }
    let middle = values.len() / 2;
    Some(*values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

//! The diagnosis of a segment's times, as they come.

use super::FindingKind as Kind;
use super::findings::{FindingPlace, Findings, short};
use super::stamps::{self, ArrivalPattern};
use kalmems_figures::number;
use std::cmp::Ordering;

/// How far an interval may be from the expected one, that of the nominal rate or the segment's median, as a part of it.
pub const TIME_TOLERANCE: f64 = 0.01;

/// Intervals of a segment's beginning whose median is the usual one: as many as a stream has at first, so that it is the same to the last bit wherever a
/// recording is held or cut. Where stamps are rounded it is the slope of all there are.
const USUAL_OVER: usize = 4095;

/// How far a gap may be from a whole number of intervals, as a part of one interval.
pub const GAP_TOLERANCE: f64 = 0.1;

/// The checks of one segment's times. The usual interval is the median over the head of the segment, which is known once
/// the head is read or the segment ends; what came before is judged then, what comes after as it comes.
pub(super) struct TimeCheck {
    /// Rows of the head.
    head: usize,
    rows: usize,
    /// Whether the head is read; then the usual interval, none where no row of the head follows another in time.
    settled: bool,
    median: Option<f64>,
    /// The interval of the rate that the settings say, where they do; what is irregular is told by it, unless the times
    /// contradict it.
    nominal: Option<f64>,
    /// How the rows arrive, where they come in bursts and not by the nominal rate.
    arrivals: Option<ArrivalPattern>,
    /// To how many s the file rounds the times.
    resolution_s: f64,
    /// That by which it wrote too few digits, and not too few bits.
    digits_s: Option<f64>,
    ordered: bool,
    /// Whether all intervals are the usual one.
    regular: bool,
    tally: TimingTally,
}

/// What is not regular in the times of a record, over its stretches until now.
pub(super) struct TimingTally {
    gaps: FirstAndCount,
    missing: f64,
    irregular: FirstAndCount,
    shortest: f64,
    longest: f64,
    /// The interval that the last stretch was judged by, and what it is.
    expected: Option<(f64, &'static str)>,
}

impl Default for TimingTally {
    fn default() -> Self {
        let (gaps, irregular) = (FirstAndCount::default(), FirstAndCount::default());
        Self { gaps, missing: 0.0, irregular, shortest: f64::INFINITY, longest: 0.0, expected: None }
    }
}

impl TimeCheck {
    /// Of a segment whose record was found so irregular before it.
    pub(super) const fn new(head: usize, nominal: Option<f64>, tally: TimingTally) -> Self {
        Self {
            head,
            rows: 0,
            settled: false,
            median: None,
            nominal,
            arrivals: None,
            resolution_s: 0.0,
            digits_s: None,
            ordered: true,
            regular: true,
            tally,
        }
    }

    /// What is found of the record until now, for its next stretch.
    pub(super) fn take_tally(&mut self) -> TimingTally {
        std::mem::take(&mut self.tally)
    }

    /// Whether the times so far are still needed from the first on.
    pub(super) const fn is_waiting(&self) -> bool {
        !self.settled
    }

    /// The usual interval, as far as it is known.
    pub(super) const fn interval_s(&self) -> Option<f64> {
        self.median
    }

    /// Hears to how many s the file rounds the times.
    pub(super) const fn hear_resolution(&mut self, resolution_s: f64) {
        self.resolution_s = self.resolution_s.max(resolution_s);
    }

    /// Takes the last `fresh` of `times`, which are the segment's times up to now: all while the head is read, at least the
    /// one before the fresh ones after that. The segment's row `i` is at `place(i)`.
    pub(super) fn take(
        &mut self,
        times: &[f64],
        fresh: usize,
        place: impl Fn(usize) -> FindingPlace,
        findings: &mut Findings,
    ) {
        let first = times.len().saturating_sub(fresh + 1);
        // The segment's row that `times` begins with.
        let base = self.rows + fresh - times.len();
        for (i, (before, after)) in steps(times, first) {
            let (kind, word) = match after.partial_cmp(&before) {
                Some(Ordering::Greater) => continue,
                Some(Ordering::Equal) => (Kind::RepeatedTime, "again after"),
                Some(Ordering::Less) => (Kind::DecreasingTime, "after"),
                // One of them is no number, which the reading has counted.
                None => {
                    self.ordered = false;
                    continue;
                }
            };
            self.ordered = false;
            findings
                .add(kind, place(base + i), || format!("{} s {word} {} s", number(after), number(before)));
        }
        self.rows += fresh;
        if !self.is_waiting() {
            self.judge(times, first, base, place);
        } else if self.rows >= self.head {
            self.settle(times, place, findings);
        }
    }

    /// Finds the usual interval and judges all so far by it.
    fn settle(&mut self, times: &[f64], place: impl Fn(usize) -> FindingPlace, findings: &mut Findings) {
        let head = times.get(..self.head.min(times.len())).unwrap_or_default();
        let positive: Vec<f64> =
            steps(head, 0).map(|(_, (before, after))| after - before).filter(|i| *i > 0.0).collect();
        self.settled = true;
        let first = positive.get(..USUAL_OVER.min(positive.len())).unwrap_or_default();
        self.median = median(&mut first.to_vec());
        if self.resolution_s == 0.0
            && let Some(rounding_s) = stamps::rounding_of(head)
        {
            (self.resolution_s, self.digits_s) = (rounding_s, Some(rounding_s));
        }
        if let Some(median) = &mut self.median
            && self.resolution_s > TIME_TOLERANCE * *median
        {
            *median = stamps::slope_of_rounded(&positive, *median, self.resolution_s);
        }
        if let Some(bursts) = stamps::bursts(head) {
            findings.add_many(Kind::BurstTime, place(bursts.first), bursts.count, || bursts.detail);
        }
        self.arrivals = self.median.and_then(|median| ArrivalPattern::of(head, median));
        self.compare_with_nominal(&positive, &place, findings);
        self.judge(times, 0, 0, place);
    }

    /// Compares the intervals of the head, each greater than zero, with that of the nominal rate. The median is right beside gaps, the
    /// mean where each time is late by another delay: only where neither agrees do the times contradict the settings.
    fn compare_with_nominal(
        &mut self,
        intervals: &[f64],
        place: &impl Fn(usize) -> FindingPlace,
        findings: &mut Findings,
    ) {
        let (Some(nominal), Some(median)) = (self.nominal, self.median) else { return };
        let mean = intervals.iter().sum::<f64>() / intervals.len() as f64;
        let rounding = self.resolution_s;
        let agrees = |found: f64| (found - nominal).abs() <= TIME_TOLERANCE * nominal + rounding;
        if agrees(median) {
            // Sampled in bursts: what is between them is missing.
            self.arrivals = None;
            return;
        }
        if agrees(mean) || self.arrivals.is_some_and(|arrivals| agrees(arrivals.mean_s)) {
            return;
        }
        self.nominal = None;
        findings.add(Kind::OtherRate, place(0), || {
            let (found, what) =
                self.arrivals.map_or((median, "median"), |arrivals| (arrivals.mean_s, "mean"));
            let [found, nominal] = [found, nominal].map(|interval| short(interval.recip()));
            format!("the {what} interval is that of a rate of {found} Hz, and the settings say {nominal} Hz")
        });
    }

    /// The interval that is expected, and what it is; none where no row follows another in time.
    fn expected(&self) -> Option<(f64, &'static str)> {
        let median = self.median.map(|median| (median, "median"));
        let mean = self.arrivals.map(|arrivals| (arrivals.mean_s, "mean"));
        let nominal = self.nominal.map(|nominal| (nominal, "interval of the nominal rate"));
        median.and(nominal.or(mean).or(median))
    }

    /// Judges the intervals from that after `times[first]` on.
    fn judge(&mut self, times: &[f64], first: usize, base: usize, place: impl Fn(usize) -> FindingPlace) {
        let Some(median) = self.interval_s() else { return };
        let expected = self.expected().map_or(median, |(expected, _)| expected);
        for (i, (before, after)) in steps(times, first) {
            let interval = after - before;
            self.regular &= !is_off(before, after, median, 0.0);
            if !is_off(before, after, expected, self.resolution_s) {
                continue;
            }
            let tally = &mut self.tally;
            let whole = (interval / expected).round();
            let missing = match &self.arrivals {
                Some(arrivals) => arrivals.missing(interval, expected),
                None if (interval / expected - whole).abs() <= GAP_TOLERANCE => whole - 1.0,
                None => 0.0,
            };
            if missing >= 1.0 {
                tally.gaps.add(|| place(base + i));
                tally.missing += missing;
            } else {
                tally.irregular.add(|| place(base + i));
                tally.shortest = tally.shortest.min(interval);
                tally.longest = tally.longest.max(interval);
            }
        }
    }

    /// The end of the segment, whose times are `times` as for [`TimeCheck::take`]: the usual interval, and whether all are it.
    pub(super) fn finish(
        &mut self,
        times: &[f64],
        place: impl Fn(usize) -> FindingPlace,
        findings: &mut Findings,
    ) -> (Option<f64>, bool) {
        if self.is_waiting() {
            self.settle(times, &place, findings);
        }
        if let Some(detail) =
            self.median.and_then(|median| stamps::rounded(median, self.resolution_s, self.digits_s.is_some()))
        {
            findings.add(Kind::RoundedTime, place(0), || detail);
        }
        self.tally.expected = self.expected().or(self.tally.expected);
        (self.median, self.median.is_some() && self.rows > 1 && self.ordered && self.regular)
    }
}

impl TimingTally {
    /// The end of the record.
    pub(super) fn tell(&self, findings: &mut Findings) {
        let Some((expected, what)) = self.expected else { return };
        if let Some(place) = self.gaps.first {
            findings.add_many(Kind::Gap, place, self.gaps.count, || {
                let missing = self.missing;
                let (samples, are) = if missing > 1.0 { ("samples", "are") } else { ("sample", "is") };
                let missing = number(missing);
                format!("{missing} {samples} {are} missing where one is expected every {} s", short(expected))
            });
        }
        if let Some(place) = self.irregular.first {
            findings.add_many(Kind::IrregularTime, place, self.irregular.count, || {
                let (percent, longest, expected) =
                    (TIME_TOLERANCE * 100.0, short(self.longest), short(expected));
                let intervals = match self.irregular.count {
                    1 => format!("an interval of {longest} s"),
                    _ => format!("intervals from {} s to {longest} s", short(self.shortest)),
                };
                format!("{intervals}, more than {percent} % off the {what} of {expected} s")
            });
        }
    }
}

/// Whether all of some times follow each other by the usual interval.
pub(super) fn are_uniform(times: &[f64], median: Option<f64>) -> bool {
    let usual = |median| {
        steps(times, 0).all(|(_, (before, after))| after > before && !is_off(before, after, median, 0.0))
    };
    times.len() > 1 && median.is_some_and(usual)
}

/// Whether an interval is one, and not the median within the tolerance, of times that the file rounds to `resolution_s`.
fn is_off(before: f64, after: f64, median: f64, resolution_s: f64) -> bool {
    // The times themselves are rounded; far from zero that is more than a part of the interval.
    let rounding = (4.0 * f64::EPSILON * before.abs().max(after.abs())).max(2.0 * resolution_s);
    // False for times that are no numbers as well.
    after > before && (after - before - median).abs() > TIME_TOLERANCE * median + rounding
}

/// Times and those before them, from the one after `first` on, with their places.
fn steps(times: &[f64], first: usize) -> impl Iterator<Item = (usize, (f64, f64))> {
    let times = times.get(first..).unwrap_or_default();
    times.iter().zip(times.iter().skip(1)).enumerate().map(move |(i, (a, b))| (first + i + 1, (*a, *b)))
}

#[derive(Default)]
struct FirstAndCount {
    first: Option<FindingPlace>,
    count: usize,
}

impl FirstAndCount {
    fn add(&mut self, place: impl Fn() -> FindingPlace) {
        if self.count == 0 {
            self.first = Some(place());
        }
        self.count += 1;
    }
}

/// The median, the upper one of an even number; `None` of nothing.
pub(super) fn median(values: &mut [f64]) -> Option<f64> {
    if values.is_empty() {
        return None;
    }
    let middle = values.len() / 2;
    Some(*values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

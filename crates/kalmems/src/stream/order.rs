//! Samples in their order, as they were taken, whatever the way has made of it.

use super::decode::Sample;
use std::collections::VecDeque;

/// What the way has made of the samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct OrderCounts {
    /// Samples that were passed on.
    pub passed: u64,
    /// Samples that never came, as far as their numbers or the times around them tell.
    pub dropped: u64,
    /// Samples that came again.
    pub duplicated: u64,
    /// Samples that came after later ones, and were put in their place.
    pub late: u64,
    /// Samples that came too late to be put in their place; they count as dropped as well.
    pub too_late: u64,
    /// Samples without a time although there should be one; they are left out.
    pub without_time: u64,
}

/// Where a sample stands: by its number where the frames count, else by its time in units of the interval.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
enum Place {
    Number(u64),
    Time(f64),
}

/// Holds samples back until so many later ones have come, so that late ones find their place.
pub struct Order {
    wait: usize,
    /// The place of the time among the numbers, and how many of its units an interval has; where the frames do not count.
    time: Option<(usize, f64)>,
    /// By how many bits the frames count.
    bits: Option<u32>,
    /// Samples by their place, in order.
    held: VecDeque<(Place, Sample)>,
    /// How many samples came after each other since the last was passed on.
    newest: Option<Place>,
    passed: Option<Place>,
    counts: OrderCounts,
}

/// Rows that a gap may have at most where the clock counts rows; beyond it the number of a frame is taken to be damaged.
const LONGEST_GAP: u64 = 1 << 20;

/// How near to each other two times are one, in intervals.
const SAME: f64 = 0.25;

impl Order {
    /// Samples wait for so many later ones. They are told apart by their number of so many bits, or else by the time at
    /// this place among their numbers, in units of which an interval has so many.
    pub fn new(wait: usize, bits: Option<u32>, time: Option<(usize, f64)>) -> Self {
        Self {
            wait,
            time,
            bits,
            held: VecDeque::new(),
            newest: None,
            passed: None,
            counts: OrderCounts::default(),
        }
    }

    /// What the way has made of the samples so far.
    pub const fn counts(&self) -> OrderCounts {
        self.counts
    }

    /// Takes a sample; what is in order now goes to `each`.
    pub fn take(&mut self, sample: Sample, each: &mut impl FnMut(Sample)) {
        if self.time.is_some_and(|(at, _)| !sample.numbers.get(at).is_some_and(|time| time.is_finite())) {
            self.counts.without_time += 1;
            return;
        }
        let Some(place) = self.place(&sample) else {
            // Neither number nor time: as it comes.
            self.counts.passed += 1;
            each(sample);
            return;
        };
        if self.passed.is_some_and(|passed| !is_after(place, passed)) {
            // Behind what was passed on: again, or too late.
            let again = self.passed.is_some_and(|passed| is_same(place, passed));
            let count = if again { &mut self.counts.duplicated } else { &mut self.counts.too_late };
            *count += 1;
            return;
        }
        let at = self.held.partition_point(|(other, _)| is_after(place, *other));
        if self.held.get(at).is_some_and(|(other, _)| is_same(place, *other)) {
            self.counts.duplicated += 1;
            return;
        }
        if at < self.held.len() {
            self.counts.late += 1;
        }
        self.held.insert(at, (place, sample));
        self.newest = self.held.back().map(|(place, _)| *place);
        while self.held.len() > self.wait || self.is_next() {
            self.pass(each);
        }
    }

    /// Passes on what waits.
    pub fn finish(&mut self, each: &mut impl FnMut(Sample)) {
        while !self.held.is_empty() {
            self.pass(each);
        }
    }

    /// Whether the first that waits follows the last one: then nothing can come between.
    fn is_next(&self) -> bool {
        let (Some((first, _)), Some(passed)) = (self.held.front(), self.passed) else { return false };
        missing(passed, *first) == 0
    }

    fn pass(&mut self, each: &mut impl FnMut(Sample)) {
        let Some((place, sample)) = self.held.pop_front() else { return };
        if let Some(passed) = self.passed {
            let dropped = missing(passed, place);
            self.counts.dropped += dropped;
            // Where the clock counts rows, each that is missing is one.
            for _ in 0..if self.time.is_none() { dropped.min(LONGEST_GAP) } else { 0 } {
                each(Sample { sequence: None, numbers: vec![f64::NAN; sample.numbers.len()] });
            }
        }
        self.passed = Some(place);
        self.counts.passed += 1;
        each(sample);
    }

    /// Where a sample stands, counted on where the number begins again.
    fn place(&self, sample: &Sample) -> Option<Place> {
        if let (Some(number), Some(bits)) = (sample.sequence, self.bits) {
            let Some(Place::Number(before)) = self.newest.or(self.passed) else {
                return Some(Place::Number(number));
            };
            if bits >= 64 {
                return Some(Place::Number(number));
            }
            let (size, half) = (1_u64 << bits, 1_u64 << (bits - 1));
            // The nearest number to that before which ends with these bits.
            let ahead = number.wrapping_sub(before) & (size - 1);
            let place =
                if ahead < half { before.wrapping_add(ahead) } else { before.wrapping_sub(size - ahead) };
            return Some(Place::Number(place));
        }
        let (at, per_interval) = self.time?;
        let time = sample.numbers.get(at).copied().filter(|time| time.is_finite())?;
        Some(Place::Time(time / per_interval))
    }
}

fn is_same(a: Place, b: Place) -> bool {
    match (a, b) {
        (Place::Number(a), Place::Number(b)) => a == b,
        (Place::Time(a), Place::Time(b)) => (a - b).abs() < SAME,
        _ => false,
    }
}

fn is_after(a: Place, b: Place) -> bool {
    a > b && !is_same(a, b)
}

/// How many samples are missing between two.
fn missing(before: Place, after: Place) -> u64 {
    match (before, after) {
        (Place::Number(before), Place::Number(after)) => after.saturating_sub(before).saturating_sub(1),
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a count, saturating
        (Place::Time(before), Place::Time(after)) => ((after - before).round() as u64).saturating_sub(1),
        _ => 0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn sample(number: u64) -> Sample {
        Sample { sequence: Some(number & 0xff), numbers: vec![number as f64 * 1e-6] }
    }

    fn run(order: &mut Order, numbers: &[u64]) -> Vec<u64> {
        let mut out = Vec::new();
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // small whole numbers
        let mut each = |sample: Sample| out.push((sample.numbers[0] * 1e6).round() as u64);
        for number in numbers {
            order.take(sample(*number), &mut each);
        }
        order.finish(&mut each);
        out
    }

    #[test]
    fn dropped_duplicated_and_late_samples_are_put_right_and_counted() {
        // 3 and 4 are dropped, 6 comes twice, 8 after 10, 9 after 20 others.
        let mut sent: Vec<u64> = vec![0, 1, 2, 5, 6, 6, 7, 10, 8, 11, 12, 13, 14, 15, 16, 9, 17];
        sent.extend(18..700);
        let expected: Vec<u64> = (0..700).filter(|k| ![3, 4, 9].contains(k)).collect();
        let counts =
            OrderCounts { passed: 697, dropped: 3, duplicated: 1, late: 1, too_late: 1, without_time: 0 };
        for bits in [Some(8), None] {
            let mut order = Order::new(4, bits, Some((0, 1e-6)));
            assert_eq!(run(&mut order, &sent), expected);
            assert_eq!(order.counts(), counts);
        }
    }

    #[test]
    fn where_the_clock_counts_rows_one_stands_for_each_that_is_missing() {
        let (mut order, mut rows) = (Order::new(4, Some(8), None), Vec::new());
        for number in [250, 251, 254, 258, 257] {
            order.take(sample(number), &mut |sample| rows.push(sample.numbers[0].is_finite()));
        }
        order.finish(&mut |sample| rows.push(sample.numbers[0].is_finite()));
        assert_eq!(rows, [true, true, false, false, true, false, false, true, true]);
    }

    proptest! {
        /// Whatever comes in whatever order: what is passed on increases, and nothing is passed on twice.
        #[test]
        fn what_is_passed_on_increases(sent in prop::collection::vec(0_u64..200, 0..300), wait in 0_usize..20) {
            let mut order = Order::new(wait, None, Some((0, 1e-6)));
            let out = run(&mut order, &sent);
            prop_assert!(out.windows(2).all(|pair| pair[0] < pair[1]));
            let counts = order.counts();
            prop_assert_eq!(counts.passed, out.len() as u64);
            prop_assert_eq!(sent.len() as u64, counts.passed + counts.duplicated + counts.too_late);
        }
    }
}

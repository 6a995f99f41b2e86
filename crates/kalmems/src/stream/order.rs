//! Samples in their order, as they were taken, whatever the way has made of it.

use super::decode::StreamSample;
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
    /// Samples far from those before and after them, as of a damaged time; they are left out.
    pub misplaced: u64,
    /// Frames with another number and the time of the one before them; they are left out.
    pub same_time: u64,
}

/// Where a sample stands: by its number where the frames count, else by its time in units of the interval.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
enum SamplePlace {
    Number(u64),
    Time(f64),
}

/// What goes on from [`Order`] to whoever takes the samples.
#[derive(Clone, Debug, PartialEq)]
pub enum OrderedEvent {
    /// The next sample.
    Sample(StreamSample),
    /// What comes next does not go on from what came before: so many samples, as far as that is known, are missing between, too
    /// many to stand rows for, or the clock went back.
    Restart {
        /// As many.
        missing: u64,
        /// Whether the clock, or the numbers, went back.
        back: bool,
    },
}

/// How samples are put in order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OrderSettings {
    /// Samples wait for so many later ones.
    pub wait: usize,
    /// By how many bits the frames count.
    pub bits: Option<u32>,
    /// The place of the time among the numbers, and how many of its units an interval has. Where the frames do not count, samples are told
    /// apart by it; where they do, it is looked for times that are not on the course of those around them.
    pub time: Option<(usize, f64)>,
    /// The most missing samples that rows stand for where the clock counts rows.
    pub longest_gap: u64,
}

/// Holds samples back until so many later ones have come, so that late ones find their place.
///
/// A sample is on the course where it is at most `wait` intervals ahead of the last one. Some that are farther ahead are
/// a gap once more than `wait` of them have come, and misplaced where as many come on the course instead. Samples behind
/// those that were passed on came again or too late, but where more than `wait` of them (and at least 8) come in a row, each
/// after the one before and none like one that was passed on: then the clock went back.
pub struct Order {
    settings: OrderSettings,
    /// Samples on the course by their place, in order.
    held: VecDeque<(SamplePlace, StreamSample)>,
    /// Samples far ahead of the course in order, and how many have come on the course since.
    ahead: VecDeque<(SamplePlace, StreamSample)>,
    since: usize,
    /// Samples behind the course that may be a new one.
    behind: Vec<(SamplePlace, StreamSample)>,
    passed: Option<SamplePlace>,
    /// Those that were passed on last: their places, which increase, and digests of their numbers.
    remembered: VecDeque<(SamplePlace, u64)>,
    counts: OrderCounts,
    /// Of frames that count: the same by their times, which takes them as their numbers have put them in order.
    by_time: Option<Box<Self>>,
}

/// How near to each other two times are one, in intervals.
const SAME: f64 = 0.25;

/// The least number of samples in a row that show that the clock went back.
const LEAST_BACK: usize = 8;

/// How many samples are remembered, so that one that is sent again is known.
const REMEMBERED: usize = 1 << 14;

impl Order {
    /// With nothing yet.
    pub fn new(settings: OrderSettings) -> Self {
        let counted = settings.bits.is_some() && settings.time.is_some();
        let by_time = counted.then(|| Box::new(Self::new(OrderSettings { bits: None, ..settings })));
        Self {
            by_time,
            settings,
            held: VecDeque::new(),
            ahead: VecDeque::new(),
            since: 0,
            behind: Vec::new(),
            passed: None,
            remembered: VecDeque::with_capacity(REMEMBERED),
            counts: OrderCounts::default(),
        }
    }

    /// What the way has made of the samples so far.
    pub fn counts(&self) -> OrderCounts {
        let Some(by_time) = &self.by_time else { return self.counts };
        // What is in order by its number and not by its time has a wrong time.
        let OrderCounts { passed, duplicated: same_time, late, too_late, misplaced, .. } = by_time.counts;
        OrderCounts { passed, same_time, misplaced: late + too_late + misplaced, ..self.counts }
    }

    /// Takes a sample; what is in order now goes to `each`.
    pub fn take(&mut self, sample: StreamSample, each: &mut impl FnMut(OrderedEvent)) {
        let time = self.settings.time;
        if time.is_some_and(|(at, _)| !sample.numbers.get(at).is_some_and(|time| time.is_finite())) {
            self.counts.without_time += 1;
            return;
        }
        let Some(place) = self.place(&sample) else {
            // Neither number nor time: as it comes.
            self.counts.passed += 1;
            each(OrderedEvent::Sample(sample));
            return;
        };
        if self.passed.is_some_and(|passed| !is_after(place, passed)) {
            self.take_behind(place, sample, each);
            return;
        }
        self.forget_behind();
        // Nearly every sample: nothing waits, and it is the next one.
        let waits = !(self.held.is_empty() && self.ahead.is_empty());
        if !waits && self.passed.is_some_and(|passed| missing(passed, place) == 0) {
            self.pass_next(place, sample, each);
            return;
        }
        let newest = self.held.back().map(|(place, _)| *place).or(self.passed);
        if newest.is_some_and(|newest| self.is_far(newest, place)) {
            self.take_ahead(place, sample, each);
            return;
        }
        let Some(at) = insert(&mut self.held, place, sample, &mut self.counts) else { return };
        self.part_at(at);
        self.catch_up();
        if !self.ahead.is_empty() {
            self.since += 1;
            if self.since > self.settings.wait {
                self.counts.misplaced += self.ahead.len() as u64;
                self.ahead.clear();
            }
        }
        self.pass_ready(each);
    }

    /// Passes an event on, of frames that count by way of their times.
    fn give(&mut self, event: OrderedEvent, each: &mut impl FnMut(OrderedEvent)) {
        match (&mut self.by_time, event) {
            (Some(by_time), OrderedEvent::Sample(sample)) => by_time.take_sorted(sample, each),
            (_, event) => each(event),
        }
    }

    /// Takes a sample for which no earlier one is waited for.
    fn take_sorted(&mut self, sample: StreamSample, each: &mut dyn FnMut(OrderedEvent)) {
        let each = &mut |event| each(event);
        self.take(sample, each);
        // What the first one is, and one far ahead, those that follow it tell.
        while self
            .passed
            .zip(self.held.front())
            .is_some_and(|(passed, (next, _))| !self.is_far(passed, *next))
        {
            self.pass(each);
        }
    }

    /// Says that what comes next does not go on from what came, of which nothing is waited for any more.
    pub fn interrupt(&mut self, each: &mut impl FnMut(OrderedEvent)) {
        if self.place_is_known() {
            return;
        }
        each(OrderedEvent::Restart { missing: 0, back: false });
    }

    /// Passes on what waits.
    pub fn finish(&mut self, each: &mut impl FnMut(OrderedEvent)) {
        self.forget_behind();
        self.pass_held(each);
        // Several that follow each other are behind a gap; one may be damaged.
        if self.ahead.len() > 1 {
            self.held = std::mem::take(&mut self.ahead);
            self.pass_held(each);
        }
        self.counts.misplaced += self.ahead.len() as u64;
        self.ahead.clear();
        if let Some(by_time) = &mut self.by_time {
            by_time.finish_sorted(each);
        }
    }

    fn finish_sorted(&mut self, each: &mut dyn FnMut(OrderedEvent)) {
        self.finish(&mut |event| each(event));
    }

    /// Takes a sample that is not after the last one that was passed on: again, too late, or of a clock that went back.
    fn take_behind(&mut self, place: SamplePlace, sample: StreamSample, each: &mut impl FnMut(OrderedEvent)) {
        let again = self.passed.is_some_and(|passed| is_same(place, passed));
        if again || self.is_remembered(place, &sample) {
            self.counts.duplicated += 1;
            return;
        }
        if self.behind.last().is_some_and(|(last, _)| !is_after(place, *last)) {
            self.forget_behind();
        }
        self.behind.push((place, sample));
        if self.behind.len() <= self.settings.wait.max(LEAST_BACK) {
            return;
        }
        let new = std::mem::take(&mut self.behind);
        self.pass_held(each);
        self.counts.misplaced += self.ahead.len() as u64;
        self.ahead.clear();
        self.remembered.clear();
        self.passed = None;
        self.give(OrderedEvent::Restart { missing: 0, back: true }, each);
        for (place, sample) in new {
            insert(&mut self.held, place, sample, &mut self.counts);
            self.pass_ready(each);
        }
    }

    /// Takes a sample far ahead of the course.
    fn take_ahead(&mut self, place: SamplePlace, sample: StreamSample, each: &mut impl FnMut(OrderedEvent)) {
        if self.ahead.is_empty() {
            self.since = 0;
        }
        if let Some(at) = insert(&mut self.ahead, place, sample, &mut self.counts)
            && self.ahead.get(at + 1).is_some_and(|(next, _)| self.is_far(place, *next))
        {
            // A sample before one that may be misplaced is not late.
            self.counts.late = self.counts.late.saturating_sub(1);
        }
        if self.ahead.len() > self.settings.wait {
            if self.first_is_misplaced() {
                self.held.clear();
                self.counts.misplaced += 1;
            }
            self.pass_held(each);
            self.held = std::mem::take(&mut self.ahead);
            self.pass_ready(each);
        }
    }

    /// Whether the first sample of all is far before those whose numbers follow its own at once.
    fn first_is_misplaced(&self) -> bool {
        let number = |samples: &VecDeque<(SamplePlace, StreamSample)>| samples.front()?.1.sequence;
        let follows = |first: u64, next: u64| next == 0 || next == first.wrapping_add(1);
        let numbers = number(&self.held).zip(number(&self.ahead));
        self.passed.is_none()
            && self.held.len() == 1
            && numbers.is_some_and(|(first, next)| follows(first, next))
    }

    /// What came first and lies far ahead of what came after it was not on the course.
    fn part_at(&mut self, at: usize) {
        let behind = self.held.get(at + 1).map(|(place, _)| *place);
        if let (Some((here, _)), Some(behind)) = (self.held.get(at), behind)
            && self.is_far(*here, behind)
        {
            let mut far = self.held.split_off(at + 1);
            far.append(&mut self.ahead);
            (self.ahead, self.since) = (far, 0);
            self.counts.late = self.counts.late.saturating_sub(1);
        }
    }

    /// Takes samples that the course has reached from those far ahead of it.
    fn catch_up(&mut self) {
        while let (Some((newest, _)), Some((next, _))) = (self.held.back(), self.ahead.front()) {
            if self.is_far(*newest, *next) {
                break;
            }
            if let Some((place, sample)) = self.ahead.pop_front() {
                insert(&mut self.held, place, sample, &mut self.counts);
            }
        }
    }

    /// Those behind the course are no new one.
    fn forget_behind(&mut self) {
        self.counts.too_late += self.behind.len() as u64;
        self.behind.clear();
    }

    fn is_far(&self, newest: SamplePlace, place: SamplePlace) -> bool {
        missing(newest, place) > self.settings.wait as u64
    }

    const fn place_is_known(&self) -> bool {
        self.settings.bits.is_some() || self.settings.time.is_some()
    }

    /// Whether a sample was passed on with the same numbers, not long ago.
    fn is_remembered(&self, place: SamplePlace, sample: &StreamSample) -> bool {
        let from = self.remembered.partition_point(|(other, _)| is_after(place, *other));
        let same = self.remembered.get(from).filter(|(other, _)| is_same(place, *other));
        same.is_some_and(|(_, digest)| *digest == digest_of(sample))
    }

    fn pass_ready(&mut self, each: &mut impl FnMut(OrderedEvent)) {
        while self.held.len() > self.settings.wait || self.is_next() {
            self.pass(each);
        }
    }

    fn pass_held(&mut self, each: &mut impl FnMut(OrderedEvent)) {
        while !self.held.is_empty() {
            self.pass(each);
        }
    }

    /// Whether the first that waits follows the last one: then nothing can come between.
    fn is_next(&self) -> bool {
        let (Some((first, _)), Some(passed)) = (self.held.front(), self.passed) else { return false };
        missing(passed, *first) == 0
    }

    fn pass(&mut self, each: &mut impl FnMut(OrderedEvent)) {
        let Some((place, sample)) = self.held.pop_front() else { return };
        if let Some(passed) = self.passed {
            let dropped = missing(passed, place);
            self.counts.dropped = self.counts.dropped.saturating_add(dropped);
            // Where the clock counts rows, each that is missing is one.
            if self.settings.time.is_none() {
                self.stand_in(dropped, sample.numbers.len(), each);
            }
        }
        self.pass_next(place, sample, each);
    }

    /// Passes on a sample that goes on from the last one.
    fn pass_next(&mut self, place: SamplePlace, sample: StreamSample, each: &mut impl FnMut(OrderedEvent)) {
        self.passed = Some(place);
        self.counts.passed += 1;
        if self.remembered.len() == REMEMBERED {
            self.remembered.pop_front();
        }
        self.remembered.push_back((place, digest_of(&sample)));
        self.give(OrderedEvent::Sample(sample), each);
    }

    /// Rows without numbers for samples that are missing, if they are not too many.
    fn stand_in(&self, missing: u64, numbers: usize, each: &mut impl FnMut(OrderedEvent)) {
        if missing > self.settings.longest_gap {
            each(OrderedEvent::Restart { missing, back: false });
            return;
        }
        for _ in 0..missing {
            each(OrderedEvent::Sample(StreamSample { sequence: None, numbers: vec![f64::NAN; numbers] }));
        }
    }

    /// Where a sample stands, counted on where the number begins again.
    fn place(&self, sample: &StreamSample) -> Option<SamplePlace> {
        if let (Some(number), Some(bits)) = (sample.sequence, self.settings.bits) {
            if bits >= 64 {
                return Some(SamplePlace::Number(number));
            }
            let (size, half) = (1_u64 << bits, 1_u64 << (bits - 1));
            let newest = self.held.back().map(|(place, _)| *place).or(self.passed);
            let Some(SamplePlace::Number(before)) = newest else {
                // There is room before it for one that comes late.
                return Some(SamplePlace::Number(number + size));
            };
            // The nearest number to that before which ends with these bits.
            let ahead = number.wrapping_sub(before) & (size - 1);
            let place =
                if ahead < half { before.wrapping_add(ahead) } else { before.saturating_sub(size - ahead) };
            return Some(SamplePlace::Number(place));
        }
        let (at, per_interval) = self.settings.time?;
        let time = sample.numbers.get(at).copied().filter(|time| time.is_finite())?;
        Some(SamplePlace::Time(time / per_interval))
    }
}

/// Puts a sample in its place, which is given; not where one is there.
fn insert(
    samples: &mut VecDeque<(SamplePlace, StreamSample)>,
    place: SamplePlace,
    sample: StreamSample,
    counts: &mut OrderCounts,
) -> Option<usize> {
    let at = samples.partition_point(|(other, _)| is_after(place, *other));
    if samples.get(at).is_some_and(|(other, _)| is_same(place, *other)) {
        counts.duplicated += 1;
        return None;
    }
    counts.late += u64::from(at < samples.len());
    samples.insert(at, (place, sample));
    Some(at)
}

/// A digest of a sample's numbers, by FNV's rule over their bits.
fn digest_of(sample: &StreamSample) -> u64 {
    sample.numbers.iter().fold(0xcbf2_9ce4_8422_2325, |digest: u64, number| {
        (digest ^ number.to_bits()).wrapping_mul(0x0100_0000_01b3).rotate_left(29)
    })
}

fn is_same(a: SamplePlace, b: SamplePlace) -> bool {
    match (a, b) {
        (SamplePlace::Number(a), SamplePlace::Number(b)) => a == b,
        (SamplePlace::Time(a), SamplePlace::Time(b)) => (a - b).abs() < SAME,
        _ => false,
    }
}

fn is_after(a: SamplePlace, b: SamplePlace) -> bool {
    a > b && !is_same(a, b)
}

/// How many samples are missing between two.
fn missing(before: SamplePlace, after: SamplePlace) -> u64 {
    match (before, after) {
        (SamplePlace::Number(before), SamplePlace::Number(after)) => {
            after.saturating_sub(before).saturating_sub(1)
        }
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a count, saturating
        (SamplePlace::Time(before), SamplePlace::Time(after)) => {
            let intervals = after - before;
            if intervals < 1.5 { 0 } else { (intervals.round() as u64).saturating_sub(1) }
        }
        _ => 0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn sample(number: u64) -> StreamSample {
        StreamSample { sequence: Some(number & 0xff), numbers: vec![number as f64 * 1e-6] }
    }

    fn ordering(wait: usize, bits: Option<u32>) -> Order {
        Order::new(OrderSettings { wait, bits, time: Some((0, 1e-6)), longest_gap: 1000 })
    }

    /// What is passed on, the beginnings apart.
    fn run(order: &mut Order, numbers: &[u64]) -> Vec<Vec<u64>> {
        let mut out = vec![Vec::new()];
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // small whole numbers
        let mut each = |next: OrderedEvent| match next {
            OrderedEvent::Sample(sample) => {
                out.last_mut().unwrap().push((sample.numbers[0] * 1e6).round() as u64);
            }
            OrderedEvent::Restart { .. } => out.push(Vec::new()),
        };
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
        let counts = OrderCounts {
            passed: 697,
            dropped: 3,
            duplicated: 1,
            late: 1,
            too_late: 1,
            ..OrderCounts::default()
        };
        for bits in [Some(8), None] {
            let mut order = ordering(4, bits);
            assert_eq!(run(&mut order, &sent), [expected.as_slice()]);
            assert_eq!(order.counts(), counts);
        }
    }

    #[test]
    fn a_clock_that_goes_back_begins_anew_as_soon_as_it_is_known() {
        let sent: Vec<u64> = (5000..9000).chain(2000..4000).collect();
        let mut order = ordering(4, None);
        let mut begun = 0;
        for (count, number) in sent.iter().enumerate() {
            order.take(sample(*number), &mut |next| {
                if next == (OrderedEvent::Restart { missing: 0, back: true }) {
                    assert_eq!(begun, 0);
                    begun = count;
                }
            });
        }
        assert_eq!(begun, 4000 + LEAST_BACK);
        let mut order = ordering(4, None);
        let beginnings = run(&mut order, &sent);
        assert_eq!(beginnings, [&sent[..4000], &sent[4000..]]);
        let counts = order.counts();
        assert_eq!((counts.passed, counts.too_late, counts.duplicated, counts.late), (6000, 0, 0, 0));
    }

    #[test]
    fn samples_that_are_sent_again_are_no_clock_that_goes_back() {
        let sent: Vec<u64> = (0..5000).chain(3000..6000).collect();
        let mut order = ordering(32, None);
        assert_eq!(run(&mut order, &sent), [(0..6000).collect::<Vec<_>>()]);
        assert_eq!(order.counts(), OrderCounts { passed: 6000, duplicated: 2000, ..OrderCounts::default() });
    }

    #[test]
    fn one_time_that_is_far_off_leaves_the_others_as_they_are() {
        let absurd = |place: usize, number: u64| {
            let mut sent: Vec<u64> = (0..1000).collect();
            sent.insert(place, number);
            let mut order = ordering(4, None);
            assert_eq!(run(&mut order, &sent), [(0..1000).collect::<Vec<_>>()], "{place} {number}");
            let counts = order.counts();
            assert_eq!((counts.misplaced, counts.dropped, counts.late), (1, 0, 0), "{place} {number}");
        };
        for place in [0, 1, 500, 1000] {
            absurd(place, 86_400_000_000);
            absurd(place, 1200);
        }
        let mut order = ordering(4, None);
        let mut each = |_: OrderedEvent| {};
        for number in 0..100 {
            order.take(sample(number), &mut each);
            if number == 50 {
                order.take(StreamSample { sequence: None, numbers: vec![1e300] }, &mut each);
            }
        }
        order.finish(&mut each);
        let counts = order.counts();
        assert_eq!((counts.passed, counts.misplaced, counts.dropped), (100, 1, 0));
    }

    #[test]
    fn one_time_that_is_far_off_is_left_out_of_frames_that_count_wherever_it_is() {
        // By itself, and with a gap that follows it soon.
        let places = [(0, 1000), (1, 1000), (500, 1000), (999, 1000), (5, 7), (500, 503)];
        for ((place, gap), time_s) in places.into_iter().flat_map(|place| [(place, 1e5), (place, -3.0)]) {
            let mut order = ordering(4, Some(8));
            let mut times = Vec::new();
            let mut each = |next| match next {
                OrderedEvent::Sample(StreamSample { numbers, .. }) => times.push(numbers[0]),
                OrderedEvent::Restart { .. } => panic!("{place} {time_s}"),
            };
            let expected = |number: u64| (number != place).then_some(number as f64 * 1e-6);
            let sent = || (0..gap).chain(gap + 60..1060);
            for number in sent() {
                let numbers = vec![expected(number).unwrap_or(time_s)];
                order.take(StreamSample { sequence: Some(number & 0xff), numbers }, &mut each);
            }
            order.finish(&mut each);
            assert_eq!(times, sent().filter_map(expected).collect::<Vec<_>>(), "{place} {time_s}");
            let OrderCounts { misplaced, dropped, late, .. } = order.counts();
            let missing = if gap < 1000 { 60 } else { 0 };
            assert_eq!((misplaced, dropped, late), (1, missing, 0), "{place} {time_s}");
        }
    }

    #[test]
    fn a_long_gap_is_one_and_what_is_late_at_its_end_finds_its_place() {
        let mut sent: Vec<u64> = (0..100).chain(10_000..10_100).collect();
        sent.swap(102, 103);
        let expected: Vec<u64> = (0..100).chain(10_000..10_100).collect();
        let mut order = ordering(8, None);
        assert_eq!(run(&mut order, &sent), [expected]);
        let counts = order.counts();
        assert_eq!((counts.dropped, counts.late, counts.misplaced), (9900, 1, 0));
    }

    #[test]
    fn where_the_clock_counts_rows_one_stands_for_each_that_is_missing_of_a_gap_that_is_not_too_long() {
        let settings = OrderSettings { wait: 4, bits: Some(16), time: None, longest_gap: 1000 };
        let numbered =
            |number: u64| StreamSample { sequence: Some(number & 0xffff), numbers: vec![number as f64] };
        let rows = |sent: &[u64]| {
            let (mut order, mut rows, mut missed) = (Order::new(settings), Vec::new(), Vec::new());
            let mut each = |next| match next {
                OrderedEvent::Sample(sample) => rows.push(sample.numbers[0].is_finite()),
                OrderedEvent::Restart { missing, .. } => missed.push(missing),
            };
            for number in sent {
                order.take(numbered(*number), &mut each);
            }
            order.finish(&mut each);
            (rows, missed)
        };
        let (found, missed) = rows(&[65_530, 65_531, 65_534, 65_538, 65_537]);
        assert_eq!(found, [true, true, false, false, true, false, false, true, true]);
        assert!(missed.is_empty());
        let sent: Vec<u64> = (0..10).chain(20_000..20_010).collect();
        let (found, missed) = rows(&sent);
        assert!(found.len() == 20 && missed == [19_990], "{found:?} {missed:?}");
    }

    proptest! {
        /// Whatever comes in whatever order: what is passed on increases from beginning to beginning, nothing is passed on
        /// twice, and each sample is counted once.
        #[test]
        fn what_is_passed_on_increases(sent in prop::collection::vec(0_u64..200, 0..300), wait in 0_usize..20) {
            let mut order = ordering(wait, None);
            let out = run(&mut order, &sent);
            prop_assert!(out.iter().flat_map(|out| out.windows(2)).all(|pair| pair[0] < pair[1]));
            let counts = order.counts();
            prop_assert_eq!(counts.passed, out.iter().map(Vec::len).sum::<usize>() as u64);
            let out = counts.duplicated + counts.too_late + counts.misplaced;
            prop_assert_eq!(sent.len() as u64, counts.passed + out);
        }
    }
}

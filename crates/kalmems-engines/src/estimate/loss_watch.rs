//! When a filter that has lost its signal is started again from it.
//!
//! What says that the signal is lost is what judges the lock of every trajectory: [`SignalWatch`]. A filter that is lost in each cycle for as long as
//! a start needs is started again by these cycles, of which none is that in which it was lost, so that what made it lose the signal is not among
//! their samples. A start that is not found is sought again later. A filter that comes back by itself is started again as well, as soon as it explains
//! the signal for as long, since what it claims rests on samples that are none of the signal; but not where its gate has rejected all of these.
//!
//! A filter that settles may leave the signal unexplained, and is not watched. Only a sample that is [`DISTURBANCE`] standard deviations away from its
//! prediction, or a drive that leads to such samples, may leave a filter where it explains nothing: from there on it is watched as a settled one is.

use super::signal_watch::{CycleState, SignalTurn, SignalWatch, WatchedSample};

/// How a course wants a filter to be started again.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reacquisition {
    /// The frequency of its slowest motion, in Hz.
    pub motion_hz: f64,
    /// The end of the settling time, in s: a filter that settles is not lost, unless a sample has disturbed it.
    pub from_s: f64,
    /// The rows that a start is sought in.
    pub rows: usize,
}

/// The innovation in standard deviations from which on a sample disturbs a filter that settles.
pub const DISTURBANCE: f64 = 100.0;

/// A search takes as long as about a thousand cycles: after one the next comes not before so many cycles, and so large a part of the cycles since
/// the loss.
const PAUSE: u32 = 2;
const PAUSE_SHARE: u32 = 4;
/// So many searches may follow each other, however often the signal is lost, and another one for each so many cycles.
const SEARCHES: u32 = 16;
const CYCLES_FOR_ONE: u32 = 256;

/// A state at a time in s.
#[derive(Clone, Debug)]
struct StateAt {
    time_s: f64,
    mean: Vec<f64>,
}

impl StateAt {
    /// Keeps another state of as many numbers.
    fn keep(&mut self, time_s: f64, mean: &[f64]) {
        self.time_s = time_s;
        for (own, other) in self.mean.iter_mut().zip(mean) {
            *own = *other;
        }
    }
}

/// Watches a filter for the loss of its signal.
#[derive(Clone, Debug)]
pub(super) struct LossWatch {
    signal: SignalWatch,
    /// Whether the filter has settled, or was disturbed before.
    is_watched: bool,
    /// Cycles since the signal was lost, from which on a start may be sought.
    age: u32,
    next: u32,
    /// Rows behind the first of the cycles that follow each other and in which it is lost.
    rows: usize,
    in_a_row: u32,
    /// Whether samples that are none of the signal have corrected the filter since it was started.
    is_misled: bool,
    /// Rows of the cycle that has not ended, and of those since which the signal is explained again.
    rows_of_cycle: usize,
    rows_shown: usize,
    /// Searches that are left, and cycles since the last of them came.
    left: u32,
    cycles: u32,
    is_due: bool,
    /// The state where the cycle began that has not ended, and where the last one began in which the signal was not lost.
    began: StateAt,
    held: StateAt,
}

impl LossWatch {
    /// Of a filter of so many states.
    pub(super) fn new(states: usize) -> Self {
        let nowhere = StateAt { time_s: f64::NAN, mean: vec![f64::NAN; states] };
        Self {
            signal: SignalWatch::default(),
            is_watched: false,
            age: 0,
            next: 0,
            rows: 0,
            in_a_row: 0,
            is_misled: false,
            rows_of_cycle: 0,
            rows_shown: 0,
            left: SEARCHES,
            cycles: 0,
            is_due: false,
            began: nowhere.clone(),
            held: nowhere,
        }
    }

    /// Takes signal, innovation and NIS of a sample, and the state after it. When the cycle began, in s, that is over and in which the signal was lost.
    #[inline]
    pub(super) fn take(
        &mut self,
        rule: &Reacquisition,
        time_s: f64,
        sample: WatchedSample,
        mean: &[f64],
    ) -> Option<f64> {
        if !self.is_watched && !self.begins(rule, time_s, sample, mean) {
            return None;
        }
        self.rows += 1;
        self.rows_of_cycle += 1;
        let ended = self.signal.take((rule.motion_hz, true), time_s, sample)?;
        // The present sample is the first of the next cycle.
        let rows_of_cycle = std::mem::replace(&mut self.rows_of_cycle, 1) - 1;
        self.cycles += 1;
        if self.cycles >= CYCLES_FOR_ONE {
            (self.cycles, self.left) = (0, (self.left + 1).min(SEARCHES));
        }
        let mut lost_s = None;
        if let Some(SignalTurn::Lost { time_s, .. }) = ended.turn {
            (self.age, self.next, lost_s) = (0, 0, Some(time_s));
        }
        if matches!(ended.turn, Some(SignalTurn::Regained { .. })) {
            self.is_misled = false;
        }
        if ended.told == CycleState::Explained && !self.signal.is_lost() {
            self.held.keep(self.began.time_s, &self.began.mean);
        }
        self.began.keep(time_s, mean);
        self.age += 1;
        self.rows_shown = if self.signal.shown() > 0 { self.rows_shown + rows_of_cycle } else { 0 };
        if ended.told != CycleState::Lost {
            self.in_a_row = 0;
            self.is_due = self.is_misled && self.rows_shown >= rule.rows && self.left > 0;
            return lost_s;
        }
        self.is_misled = true;
        if self.in_a_row == 0 {
            self.rows = 1;
        }
        self.in_a_row += 1;
        self.is_due = self.rows >= rule.rows && self.age >= self.next && self.left > 0;
        lost_s
    }

    /// Whether the samples of a filter that was not watched are watched from this one on. Those before tell where the motion was, cycle by cycle.
    fn begins(&mut self, rule: &Reacquisition, time_s: f64, sample: WatchedSample, mean: &[f64]) -> bool {
        if time_s >= rule.from_s {
            self.is_watched = true;
            self.began.keep(time_s, mean);
            return true;
        }
        // The sample that disturbs it is none of the motion.
        self.is_watched =
            matches!(sample, WatchedSample::Taken([.., nis]) if nis > DISTURBANCE * DISTURBANCE);
        let has_begun = !self.began.time_s.is_nan();
        if self.is_watched || (has_begun && time_s < self.began.time_s + 1.0 / rule.motion_hz) {
            return false;
        }
        if has_begun {
            self.held.keep(self.began.time_s, &self.began.mean);
        }
        self.began.keep(time_s, mean);
        false
    }

    /// Whether a start is to be sought before the next sample; it is taken for done then.
    pub(super) fn take_due(&mut self) -> bool {
        let is_due = std::mem::take(&mut self.is_due);
        if is_due {
            self.left -= 1;
            self.next = self.age + PAUSE.max(self.age / PAUSE_SHARE);
            (self.in_a_row, self.is_misled) = (0, false);
        }
        is_due
    }

    /// The filter stopped: what was known of its signal is over, but for the last state at which that was not lost.
    pub(super) fn stop(&mut self) {
        let held = self.held.clone();
        let fresh = Self::new(held.mean.len());
        *self = Self { left: self.left, cycles: self.cycles, held, ..fresh };
    }

    /// The time in s and the state at the beginning of the last cycle in which the signal was not lost.
    pub(super) fn held(&self) -> (f64, &[f64]) {
        (self.held.time_s, &self.held.mean)
    }

    /// As numbers, for another run to go on from.
    pub(super) fn numbers(&self) -> Vec<f64> {
        let flags = [self.is_due, self.is_misled, self.is_watched].map(u32::from);
        let counts = [self.age, self.next, self.in_a_row, self.left, self.cycles];
        let states = [&self.began, &self.held];
        let states = states
            .into_iter()
            .flat_map(|state| std::iter::once(state.time_s).chain(state.mean.iter().copied()));
        let of_signal = self.signal.numbers();
        let rows = [self.rows, self.rows_of_cycle, self.rows_shown].map(|rows| rows as f64);
        let counts = counts.into_iter().chain(flags).map(f64::from);
        of_signal.into_iter().chain(rows).chain(counts).chain(states).collect()
    }

    /// How many numbers it is of a filter of so many states.
    pub(super) const fn count(states: usize) -> usize {
        SignalWatch::NUMBERS + 11 + 2 * (states + 1)
    }

    /// From such numbers, where they are those of a filter of so many states.
    pub(super) fn resumed(numbers: &[f64], states: usize) -> Self {
        let mut watch = Self::new(states);
        let (Some((of_signal, rest)), true) =
            (numbers.split_first_chunk(), numbers.len() == Self::count(states))
        else {
            return watch;
        };
        let Some((rows, rest)) = rest.split_first_chunk::<3>() else { return watch };
        let Some(([age, next, in_a_row, left, cycles, flags @ ..], rest)) = rest.split_first_chunk::<8>()
        else {
            return watch;
        };
        let (began, held) = rest.split_at(states + 1);
        for (state, numbers) in [(&mut watch.began, began), (&mut watch.held, held)] {
            if let Some((time_s, mean)) = numbers.split_first() {
                state.keep(*time_s, mean);
            }
        }
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // counts
        let count = |number: &f64| *number as u32;
        watch.signal = SignalWatch::resumed(*of_signal);
        (watch.age, watch.next, watch.in_a_row) = (count(age), count(next), count(in_a_row));
        (watch.left, watch.cycles) = (count(left), count(cycles));
        [watch.is_due, watch.is_misled, watch.is_watched] = flags.map(|flag| flag != 0.0);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // counts
        let rows = rows.map(|rows| rows as usize);
        [watch.rows, watch.rows_of_cycle, watch.rows_shown] = rows;
        watch
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    const RULE: Reacquisition = Reacquisition { motion_hz: 500.0, from_s: 0.0, rows: 120 };

    /// The samples before which a start is sought, of a filter that is lost from the 1000th on.
    fn searches(samples: u32, is_lost: impl Fn(u32) -> bool) -> Vec<u32> {
        let mut watch = LossWatch::new(2);
        let mut all = Vec::new();
        for k in 0..samples {
            if watch.take_due() {
                all.push(k);
            }
            let signal = (TAU * f64::from(k) / 40.0).sin();
            let innovation = if is_lost(k) { signal } else { 1e-3 * f64::from(k % 2) };
            let values = WatchedSample::Taken([signal, innovation, 1e6 * innovation * innovation]);
            watch.take(&RULE, f64::from(k) * 5e-5, values, &[f64::from(k), 0.0]);
            // Another run goes on from the numbers as this one does.
            watch = LossWatch::resumed(&watch.numbers(), 2);
        }
        all
    }

    #[test]
    fn a_start_is_sought_behind_the_first_lost_cycle_and_less_often_the_longer_the_loss_lasts() {
        let all = searches(100_000, |k| k >= 1000);
        // The cycle of 40 samples in which it is lost, and 120 rows.
        assert!((1120..=1201).contains(&all[0]), "{all:?}");
        // By a quarter of the cycles since the loss, rounded down.
        assert!(all.len() <= 16 + 100_000 / (40 * 256) + 1, "{}: {all:?}", all.len());
        let late = all
            .windows(2)
            .filter(|pair| pair[1] > 5_000)
            .all(|pair| pair[1] - pair[0] >= (pair[0] - 1000) / 5);
        assert!(late, "{all:?}");
    }

    #[test]
    fn a_filter_that_comes_back_by_itself_is_started_again_by_what_it_explains() {
        let all = searches(10_000, |k| (1000..1080).contains(&k));
        assert!(matches!(all[..], [k] if (1200..1261).contains(&k)), "{all:?}");
        assert!(searches(10_000, |_| false).is_empty());
    }

    /// A filter that leaves the signal unexplained while it settles, for the first 2000 samples, one of which may disturb it.
    fn settles(disturbed_at: Option<u32>) -> Vec<u32> {
        let rule = Reacquisition { from_s: 0.1, ..RULE };
        let (mut watch, mut all) = (LossWatch::new(2), Vec::new());
        for k in 0..2000 {
            if watch.take_due() {
                all.push(k);
            }
            let signal = (TAU * f64::from(k) / 40.0).sin();
            let nis = if Some(k) == disturbed_at { 1.1e4 } else { 9.9e3 };
            let values = WatchedSample::Taken([signal, signal, nis]);
            watch.take(&rule, f64::from(k) * 5e-5, values, &[f64::from(k), 0.0]);
            watch = LossWatch::resumed(&watch.numbers(), 2);
        }
        // A cycle is held that began undisturbed, of which the last is not yet known to have been so to its end.
        let (held, until) = (watch.held().1[0], f64::from(disturbed_at.unwrap_or(2000)));
        let is_recent = (until - 83.0..=until - 40.0).contains(&held);
        assert!(if until < 40.0 { held.is_nan() } else { is_recent }, "{held} {until}");
        all
    }

    #[test]
    fn a_filter_that_settles_is_started_again_only_where_a_sample_has_disturbed_it() {
        assert!(settles(None).is_empty());
        for at in [0, 1, 17, 999] {
            let all = settles(Some(at));
            // The cycle in which it is found lost, and 120 rows.
            assert!((at + 160..=at + 201).contains(&all[0]), "{at}: {all:?}");
        }
    }

    #[test]
    fn however_often_the_signal_is_lost_searches_are_few() {
        let all = searches(400_000, |k| k % 400 > 100);
        assert!(all.len() <= 16 + 400_000 / (40 * 256) + 1, "{}", all.len());
    }
}

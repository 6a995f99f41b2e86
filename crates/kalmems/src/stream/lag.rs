//! How far estimates are behind the samples' own times.
//!
//! What waits in the system before it is read has not arrived by this program's clock, so that the time since its arrival says nothing of it. The
//! samples' own times do: the estimate of a sample that comes at once is there after the shortest time that was ever between a sample and its
//! estimate, whatever zero the clock of the samples counts from, and one that comes later is behind by the difference. At the beginning the first samples that are read
//! give that time, as their estimates wait for the settling time and may be held up.

use std::time::{Duration, Instant};

/// By how much the clock of the samples may be slower or faster than this one: the shortest time grows by as much.
const CLOCK_ERROR: f64 = 2e-4;

/// Estimates are behind from so many s on, and no longer below the share of it.
const BEHIND_S: f64 = 0.25;
const CAUGHT_UP: f64 = 0.5;

/// How long samples are estimated at the beginning until it is known whether that takes longer than they do, and how many there are at least. A process
/// that waits for a core does so for some milliseconds.
const TRIAL: (Duration, u64) = (Duration::from_millis(25), 4096);

/// How long the work on samples takes, that of their outputs included.
#[derive(Default)]
pub(super) struct WorkWatch {
    samples: u64,
    work: Duration,
    is_judged: bool,
}

impl WorkWatch {
    /// So many samples took so long.
    pub(super) fn take(&mut self, samples: u64, work: Duration) {
        self.samples += samples;
        self.work += work;
    }

    /// Samples that can be estimated in a second; none of nothing.
    pub(super) fn sustained_hz(&self) -> Option<f64> {
        (self.samples > 0).then(|| self.samples as f64 / self.work.as_secs_f64().max(1e-9))
    }

    /// Once, when that is known: the rate that can be sustained, where it is less than that of the samples.
    pub(super) fn verdict(&mut self, rate_hz: f64) -> Option<f64> {
        if self.is_judged || self.work < TRIAL.0 || self.samples < TRIAL.1 {
            return None;
        }
        self.is_judged = true;
        self.sustained_hz().filter(|sustained_hz| *sustained_hz < rate_hz)
    }
}

/// A change of whether the estimates are behind.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum LagTurn {
    /// They are behind by so many s.
    Behind(f64),
    /// They are not any more.
    CaughtUp,
}

/// Follows how far estimates are behind.
pub(super) struct LagWatch {
    zero: Instant,
    /// The shortest time between a sample and its estimate, up to a constant, in s, and when it was brought up to date.
    shortest: Option<[f64; 2]>,
    is_behind: bool,
}

impl LagWatch {
    pub(super) fn new() -> Self {
        Self { zero: Instant::now(), shortest: None, is_behind: false }
    }

    /// The sample of this time in s was read then, before any estimate.
    pub(super) fn begin_with(&mut self, (read, time_s): (Instant, f64)) {
        let read_s = read.saturating_duration_since(self.zero).as_secs_f64();
        self.shortest.get_or_insert([read_s - time_s, read_s]);
    }

    /// The clock of the samples begins anew.
    pub(super) fn begin(&mut self) {
        self.shortest = None;
    }

    /// The estimate of a sample of this time in s is there: by how much it is behind.
    pub(super) fn take(&mut self, time_s: f64) -> Duration {
        self.take_at(time_s, self.zero.elapsed().as_secs_f64())
    }

    fn take_at(&mut self, time_s: f64, now_s: f64) -> Duration {
        let took_s = now_s - time_s;
        let shortest_s = match self.shortest {
            Some([before_s, then_s]) => took_s.min(before_s + CLOCK_ERROR * (now_s - then_s)),
            None => took_s,
        };
        self.shortest = Some([shortest_s, now_s]);
        Duration::try_from_secs_f64(took_s - shortest_s).unwrap_or_default()
    }

    /// Whether that has become too much, or has been.
    pub(super) fn turn(&mut self, behind: Duration) -> Option<LagTurn> {
        let behind_s = behind.as_secs_f64();
        let bound_s = if self.is_behind { CAUGHT_UP * BEHIND_S } else { BEHIND_S };
        let is_behind = behind_s > bound_s;
        let has_turned = std::mem::replace(&mut self.is_behind, is_behind) != is_behind;
        has_turned.then_some(if is_behind { LagTurn::Behind(behind_s) } else { LagTurn::CaughtUp })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_waits_before_it_is_read_is_behind_by_the_times_of_the_samples() {
        let mut watch = LagWatch::new();
        let mut turns = Vec::new();
        let mut longest_s = 0.0_f64;
        // Samples of 10 s whose clock counts from 1000 s; 4 of 5 seconds' worth are taken in each second from 2 s on, and all from 6 s on.
        for k in 0..1000 {
            let time_s = f64::from(k) * 0.01;
            let taken_s = if time_s < 2.0 { time_s } else { (2.0 + (time_s - 2.0) * 1.25).min(time_s + 1.0) };
            let taken_s = if time_s > 8.0 { time_s + 0.003 } else { taken_s };
            let behind = watch.take_at(1000.0 + time_s, taken_s + 0.003);
            longest_s = longest_s.max(behind.as_secs_f64());
            turns.extend(watch.turn(behind));
        }
        assert!((longest_s - 1.0).abs() < 0.01, "{longest_s}");
        let [LagTurn::Behind(behind_s), LagTurn::CaughtUp] = turns[..] else { panic!("{turns:?}") };
        assert!((0.25..0.26).contains(&behind_s), "{behind_s}");
    }

    #[test]
    fn samples_that_take_longer_than_they_last_are_told_once_at_the_beginning() {
        let mut watch = WorkWatch::default();
        let verdicts: Vec<(u32, f64)> = (0..100)
            .filter_map(|k| {
                watch.take(1024, Duration::from_micros(10 * 1024));
                watch.verdict(200e3).map(|sustained_hz| (k, sustained_hz))
            })
            .collect();
        let [(3, sustained_hz)] = verdicts[..] else { panic!("{verdicts:?}") };
        assert!((sustained_hz - 100e3).abs() < 1.0, "{sustained_hz}");
        let mut watch = WorkWatch::default();
        watch.take(1_000_000, Duration::from_secs(10));
        assert_eq!(watch.verdict(99e3), None);
    }

    #[test]
    fn a_clock_that_is_a_little_slow_is_not_behind() {
        let mut watch = LagWatch::new();
        let behind =
            (0..1_000_000).map(|k| watch.take_at(f64::from(k) * 0.01, f64::from(k) * 0.01 * 1.000_1));
        assert_eq!(behind.max(), Some(Duration::ZERO));
    }
}

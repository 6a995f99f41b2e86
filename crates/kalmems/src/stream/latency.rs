//! How long a sample takes from its arrival to the estimate.

use kalmems_core::Portable;
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Bins per octave.
const PER_OCTAVE: u32 = 4;
/// The first bin ends at 1 µs, the last one holds all above 2²⁴ µs.
const BINS: usize = 24 * PER_OCTAVE as usize + 2;

/// A histogram of durations, in bins of a quarter of an octave.
#[derive(Clone, Debug)]
pub struct LatencyHistogram {
    bins: [u64; BINS],
    count: u64,
    longest: Duration,
}

impl Default for LatencyHistogram {
    fn default() -> Self {
        Self { bins: [0; BINS], count: 0, longest: Duration::ZERO }
    }
}

impl LatencyHistogram {
    /// Counts so many durations that are the same.
    pub fn add(&mut self, duration: Duration, times: u64) {
        let octaves = (duration.as_secs_f64() * 1e6).portable_log2() * f64::from(PER_OCTAVE);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // bounded
        let bin = (octaves + 1.0).clamp(0.0, (BINS - 1) as f64) as usize;
        self.bins[bin] += times;
        self.count += times;
        self.longest = self.longest.max(duration);
    }

    /// How many were counted.
    pub const fn count(&self) -> u64 {
        self.count
    }

    /// The longest.
    pub const fn longest(&self) -> Duration {
        self.longest
    }

    /// What this share of them is not longer than, to a quarter of an octave; `None` of nothing.
    pub fn quantile(&self, share: f64) -> Option<Duration> {
        let wanted = share * self.count as f64;
        let mut below = 0;
        for (bin, count) in self.bins.iter().enumerate() {
            below += count;
            if *count > 0 && below as f64 >= wanted {
                return Some(Self::upper_end(bin).min(self.longest));
            }
        }
        None
    }

    /// The bins with something in them: their upper end, and how many.
    pub fn filled(&self) -> impl Iterator<Item = (Duration, u64)> {
        let filled = self.bins.iter().enumerate().filter(|(_, count)| **count > 0);
        filled.map(|(bin, count)| (Self::upper_end(bin), *count))
    }

    fn upper_end(bin: usize) -> Duration {
        Duration::from_secs_f64(1e-6 * (bin as f64 / f64::from(PER_OCTAVE)).exp2())
    }
}

/// When samples arrived: told by who reads them, asked by who has their estimate.
#[derive(Clone, Debug, Default)]
pub struct ArrivalTimes(Arc<Mutex<VecDeque<(u64, Instant)>>>);

impl ArrivalTimes {
    /// All samples up to this one, counted from 1, have arrived now.
    pub fn note_arrivals(&self, until: u64) {
        let mut arrivals = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if arrivals.back().is_none_or(|(last, _)| *last < until) {
            arrivals.push_back((until, Instant::now()));
        }
    }

    /// When this sample arrived, unless its estimate was there already.
    pub fn of(&self, sample: u64) -> Option<Instant> {
        let arrivals = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        arrivals.iter().find(|(last, _)| sample <= *last).map(|(_, arrived)| *arrived)
    }

    /// The estimates of all samples up to this one are there now, this long at least after they were taken; how long the slowest of them took.
    pub fn done(
        &self,
        until: u64,
        (histogram, at_least): (&mut LatencyHistogram, Duration),
        from: u64,
    ) -> Duration {
        let now = Instant::now();
        let mut longest = Duration::ZERO;
        let mut arrivals = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let mut done = from;
        while let Some((last, arrived)) = arrivals.front() {
            if done >= until {
                break;
            }
            let end = until.min(*last);
            let took = now.saturating_duration_since(*arrived).max(at_least);
            longest = longest.max(took);
            histogram.add(took, end.saturating_sub(done));
            done = end.max(done);
            if *last > until {
                break;
            }
            arrivals.pop_front();
        }
        longest
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_right_to_a_bin() {
        let mut histogram = LatencyHistogram::default();
        for microseconds in 1..=1000 {
            histogram.add(Duration::from_micros(microseconds), 1);
        }
        for (share, microseconds) in [(0.5, 500.0), (0.9, 900.0), (0.99, 990.0)] {
            let found = histogram.quantile(share).unwrap().as_secs_f64() * 1e6;
            assert!(found >= microseconds * 0.999 && found <= microseconds * 1.2, "{share}: {found}");
        }
        assert_eq!(histogram.quantile(1.0), Some(Duration::from_millis(1)));
        assert_eq!(histogram.filled().map(|(_, count)| count).sum::<u64>(), 1000);
        assert_eq!(LatencyHistogram::default().quantile(0.5), None);
    }
}

//! The last samples as they came, which another run goes on from.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// The last samples that the reading thread gave, before the settings' factors and offsets are applied to their numbers:
/// another run applies these itself. Both threads hold it.
#[derive(Clone, Debug)]
pub(super) struct RecentSamples {
    /// The place of the time among the numbers of a sample.
    time: usize,
    /// How many are kept of those that were estimated.
    count: usize,
    samples: Arc<Mutex<SampleQueue>>,
}

#[derive(Debug, Default)]
struct SampleQueue {
    /// The numbers of each, the newest last.
    numbers: VecDeque<Vec<f64>>,
    /// How many of them were estimated; those behind them were read ahead.
    estimated: usize,
    /// Vectors that are needed no more.
    spare: Vec<Vec<f64>>,
}

impl RecentSamples {
    /// None yet; so many of those that were estimated are kept.
    pub(super) fn new(time: usize, count: usize) -> Self {
        Self { time, count, samples: Arc::default() }
    }

    fn samples(&self) -> MutexGuard<'_, SampleQueue> {
        self.samples.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes the numbers of one that is given to be estimated; gives a vector back that is needed no more.
    pub(super) fn push(&self, numbers: Vec<f64>) -> Option<Vec<f64>> {
        let mut samples = self.samples();
        samples.numbers.push_back(numbers);
        samples.spare.pop()
    }

    /// Hears that all until the next one at this time in s were estimated.
    pub(super) fn pass(&self, time_s: f64) {
        let mut samples = self.samples();
        let is_it = |numbers: &Vec<f64>| {
            numbers.get(self.time).is_some_and(|time| time.to_bits() == time_s.to_bits())
        };
        // A clock that goes back may give a time twice: what was estimated is not looked at again.
        let ahead = samples.numbers.range(samples.estimated..).position(is_it);
        let estimated = samples.estimated + ahead.map_or(0, |ahead| ahead + 1);
        let excess = estimated.saturating_sub(self.count);
        let SampleQueue { numbers, spare, .. } = &mut *samples;
        spare.extend(numbers.drain(..excess));
        samples.estimated = estimated - excess;
    }

    /// The last of those that were estimated, by the bits of their numbers.
    pub(super) fn estimated(&self) -> Vec<Vec<u64>> {
        let samples = self.samples();
        let bits = |numbers: &Vec<f64>| numbers.iter().copied().map(f64::to_bits).collect();
        samples.numbers.iter().take(samples.estimated).map(bits).collect()
    }
}

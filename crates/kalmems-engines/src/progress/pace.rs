//! When long work looks at whether it shall stop: by time, whatever a step of it costs.

use super::Progress;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

/// How long work goes on between two looks.
pub(super) const PULSE: Duration = Duration::from_millis(50);

/// Steps between two looks at the clock.
const STEPS: usize = 64;

/// Looks at the progress at least as often as a user's patience asks for.
#[derive(Debug)]
pub struct Pace {
    looked: Instant,
    next: usize,
}

impl Default for Pace {
    fn default() -> Self {
        Self { looked: Instant::now(), next: STEPS }
    }
}

impl Pace {
    /// Whether it is time to look, after so many steps of the work.
    pub fn is_due(&mut self, steps: usize) -> bool {
        if steps < self.next {
            return false;
        }
        self.next = steps.saturating_add(STEPS);
        let due = self.looked.elapsed() >= PULSE;
        if due {
            self.looked = Instant::now();
        }
        due
    }

    /// Whether the work shall stop after so many steps, where it is time to ask; `done` units of it are told.
    pub fn stops(&mut self, steps: usize, progress: &dyn Progress, done: u64) -> bool {
        self.is_due(steps) && progress.reached(done) == ControlFlow::Break(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_look_comes_by_time_and_not_by_steps() {
        let mut pace = Pace::default();
        assert!((1..10_000).filter(|steps| pace.is_due(*steps)).count() <= 1);
        std::thread::sleep(PULSE);
        assert!(!pace.is_due(10_000) || pace.looked.elapsed() < PULSE);
        std::thread::sleep(PULSE);
        assert!(pace.is_due(20_000));
        // Whatever the number of steps is.
        std::thread::sleep(PULSE);
        assert!(pace.is_due(usize::MAX));
    }
}

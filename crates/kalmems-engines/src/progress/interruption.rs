//! How work that only computes hears that it is to stop.

use super::pace::PULSE;
use super::{Progress, Silent};
use std::cell::Cell;
use std::ops::ControlFlow;
use std::time::Instant;

/// Samples between two looks at the clock.
const SAMPLES: usize = 1024;

/// Whether long loops over samples are to end: looked at by time, and remembered.
///
/// What a loop gives that ended so means nothing; whoever began the work asks at its end and drops it.
pub struct Interruption<'a> {
    progress: &'a dyn Progress,
    done: Cell<u64>,
    looked: Cell<Instant>,
    is_requested: Cell<bool>,
}

impl Interruption<'static> {
    /// For work that nobody stops.
    pub fn never() -> Self {
        Interruption::by(&Silent)
    }
}

impl<'a> Interruption<'a> {
    /// By whoever hears how far the work has come.
    pub fn by(progress: &'a dyn Progress) -> Self {
        Self {
            progress,
            done: Cell::new(0),
            looked: Cell::new(Instant::now()),
            is_requested: Cell::new(false),
        }
    }

    /// Says that so many more units of the work are done.
    pub fn advance(&self, units: usize) {
        self.done.set(self.done.get() + units as u64);
    }

    /// Whether the work is to stop; what follows is known at most a pulse later.
    pub fn is_requested(&self) -> bool {
        if !self.is_requested.get() && self.looked.get().elapsed() >= PULSE {
            self.is_requested.set(self.progress.reached(self.done.get()) == ControlFlow::Break(()));
            self.looked.set(Instant::now());
        }
        self.is_requested.get()
    }

    /// The same for sample `k` of a loop, which costs next to nothing for most of them.
    pub fn is_requested_at(&self, k: usize) -> bool {
        if k.is_multiple_of(SAMPLES) { self.is_requested() } else { self.is_requested.get() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::thread::sleep;

    /// Stops whatever asks, and remembers what it heard.
    struct Stops(Cell<u64>);

    impl Progress for Stops {
        fn begin(&self, _: &str, _: u64) {}
        fn reached(&self, done: u64) -> ControlFlow<()> {
            self.0.set(done);
            ControlFlow::Break(())
        }
    }

    #[test]
    fn a_loop_hears_of_it_after_a_pulse_and_not_before() {
        let stops = Stops(Cell::new(0));
        let interruption = Interruption::by(&stops);
        interruption.advance(7);
        sleep(PULSE);
        assert!(!interruption.is_requested_at(1));
        assert!(interruption.is_requested_at(2 * SAMPLES) && interruption.is_requested_at(1));
        assert_eq!(stops.0.get(), 7);
        let never = Interruption::never();
        sleep(PULSE);
        assert!(!never.is_requested());
    }
}

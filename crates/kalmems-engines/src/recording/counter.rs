//! Counters of 32 bits that begin again while a recording goes on, as those of microcontrollers do.

use kalmems_formats::{Instant, TimeUnit};

/// Counts of 32 bits.
const COUNTS: f64 = 4_294_967_296.0;
/// The part of them at either end in which a counter is found before and behind its begin.
const END: f64 = 0.01;

/// Times of a counter, to which its period is added as often as it has begun again.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CounterTimes {
    /// From one begin of the counter to the next, in s.
    period: f64,
    /// What is added so far, and the last time without it, counted from the counter's zero, both in s.
    added: f64,
    last: f64,
}

impl CounterTimes {
    /// Of a counter of this unit.
    pub(crate) fn new(unit: TimeUnit) -> Self {
        let tick_s = f64::from(unit.factor) * 10_f64.powi(unit.power);
        Self { period: COUNTS * tick_s, added: 0.0, last: f64::NAN }
    }

    /// Unwraps times that count from an origin; the places at which the counter began again.
    pub(crate) fn unwrap(&mut self, times: &mut [f64], origin: Instant) -> Vec<usize> {
        let zero_s = origin.since(Instant::ZERO);
        let mut begun = Vec::new();
        for (place, time) in times.iter_mut().enumerate() {
            let counted_s = *time + zero_s;
            let near_end = self.last >= (1.0 - END) * self.period && self.last < self.period;
            if near_end && (0.0..END * self.period).contains(&counted_s) {
                self.added += self.period;
                begun.push(place);
            }
            if counted_s.is_finite() {
                self.last = counted_s;
            }
            *time += self.added;
        }
        begun
    }

    /// From one begin of the counter to the next, in s.
    pub(crate) const fn period_s(&self) -> f64 {
        self.period
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_counter_goes_on_behind_its_end_and_a_clock_that_is_set_back_does_not() {
        let micro = TimeUnit::decimal(-6);
        let mut times = [4294.9668, 4294.9670, f64::NAN, 0.0001, 0.0003];
        assert_eq!(CounterTimes::new(micro).unwrap(&mut times, Instant::ZERO), [3]);
        for (time, expected) in times[3..].iter().zip([4_294.967_396, 4_294.967_596]) {
            approx::assert_relative_eq!(*time, expected, max_relative = 1e-12);
        }
        let mut back = [4000.0, 4000.1, 0.0, 0.1];
        assert!(CounterTimes::new(micro).unwrap(&mut back, Instant::ZERO).is_empty());
        assert_eq!(back, [4000.0, 4000.1, 0.0, 0.1]);
        // In blocks, and from an origin on.
        let mut counter = CounterTimes::new(TimeUnit::decimal(-3));
        let origin = Instant::of_seconds(4_294_900);
        let (mut first, mut second) = ([60.0, 67.0], [-4_294_899.5]);
        assert!(counter.unwrap(&mut first, origin).is_empty());
        assert_eq!(counter.unwrap(&mut second, origin), [0]);
        approx::assert_relative_eq!(second[0], 67.796, max_relative = 1e-9);
    }
}

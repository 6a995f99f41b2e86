//! Maxima without a higher one near them.

use super::Threshold;
use crate::Scalar;

/// A local maximum of the response: higher than the sample before, and not lower than the one after.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Peak<T> {
    /// Which sample.
    pub index: u64,
    /// The response there.
    pub height: T,
    /// Where the parabola through it and its neighbours is highest, in samples from it: at most half a sample away.
    pub fraction: T,
    /// The parabola's second derivative, per sample²: negative.
    pub curvature: T,
}

impl<T: Scalar> Peak<T> {
    /// The middle one of three responses, if it is a maximum. All three must be numbers.
    #[inline(always)]
    fn of(index: u64, [before, height, after]: [T; 3]) -> Option<Self> {
        if !(height.gt(before) && after.is_finite() && !height.lt(after)) {
            return None;
        }
        let curvature = (before - height) + (after - height);
        Some(Self { index, height, fraction: (before - after).half() / curvature, curvature })
    }
}

/// The maxima of a stream that have no higher one within `REACH` samples on either side; of equal ones the first.
#[derive(Clone, Copy, Debug)]
pub(super) struct Maxima<T, const REACH: usize> {
    /// The two newest responses.
    last: [T; 2],
    /// How many responses there have been.
    count: u64,
    /// What is not higher than this is ignored.
    lowest: T,
    /// Maxima of which none is followed by a higher one, the oldest and highest first: a ring. Two maxima are two samples
    /// apart at least, so that 2·`REACH` samples have room.
    kept: [Peak<T>; REACH],
    oldest: usize,
    filled: usize,
}

impl<T: Scalar, const REACH: usize> Maxima<T, REACH> {
    pub fn new(lowest: T) -> Self {
        const { assert!(REACH > 0, "maxima are compared over one sample at least") };
        let zero = T::of(0.0);
        let none = Peak { index: 0, height: zero, fraction: zero, curvature: zero };
        Self { last: [T::of(f64::NAN); 2], count: 0, lowest, kept: [none; REACH], oldest: 0, filled: 0 }
    }

    /// Takes in a response; what is known of the one `REACH` + 1 before it.
    #[inline(always)]
    pub fn push(&mut self, response: T) -> Option<Peak<T>> {
        let newest = self.count;
        self.count += 1;
        let three = [self.last[0], self.last[1], response];
        self.last = [three[1], three[2]];
        // Most are lower, and then there is nothing to look at.
        let risen = three[1].gt(self.lowest);
        if !risen && self.filled == 0 {
            return None;
        }
        let peak = if risen { Peak::of(newest.saturating_sub(1), three) } else { None };
        self.settle(newest, peak)
    }

    /// Decides on the candidate in the middle, forgets what is out of its reach and takes in the new maximum.
    fn settle(&mut self, newest: u64, peak: Option<Peak<T>>) -> Option<Peak<T>> {
        // The candidate is at newest − 1 − REACH, and `peak`, if there is one, REACH after it.
        let reach = REACH as u64;
        self.forget(|index| index + 1 + 2 * reach < newest);
        let highest = self.front().filter(|front| front.index + 1 + reach == newest);
        let decided = highest.filter(|front| peak.is_none_or(|peak| !peak.height.gt(front.height)));
        self.forget(|index| index + 1 + 2 * reach <= newest);
        if let Some(peak) = peak {
            self.enter(peak);
        }
        decided
    }

    /// Drops the oldest as long as they are out of reach.
    #[inline(always)]
    fn forget(&mut self, out_of_reach: impl Fn(u64) -> bool) {
        while self.front().is_some_and(|front| out_of_reach(front.index)) {
            self.oldest = self.place(1);
            self.filled -= 1;
        }
    }

    /// Takes in a maximum and drops those before it that are lower.
    #[inline(always)]
    fn enter(&mut self, peak: Peak<T>) {
        while self.filled > 0
            && self.kept.get(self.place(self.filled - 1)).is_some_and(|last| last.height.lt(peak.height))
        {
            self.filled -= 1;
        }
        let place = self.place(self.filled);
        if let Some(free) = self.kept.get_mut(place) {
            *free = peak;
            self.filled += 1;
        }
    }

    #[inline(always)]
    fn front(&self) -> Option<Peak<T>> {
        if self.filled > 0 { self.kept.get(self.oldest).copied() } else { None }
    }

    /// Where the maximum is that comes `i` after the oldest.
    #[inline(always)]
    fn place(&self, i: usize) -> usize {
        let place = self.oldest + i;
        if place < REACH { place } else { place - REACH }
    }
}

/// The detections among the responses of a whole recording: the same as of a [`Detector`](super::Detector).
///
/// A maximum above the threshold is one if no other maximum within `reach` samples is higher, or as high and earlier.
/// Responses that are not numbers are a gap: next to it there is no maximum, and nothing is known of what was in it.
#[must_use]
pub fn peaks<T: Scalar>(responses: &[T], reach: usize, threshold: Threshold<T>) -> Peaks<'_, T> {
    Peaks { responses, reach, threshold, next: 0, last: None }
}

/// An iterator over detections; see [`peaks`].
#[derive(Clone, Debug)]
pub struct Peaks<'a, T> {
    responses: &'a [T],
    reach: usize,
    threshold: Threshold<T>,
    next: usize,
    last: Option<u64>,
}

impl<T: Scalar> Peaks<'_, T> {
    /// The maximum at a sample, if there is one.
    fn maximum(&self, index: usize) -> Option<Peak<T>> {
        let before = *self.responses.get(index.checked_sub(1)?)?;
        let (height, after) = (*self.responses.get(index)?, *self.responses.get(index + 1)?);
        Peak::of(index as u64, [before, height, after])
    }

    /// Whether a maximum near it is higher, or as high and earlier.
    fn suppressed(&self, index: usize, peak: &Peak<T>) -> bool {
        let near = index.saturating_sub(self.reach)..=index.saturating_add(self.reach);
        near.filter(|other| *other != index).any(|other| {
            self.maximum(other).is_some_and(|rival| {
                rival.height.gt(peak.height) || other < index && !rival.height.lt(peak.height)
            })
        })
    }
}

impl<T: Scalar> Iterator for Peaks<'_, T> {
    type Item = Peak<T>;

    fn next(&mut self) -> Option<Peak<T>> {
        while self.next < self.responses.len() {
            let index = self.next;
            self.next += 1;
            let Some(peak) = self.maximum(index) else { continue };
            if self.threshold.takes(&peak, self.last) && !self.suppressed(index, &peak) {
                self.last = Some(peak.index);
                return Some(peak);
            }
        }
        None
    }
}

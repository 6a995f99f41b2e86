//! The mirror's way through one segment.

use super::data::SegmentData;
use super::phasor::Phasor;
use crate::estimate::{Bridge, Counts, Course, Derived, Filtering, Reading, Step, by_signal};
use kalmems_core::{FilterError, Innovation};
use std::f64::consts::TAU;

/// Model and signal of one segment.
pub struct PhasorCourse<'a, P: Phasor<N>, const N: usize> {
    phasor: &'a P,
    data: &'a SegmentData<'a>,
    usual: P::Process,
}

/// How far an interval may be from the usual one and still be stepped as such, relative to it: well below what
/// times written in decimals round to.
const SAME: f64 = 1e-6;

impl<'a, P: Phasor<N>, const N: usize> PhasorCourse<'a, P, N> {
    /// A way through this segment.
    pub fn new(phasor: &'a P, data: &'a SegmentData<'a>) -> Self {
        Self { phasor, data, usual: phasor.over(data.interval_s) }
    }
}

impl<P: Phasor<N>, const N: usize> Course for PhasorCourse<'_, P, N> {
    fn time_s(&self) -> &[f64] {
        self.data.time_s
    }

    fn signal(&self) -> &[f64] {
        self.data.signal
    }

    fn derived(&self) -> Option<Derived> {
        Some(self.phasor.derived())
    }

    fn advance(
        &mut self,
        filter: &mut dyn Filtering,
        to: usize,
        counts: &mut Counts,
    ) -> Result<(), FilterError> {
        let interval = self.data.time_s[to] - self.data.time_s[to - 1];
        let x = filter.mean();
        let turns = (x[2] / TAU + x[1] * interval).round();
        if (interval / self.data.interval_s - 1.0).abs() <= SAME {
            return filter.predict(&Step::new(&self.usual, &turns));
        }
        // The step is exact over any interval: a gap needs no more than one.
        counts.bridged = counts.bridged.saturating_add(Bridge::over(interval, self.data.interval_s).missing);
        filter.predict(&Step::new(&self.phasor.over(interval), &turns))
    }

    fn correct(
        &mut self,
        filter: &mut dyn Filtering,
        k: usize,
        _: &mut Counts,
    ) -> Result<Option<Innovation<f64, 1>>, FilterError> {
        let sensor = Reading::<_, N>(self.phasor.readout());
        by_signal(filter, self.data.signal[k], (&sensor, self.data.noise_variance))
    }
}

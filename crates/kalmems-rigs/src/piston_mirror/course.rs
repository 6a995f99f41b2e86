//! The mirror's way through one segment.

use super::data::SegmentData;
use super::phasor::Phasor;
use crate::estimate::{Bridge, Counts, Course, Derived};
use kalmems_core::{Filter, FilterError};
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

impl<P: Phasor<N>, const N: usize> Course<N> for PhasorCourse<'_, P, N> {
    type Measurement = P::Readout;

    fn time_s(&self) -> &[f64] {
        self.data.time_s
    }

    fn signal(&self) -> &[f64] {
        self.data.signal
    }

    fn measurement(&self) -> (&P::Readout, f64) {
        (self.phasor.readout(), self.data.noise_variance)
    }

    fn derived(&self) -> Option<Derived<N>> {
        Some(self.phasor.derived())
    }

    fn advance<F: Filter<f64, N>>(
        &mut self,
        filter: &mut F,
        to: usize,
        counts: &mut Counts,
    ) -> Result<(), FilterError> {
        let interval = self.data.time_s[to] - self.data.time_s[to - 1];
        let x = filter.mean();
        let turns = (x[2] / TAU + x[1] * interval).round();
        if (interval / self.data.interval_s - 1.0).abs() <= SAME {
            return filter.predict_linked(&self.usual, &turns).map(drop);
        }
        // The step is exact over any interval: a gap needs no more than one.
        counts.bridged = counts.bridged.saturating_add(Bridge::over(interval, self.data.interval_s).missing);
        filter.predict_linked(&self.phasor.over(interval), &turns).map(drop)
    }
}

//! A segment of a recording.

use crate::estimate::EstimateError;
use crate::signal::GAP;

/// One segment of a recording: the readout and the feedback.
#[derive(Clone, Copy, Debug)]
pub struct AccelerometerSegment<'a> {
    /// When, in s.
    pub time_s: &'a [f64],
    /// The readout's voltage in V.
    pub signal: &'a [f64],
    /// The feedback in V that is applied from each sample to the next; `None` for an open loop.
    pub feedback: Option<&'a [f64]>,
    /// The usual interval between samples in s.
    pub interval_s: f64,
}

impl<'a> AccelerometerSegment<'a> {
    /// So many samples from the first on, at most, with this feedback.
    #[must_use]
    pub fn beginning(&self, samples: usize, feedback: &'a [f64]) -> Self {
        let samples = samples.min(self.signal.len());
        Self {
            time_s: &self.time_s[..samples],
            signal: &self.signal[..samples],
            feedback: Some(&feedback[..samples]),
            ..*self
        }
    }

    /// The feedback from sample `k` to the next, in V.
    pub fn feedback(&self, k: usize) -> f64 {
        self.feedback.map_or(0.0, |feedback| feedback[k])
    }

    /// Refuses a segment in which the feedback is not known throughout: it follows no law that would tell it.
    pub fn require_whole(&self, column: &str, place: &str) -> Result<(), EstimateError> {
        let Some(input) = self.feedback else { return Ok(()) };
        // What is applied after the last sample does not matter.
        let steps = self.time_s.windows(2).zip(input);
        let unknown = |(times, value): &(&[f64], &f64)| {
            !value.is_finite() || times[1] - times[0] > GAP * self.interval_s
        };
        let mut missing = steps.filter(unknown).map(|(times, _)| times[0]);
        let Some(first_s) = missing.next() else { return Ok(()) };
        let (place, column) = (place.to_owned(), column.to_owned());
        Err(EstimateError::DriveUnknown { place, column, count: 1 + missing.count(), first_s })
    }
}

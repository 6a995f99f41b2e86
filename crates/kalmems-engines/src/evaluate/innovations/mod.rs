//! Whether innovations are what the filter claims: white, of zero mean and of the stated variance.
//!
//! Each test looks for another way in which a model can be wrong, and states how probable its finding is for a filter that is
//! right, after a correction for how many places it looked at. All of them are sums, so that a recording of any length takes
//! the same memory.

mod cycle;
mod evidence;
mod moments;
mod result;
mod spectrum;
mod windows;

pub use evidence::{CycleEvidence, InnovationEvidence, InnovationHistogram, SpectrumGroup};
pub use result::{InnovationTest, TestPlace, TestResult, WRONG, nis};

use crate::progress::Interruption;
use cycle::InnovationCycle;
use moments::InnovationMoments;
use spectrum::SpectrumRecord;
use statrs::function::erf::erfc;
use std::f64::consts::SQRT_2;
use windows::InnovationWindows;

/// The innovations of one channel of one filter, as sums.
#[derive(Clone, Default)]
pub struct InnovationRecord {
    moments: InnovationMoments,
    windows: InnovationWindows,
    spectrum: SpectrumRecord,
    histogram: InnovationHistogram,
    /// One for each axis of the device.
    cycles: Vec<InnovationCycle>,
    first_s: f64,
    last_s: f64,
}

impl InnovationRecord {
    /// Of motions with these frequencies in Hz, in a segment that begins at this time in s.
    pub fn new(motions_hz: impl IntoIterator<Item = f64>, start_s: f64) -> Self {
        let moves = |hz: &f64| hz.is_finite() && *hz > 0.0;
        let cycles =
            motions_hz.into_iter().filter(moves).map(|hz| InnovationCycle::new(hz, start_s)).collect();
        Self { cycles, ..Self::default() }
    }

    /// Takes innovations and their standard deviations in, in the order of time; what is not finite is no update.
    /// The work ends where it is stopped.
    pub fn take(&mut self, time_s: &[f64], innovation: &[f64], sd: &[f64], stop: &Interruption) {
        for (k, ((time_s, innovation), sd)) in time_s.iter().zip(innovation).zip(sd).enumerate() {
            if stop.is_requested_at(k) {
                return;
            }
            let z = innovation / sd;
            if !z.is_finite() {
                continue;
            }
            if self.moments.count == 0.0 {
                self.first_s = *time_s;
            }
            self.last_s = *time_s;
            self.moments.take(*time_s, z);
            self.windows.take(*time_s, z);
            self.spectrum.take(z);
            self.histogram.take(z);
            for cycle in &mut self.cycles {
                cycle.take(*time_s, z);
            }
        }
    }

    /// How many there were.
    pub fn count(&self) -> f64 {
        self.moments.count
    }

    /// What each test finds; those that need more innovations are not there. Of a filter that does not whiten them, as its gain
    /// is not the optimal one, they are correlated when it is right: their size alone is judged.
    pub fn tests(&self, whitens: bool) -> Vec<TestResult> {
        let moments = &self.moments;
        if !whitens {
            return moments.size_of_one().into_iter().collect();
        }
        let mut all: Vec<TestResult> = moments.size().into_iter().chain(self.windows.level()).collect();
        all.extend(moments.outlier());
        let Some(spectrum) = self.spectrum.spectrum() else { return all };
        let interval_s = (self.last_s - self.first_s) / (moments.count - 1.0).max(1.0);
        // Squares of normal numbers of correlation ρ have one of ρ².
        let (squares, resolution) = (spectrum.inflation(2), spectrum.resolution());
        all.extend(spectrum.bands(interval_s));
        all.extend(spectrum.line(moments, interval_s));
        all.extend(self.worst_of_axes(|cycle| cycle.harmonics(moments, &spectrum, interval_s)));
        if moments.are_careful() {
            all.extend(self.worst_of_axes(|cycle| cycle.excess(moments)));
            all.extend(self.windows.excess());
        } else {
            let variance = |cycle: &InnovationCycle| cycle.variance(moments, squares, resolution, interval_s);
            all.extend(self.worst_of_axes(variance));
            all.extend(self.windows.steadiness(moments, squares));
            all.extend(moments.shape(spectrum.inflation(3).recip()));
            all.extend(spectrum.whiteness(interval_s));
        }
        all.sort_by_key(|found| found.test);
        all
    }
}

impl InnovationRecord {
    /// What a test finds at the axis where it finds most.
    fn worst_of_axes(&self, test: impl Fn(&InnovationCycle) -> Option<TestResult>) -> Option<TestResult> {
        let looks = self.cycles.len() as f64;
        let worst = self.cycles.iter().filter_map(test).min_by(|a, b| a.p_value.total_cmp(&b.p_value))?;
        Some(TestResult { p_value: (looks * worst.p_value).min(1.0), ..worst })
    }
}

/// The probability that a standard normal number is above this one.
pub fn normal_tail(x: f64) -> f64 {
    0.5 * erfc(x / SQRT_2)
}

#[cfg(test)]
mod tests;

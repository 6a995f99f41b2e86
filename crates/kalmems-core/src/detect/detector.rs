//! Detections while samples arrive.

use super::maxima::Maxima;
use super::window::SampleWindow;
use super::{Crossing, CubicFit, SlopeKernel, Threshold};
use crate::Scalar;

/// A crossing of the threshold angle, found in the signal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Detection<T> {
    /// The sample with the steepest slope, counted from the first that was pushed.
    pub index: u64,
    /// The time of the crossing after that sample, in samples: between −½ and ½.
    pub fraction: T,
    /// The smoothed slope there, in the signal's unit per sample.
    pub slope: T,
    /// Its second derivative, per sample².
    pub curvature: T,
    /// The variance of the time that noise causes, in samples²: [`SlopeKernel::timing_variance`] with the curvature that
    /// was seen.
    ///
    /// The curvature is noisy itself; where a model knows the edge, the variance for its curvature is the better one.
    pub timing_variance: T,
}

/// Finds crossings in a stream of samples, one by one, without allocation.
///
/// A detection is reported [`LOOK_AHEAD`](Self::LOOK_AHEAD) samples after it happened: `HALF` until the response at it is
/// known, and `REACH` + 1 until it is known that no higher maximum follows. `MEMORY` samples are kept, 2·`HALF` + 1
/// at least; for a [`crossing`](Self::crossing) as many as `LOOK_AHEAD` and the fit's reach and three eighths of it
/// together.
///
/// A sample that is not a number is a gap, and is not bridged: there is no response, and so no detection, within
/// `HALF` samples of it, and a slope that rises into it is no maximum. Time goes on, and what was found before it is
/// reported when it is due. After the end of a recording, `LOOK_AHEAD` pushes of no number bring out the rest.
///
/// The example is in [the module](super).
#[derive(Clone, Copy, Debug)]
pub struct Detector<T, const HALF: usize, const REACH: usize, const MEMORY: usize> {
    kernel: SlopeKernel<T, HALF>,
    threshold: Threshold<T>,
    noise_variance: T,
    window: SampleWindow<T, MEMORY>,
    /// How many finite samples in a row are the newest.
    whole: usize,
    maxima: Maxima<T, REACH>,
    last: Option<u64>,
}

impl<T: Scalar, const HALF: usize, const REACH: usize, const MEMORY: usize> Detector<T, HALF, REACH, MEMORY> {
    /// How many samples after it happened a crossing is reported.
    pub const LOOK_AHEAD: usize = HALF + REACH + 1;

    /// Before the first sample. `noise_variance` is that of one sample, in the signal's unit squared.
    pub fn new(kernel: SlopeKernel<T, HALF>, threshold: Threshold<T>, noise_variance: T) -> Self {
        const { assert!(MEMORY > 2 * HALF, "the memory must hold the kernel") };
        Self {
            kernel,
            threshold,
            noise_variance,
            window: SampleWindow::new(),
            whole: 0,
            maxima: Maxima::new(threshold.keep()),
            last: None,
        }
    }

    /// Takes in a sample, not a number where it is missing; the crossing that happened
    /// [`LOOK_AHEAD`](Self::LOOK_AHEAD) samples ago, if there was one.
    #[inline(always)]
    pub fn push(&mut self, sample: T) -> Option<Detection<T>> {
        self.window.push(sample);
        self.whole = if sample.is_finite() { self.whole.saturating_add(1) } else { 0 };
        let response = if self.whole > 2 * HALF {
            self.kernel.response(self.window.newest(2 * HALF + 1))
        } else {
            T::of(f64::NAN)
        };
        let mut peak = self.maxima.push(response)?;
        // The response belongs to the middle of its window.
        peak.index = peak.index.saturating_sub(HALF as u64);
        if !self.threshold.takes(&peak, self.last) {
            return None;
        }
        self.last = Some(peak.index);
        Some(Detection {
            index: peak.index,
            fraction: peak.fraction,
            slope: peak.height,
            curvature: peak.curvature,
            timing_variance: self.kernel.timing_variance(self.noise_variance, peak.curvature),
        })
    }

    /// The zero crossing of the smoothed signal near the sample [`LOOK_AHEAD`](Self::LOOK_AHEAD) samples ago, just
    /// after [`push`](Self::push) has reported it. `offset` is what the signal is without motion.
    ///
    /// None where the fit has no crossing near, leaves the memory, or meets a gap.
    pub fn crossing<const FIT: usize>(&self, fit: &CubicFit<T, FIT>, offset: T) -> Option<Crossing<T>> {
        let centre = MEMORY.checked_sub(1 + Self::LOOK_AHEAD)?;
        fit.crossing(self.window.samples(), centre, offset, self.noise_variance)
    }

    /// The samples kept, the oldest first.
    pub fn samples(&self) -> &[T] {
        self.window.samples()
    }
}

//! How large a maximum must be.

use super::{DetectError, Peak, SlopeKernel};
use crate::Scalar;

/// How large a maximum of the response must be to be a detection.
///
/// One level, or two as in Canny's edges: `acquire` for the first crossing, and a lower `keep` as long as the last
/// detection is at most `memory` samples ago. A motion that decays gives ever smaller maxima at times that are nearly
/// known. Once it is followed, few samples are left in which noise could be mistaken for a crossing, and a lower level
/// costs few false alarms. Where the motion has died away, the level goes back up by itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Threshold<T> {
    acquire: T,
    keep: T,
    memory: u64,
}

/// The lower level while a motion is followed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HoldLevel {
    /// In standard deviations of the response to noise.
    pub deviations: f64,
    /// For how many samples after a detection: at least the time between two crossings, twice that if one may be
    /// missed.
    pub samples: u32,
}

impl<T: Scalar> Threshold<T> {
    /// One level, in the signal's unit per sample: k·[`noise_deviation`](SlopeKernel::noise_deviation) for k σ.
    pub fn fixed(level: T) -> Self {
        Self { acquire: level, keep: level, memory: 0 }
    }

    /// The level at which white noise of standard deviation `noise` per sample, and no motion, has `per_sample` false
    /// alarms per sample (the rate per second times the interval), with maxima suppressed over `reach` samples.
    ///
    /// With a [`HoldLevel`] of M samples at a level with the rate b, a false alarm is followed by another with the chance
    /// p = 1 − e^{−h·(M − reach)}, where h = b/(1 − b·reach) is the rate once the suppression has ended; one leads to
    /// 1/(1 − p) on average. The upper level is that for the rate times 1 − p, so that the stated rate is that of all.
    ///
    /// # Errors
    /// Where the noise is not positive, or no level has this rate.
    pub fn for_false_alarms<const HALF: usize>(
        kernel: &SlopeKernel<T, HALF>,
        noise: f64,
        per_sample: f64,
        reach: usize,
        hold: Option<HoldLevel>,
    ) -> Result<Self, DetectError> {
        if !(noise > 0.0 && noise.is_finite()) {
            return Err(DetectError::Noise { deviation: noise });
        }
        let maxima = kernel.noise_maxima();
        let deviation = kernel.noise_deviation(T::of(noise));
        let alone = maxima.level(per_sample, reach)?;
        let Some(hold) = hold.filter(|hold| hold.deviations < alone) else {
            return Ok(Self::fixed(deviation * T::of(alone)));
        };
        let rate = maxima.detections(hold.deviations, reach);
        let hazard = rate / (1.0 - rate * reach as f64);
        let followed = hazard * (f64::from(hold.samples) - reach as f64).max(0.0);
        let acquire = maxima.level(per_sample * libm::exp(-followed), reach)?;
        Ok(Self {
            acquire: deviation * T::of(acquire),
            keep: deviation * T::of(hold.deviations),
            memory: u64::from(hold.samples),
        })
    }

    /// The level that a first crossing must pass.
    pub const fn acquire(&self) -> T {
        self.acquire
    }

    /// The level while a motion is followed.
    pub const fn keep(&self) -> T {
        self.keep
    }

    /// Whether a peak is a detection, the one before having been at sample `last`.
    #[inline(always)]
    pub fn takes(&self, peak: &Peak<T>, last: Option<u64>) -> bool {
        let followed = last.is_some_and(|last| peak.index.saturating_sub(last) <= self.memory);
        peak.height.gt(if followed { self.keep } else { self.acquire })
    }
}

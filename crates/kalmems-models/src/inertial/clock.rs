//! A clock that nobody set.

use kalmems_core::Scalar;
use kalmems_macros::{Parameters, model};

/// t_k = t₀ + k/(f·(1 + s)): when an instrument that samples by a clock of its own takes its sample k, on the time of
/// another.
///
/// ```
/// use kalmems_models::inertial::SampleClock;
/// // Nominally 8 kHz, 0.31 % fast.
/// let clock = SampleClock { start: 1e-3_f64, rate: 8000.0, skew: 3.1e-3 };
/// assert!((clock.true_rate() - 8024.8).abs() < 1e-9);
/// assert!((clock.time(8025.0) - 1.001_024_9).abs() < 1e-7);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
pub struct SampleClock<P> {
    /// t₀ in s.
    pub start: P,
    /// f in Hz: the rate that it is sold as. Positive.
    pub rate: P,
    /// s: by what part it is faster than that. Above −1.
    pub skew: P,
}

#[model]
impl<P: Scalar> SampleClock<P> {
    /// f·(1 + s) in Hz.
    pub fn true_rate(&self) -> P {
        self.rate * (P::of(1.0) + self.skew)
    }

    /// t_k in s; the index is counted from 0.
    pub fn time(&self, index: P) -> P {
        self.start + index / self.true_rate()
    }
}

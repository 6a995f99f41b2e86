//! The same filters as an expert writes them for this one problem: two states, one measurement, scalars, three
//! numbers for P, one reciprocal, one exp for a value and its slope. What they compute and refuse is what the
//! generic filters compute and refuse.

mod extended;
mod fixed_gain;
mod square_root;
mod step;
mod unscented;

pub use extended::Extended;
pub use fixed_gain::FixedGain;
pub use square_root::SquareRoot;
pub use unscented::Unscented;

use step::Step;

use crate::system::{Innovations, Outcome, System};
use kalmems_core::{FilterError, Scalar};

/// The readout's constants, put together once: y = a·exp(−(θ/θ₀)²) + b.
#[derive(Clone, Copy)]
struct Readout<T> {
    /// −1/θ₀².
    exponent: T,
    /// a.
    gain: T,
    /// b.
    offset: T,
    /// −2·a/θ₀².
    slope: T,
    /// R.
    variance: T,
}

impl<T: Scalar> Readout<T> {
    fn of(system: &System<T>) -> Self {
        let comb = &system.readout.comb;
        let exponent = -comb.angular_width.sq().recip();
        let gain = comb.nominal * system.readout.gain;
        Self {
            exponent,
            gain,
            offset: comb.bias * system.readout.gain + system.readout.offset,
            slope: gain.twice() * exponent,
            variance: system.readout_variance,
        }
    }

    /// y.
    #[inline(always)]
    fn value(&self, angle: T) -> T {
        (angle.sq() * self.exponent).exp() * self.gain + self.offset
    }

    /// y and dy/dθ.
    #[inline(always)]
    fn value_and_slope(&self, angle: T) -> (T, T) {
        let e = (angle.sq() * self.exponent).exp();
        (e * self.gain + self.offset, angle * e * self.slope)
    }
}

/// Mean and covariance in scalars.
#[derive(Clone, Copy)]
struct State<T> {
    angle: T,
    rate: T,
    p00: T,
    p10: T,
    p11: T,
}

impl<T: Scalar> State<T> {
    fn start(system: &System<T>) -> Self {
        let [angle, rate] = system.start_mean;
        let p = &system.start_covariance;
        Self { angle, rate, p00: p.get(0, 0), p10: p.get(1, 0), p11: p.get(1, 1) }
    }

    /// Itself, if it is finite.
    #[inline(always)]
    fn checked(self) -> Result<Self, FilterError> {
        let finite = self.angle.is_finite()
            & self.rate.is_finite()
            & self.p00.is_finite()
            & self.p10.is_finite()
            & self.p11.is_finite();
        if finite { Ok(self) } else { Err(FilterError::NonFiniteState) }
    }

    fn outcome(&self, innovations: Innovations<T>) -> Outcome<T> {
        Outcome {
            mean: [self.angle, self.rate],
            covariance: [self.p00, self.p10, self.p11],
            innovations: Some(innovations),
        }
    }
}

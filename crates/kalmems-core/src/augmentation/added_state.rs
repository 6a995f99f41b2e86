//! What an added state is, and how it wanders.

use super::AugmentationError;
use crate::discretize::{Discretization, discretize};
use crate::{Mat, NoiseDensity, Scalar};

/// A state x that stands for the deviation of a parameter p: p = nominal + scale·x.
///
/// ```
/// use kalmems_core::augmentation::{AddedState, Drift};
/// // A gain of 2 V that is 3 % off at most days, and takes an hour to get there.
/// let gain = AddedState {
///     scale: 0.03 * 2.0,
///     drift: Drift::GaussMarkov { correlation_time: 3600.0, deviation: 1.0 },
/// };
/// assert_eq!(gain.scale, 0.06);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AddedState<T> {
    /// In the parameter's unit, not 0: what the parameter is off by where the state is 1. Best what it is likely
    /// to be off by, so that the state is of order 1 and `f32` has the digits for it.
    pub scale: T,
    /// How the state wanders.
    pub drift: Drift<T>,
}

/// How an added state wanders, in units of its scale.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Drift<T> {
    /// ẋ = w: there is no value that it returns to. With a density of 0 it is a constant.
    RandomWalk {
        /// The density of w in 1/s, at least 0: after a time t the variance has grown by density·t.
        density: T,
    },
    /// ẋ = −x/τ + w with w of density 2σ²/τ: it returns to 0, with the autocorrelation σ²·e^{−|t|/τ} (Gelb,
    /// Applied Optimal Estimation, 1974, section 2.2).
    ///
    /// In `f32` a step of less than 10⁻⁷ of τ cannot be told from none, and the state becomes a random walk.
    GaussMarkov {
        /// τ in s, above 0.
        correlation_time: T,
        /// σ, at least 0: the standard deviation in the long run.
        deviation: T,
    },
}

impl<T: Scalar> AddedState<T> {
    /// Whether every number is in its range; `state` is its index among the added states.
    pub fn check(&self, state: usize) -> Result<(), AugmentationError> {
        let zero = T::of(0.0);
        let positive = |x: T| zero.lt(x) && x.is_finite();
        let not_negative = |x: T| !x.lt(zero) && x.is_finite();
        if !positive(self.scale.abs()) {
            return Err(AugmentationError::Scale { state });
        }
        let drifts = match self.drift {
            Drift::RandomWalk { density } => not_negative(density),
            Drift::GaussMarkov { correlation_time, deviation } => {
                positive(correlation_time) && not_negative(deviation)
            }
        };
        if drifts { Ok(()) } else { Err(AugmentationError::Drift { state }) }
    }
}

impl<T: Scalar> Drift<T> {
    /// The exact step over an interval: x′ = a·x + w, with a and the variance of w.
    ///
    /// a = 1 with the variance density·h, or a = e^{−h/τ} with σ²·(1 − e^{−2h/τ}), which is left to the
    /// discretisation because the difference loses its digits where h is short against τ.
    pub fn over(&self, interval: T) -> (T, T) {
        let (rate, density) = match *self {
            Self::RandomWalk { density } => (T::of(0.0), density),
            Self::GaussMarkov { correlation_time, deviation } => {
                (-correlation_time.recip(), deviation.sq().twice() / correlation_time)
            }
        };
        let Discretization { transition, noise, .. } =
            discretize(&Mat([[rate]]), &NoiseDensity::none().on::<0>(density), interval);
        (transition.0[0][0], noise.get(0, 0))
    }
}

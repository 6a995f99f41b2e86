//! Finding noise and models while filtering.
//!
//! | what | with | costs |
//! |---|---|---|
//! | R as a whole matrix, or one scale of Q, the other known | [`InnovationWindow`] | next to nothing |
//! | parameters at once: R and Q together, each source of noise | [`Score`] | a filter over dual numbers |
//! | one of K given models | [`Bank`] | K filters |
//!
//! None of them writes into a filter. What is estimated goes through [`Bounds`], which say where they bind,
//! and from there into the models by the caller's hand.

mod bank;
mod score;
mod window;

pub use bank::{Bank, BankEvidence};
pub use score::{Score, ScoreStep};
pub use window::InnovationWindow;

use crate::notation::{lower, vector};
use crate::{Covariance, Scalar};
use core::array;

/// Between what an estimate may lie, for each of `P` numbers.
///
/// ```
/// use kalmems_core::adapt::Bounds;
/// use kalmems_core::{Covariance, Mat};
/// let held = Bounds { least: [0.0, -1.0], most: [1.0, 1.0] }.hold([3.0, 0.5]);
/// assert_eq!(held.value, [1.0, 0.5]);
/// assert_eq!((held.at_most, held.at_least), ([true, false], [false, false]));
/// // Variances within bounds, the correlation as it was.
/// let r = Covariance::from_lower(Mat([[4.0, 0.0], [1.0, 1.0]]));
/// let (r, held) = Bounds { least: [0.0; 2], most: [1.0; 2] }.hold_variances(&r);
/// assert_eq!((r.get(0, 0), r.get(1, 0), r.get(1, 1)), (1.0, 0.5, 1.0));
/// assert_eq!(held.at_most, [true, false]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds<T, const P: usize> {
    /// The smallest value of each.
    pub least: [T; P],
    /// The largest value of each.
    pub most: [T; P],
}

/// Numbers within their bounds, and which of the bounds hold them.
#[derive(Clone, Copy, Debug)]
pub struct BoundedEstimate<T: Scalar, const P: usize> {
    /// The numbers.
    pub value: [T; P],
    /// Where a number was below its bound and stands at it now.
    pub at_least: [bool; P],
    /// Where a number was above its bound and stands at it now.
    pub at_most: [bool; P],
}

impl<T: Scalar, const P: usize> BoundedEstimate<T, P> {
    /// Where a bound binds: the estimate is then not what the data say.
    pub fn binds(&self) -> bool {
        let no = false;
        let below = self.at_least.iter().fold(no, |binds, at| binds || *at);
        self.at_most.iter().fold(below, |binds, at| binds || *at)
    }
}

impl<T: Scalar, const P: usize> Bounds<T, P> {
    /// Holds numbers within the bounds. What is not a number stays so.
    pub fn hold(&self, value: [T; P]) -> BoundedEstimate<T, P> {
        let at_least: [bool; P] = array::from_fn(|i| value[i].lt(self.least[i]));
        let at_most: [bool; P] = array::from_fn(|i| value[i].gt(self.most[i]));
        let value = vector!(|i| {
            T::select(at_least[i], self.least[i], T::select(at_most[i], self.most[i], value[i]))
        });
        BoundedEstimate { value, at_least, at_most }
    }

    /// Holds the variances of a covariance within the bounds, and keeps its correlations.
    pub fn hold_variances(&self, covariance: &Covariance<T, P>) -> (Covariance<T, P>, BoundedEstimate<T, P>) {
        let held = self.hold(vector!(|i| covariance.get(i, i)));
        let scales: [T; P] = vector!(|i| {
            let changed = held.at_least[i] | held.at_most[i];
            T::select(changed, (held.value[i] / covariance.get(i, i)).sqrt(), T::of(1.0))
        });
        (lower!(|i, j| covariance.get(i, j) * (scales[i] * scales[j])), held)
    }
}

//! The steps of a smoother as functions that are called, so that all who smooth share one of each size.
//!
//! The methods of [`Backward`] and [`Smoothed`] dissolve into their callers, which lanes need.

use super::{Backward, Smoothed};
use crate::{FilterError, Gaussian, Scalar, StateTransition};

/// [`Backward::new`].
#[inline(never)]
pub fn step_back<T: Scalar, const N: usize>(
    before: &Gaussian<T, N>,
    link: &StateTransition<T, N>,
    predicted: &[T; N],
) -> Result<Backward<T, N>, FilterError> {
    Backward::new(before, link, predicted)
}

/// [`Smoothed::newest`].
#[inline(never)]
pub fn newest<T: Scalar, const N: usize>(filtered: &Gaussian<T, N>) -> Result<Smoothed<T, N>, FilterError> {
    Smoothed::newest(filtered)
}

/// [`Backward::apply`].
#[inline(never)]
pub fn apply<T: Scalar, const N: usize>(step: &Backward<T, N>, later: &Smoothed<T, N>) -> Smoothed<T, N> {
    step.apply(later)
}

/// [`Backward::after`].
#[inline(never)]
pub fn after<T: Scalar, const N: usize>(step: &Backward<T, N>, later: &Backward<T, N>) -> Backward<T, N> {
    step.after(later)
}

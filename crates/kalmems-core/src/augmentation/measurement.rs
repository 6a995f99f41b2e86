//! A measurement of model states and added states.

use super::slots::Slots;
use super::{AddedState, AugmentationError, ParametricMeasurement};
use crate::notation::vector;
use crate::parameters::Parameters;
use crate::{Dual, Mat, Measurement, Over, Scalar};

/// A measurement of `N` states with `A` added states behind them: y = h(x, nominal + scale·s) + v.
///
/// It takes the same added states as the [`Augmented`](super::Augmented) process; each sensor of a filter says for
/// itself which of its parameters they enter. See the example [there](crate::augmentation).
#[derive(Clone, Copy, Debug)]
pub struct AugmentedMeasurement<H, T, const N: usize, const A: usize> {
    measurement: H,
    slots: Slots<T, A>,
}

impl<H, T, const N: usize, const A: usize> AugmentedMeasurement<H, T, N, A>
where
    T: Scalar,
    H: Parameters<T>,
{
    /// Adds states to a measurement. `enters` names the parameter of it that each of them enters, if any.
    pub fn new(
        measurement: H,
        added: &[AddedState<T>; A],
        enters: [Option<&str>; A],
    ) -> Result<Self, AugmentationError> {
        Ok(Self { measurement, slots: Slots::new::<H>(added, enters)? })
    }
}

impl<H, T, const N: usize, const A: usize> AugmentedMeasurement<H, T, N, A>
where
    T: Scalar,
    H: Parameters<T>,
{
    /// The measurement with the parameters that a state says.
    #[inline(always)]
    pub fn model_at<const NA: usize>(&self, x: &[T; NA]) -> H::Of<T> {
        const { assert!(NA == N + A, "the augmented state has N + A components") };
        self.slots.vary(&self.measurement, &vector!(|i| x[N + i]))
    }
}

impl<H, T, const N: usize, const A: usize, const NA: usize, const M: usize> Measurement<T, NA, M>
    for AugmentedMeasurement<H, T, N, A>
where
    T: Scalar,
    H: ParametricMeasurement<T, N, M>,
{
    #[inline(always)]
    fn predict<S: Over<T>>(&self, x: &[S; NA]) -> [S; M] {
        const { assert!(NA == N + A, "the augmented state has N + A components") };
        let varied = self.slots.vary(&self.measurement, &vector!(|i| x[N + i]));
        H::predict_of(&varied, &vector!(|i| x[i]))
    }

    /// Which parameters the added states enter is not known before the program runs: all of them may matter.
    #[inline(always)]
    fn depends(i: usize, j: usize) -> bool {
        j >= N || H::depends(i, j)
    }

    /// As dual numbers give it, without the products of the added states with 0 and 1.
    #[inline(always)]
    fn linearize(&self, x: &[T; NA]) -> ([T; M], Mat<T, M, NA>) {
        const { assert!(NA == N + A, "the augmented state has N + A components") };
        let added = vector!(|i| x[N + i]);
        let varied = self.slots.differentiate::<_, NA>(&self.measurement, &added, N);
        let y = H::predict_of(&varied, &vector!(|i| Dual::variable(x[i], i)));
        (y.map(Dual::value), Mat(vector!(|i| y[i].gradient())))
    }
}

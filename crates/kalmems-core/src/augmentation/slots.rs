//! Which parameter of one model each added state enters.

use super::{AddedState, AugmentationError};
use crate::parameters::Parameters;
use crate::{Dual, Over, Scalar};

/// Which parameter of one model each of `A` added states enters, and its scale.
#[derive(Clone, Copy, Debug)]
pub struct Slots<T, const A: usize> {
    /// The parameter's index, or [`NONE`].
    parameter: [usize; A],
    scale: [T; A],
}

/// A state that does not enter the model.
const NONE: usize = usize::MAX;

impl<T: Scalar, const A: usize> Slots<T, A> {
    /// Looks the names up and checks the states.
    pub fn new<M: Parameters<T>>(
        added: &[AddedState<T>; A],
        names: [Option<&str>; A],
    ) -> Result<Self, AugmentationError> {
        let mut slots = Self { parameter: [NONE; A], scale: [T::of(0.0); A] };
        for state in 0..A {
            added[state].check(state)?;
            slots.scale[state] = added[state].scale;
            let Some(name) = names[state] else { continue };
            let index = M::index_of(name).ok_or(AugmentationError::NoSuchParameter { state })?;
            if let Some(parameter) = M::name(index).filter(|_| slots.parameter.contains(&index)) {
                return Err(AugmentationError::EnteredTwice { parameter, state });
            }
            slots.parameter[state] = index;
        }
        Ok(slots)
    }
}

impl<T: Scalar, const A: usize> Slots<T, A> {
    /// ∂p/∂x of one parameter and one added state.
    #[inline(always)]
    fn slope(&self, parameter: usize, state: usize) -> T {
        if self.parameter[state] == parameter { self.scale[state] } else { T::of(0.0) }
    }

    /// The model with p = nominal + scale·x.
    #[inline(always)]
    pub fn vary<M: Parameters<T>, S: Over<T>>(&self, model: &M, added: &[S; A]) -> M::Of<S> {
        model.map(|parameter, nominal| {
            let mut value = S::lift(nominal);
            for state in 0..A {
                value = value + added[state] * self.slope(parameter, state);
            }
            value
        })
    }

    /// The same with its derivatives by the added states, which are the variables `first…` of `NA`.
    #[inline(always)]
    pub fn differentiate<M: Parameters<T>, const NA: usize>(
        &self,
        model: &M,
        added: &[T; A],
        first: usize,
    ) -> M::Of<Dual<T, NA>> {
        model.map(|parameter, nominal| {
            let mut value = nominal;
            let mut gradient = [T::of(0.0); NA];
            for i in 0..NA {
                let state = i.wrapping_sub(first);
                if state < A {
                    let slope = self.slope(parameter, state);
                    value = value + added[state] * slope;
                    gradient[i] = slope;
                }
            }
            Dual::new(value, gradient)
        })
    }
}

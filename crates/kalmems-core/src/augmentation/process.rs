//! A step of model states and added states.

use super::slots::Slots;
use super::{AddedState, AugmentationError, ParametricProcess};
use crate::notation::{lower, matrix, vector};
use crate::parameters::Parameters;
use crate::{Dual, Mat, Over, Process, ProcessNoise, Scalar};

/// A step with `A` added states behind the `N` states of its model, `NA = N + A` in all.
///
/// x′ = f(x, nominal + scale·s, u) + w and s′ = a·s + v, where a and the variance of v are those of each state's
/// [`Drift`](super::Drift) over the interval, exactly. A parameter is held over each step and moves at its end.
/// Its noise is independent of that of the model.
///
/// The model may have parameters that no state enters and states that enter no parameter of it, those of the
/// measurement alone. See the example [there](crate::augmentation).
#[derive(Clone, Copy, Debug)]
pub struct Augmented<P, T, const N: usize, const A: usize, const NA: usize> {
    process: P,
    slots: Slots<T, A>,
    /// a of each added state.
    persistence: [T; A],
    noise: ProcessNoise<T, NA>,
}

impl<P, T, const N: usize, const A: usize, const NA: usize> Augmented<P, T, N, A, NA>
where
    T: Scalar,
    P: ParametricProcess<T, N>,
{
    /// Adds states to a process. `enters` names the parameter of its model that each of them enters, if any.
    pub fn new(
        process: P,
        added: &[AddedState<T>; A],
        enters: [Option<&str>; A],
    ) -> Result<Self, AugmentationError> {
        const { assert!(NA == N + A, "the augmented state has N + A components") };
        let slots = Slots::new::<P::Model>(added, enters)?;
        let steps = added.map(|state| state.drift.over(process.interval()));
        let of_model = process.noise().covariance();
        let noise = lower!(|i, j| match (i < N, i == j) {
            (true, _) => of_model.get(i, j),
            (false, true) => steps[i - N].1,
            (false, false) => T::of(0.0),
        });
        Ok(Self { process, slots, persistence: steps.map(|(a, _)| a), noise: noise.into() })
    }
}

impl<P, T, const N: usize, const A: usize, const NA: usize> Augmented<P, T, N, A, NA>
where
    T: Scalar,
    P: ParametricProcess<T, N>,
{
    /// The model with the parameters that a state says.
    #[inline(always)]
    pub fn model_at(&self, x: &[T; NA]) -> <P::Model as Parameters<T>>::Of<T> {
        self.slots.vary(self.process.model(), &added(x))
    }
}

/// The first `N` states.
#[inline(always)]
fn of_model<S: Scalar, const N: usize, const NA: usize>(x: &[S; NA]) -> [S; N] {
    vector!(|i| x[i])
}

/// The last `A` states.
#[inline(always)]
fn added<S: Scalar, const A: usize, const NA: usize>(x: &[S; NA]) -> [S; A] {
    vector!(|i| x[NA - A + i])
}

impl<P, T, const N: usize, const A: usize, const NA: usize> Process<T, NA> for Augmented<P, T, N, A, NA>
where
    T: Scalar,
    P: ParametricProcess<T, N>,
{
    type Input = P::Input;

    #[inline(always)]
    fn step<S: Over<T>>(&self, x: &[S; NA], u: &P::Input) -> [S; NA] {
        let model = self.slots.vary(self.process.model(), &added(x));
        let moved = self.process.step_of(&model, &of_model(x), u);
        vector!(|i| if i < N { moved[i] } else { x[i] * self.persistence[i - N] })
    }

    #[inline(always)]
    fn noise(&self) -> &ProcessNoise<T, NA> {
        &self.noise
    }

    #[inline(always)]
    fn depends(i: usize, j: usize) -> bool {
        i < N || i == j
    }

    /// As dual numbers give it, without the products of the added states with 0 and 1.
    #[inline(always)]
    fn linearize(&self, x: &[T; NA], u: &P::Input) -> ([T; NA], Mat<T, NA, NA>) {
        let model = self.slots.differentiate::<_, NA>(self.process.model(), &added(x), N);
        let states: [Dual<T, NA>; N] = vector!(|i| Dual::variable(x[i], i));
        let moved = self.process.step_of(&model, &states, u);
        let mean = vector!(|i| if i < N { moved[i].value() } else { x[i] * self.persistence[i - N] });
        let jacobian = matrix!(|i, j| match (i < N, i == j) {
            (true, _) => moved[i].gradient()[j],
            (false, true) => self.persistence[i - N],
            (false, false) => T::of(0.0),
        });
        (mean, jacobian)
    }
}

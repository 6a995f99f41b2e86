//! Parameters as states.

use super::Dynamics;
use crate::{Over, Scalar};
use core::array;

/// Dynamics whose parameters can vary: f(x, p, u) with `P` of them.
///
/// ```
/// use kalmems_core::{Augmented, Dynamics, Over, ParametricDynamics, Scalar};
/// /// Decay at an uncertain rate.
/// struct Decay<T>(T);
/// impl<T: Scalar> Dynamics<T, 1> for Decay<T> {
///     type Input = ();
///     fn derivative<S: Over<T>>(&self, x: &[S; 1], u: &()) -> [S; 1] {
///         self.derivative_with(x, &[S::lift(self.0)], u)
///     }
/// }
/// impl<T: Scalar> ParametricDynamics<T, 1, 1> for Decay<T> {
///     fn derivative_with<S: Over<T>>(&self, x: &[S; 1], p: &[S; 1], _: &()) -> [S; 1] {
///         [-(p[0] * x[0])]
///     }
/// }
/// let with_rate = Augmented::<_, 1, 1>::new(Decay(0.5));
/// assert_eq!(with_rate.derivative(&[2.0, 0.5], &()), [-1.0, 0.0]);
/// ```
pub trait ParametricDynamics<T: Scalar, const N: usize, const P: usize>: Dynamics<T, N> {
    /// f(x, p, u): the same law with these parameters instead of its own.
    fn derivative_with<S: Over<T>>(&self, x: &[S; N], p: &[S; P], u: &Self::Input) -> [S; N];
}

/// Dynamics with its `P` parameters appended to the `N` states, `NA = N + P` in all.
///
/// The parameters stand still; a [`NoiseDensity`](crate::NoiseDensity) on them makes them random walks.
#[derive(Clone, Copy, Debug)]
pub struct Augmented<D, const N: usize, const P: usize>(D);

impl<D, const N: usize, const P: usize> Augmented<D, N, P> {
    /// Wraps a model.
    pub const fn new(dynamics: D) -> Self {
        Self(dynamics)
    }
}

impl<T, D, const N: usize, const P: usize, const NA: usize> Dynamics<T, NA> for Augmented<D, N, P>
where
    T: Scalar,
    D: ParametricDynamics<T, N, P>,
{
    type Input = D::Input;

    #[inline(always)]
    fn derivative<S: Over<T>>(&self, x: &[S; NA], u: &D::Input) -> [S; NA] {
        const { assert!(NA == N + P, "the augmented state has N + P components") };
        let states: [S; N] = array::from_fn(|i| x[i]);
        let parameters: [S; P] = array::from_fn(|i| x[N + i]);
        let moved = self.0.derivative_with(&states, &parameters, u);
        array::from_fn(|i| if i < N { moved[i] } else { S::of(0.0) })
    }
}

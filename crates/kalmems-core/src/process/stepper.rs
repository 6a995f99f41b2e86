//! Integrators: a differential equation over one interval.

use super::{Dynamics, Process, ProcessNoise};
use crate::augmentation::{ParametricDynamics, ParametricProcess};
use crate::discretize::discretize;
use crate::linalg::unrolled;
use crate::notation::{matrix, vector};
use crate::{Dual, Mat, NoiseDensity, Over, Parameters, Scalar};
use core::marker::PhantomData;

/// An input at the start, the middle and the end of an interval.
///
/// How an input runs between two samples is for the caller to say. It matters: with the drive held over each
/// microsecond instead of interpolated by a cubic, the 15.7 kHz scanner is about 2° of its cycle off after 2 ms
/// instead of less than 0.01° (the test `a_held_drive_has_a_larger_error_than_a_large_step` of `kalmems-models`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nodes<I> {
    /// At the start.
    pub start: I,
    /// In the middle.
    pub middle: I,
    /// At the end.
    pub end: I,
}

impl<I: Copy> Nodes<I> {
    /// The same input over the whole interval.
    #[inline(always)]
    pub fn held(input: I) -> Self {
        Self { start: input, middle: input, end: input }
    }
}

/// What the steppers say of the dynamics that they hold, whose parameters may be states.
macro_rules! held_dynamics {
    () => {
        type Model = D;

        #[inline(always)]
        fn model(&self) -> &D {
            &self.dynamics
        }

        #[inline(always)]
        fn interval(&self) -> T {
            self.interval
        }
    };
}
pub(super) use held_dynamics;

/// The classical Runge–Kutta method of fourth order, one step per interval.
///
/// The process noise is discretised exactly for the dynamics linearised at one stated point; over an interval
/// that is short against the motion it hardly depends on which.
#[derive(Clone, Copy, Debug)]
pub struct Rk4<D, T, const N: usize> {
    dynamics: D,
    interval: T,
    noise: ProcessNoise<T, N>,
}

impl<T: Scalar, D: Dynamics<T, N>, const N: usize> Rk4<D, T, N> {
    /// Steps of `interval` seconds, the noise linearised `at` a state and an input.
    #[inline(always)]
    pub fn new(dynamics: D, interval: T, density: &NoiseDensity<T, N>, at: (&[T; N], &D::Input)) -> Self {
        let noise = discretize(&dynamics.jacobian(at.0, at.1), density, interval).noise;
        Self { dynamics, interval, noise: noise.into() }
    }
}

impl<T: Scalar, D: Dynamics<T, N>, const N: usize> Rk4<D, T, N> {
    /// Steps of `interval` seconds with this noise per step.
    #[inline(always)]
    pub fn with_noise(dynamics: D, interval: T, noise: ProcessNoise<T, N>) -> Self {
        Self { dynamics, interval, noise }
    }
}

impl<T: Scalar, D: Dynamics<T, N>, const N: usize> Process<T, N> for Rk4<D, T, N> {
    type Input = Nodes<D::Input>;

    #[inline(always)]
    fn step<S: Over<T>>(&self, x: &[S; N], u: &Nodes<D::Input>) -> [S; N] {
        runge_kutta(self.interval, x, u, &AsGiven::<T, D>::new(&self.dynamics))
    }

    #[inline(always)]
    fn noise(&self) -> &ProcessNoise<T, N> {
        &self.noise
    }
}

impl<T: Scalar, D: ParametricDynamics<T, N>, const N: usize> ParametricProcess<T, N> for Rk4<D, T, N> {
    held_dynamics!();

    #[inline(always)]
    fn step_of<S: Over<T>>(&self, varied: &D::Of<S>, x: &[S; N], u: &Nodes<D::Input>) -> [S; N] {
        runge_kutta(self.interval, x, u, &VariedDynamics::<T, S, D>(varied))
    }
}

/// A right-hand side, to be integrated. A trait and not a closure, which the compiler would be free to call
/// instead of inlining it.
pub(super) trait RightHandSide<S, I, const N: usize> {
    fn at(&self, x: &[S; N], u: &I) -> [S; N];

    /// See [`Dynamics::bends`].
    fn bends(i: usize) -> bool;
}

/// Dynamics as they are.
pub(super) struct AsGiven<'a, T, D>(&'a D, PhantomData<T>);

impl<'a, T, D> AsGiven<'a, T, D> {
    #[inline(always)]
    pub(super) fn new(dynamics: &'a D) -> Self {
        Self(dynamics, PhantomData)
    }
}

impl<T: Scalar, S: Over<T>, D: Dynamics<T, N>, const N: usize> RightHandSide<S, D::Input, N>
    for AsGiven<'_, T, D>
{
    #[inline(always)]
    fn at(&self, x: &[S; N], u: &D::Input) -> [S; N] {
        self.0.derivative(x, u)
    }

    #[inline(always)]
    fn bends(i: usize) -> bool {
        D::bends(i)
    }
}

/// Dynamics with other parameters.
pub(super) struct VariedDynamics<'a, T: Scalar, S: Scalar, D: Parameters<T>>(pub(super) &'a D::Of<S>);

impl<T: Scalar, S: Over<T>, D: ParametricDynamics<T, N>, const N: usize> RightHandSide<S, D::Input, N>
    for VariedDynamics<'_, T, S, D>
{
    #[inline(always)]
    fn at(&self, x: &[S; N], u: &D::Input) -> [S; N] {
        D::derivative_of(self.0, x, u)
    }

    #[inline(always)]
    fn bends(i: usize) -> bool {
        D::bends(i)
    }
}

/// One step over `h`.
#[inline(always)]
pub(super) fn runge_kutta<T: Scalar, S: Over<T>, I, const N: usize>(
    h: T,
    x: &[S; N],
    u: &Nodes<I>,
    f: &impl RightHandSide<S, I, N>,
) -> [S; N] {
    let k1 = f.at(x, &u.start);
    let k2 = f.at(&moved(x, &k1, h.half()), &u.middle);
    let k3 = f.at(&moved(x, &k2, h.half()), &u.middle);
    let k4 = f.at(&moved(x, &k3, h), &u.end);
    let sixth = h * T::of(1.0 / 6.0);
    let mut next = *x;
    unrolled!(i < N {
        next[i] = x[i].mac_by(k1[i] + (k2[i] + k3[i]).twice() + k4[i], sixth);
    });
    next
}

/// x + h·k.
#[inline(always)]
fn moved<T: Scalar, S: Over<T>, const N: usize>(x: &[S; N], k: &[S; N], h: T) -> [S; N] {
    let mut moved = *x;
    unrolled!(i < N {
        moved[i] = x[i].mac_by(k[i], h);
    });
    moved
}

/// The explicit Euler method, x′ = x + h·f(x, u).
///
/// It is what the published filters for these devices use, and is here to reproduce them: on a resonator it
/// adds energy at every step, and is unstable where the sampling rate is below ω/(2ζ).
#[derive(Clone, Copy, Debug)]
pub struct Euler<D, T, const N: usize> {
    dynamics: D,
    interval: T,
    noise: ProcessNoise<T, N>,
}

impl<T: Scalar, D: Dynamics<T, N>, const N: usize> Euler<D, T, N> {
    /// Steps of `interval` seconds with this covariance of the noise per step.
    pub fn new(dynamics: D, interval: T, noise: impl Into<ProcessNoise<T, N>>) -> Self {
        Self { dynamics, interval, noise: noise.into() }
    }
}

impl<T: Scalar, D: Dynamics<T, N>, const N: usize> Process<T, N> for Euler<D, T, N> {
    type Input = D::Input;

    #[inline(always)]
    fn step<S: Over<T>>(&self, x: &[S; N], u: &D::Input) -> [S; N] {
        moved(x, &self.dynamics.derivative(x, u), self.interval)
    }

    /// I + h·∂f/∂x.
    #[inline(always)]
    fn linearize(&self, x: &[T; N], u: &D::Input) -> ([T; N], Mat<T, N, N>) {
        let k = self.dynamics.derivative(&Dual::variables(x), u);
        let gradient: [[T; N]; N] = vector!(|i| k[i].gradient());
        let f = matrix!(|i, j| { T::of(if i == j { 1.0 } else { -0.0 }) + gradient[i][j] * self.interval });
        (moved(x, &vector!(|i| k[i].value()), self.interval), f)
    }

    #[inline(always)]
    fn noise(&self) -> &ProcessNoise<T, N> {
        &self.noise
    }
}

impl<T: Scalar, D: ParametricDynamics<T, N>, const N: usize> ParametricProcess<T, N> for Euler<D, T, N> {
    held_dynamics!();

    #[inline(always)]
    fn step_of<S: Over<T>>(&self, varied: &D::Of<S>, x: &[S; N], u: &D::Input) -> [S; N] {
        moved(x, &D::derivative_of(varied, x, u), self.interval)
    }
}

//! Integrators: a differential equation over one interval.

use super::{Dynamics, Process, ProcessNoise};
use crate::discretize::discretize;
use crate::{Covariance, NoiseDensity, Over, Scalar};
use core::array;

/// An input at the start, the middle and the end of an interval.
///
/// How an input runs between two samples is for the caller to say. It matters: with the drive held over each
/// microsecond instead of interpolated by a cubic, the 15.7 kHz scanner is about 2° of its cycle off after 2 ms
/// instead of less than 0.01° (the test `a_held_drive_costs_more_than_a_large_step` of `kalmems-models`).
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

impl<T: Scalar<Mask = bool>, D: Dynamics<T, N>, const N: usize> Rk4<D, T, N> {
    /// Steps of `interval` seconds, the noise linearised `at` a state and an input.
    pub fn new(dynamics: D, interval: T, density: &NoiseDensity<T, N>, at: (&[T; N], &D::Input)) -> Self {
        let noise = discretize(&dynamics.jacobian(at.0, at.1), density, interval).noise;
        Self { dynamics, interval, noise: noise.into() }
    }
}

impl<T: Scalar, D: Dynamics<T, N>, const N: usize> Process<T, N> for Rk4<D, T, N> {
    type Input = Nodes<D::Input>;

    #[inline(always)]
    fn step<S: Over<T>>(&self, x: &[S; N], u: &Nodes<D::Input>) -> [S; N] {
        runge_kutta(&self.dynamics, x, u, self.interval)
    }

    #[inline(always)]
    fn noise(&self) -> &ProcessNoise<T, N> {
        &self.noise
    }
}

/// One step of the classical Runge–Kutta method over `h`.
#[inline(always)]
pub(super) fn runge_kutta<T: Scalar, D: Dynamics<T, N>, S: Over<T>, const N: usize>(
    dynamics: &D,
    x: &[S; N],
    u: &Nodes<D::Input>,
    h: T,
) -> [S; N] {
    let moved = |k: &[S; N], by: T| -> [S; N] { array::from_fn(|i| x[i] + k[i] * by) };
    let k1 = dynamics.derivative(x, &u.start);
    let k2 = dynamics.derivative(&moved(&k1, h.half()), &u.middle);
    let k3 = dynamics.derivative(&moved(&k2, h.half()), &u.middle);
    let k4 = dynamics.derivative(&moved(&k3, h), &u.end);
    let sixth = h * T::of(1.0 / 6.0);
    array::from_fn(|i| x[i] + (k1[i] + (k2[i] + k3[i]).twice() + k4[i]) * sixth)
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
    pub fn new(dynamics: D, interval: T, noise: Covariance<T, N>) -> Self {
        Self { dynamics, interval, noise: noise.into() }
    }
}

impl<T: Scalar, D: Dynamics<T, N>, const N: usize> Process<T, N> for Euler<D, T, N> {
    type Input = D::Input;

    #[inline(always)]
    fn step<S: Over<T>>(&self, x: &[S; N], u: &D::Input) -> [S; N] {
        let k = self.dynamics.derivative(x, u);
        array::from_fn(|i| x[i] + k[i] * self.interval)
    }

    #[inline(always)]
    fn noise(&self) -> &ProcessNoise<T, N> {
        &self.noise
    }
}

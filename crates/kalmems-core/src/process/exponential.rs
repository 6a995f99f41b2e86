//! An integrator for what is stiff and nearly linear.

use super::{Dynamics, Process, ProcessNoise, derivatives};
use crate::discretize::discretize;
use crate::notation::{matrix, sum, vector};
use crate::{Dual, Mat, NoiseDensity, Over, Scalar};

/// The exponential Euler method after Rosenbrock, one step per interval: x′ = x + Γ·f(x, u) with
/// Γ = ∫₀ʰ e^{A·s} ds and A = ∂f/∂x at one stated point (Hochbruck and Ostermann, Exponential integrators, Acta
/// Numerica 19, 209, 2010, equation 2.44 with a Jacobian that is kept).
///
/// Exact where f is linear in the state and the input is held, however long the interval is against the fastest decay:
/// what an explicit method needs steps for, this one has in Γ. Elsewhere it is off by about ½·h²·(∂f/∂x − A)·f per step:
/// for a system that is linear but for a small part of its slow forces. The process noise is discretised exactly for A.
///
/// ```
/// use kalmems_core::{Dynamics, Exponential, NoiseDensity, Over, Process, Scalar};
/// /// Relaxes within a microsecond.
/// struct Relaxation;
/// impl<T: Scalar> Dynamics<T, 1> for Relaxation {
///     type Input = T;
///     fn derivative<S: Over<T>>(&self, x: &[S; 1], u: &T) -> [S; 1] {
///         [-(x[0] - *u) * T::of(1e6)]
///     }
/// }
/// let millisecond = Exponential::new(Relaxation, 1e-3, &NoiseDensity::none(), (&[0.0], &0.0));
/// let [there]: [f64; 1] = millisecond.step(&[5.0], &2.0);
/// assert!((there - 2.0).abs() < 1e-14);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Exponential<D, T, const N: usize> {
    dynamics: D,
    integral: Mat<T, N, N>,
    noise: ProcessNoise<T, N>,
}

impl<T: Scalar<Mask = bool>, D: Dynamics<T, N>, const N: usize> Exponential<D, T, N> {
    /// Steps of `interval` seconds, linearised `at` a state and an input.
    pub fn new(dynamics: D, interval: T, density: &NoiseDensity<T, N>, at: (&[T; N], &D::Input)) -> Self {
        let discrete = discretize(&dynamics.jacobian(at.0, at.1), density, interval);
        Self { dynamics, integral: discrete.input_integral, noise: discrete.noise.into() }
    }
}

impl<T: Scalar, D: Dynamics<T, N>, const N: usize> Process<T, N> for Exponential<D, T, N> {
    type Input = D::Input;

    #[inline(always)]
    fn step<S: Over<T>>(&self, x: &[S; N], u: &D::Input) -> [S; N] {
        let moved: [S; N] = self.integral.times_vector(&self.dynamics.derivative(x, u));
        vector!(|i| x[i] + moved[i])
    }

    #[inline(always)]
    fn noise(&self) -> &ProcessNoise<T, N> {
        &self.noise
    }

    /// I + Γ·∂f/∂x.
    #[inline(always)]
    fn linearize(&self, x: &[T; N], u: &D::Input) -> ([T; N], Mat<T, N, N>) {
        let (rates, slopes) = derivatives(&self.dynamics.derivative(&Dual::variables(x), u));
        let moved: [T; N] = self.integral.times_vector(&rates);
        let transition = matrix!(|i, j| {
            let entry = sum!(N, |k| self.integral.0[i][k] * slopes.0[k][j]);
            if i == j { entry + T::of(1.0) } else { entry }
        });
        (vector!(|i| x[i] + moved[i]), transition)
    }
}
